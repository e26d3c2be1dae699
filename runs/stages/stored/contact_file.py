"""contact.h5, written during the time loop, and the checkpoint from which a loop continues."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from tireroad.contact.loop import Instant
from tireroad.contact.results.chatter import Chosen
from tireroad.contact.setup import ContactSetup
from tireroad.runs.files import packed, store
from tireroad.runs.files.disk import part_of, replacing, seal
from tireroad.runs.process import observe
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.build import corner, pattern
from tireroad.runs.stages.stored import road_file

BLOCK = 512  # steps kept in memory between two writes
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
DRIVEN = "driven_displacement"  # (nt, k, 3) m at the k prescribed forces, if the scene has them


@dataclass(frozen=True, kw_only=True)
class ContactHistory:
    """The contact over n steps of `step` s ending at `time` (n,) s: `total_force` (n, 3) N;
    `axle_force` (n, 3) N if stored; `driven` (n, k, 3) m: displacement at driven points, if any;
    `wheel`: hub moments, and motions of a moving wheel, by the names of
    runs.stages.build.corner; `free_slip`: slip added so that the wheel rolls freely."""

    step: float
    scheme: str
    time: np.ndarray
    total_force: np.ndarray
    axle_force: np.ndarray | None = None
    driven: np.ndarray | None = None
    wheel: dict[str, np.ndarray] = field(default_factory=dict)
    free_slip: float = 0.0

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
        )


def begun_with(job: Job, key: str) -> Chosen | None:
    """The scheme stored in a usable checkpoint of the same inputs, or None. Collective."""

    def found() -> Chosen | None:
        path = job.directory / CHECKPOINT
        if job.fresh or store.why_not(path, job.provenance("contact", key).input_hash, "contact"):
            return None
        with store.opened(path) as file:
            given = file.attrs
            reason, limit = str(given["scheme_reason"]), float(given["scheme_limit"])
            return Chosen(str(given["scheme"]), reason, limit)

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
        self._stack: list = []
        self._readings: list[np.ndarray] = []
        self._rubs = job.scene.contact.rubs or job.scene.static.friction is not None
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
        self._path, self._packer = path, packed.Packer()
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
            observe.say(f"  {CHECKPOINT} exists, but {reason}: the loop begins at t = 0")
        return not reason

    def _lay_out(self) -> None:
        patch = self._patch
        c = len(patch.points)
        store.put(self._file, "points", patch.points, "m")
        store.put(self._file, "area", patch.area, "m2")
        store.put(self._file, "static_force", patch.force, "N")
        pattern.fill(self._file, self._setup)
        road_file.fill(self._file, self._setup)
        forces = len(self._job.scene.force)
        driven: dict[str, tuple[tuple, str]] = {DRIVEN: ((forces, 3), "m")} if forces else {}
        driven |= corner.layout(self._job)
        # Limit a chunk, the least that is read at once, to 4 MB.
        rows = 2 ** int(np.log2(np.clip(500_000 // max(c, 1), 1, BLOCK)))
        for name, (shape, unit) in (self._layout | driven).items():
            width = tuple(c if n is None else n for n in shape)
            if width[:1] == (c,):
                dataset = packed.create(self._file, name, rows, width)
            else:
                sizes = {"maxshape": (None, *width), "chunks": (BLOCK, *width)}
                dataset = self._file.create_dataset(name, (0, *width), "f8", **sizes)
            dataset.attrs["unit"] = unit
        self._file.attrs.update(self._attributes)

    def add(self, instant, reading: np.ndarray | None = None) -> bool:
        """Add a step, with the readings of driven points and wheel; returns whether to `flush`."""
        self._stack.append(instant)
        if reading is not None:
            self._readings.append(reading)
        return (self._done + len(self._stack)) % BLOCK == 0

    def flush(self, count: Callable[[dict[str, np.ndarray]], None]) -> None:
        """Write the n steps since the last call, after passing them to `count`: all fields of
        `Instant` and `total_force` as arrays (n, ...) by name. Collective."""
        if not self._stack:
            return
        steps = _columns(self._stack)
        if self._job.axle:
            height = 3 * len(self._job.scene.force) + 2
            steps["wheel_height"] = np.array([reading[height] for reading in self._readings])
        count(steps)
        on_root(self._job.comm, lambda: self._write(steps))
        self._done += len(self._stack)
        self._stack.clear()
        self._readings.clear()

    def _write(self, steps: dict[str, np.ndarray]) -> None:
        self._packer.wait()
        driven = self._read()
        for name in self._layout | driven:
            dataset, values = self._file[name], (steps | driven)[name]
            if name == "horizontal_force" and not self._rubs:
                dataset.resize(self._done + len(values), axis=0)  # unwritten entries are zero
            elif dataset.compression:
                self._packer.append(dataset, values)
            else:
                dataset.resize(self._done + len(values), axis=0)
                dataset[self._done :] = values

    def _read(self) -> dict[str, np.ndarray]:
        """Readings other than contact since the last call, by name."""
        if not self._readings:
            return {}
        readings, forces = np.stack(self._readings), len(self._job.scene.force)
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


def _columns(instants: list[Instant]) -> dict[str, np.ndarray]:
    """A block of steps as arrays by name."""
    steps = {
        name: np.array(values)
        for name, values in zip(Instant._fields, zip(*instants, strict=True), strict=True)
    }
    steps["normal_force"] = steps.pop("force")
    steps["horizontal_force"] = steps.pop("horizontal")
    normal = steps["normal_force"]
    sums = np.ones(normal.shape[1]) @ steps["horizontal_force"], normal.sum(axis=1)[:, None]
    return steps | {"total_force": np.concatenate(sums, axis=1)}
