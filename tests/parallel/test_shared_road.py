"""The file of a road is read by one process: the others have the same heights from it, and the same errors."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.roads import grid
from tireroad.contact.roads.kinds.laser import LaserFile
from tireroad.contact.roads.kinds.measured import GridFile
from tireroad.contact.roads.road import RoadKind
from tireroad.fem.errors import InputError
from tireroad.runs.pipeline import share
from tireroad.runs.scene.road_cache import road_of

COMM = MPI.COMM_WORLD
X, Y = 5e-4 * np.arange(400), 5e-4 * np.arange(200)
Z = 3e-4 * np.random.default_rng(1).standard_normal((400, 200))
STRIP = 0.01, 0.15, 0.02, 0.08
KINDS = ("npz", "packed", "h5", "csv", "points", "laser")

pytestmark = pytest.mark.mpi


@pytest.fixture
def folder() -> Iterator[Path]:
    """One that all processes see."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(COMM.bcast(name))
        COMM.Barrier()


def written(folder: Path, kind: str) -> RoadKind:
    """A road whose file the root process writes."""
    ending = {"packed": "npz", "points": "csv", "laser": "csv"}.get(kind, kind)
    file = folder / f"{kind}.{ending}"
    if COMM.rank == 0:
        _write(file, kind)
    COMM.Barrier()
    if kind == "laser":
        return LaserFile(file=str(file), pitch=1e-3, length_unit="m", height_unit="m")
    return GridFile(file=str(file))


def _write(file: Path, kind: str) -> None:
    if kind in ("npz", "packed"):
        (np.savez if kind == "npz" else np.savez_compressed)(file, x=X, y=Y, z=Z)
    elif kind == "h5":
        with h5py.File(file, "w") as store:
            store["x"], store["y"], store["z"] = X, Y, Z
    elif kind == "csv":
        lines = np.vstack([[0.0, *Y], np.column_stack([X, Z])])
        np.savetxt(file, lines, delimiter=",", fmt="%.17g")
    elif kind == "points":
        table = [
            [x, y, z]
            for x, row in zip(X[:40], Z, strict=False)
            for y, z in zip(Y, row, strict=True)
        ]
        np.savetxt(file, table, delimiter=",", fmt="%.17g", header="x,y,z", comments="")
    else:
        np.savetxt(file, 1e-3 * np.sin(np.arange(2000) / 30.0), fmt="%.17g")


def counted(monkeypatch: pytest.MonkeyPatch, surface: RoadKind) -> list[str]:
    """What is read from now on."""
    found, make = [], type(surface).make

    def noted(self):
        found.append(self.file)
        return make(self)

    monkeypatch.setattr(type(surface), "make", noted)
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_one_process_reads_and_all_have_the_same_bits(monkeypatch, folder, kind: str) -> None:
    surface = written(folder, kind)
    strip = STRIP if kind != "points" else (0.001, 0.018, *STRIP[2:])
    x, y = (a + (b - a) * np.random.default_rng(2).random(500) for a, b in (strip[:2], strip[2:]))
    alone = surface.make().prepare(*strip).height(x, y)
    monkeypatch.setattr(grid, "PIECE", 5000)  # more than that goes to a temporary file
    read = counted(monkeypatch, surface)
    share(surface, COMM)
    road = road_of(surface)
    assert np.array_equal(road.prepare(*strip).height(x, y), alone)
    assert COMM.allreduce(len(read)) == 1


def test_the_process_that_reads_keeps_its_own(folder: Path) -> None:
    """A copy in its place would close the temporary file that the others are about to open by its number."""
    surface = written(folder, "csv")
    own = road_of(surface) if COMM.rank == 0 else None
    share(surface, COMM)
    assert own is None or road_of(surface) is own


def test_a_file_written_anew_is_read_anew(folder: Path) -> None:
    surface = written(folder, "npz")
    share(surface, COMM)
    before = road_of(surface).prepare(*STRIP).highest(*STRIP)
    COMM.Barrier()
    if COMM.rank == 0:
        np.savez(folder / "npz.npz", x=X, y=Y, z=2 * Z)
    COMM.Barrier()
    share(surface, COMM)
    assert road_of(surface).prepare(*STRIP).highest(*STRIP) == 2 * before


def test_all_processes_are_told_of_a_damaged_file(folder: Path) -> None:
    surface = written(folder, "npz")
    if COMM.rank == 0:
        (folder / "npz.npz").write_bytes(b"no archive")
    COMM.Barrier()
    with pytest.raises(InputError, match="is it complete"):
        share(surface, COMM)
        road_of(surface)


def test_a_process_that_cannot_open_the_others_file_reads_by_itself(monkeypatch, folder) -> None:
    """Processes that see another /proc, or none."""
    monkeypatch.setattr(grid, "PIECE", 5000)
    surface = written(folder, "packed")
    monkeypatch.setattr(
        grid.FileRows, "__reduce__", lambda self: (grid.FileRows, (Path("/nowhere"), self._packed))
    )
    share(surface, COMM)
    assert np.isfinite(road_of(surface).prepare(*STRIP).highest(*STRIP))
