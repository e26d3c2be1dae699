"""contact.h5 as the time loop goes, and the checkpoint from which a loop goes on."""

from __future__ import annotations

import shutil
from contextlib import ExitStack
from pathlib import Path

import h5py
import numpy as np

from runs import store
from runs.disk import part_of, replacing
from runs.mpi import on_root
from runs.session import Session

BLOCK = 512  # steps kept in memory between two writes
CHECKPOINT = "checkpoint.h5"
STATE = "state"  # the group of a checkpoint that contact.h5 does not have

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
DRIVEN = "driven_displacement"  # (nt, k, 3) m at the k prescribed forces, where a scene has them


class ContactFile:
    """Blocks of steps, compressed, on the root process; a checkpoint is a copy with the loop's state."""

    def __init__(self, session: Session, attributes: dict):
        self._session = session
        self._attributes = attributes | {
            "road": session.scene.road.kind,
            "speed": session.speed,
            "road_speed": session.road_speed,
        }
        self._checkpoint = session.directory / CHECKPOINT
        self._stack: list = []
        self._readings: list[np.ndarray] = []
        self._done = 0

    def open(self, stack: ExitStack, path: Path) -> dict[str, np.ndarray] | None:
        """Begin the temporary file; the stack puts it in place at its end, or removes it after an
        error. The state of a checkpoint of the same inputs to go on from, else None. Collective.
        """
        comm = self._session.comm
        return on_root(comm, lambda: self._open(stack, path))

    def _open(self, stack: ExitStack, path: Path) -> dict[str, np.ndarray] | None:
        self._path = path
        provenance = self._session.provenance("contact")
        usable = store.stored_hash(self._checkpoint) == provenance.input_hash
        going_on = usable and not self._session.fresh
        begin = self._checkpoint if going_on else None
        self._file = stack.enter_context(store.writing(path, provenance, begin))
        if not going_on:
            self._lay_out()
            return None
        state = {name: value[()] for name, value in self._file[STATE].items()}
        del self._file[STATE]
        self._done = len(self._file["time"])
        return state

    def _lay_out(self) -> None:
        patch = self._session.patch
        c = len(patch.points)
        store.put(self._file, "points", patch.points, "m")
        store.put(self._file, "area", patch.area, "m2")
        forces = len(self._session.scene.force)
        driven = {DRIVEN: ((forces, 3), "m")} if forces else {}
        for name, (shape, unit) in (_LAYOUT | driven).items():
            width = tuple(c if n is None else n for n in shape)
            packed = width[:1] == (c,)
            dataset = self._file.create_dataset(
                name,
                (0, *width),
                maxshape=(None, *width),
                # A chunk of many points would be many megabytes: some 4 MB is read at once.
                chunks=(max(1, min(BLOCK, 500_000 // max(c, 1))) if packed else BLOCK, *width),
                compression="gzip" if packed else None,
                compression_opts=1 if packed else None,
                shuffle=packed,
            )
            dataset.attrs["unit"] = unit
        self._file.attrs.update(self._attributes)

    def add(self, instant, reading: np.ndarray | None = None) -> None:
        """Keep a step, with the driven points' displacement; write when a block is full. Collective
        every block."""
        self._stack.append(instant)
        if reading is not None:
            self._readings.append(reading.reshape(-1, 3))
        if len(self._stack) == BLOCK:
            self.flush()

    def flush(self) -> None:
        """Write the steps kept so far. Collective."""
        on_root(self._session.comm, self._write)
        self._stack.clear()
        self._readings.clear()

    def _write(self) -> None:
        if not self._stack:
            return
        end = self._done + len(self._stack)
        driven = {DRIVEN: np.stack(self._readings)} if self._readings else {}
        for name, values in (_columns(self._stack) | driven).items():
            dataset = self._file[name]
            dataset.resize(end, axis=0)
            dataset[self._done :] = values
        self._done = end

    def checkpoint(self, state: dict[str, np.ndarray]) -> None:
        """Keep the steps so far and the loop's state, whole or not at all. Collective."""
        self.flush()
        on_root(self._session.comm, lambda: self._save(state))

    def _save(self, state: dict[str, np.ndarray]) -> None:
        self._file.flush()
        with replacing(self._checkpoint) as part:
            shutil.copyfile(part_of(self._path), part)
            with h5py.File(part, "r+") as copy:
                for name, value in state.items():
                    copy.create_dataset(f"{STATE}/{name}", data=value)

    def finish(self) -> None:
        """All steps are written: the checkpoint has had its day. Collective."""
        self.flush()
        on_root(self._session.comm, lambda: self._checkpoint.unlink(missing_ok=True))


def _columns(instants: list) -> dict[str, np.ndarray]:
    """The datasets' next rows from a block of instants."""
    force = np.stack([i.force for i in instants])
    horizontal = np.stack([i.horizontal for i in instants])
    sums = np.concatenate([horizontal.sum(axis=1), force.sum(axis=1)[:, None]], axis=1)
    return {
        "time": np.array([i.time for i in instants]),
        "normal_force": force,
        "horizontal_force": horizontal,
        "total_force": sums,
        "displacement": np.stack([i.displacement for i in instants]),
        "gap": np.stack([i.gap for i in instants]),
        "axle_force": np.stack([i.axle_force for i in instants]),
        "active": np.array([i.active for i in instants]),
        "residual": np.array([i.residual for i in instants]),
    }
