"""Roads longer than memory: read as they roll by, the same heights as at once."""

import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest

from tireroad.contact.roads import grid, grid_file
from tireroad.contact.roads.grid import ArrayRows, FileRows, Grid, pieces
from tireroad.contact.roads.grid_file import read_grid
from tireroad.contact.roads.road import make_road
from tireroad.fem.errors import InputError

pytestmark = pytest.mark.slow

LENGTH, STEP, WIDTH = 10_000.0, 0.01, 41
HEADER = """$ROAD_CRG
REFERENCE_LINE_INCREMENT = 0.01
LONG_SECTION_V_INCREMENT = 0.01
$
$KD_DEFINITION
#:KRBI
"""


def wave(x: np.ndarray) -> np.ndarray:
    """1 mm, 3 m long: what is kept of the road."""
    return 1e-3 * np.sin(2 * np.pi * x / 3.0)


def long_road(file: Path) -> None:
    """10 km, written a stretch at a time: `wave`, and 50 mm of waves of 200 m."""
    sections = "".join(f"D:long section {i + 1},m\n" for i in range(WIDTH))
    count = round(LENGTH / STEP) + 1
    with file.open("wb") as stream:
        stream.write((HEADER + sections).encode() + b"$" * 80 + b"\n")
        for first in range(0, count, 50_000):
            x = STEP * np.arange(first, min(first + 50_000, count))
            z = wave(x) + 0.05 * np.sin(2 * np.pi * x / 200.0)
            stream.write(np.repeat(z, WIDTH).astype(">f4").tobytes())
        stream.write(np.full(-count * WIDTH % 20, np.nan).astype(">f4").tobytes())


@pytest.mark.long
def test_ten_kilometres_in_bounded_memory(tmp_path: Path) -> None:
    """164 MB of file, 328 MB as doubles; levelled by `longest_wave` and driven from end to end."""
    long_road(tmp_path / "long.crg")
    patch = np.linspace(-0.1, 0.1, 50)
    tracemalloc.start()
    try:
        road = make_road(kind="crg", file=tmp_path / "long.crg", longest_wave=20.0, run_in=0.0)
        strip = road.prepare(0.1, LENGTH - 0.2, -0.1, 0.1)
        assert (
            1e-3 < strip.highest(100.0, LENGTH - 100.0, -0.1, 0.1) < 2e-3
        )  # its ends are levelled worse
        for way in np.arange(100.0, LENGTH - 100.0, 5.0):
            z = strip.height(way + patch, patch)
            assert (
                np.abs(z - wave(way + patch)).max() < 4e-4
            )  # 0.05 (1 - 2^-(20/200)^2): what the filter leaves
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 130e6, peak


@pytest.fixture
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (grid, grid_file):
        monkeypatch.setattr(module, "PIECE", 200)


X, Y = np.linspace(0.0, 30.0, 301), np.linspace(-0.5, 0.5, 11)
Z = 0.1 * np.random.default_rng(3).standard_normal((301, 11))


def holed() -> np.ndarray:
    """Single holes, whole rows, and a stretch longer than a piece."""
    z = Z.copy()
    z[np.random.default_rng(4).random(z.shape) < 0.1] = np.nan
    z[[0, 40, 41, 300]] = np.nan
    z[100:150] = np.nan
    return z


def write(file: Path, z: np.ndarray) -> None:
    if file.suffix == ".csv":
        lines = [",".join(["", *map(repr, Y.tolist())])]
        lines += [
            ",".join(map(repr, [x, *row])) for x, row in zip(X.tolist(), z.tolist(), strict=True)
        ]
        file.write_text("\n".join(lines))
    elif file.suffix == ".h5":
        with h5py.File(file, "w") as store:
            store["x"], store["y"], store["z"] = X, Y, z
    else:
        save = np.savez_compressed if file.stem == "compressed" else np.savez
        save(file, x=X, y=Y, z=np.asfortranarray(z) if file.stem == "columns" else z)


@pytest.mark.usefixtures("small_pieces")
@pytest.mark.parametrize("name", ["a.csv", "a.h5", "plain.npz", "compressed.npz", "columns.npz"])
@pytest.mark.parametrize("end", ["refuse", "mirror"])
def test_pieces_of_a_file_are_the_road(tmp_path: Path, name: str, end: str) -> None:
    """18 rows at a time: anywhere, onwards, and over more rows than are held, holes filled."""
    z = holed()
    write(tmp_path / name, z)
    strip = (0.0, 40.0 if end == "mirror" else 30.0, -0.35, 0.4)
    road = read_grid(tmp_path / name, holes="fill", end=end).prepare(*strip)
    filled = grid.fill_holes(z[:, 1:], X, Y[1:])
    exact = Grid(X, Y[1:], filled, end=end)
    assert road.filled == np.isnan(z[:, 1:]).sum()
    x, y = np.random.default_rng(5).uniform(strip[::2], strip[1::2], (500, 2)).T
    for places in (slice(None), slice(3), np.argsort(x)):
        assert np.allclose(road.height(x[places], y[places]), exact.height(x[places], y[places]))
    for way in np.linspace(0.0, strip[1] - 0.3, 200):
        along = way + np.linspace(0.0, 0.3, 5)
        assert np.allclose(road.height(along, 0 * along), exact.height(along, 0 * along))
    for low, high in ((1.0, 2.0), (0.0, 30.0)):
        assert (
            exact.highest(low, high, -0.2, 0.2) >= road.height(*_lattice(low, high)).max() - 1e-12
        )


def _lattice(low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    return tuple(
        a.ravel() for a in np.meshgrid(np.linspace(low, high, 200), np.linspace(-0.2, 0.2, 9))
    )


@pytest.mark.usefixtures("small_pieces")
def test_all_pieces_cover_the_rows() -> None:
    for overlap in (0, 1):
        found = list(pieces(ArrayRows(Z), overlap))
        assert np.array_equal(
            np.concatenate([z[overlap if first else 0 :] for first, z in found]), Z
        )
        assert len(found) > 10


def test_a_file_that_is_cut_while_it_is_driven_on(tmp_path: Path) -> None:
    (tmp_path / "z").write_bytes(Z.tobytes())
    there = FileRows(tmp_path / "z", grid.Packed(0, Z.dtype, Z.shape))
    assert np.array_equal(there.read(3, 7), Z[3:7])
    (tmp_path / "z").write_bytes(Z.tobytes()[:1000])
    with pytest.raises(InputError, match="ends while it is read"):
        there.read(100, 200)


def test_a_damaged_archive_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "plain.npz", Z)
    data = bytearray((tmp_path / "plain.npz").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "plain.npz").write_bytes(bytes(data))
    with pytest.raises(InputError, match=r"plain\.npz"):
        read_grid(tmp_path / "plain.npz")
