"""Roads on a grid: bilinear heights, holes, ends, and the files they come from."""

import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from tireroad.contact.roads.grid import Grid, fill_holes
from tireroad.contact.roads.grid_file import read_grid
from tireroad.fem.errors import InputError

X, Y = 5.0 + 0.1 * np.arange(31), np.linspace(-0.5, 0.5, 11)
Z = 0.1 * np.random.default_rng(2).standard_normal((31, 11))


@pytest.mark.parametrize("y", [Y, np.sort(np.r_[Y, 0.333, -0.111])], ids=["even", "uneven"])
def test_bilinear_against_scipy(y: np.ndarray) -> None:
    rng = np.random.default_rng(3)
    z = rng.standard_normal((31, len(y)))
    px, py = rng.uniform(5.0, 8.0, 1000), rng.uniform(-0.5, 0.5, 1000)
    expected = RegularGridInterpolator((X, y), z)(np.column_stack((px, py)))
    road = Grid(X, y, z)
    assert np.allclose(road.height(px, py), expected, atol=1e-12)
    strip = px.min(), px.max(), py.min(), py.max()
    assert np.allclose(road.prepare(*strip).height(px, py), expected, atol=1e-12)


def test_grid_points_and_borders_are_exact() -> None:
    road = Grid(X, Y, Z)
    px, py = (c.ravel() for c in np.meshgrid(X, Y, indexing="ij"))
    assert np.allclose(road.height(px, py), Z.ravel(), atol=1e-12)


def test_road_that_ends_too_early_is_refused_with_both_lengths() -> None:
    with pytest.raises(InputError, match=r"from x = 6 to 9 m, and it has 5 to 8 m.*mirror"):
        Grid(X, Y, Z).prepare(6.0, 9.0, -0.1, 0.1)
    with pytest.raises(InputError, match=r"from x = 4 to 7 m, and it has 5 to 8 m"):
        Grid(X, Y, Z).prepare(4.0, 7.0, -0.1, 0.1)
    with pytest.raises(InputError, match="lateral"):
        Grid(X, Y, Z, end="mirror").prepare(6.0, 9.0, 0.0, 0.6)


def test_mirrored_road_is_continuous_and_reflected() -> None:
    road = Grid(X, Y, Z, end="mirror").prepare(4.0, 13.0, -0.1, 0.1)
    inside = np.linspace(5.0, 8.0, 50)
    assert np.allclose(road.height(inside, 0 * inside), Grid(X, Y, Z).height(inside, 0 * inside))
    s = np.linspace(0.0, 2.0, 50)
    for mirror in (5.0, 8.0, 11.0):
        before, after = road.height(mirror - s, 0 * s), road.height(mirror + s, 0 * s)
        assert np.allclose(before, after, atol=1e-12)
    bounds = road.lowest(4.0, 13.0, -0.1, 0.1), road.highest(4.0, 13.0, -0.1, 0.1)
    z = road.height(np.linspace(4, 13, 500), np.zeros(500))
    assert bounds[0] <= z.min() and z.max() <= bounds[1]


def test_holes_in_the_strip_are_refused_with_count_and_place() -> None:
    z = Z.copy()
    z[12:14, 3] = np.nan
    z[0, 10] = np.nan
    with pytest.raises(InputError, match=r"2 heights .* at x = 6.2 m and y = -0.2 m"):
        Grid(X, Y, z).prepare(5.5, 7.0, -0.3, 0.1)
    road = Grid(X, Y, z).prepare(5.5, 7.0, 0.0, 0.2)
    assert road.filled == 0


def test_filled_holes_follow_a_plane_and_are_counted() -> None:
    plane = 0.3 * X[:, None] + 0.7 * Y[None, :]
    z = plane.copy()
    z[3, 4:7] = np.nan
    z[8, :] = np.nan
    road = Grid(X, Y, z, holes="fill").prepare(5.0, 8.0, -0.5, 0.5)
    px, py = np.random.default_rng(4).uniform([5.0, -0.5], [8.0, 0.5], (500, 2)).T
    assert np.allclose(road.height(px, py), 0.3 * px + 0.7 * py, atol=1e-12)
    assert road.filled == 3 + 11


def test_holes_at_the_border_take_the_nearest_height() -> None:
    z = np.arange(12.0).reshape(3, 4)
    z[0, :2] = np.nan
    z[2] = np.nan
    filled = fill_holes(z, np.arange(3.0), np.arange(4.0))
    assert filled[0].tolist() == [2.0, 2.0, 2.0, 3.0]
    assert filled[2].tolist() == filled[1].tolist() == [4.0, 5.0, 6.0, 7.0]
    with pytest.raises(InputError, match="no valid height"):
        fill_holes(np.full((2, 2), np.nan), np.arange(2.0), np.arange(2.0))


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ((X[::-1], Y, Z), "ascend"),
        ((X, Y, Z.T), "shape"),
        ((X, Y[:1], Z[:, :1]), "two positions"),
        ((X, Y, np.where(Z[4, 4] == Z, np.inf, Z)), "infinite"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(arrays: tuple, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Grid(*arrays)


@pytest.mark.parametrize("key", ["holes", "end"])
def test_unknown_choices_are_refused(key: str) -> None:
    with pytest.raises(InputError, match="maybe"):
        Grid(X, Y, Z, **{key: "maybe"})


def write(file: Path) -> None:
    """The test road as a file of the ending's format; `points.csv` as a list of points."""
    if file.suffix == ".npz":
        np.savez(file, x=X, y=Y, z=Z)
    elif file.suffix == ".h5":
        with h5py.File(file, "w") as store:
            for name, values in (("x", X), ("y", Y), ("z", Z)):
                store[name] = values
    elif file.stem == "points":
        px, py = np.meshgrid(X, Y, indexing="ij")
        table = np.column_stack((px.ravel(), py.ravel(), Z.ravel()))
        np.savetxt(file, table[::-1], delimiter=",", header="x,y,z", comments="", fmt="%.17g")
    else:
        rows = [",".join(["x\\y", *map(repr, Y.tolist())])]
        rows += [",".join(map(repr, [x, *z])) for x, z in zip(X.tolist(), Z.tolist(), strict=True)]
        file.write_text("# a comment\n" + "\n".join(rows) + "\n")


@pytest.mark.parametrize("name", ["road.npz", "road.h5", "points.csv", "matrix.csv"])
def test_files_hold_the_same_road(tmp_path: Path, name: str) -> None:
    write(tmp_path / name)
    px, py = np.random.default_rng(5).uniform([5.0, -0.5], [8.0, 0.5], (200, 2)).T
    road = read_grid(tmp_path / name)
    assert np.allclose(road.height(px, py), Grid(X, Y, Z).height(px, py), atol=1e-12)


@pytest.mark.parametrize("name", ["road.npz", "road.h5", "points.csv", "matrix.csv"])
def test_truncated_files_are_refused_by_name(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    write(file)
    data = file.read_bytes()
    file.write_bytes(data[: len(data) * 2 // 3])
    with pytest.raises(InputError, match=name):
        read_grid(file)


def test_archive_of_an_unknown_version_is_refused(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "road.npz", x=X, y=Y, z=Z)
    data = bytearray((tmp_path / "road.npz").read_bytes())
    for entry in (i for i in range(len(data)) if data[i : i + 4] == b"PK\x01\x02"):
        data[entry + 6] = 83
    (tmp_path / "road.npz").write_bytes(bytes(data))
    with pytest.raises(InputError, match=r"road\.npz: cannot be read"):
        read_grid(tmp_path / "road.npz")


@pytest.mark.parametrize("header", ["{'descr': ((", "{'descr': ()", "{'descr': '<f8', 'shape': (1"])
def test_archive_whose_headers_do_not_parse_is_refused(tmp_path: Path, header: str) -> None:
    file = tmp_path / "road.npz"
    with zipfile.ZipFile(file, "w") as archive:
        for name in "xyz":
            text = header.ljust(118).encode()
            archive.writestr(f"{name}.npy", b"\x93NUMPY\x01\x00\x76\x00" + text + bytes(80))
    with pytest.raises(InputError, match=r"road\.npz: .*header of x is damaged"):
        read_grid(file)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y,z\n0,0,1\n0,1,oops\n1,0,1\n", "line 3.*oops"),
        ("x,y,z\n0,0,1\n0,1\n1,0,1\n", "line 3: 2 fields, 3 expected"),
        ("x,y,z\n0,0,1\n0,1,1\n1,0,1\n", "3 points do not fill"),
        (",0,1\n0,1,2\n# note\n1,2,x\n", "line 4"),
        ("x,y,z\n", "at least 3"),
        ("", "road.csv: is empty"),
        ("0.001\n0.002\n0.001\n", 'kind = "laser"'),
        ("# laser\n0;1;2\n1;0;0\n", "2 lines of data"),
    ],
)
def test_csv_damage_is_named_by_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "road.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_grid(tmp_path / "road.csv")


def test_missing_arrays_and_objects_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", x=X, z=Z)
    with pytest.raises(InputError, match="no array y"):
        read_grid(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", x=X, y=Y, z=np.array([{}, {}], dtype=object))
    with pytest.raises(InputError, match="numbers"):
        read_grid(tmp_path / "b.npz")
    with h5py.File(tmp_path / "c.h5", "w") as store:
        store["x"] = X
    with pytest.raises(InputError, match="no dataset y, z"):
        read_grid(tmp_path / "c.h5")
