"""contact.h5, written during the time loop, and the checkpoint from which a loop continues.

HDF5's own filters hold Python's lock while they deflate; zlib does not. Whole chunks are therefore
packed by zlib in a thread while the loop continues, and written directly. HDF5 itself is only
called from the caller's thread.
"""

from __future__ import annotations

import shutil
import zlib
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np

from tireroad.contact.loop import Block, block_size
from tireroad.contact.results.chatter import Chosen
from tireroad.contact.roads.cell_mean import CellMean
from tireroad.contact.roads.under_tire import NOTHING, is_level
from tireroad.contact.setup import ContactSetup
from tireroad.runs.files import store
from tireroad.runs.files.disk import part_of, replacing, seal
from tireroad.runs.files.store import put
from tireroad.runs.process import console
from tireroad.runs.process.mpi import on_root
from tireroad.runs.scene.rules import foot, never_met, within_run_in, without_relief
from tireroad.runs.scene.tables.scene import RoadTable
from tireroad.runs.stages import corner
from tireroad.runs.stages import setup as stages_setup
from tireroad.runs.stages.stage import Job, Record

LEVEL = 1  # higher levels take several times as long for a few percent

# Share of the road's standard deviation that the points have to see.
_SEEN = 0.5
# Share of its height from which on an obstacle counts as whole.
_WHOLE = 0.98
_LONGEST = 1.0  # m of road that is sampled
_MOST = 8000  # samples along
_CHUNK = 512  # steps in a chunk of what is not one number a point
CHECKPOINT = "checkpoint.h5"
STATE = "state"  # the group that a checkpoint has in addition to those of contact.h5

_LAYOUT: dict[str, tuple[tuple, str]] = {
    "time": ((), "s"),
    "normal_force": ((None,), "N"),
    "horizontal_force": ((None, 2), "N"),
    "total_force": ((3,), "N"),
    "displacement": ((None,), "m"),
    "gap": ((None,), "m"),
    "axle_force": ((3,), "N"),
    "active": ((), "-"),
    "residual": ((), "-"),
}
_OF_BLOCK = (
    "time", "gap", "displacement", "axle_force", "active", "residual", "penetration", "moved", "total_force",
)  # fmt: skip
DRIVEN = "driven_displacement"  # (nt, k, 3) m at the k prescribed forces, if the scene has them
INITIAL = "initial_normal_force"  # (c,) N of steady rolling, if the loop begins with it


def create(file: h5py.File, name: str, rows: int, width: tuple[int, ...]) -> h5py.Dataset:
    """An empty, growing dataset (0, *width) in compressed chunks of `rows` rows.

    Single precision, relative error 1e-7: half of the bytes.
    """
    return file.create_dataset(
        name,
        (0, *width),
        dtype="f4",
        maxshape=(None, *width),
        chunks=(rows, *width),
        compression="gzip",
        compression_opts=LEVEL,
        shuffle=True,
    )


class Packer:
    """Appends rows to datasets of `create`; `wait` before reading the file, `close` at the end."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1)
        self._put: list[tuple[Callable, tuple[int, ...], Future]] = []

    def append(self, dataset: h5py.Dataset, values: np.ndarray) -> None:
        """Append rows: whole chunks at a chunk boundary by the thread, others at once by HDF5."""
        first, chunk = len(dataset), dataset.chunks[0]
        dataset.resize(first + len(values), axis=0)
        whole = 0 if first % chunk else len(values) - len(values) % chunk
        for start in range(0, whole, chunk):
            rows = values[start : start + chunk]
            packed = self._thread.submit(_packed, rows, dataset.dtype)
            offset = (first + start, *[0] * (values.ndim - 1))
            self._put.append((dataset.id.write_direct_chunk, offset, packed))
        if whole < len(values):
            dataset[first + whole :] = values[whole:]

    def wait(self) -> None:
        """Write what the thread has packed."""
        for write, offset, packed in self._put:
            write(offset, packed.result())
        self._put.clear()

    def close(self) -> None:
        """End the thread; anything not waited for is lost."""
        self._thread.shutdown(cancel_futures=True)


def _packed(values: np.ndarray, kind: np.dtype) -> bytes:
    """HDF5's shuffle filter (first bytes of all values, then second ones, ...) and deflate."""
    octets = np.ascontiguousarray(values, kind).view(np.uint8).reshape(-1, kind.itemsize)
    return zlib.compress(np.ascontiguousarray(octets.T).data, LEVEL)


def describe(record: Record, setup: ContactSetup, road: RoadTable) -> None:
    """Record the mean profile depth; report the processing of a measured road in words.

    Warns if the `road` of the scene is flat where the run passes, or flat to its points.
    """
    if not road.surface.files:  # of a file it is in the table of files
        for note in setup.road.notes:
            console.say(f"  road: {note}")
    texture = setup.road.texture
    if texture is not None and texture.depth is not None:
        record.headline["mean profile depth"] = (texture.depth, "m")
    first, last = setup.road.passed
    if last <= first:
        record.warnings.extend(never_met(road))
    elif road.kind != "flat" and nothing_met(setup):
        record.warnings.append(without_relief(road, first, last))
    elif (place := foot(road)) is not None and (share := setup.road.share(place)) < _WHOLE:
        record.warnings.append(within_run_in(road, place, share))
    elif (relief := relief_seen(setup)) is not None:
        _describe_smoothing(record, setup, relief)


def _describe_smoothing(record: Record, setup: ContactSetup, relief: Relief) -> None:
    """Record the road's relief and what the points see of it; warn if that is less than half."""
    record.indicators["standard deviation of the road"] = (relief.road, "m")
    record.indicators["standard deviation of the road as the points see it"] = (relief.points, "m")
    if relief.points < _SEEN * relief.road:
        along, across = 1e3 * setup.patch.spacing
        record.warnings.append(
            f"contact points {along:.3g} × {across:.3g} mm apart see {1e3 * relief.points:.2g} of the road's "
            f"{1e3 * relief.road:.2g} mm (standard deviation): waves shorter than two spacings are averaged over each "
            "point's rectangle, so most of this road has no effect; take points a quarter of its waves apart or less "
            "(contact.points), or a road of longer waves"
        )


def fill(file: h5py.File, setup: ContactSetup) -> None:
    """Write the texture's third octaves; mean profile depth and notes as attributes."""
    road = setup.road
    if road.notes:
        file.attrs["road_notes"] = "; ".join(road.notes)
    if road.texture is None or not len(road.texture.level):
        return
    put(file, "road/wavelength", road.texture.wavelength, "m")
    put(file, "road/texture_level", road.texture.level, "dB re 1 um")
    if road.texture.depth is not None:
        file.attrs["mean_profile_depth"] = road.texture.depth


class Relief(NamedTuple):
    """Standard deviation (m) of the heights of the `road`, and of those that the `points` see."""

    road: float
    points: float


def nothing_met(setup: ContactSetup) -> bool:
    """Whether all heights that the patch passes over are the same, by the road's own bounds."""
    _, x1, y0, y1 = setup.patch.extent
    return is_level(setup.road, x1, setup.road.end, y0, y1)


def relief_seen(setup: ContactSetup) -> Relief | None:
    """The relief along up to three rows of points that touch, before and after smoothing.

    After the run-in, over at most 1 m; None if the points resolve the road, which is then not
    smoothed, or if there is nothing to see.
    """
    patch, road = setup.patch, setup.road
    held = np.flatnonzero(patch.force > 0)
    x = _places(setup)
    if not setup.fine or not len(held) or not len(x):
        return None
    order = held[np.argsort(patch.points[held, 1], kind="stable")]
    chosen = order[[0, len(order) // 2, -1]]
    y, half = patch.points[chosen, 1], patch.half_sizes[chosen]
    arguments = np.repeat(x[:, None], 3, axis=1), np.broadcast_to(y, (len(x), 3))
    raw, seen = road.height(*arguments), CellMean(road, y, half).height(*arguments)
    relief = Relief(float(raw.std(axis=0).max()), float(seen.std(axis=0).max()))
    return relief if relief.road > NOTHING else None


def _places(setup: ContactSetup) -> np.ndarray:
    """Places (n,) m along a run, behind its run-in if half of it is left."""
    first, end = setup.patch.extent[1], setup.road.end
    grown = setup.road.grown
    first = grown if grown < 0.5 * (first + end) else first
    length = min(end - first, _LONGEST)
    count = int(np.clip(4 * length / setup.road.spacing, 0, _MOST))
    return first + length * (np.arange(count) + 0.5) / max(count, 1)


@dataclass(frozen=True, kw_only=True)
class ContactHistory:
    """The contact over n steps of `step` s ending at `time` (n,) s: `total_force` (n, 3) N;
    `axle_force` (n, 3) N if stored; `driven` (n, k, 3) m: displacement at driven points, if any;
    `wheel`: hub moments, and motions of a moving wheel, by the names of
    runs.stages.corner; `free_slip`: slip added so that the wheel rolls freely; `friction`: coefficient of
    the loop, 0 without; `steady`: false if it began at rest since no steady rolling was found."""

    step: float
    scheme: str
    time: np.ndarray
    total_force: np.ndarray
    axle_force: np.ndarray | None = None
    driven: np.ndarray | None = None
    wheel: dict[str, np.ndarray] = field(default_factory=dict)
    free_slip: float = 0.0
    friction: float = 0.0
    steady: bool = True

    @staticmethod
    def of(file: h5py.File) -> ContactHistory:
        """The history in contact.h5, without the single points, which may be many."""
        kept = {"axle_force": "axle_force", "driven": DRIVEN}
        return ContactHistory(
            step=float(file.attrs["step"]),
            scheme=str(file.attrs["scheme"]),
            time=file["time"][:],
            total_force=file["total_force"][:],
            **{name: file[stored][:] for name, stored in kept.items() if stored in file},
            wheel={name: file[name][:] for name in corner.UNITS if name in file},
            free_slip=float(file.attrs["free_slip"]),
            friction=float(file.attrs["friction"]),
            steady=bool(file.attrs["steady"]),
        )


def begun_with(job: Job, key: str) -> Chosen | None:
    """The scheme stored in a usable checkpoint of the same inputs, or None. Collective."""

    def found() -> Chosen | None:
        path = job.directory / CHECKPOINT
        if job.fresh or store.why_not(path, job.provenance("contact", key).input_hash, "contact"):
            return None
        with store.opened(path) as file:
            attrs = file.attrs
            reason, limit = str(attrs["scheme_reason"]), float(attrs["scheme_limit"])
            return Chosen(str(attrs["scheme"]), reason, limit)

    return on_root(job.comm, found)


def forget_checkpoint(job: Job) -> None:
    """Remove the checkpoint, so that the loop begins at t = 0 again. Collective."""
    on_root(job.comm, lambda: (job.directory / CHECKPOINT).unlink(missing_ok=True))


class ContactFile:
    """Blocks of steps, compressed, on the root process; a checkpoint adds the loop's state."""

    def __init__(self, job: Job, key: str, setup: ContactSetup, attributes: dict):
        self._job, self._key, self._patch = job, key, setup.patch
        self._setup = setup
        self._attributes = attributes | {
            "road": job.scene.road.kind,
            "speed": job.speed,
            "road_speed": setup.rolled.speed,
        }
        self._checkpoint = job.directory / CHECKPOINT
        self._horizontal = job.scene.horizontal_forces or job.scene.static.friction is not None
        self._layout = dict(_LAYOUT)
        if not job.scene.output.axle_force:
            del self._layout["axle_force"]
        self._done = 0

    def open(self, stack: ExitStack, path: Path) -> dict[str, np.ndarray] | None:
        """Begin the temporary file, which the stack moves into place, or removes after an error.

        Returns the state of a checkpoint of the same inputs to continue from, or None. Collective.
        """
        self._done, state = on_root(self._job.comm, lambda: self._open(stack, path))
        return state

    def _open(self, stack: ExitStack, path: Path) -> tuple[int, dict[str, np.ndarray] | None]:
        self._path, self._packer = path, Packer()
        stack.callback(self._packer.close)
        provenance = self._job.provenance("contact", self._key)
        going_on = not self._job.fresh and self._usable(provenance.input_hash)
        begin = self._checkpoint if going_on else None
        self._file = stack.enter_context(store.writing(path, provenance, begin))
        if not going_on:
            self._lay_out()
            return 0, None
        state = {name: value[()] for name, value in self._file[STATE].items()}
        del self._file[STATE]
        return len(self._file["time"]), state

    def _usable(self, wanted: str) -> bool:
        """Whether there is a usable checkpoint; reports why one is not usable."""
        reason = store.why_not(self._checkpoint, wanted, "contact")
        if reason and reason != "absent":
            console.say(f"  {CHECKPOINT} exists, but {reason}: the loop begins at t = 0")
        return not reason

    def _lay_out(self) -> None:
        patch = self._patch
        c = len(patch.points)
        store.put(self._file, "points", patch.points, "m")
        store.put(self._file, "area", patch.area, "m2")
        store.put(self._file, "static_force", patch.force, "N")
        if patch.pull is not None:
            store.put(self._file, "static_horizontal_force", patch.pull, "N")
        if (steady := self._setup.steady) is not None:
            store.put(self._file, INITIAL, steady.normal, "N")
            store.put(self._file, "initial_horizontal_force", steady.horizontal, "N")
        stages_setup.fill(self._file, self._setup)
        fill(self._file, self._setup)
        forces = len(self._job.scene.force)
        driven: dict[str, tuple[tuple, str]] = {DRIVEN: ((forces, 3), "m")} if forces else {}
        driven |= corner.layout(self._job)
        rows = block_size(c)  # so that each block fills a chunk
        for name, (shape, unit) in (self._layout | driven).items():
            width = tuple(c if n is None else n for n in shape)
            if width[:1] == (c,):
                dataset = create(self._file, name, rows, width)
            else:
                sizes = {"maxshape": (None, *width), "chunks": (_CHUNK, *width)}
                dataset = self._file.create_dataset(name, (0, *width), "f8", **sizes)
            dataset.attrs["unit"] = unit
        self._file.attrs.update(self._attributes)

    def write(self, block: Block, count: Callable[[dict[str, np.ndarray]], None]) -> None:
        """Write a block of steps, after passing it to `count`: the fields of `Block`, in the names of the file, and
        `total_force`, as arrays (n, ...) by name. Collective."""
        steps = {name: getattr(block, name) for name in _OF_BLOCK}
        steps["normal_force"], steps["horizontal_force"] = block.force, block.horizontal
        steps["change"] = block.followed
        if self._job.axle:
            steps["wheel_height"] = block.reading[:, 3 * len(self._job.scene.force) + 2]
        count(steps)
        on_root(self._job.comm, lambda: self._write(steps, self._read(block.reading)))
        self._done += len(block.time)

    def _write(self, steps: dict[str, np.ndarray], driven: dict[str, np.ndarray]) -> None:
        self._packer.wait()
        for name in self._layout | driven:
            dataset, values = self._file[name], (steps | driven)[name]
            if name == "horizontal_force" and not self._horizontal:
                dataset.resize(self._done + len(values), axis=0)  # unwritten entries are zero
            elif dataset.compression:
                self._packer.append(dataset, values)
            else:
                dataset.resize(self._done + len(values), axis=0)
                dataset[self._done :] = values

    def _read(self, readings: np.ndarray | None) -> dict[str, np.ndarray]:
        """Readings (n, r) other than contact, by name."""
        if readings is None:
            return {}
        forces = len(self._job.scene.force)
        points, wheel = np.split(readings, [3 * forces], axis=1)
        driven = {DRIVEN: points.reshape(-1, forces, 3)} if forces else {}
        if not corner.readings(self._job):
            return driven
        return driven | corner.parts(wheel, corner.standing_moment(self._patch))

    def checkpoint(self, state: dict[str, np.ndarray]) -> None:
        """Write a checkpoint of the flushed steps and the loop's state, atomically. Collective."""
        on_root(self._job.comm, lambda: self._save(state))

    def _save(self, state: dict[str, np.ndarray]) -> None:
        self._packer.wait()
        self._file.flush()
        with replacing(self._checkpoint) as part:
            shutil.copyfile(part_of(self._path), part)
            with h5py.File(part, "r+") as copy:
                for name, value in state.items():
                    copy.create_dataset(f"{STATE}/{name}", data=value)
            seal(part)

    def finish(self) -> None:
        """All steps are flushed: delete the checkpoint. Collective."""
        on_root(self._job.comm, self._finish)

    def _finish(self) -> None:
        self._packer.wait()
        self._checkpoint.unlink(missing_ok=True)
