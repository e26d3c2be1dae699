"""Road files that would be misread, or take more than there is: units, headers, links, sizes."""

import os
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest

from tireroad.contact.roads import grid, grid_text
from tireroad.contact.roads.grid import Grid
from tireroad.contact.roads.grid_file import read_grid
from tireroad.fem.errors import InputError

X, Y = 5e-4 * np.arange(400), 5e-4 * np.arange(200)
RNG = np.random.default_rng(1)
Z = 3e-4 * RNG.standard_normal((400, 200))


def saved(file: Path, length: float = 1.0, height: float = 1.0) -> Path:
    """The texture with its numbers in units of 1/length and 1/height metres."""
    np.savez(file, x=length * X, y=length * Y, z=height * Z)
    return file


def test_texture_in_metres_passes(tmp_path: Path) -> None:
    read_grid(saved(tmp_path / "m.npz"))


@pytest.mark.parametrize(
    ("length", "height", "key"),
    [(1, 1e3, "height_unit"), (1e3, 1, "length_unit"), (1e3, 1e3, "length_unit")],
)
def test_millimetres_are_not_taken_for_metres(tmp_path, length, height, key) -> None:
    file = saved(tmp_path / "mm.npz", length, height)
    with pytest.raises(InputError, match=f'{key} = "mm"'):
        read_grid(file)
    units = {
        "length_unit": "mm" if length > 1 else "m",
        "height_unit": "mm" if height > 1 else "m",
    }
    road, exact = read_grid(file, **units), Grid(X, Y, Z)
    x, y = np.random.default_rng(2).uniform(0.0, 0.09, (2, 100))
    assert np.allclose(road.height(x, y), exact.height(x, y), rtol=1e-9, atol=1e-15)


def test_heights_take_the_unit_of_lengths_where_they_have_none(tmp_path: Path) -> None:
    road = read_grid(saved(tmp_path / "mm.npz", 1e3, 1e3), length_unit="mm")
    assert road.highest(0, 0.1, 0, 0.05) == pytest.approx(Grid(X, Y, Z).highest(0, 0.1, 0, 0.05))


def test_heights_in_micrometres_are_not_taken_for_millimetres(tmp_path: Path) -> None:
    """A laser's file: to give the unit of lengths alone is the ordinary mistake."""
    file = saved(tmp_path / "um.npz", 1e3, 1e6)
    with pytest.raises(InputError, match='read as mm.*height_unit = "mm" or "um"'):
        read_grid(file, length_unit="mm")
    read_grid(file, length_unit="mm", height_unit="um")


def test_smooth_road_in_millimetres_is_noticed_by_its_relief(tmp_path: Path) -> None:
    y = np.linspace(0.0, 0.4, 401)
    z = np.tile(5e-3 * np.sin(2 * np.pi * y / 0.2), (400, 1))
    np.savez(tmp_path / "mm.npz", x=1e-3 * np.arange(400), y=y, z=1e3 * z)
    with pytest.raises(InputError, match='height_unit = "mm"'):
        read_grid(tmp_path / "mm.npz")


def test_units_given_are_believed(tmp_path: Path) -> None:
    read_grid(saved(tmp_path / "m.npz", 1.0, 1e3), height_unit="m")
    with pytest.raises(InputError, match="implausible for a road"):
        read_grid(saved(tmp_path / "far.npz", 1.0, 1e300), height_unit="m")
    with pytest.raises(InputError, match="furlong"):
        read_grid(tmp_path / "m.npz", length_unit="furlong")


def test_positions_too_close_or_too_far_are_refused() -> None:
    for x in (1e-302 * np.arange(3.0), 1e9 + np.arange(3.0)):
        with pytest.raises(InputError, match="steps must be at least"):
            Grid(x, Y, Z[:3])


@pytest.mark.parametrize("name", ["x", "z"])
def test_header_that_announces_too_much(tmp_path: Path, name: str) -> None:
    """1e12 numbers announced by a file of some kilobytes: refused at once, no memory taken."""
    np.savez(tmp_path / "good.npz", x=X, y=Y, z=Z)
    shape = {"x": "(400,)", "z": "(400, 200)"}[name]
    wrong = {"x": "(1000000000000,)", "z": "(5000000000, 200)"}[name]
    with (
        zipfile.ZipFile(tmp_path / "good.npz") as good,
        zipfile.ZipFile(tmp_path / "bad.npz", "w") as bad,
    ):
        for member in good.infolist():
            data = good.read(member)
            if member.filename == f"{name}.npy":
                long = len(wrong) - len(shape)
                assert shape.encode() in data
                data = data.replace(shape.encode() + b", }" + b" " * long, wrong.encode() + b", }")
            bad.writestr(member.filename, data)
    with pytest.raises(InputError, match=r"road\.file .*announces"):
        read_grid(tmp_path / "bad.npz")


def test_unpacking_takes_no_more_than_half_of_the_disk(tmp_path: Path, monkeypatch) -> None:
    np.savez_compressed(tmp_path / "zeros.npz", x=X, y=Y, z=np.zeros((400, 200)))
    np.savetxt(tmp_path / "zeros.csv", np.zeros((400, 201)), delimiter=",", fmt="%g")
    text = (tmp_path / "zeros.csv").read_text().splitlines()
    head = ",".join(["", *(f"{y:g}" for y in Y)])
    body = [f"{x:g},{line.partition(',')[2]}" for x, line in zip(X[1:], text[1:], strict=True)]
    (tmp_path / "zeros.csv").write_text("\n".join([head, *body]))
    monkeypatch.setattr(grid, "PIECE", 1000)
    monkeypatch.setattr(grid_text, "BLOCK", 10)
    for name in ("zeros.npz", "zeros.csv"):
        read_grid(tmp_path / name)
    monkeypatch.setattr(grid, "MAX_UNPACKED", 10_000)
    for name in ("zeros.npz", "zeros.csv"):
        with pytest.raises(InputError, match=rf"road\.file .*{name}: unpacked"):
            read_grid(tmp_path / name)


def test_a_line_without_end_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "long.csv").open("w") as stream:
        stream.write("0,1\n")
        for _ in range(40):
            stream.write("1," * 250_000)
    with pytest.raises(InputError, match="line 2: longer than 16,000,000 characters"):
        read_grid(tmp_path / "long.csv")


def test_millimetres_of_a_road_that_is_the_same_across_are_noticed_along_it(tmp_path: Path) -> None:
    """Waves of 1 mm told in mm: slopes across are none, and the tire met hills of 1 m."""
    wave = np.sin(2 * np.pi * X / 0.1)[:, None] + 0 * Y
    np.savez(tmp_path / "wave.npz", x=X, y=Y, z=wave)
    with pytest.raises(InputError, match='height_unit = "mm"'):
        read_grid(tmp_path / "wave.npz")
    np.savez(tmp_path / "right.npz", x=X, y=Y, z=1e-3 * wave)
    read_grid(tmp_path / "right.npz")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x;-0,1;0,1\n0;0,001;0,002\n", "2 lines of data"),
        ("X [m],Y [m],Z [m]\n0,0,0\n", "begins with the line x,y,z"),
        ("x,z\n0,0\n1,0\n", 'kind = "laser"'),
    ],
)
def test_csv_of_other_programs_is_told_the_layout(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "other.csv").write_text(text)
    with pytest.raises(InputError, match=words):
        read_grid(tmp_path / "other.csv")


def test_plain_matrix_is_told_the_layout(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "plain.csv", Z, delimiter=",")
    with pytest.raises(InputError, match=r"line 1: the first line must hold a corner"):
        read_grid(tmp_path / "plain.csv")


@pytest.mark.parametrize("how", ["external", "link", "virtual"])
def test_numbers_of_other_files_are_not_read(tmp_path: Path, how: str) -> None:
    file, other = tmp_path / "road.h5", tmp_path / "other.h5"
    with h5py.File(other, "w") as store:
        store["z"] = Z
    with h5py.File(file, "w") as store:
        store["x"], store["y"] = X, Y
        if how == "external":
            store.create_dataset("z", Z.shape, float, external=[(os.fspath(other), 0, Z.nbytes)])
        elif how == "link":
            store["z"] = h5py.ExternalLink(os.fspath(other), "/z")
        else:
            layout = h5py.VirtualLayout(Z.shape, float)
            layout[:] = h5py.VirtualSource(os.fspath(other), "z", Z.shape)
            store.create_virtual_dataset("z", layout)
    with pytest.raises(InputError, match="another file"):
        read_grid(file)


def test_huge_chunks_are_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "road.h5", "w") as store:
        store["x"], store["y"] = X, Y
        store.create_dataset("z", (400, 200), float, maxshape=(None, None), chunks=(400_000, 200))
    with pytest.raises(InputError, match="chunks"):
        read_grid(tmp_path / "road.h5")
