"""Checkpoints of the stages static and modes: each process stores its own results, part by part.

A part is `<stage>_checkpoint/<rank>of<size>-<number>.h5`, where `number` is that of the part's first
result. Parts carry a checksum and the key of the stage's inputs; reading ends at the first part that
is absent, damaged or of other inputs.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from tireroad.fem.static.checkpoint import Entry, Journal
from tireroad.runs.files import store
from tireroad.runs.process import console
from tireroad.runs.process.mpi import on_root
from tireroad.runs.process.signals import Stopped
from tireroad.runs.stages.stage import Job, Stage

WORTH = 60.0  # results are written once computing them has taken this many times the writing
LEAST = 1.0  # s of computing
_COLUMNS = "by_columns"
_RATE = 2e8  # bytes per second, until a large part has been written
_LARGE = 1e6  # bytes from which the write rate is measured: below, opening the file dominates


@contextmanager
def checkpointed(stage: Stage, what: str) -> Iterator[Journal]:
    """The journal of a stage, of results named `what`; a stop writes them. Collective."""
    job = stage.job
    parts = _Parts(job, stage.name, store.wanted_hash(stage.name, stage.inputs()))
    entries = parts.read()
    journal = Journal(entries, parts.keep)
    least = min(job.comm.allgather(len(entries)))
    if least:
        console.say(f"  continues from the checkpoint after {least} {what}")
    try:
        yield journal
    except Stopped:
        parts.flush()
        raise


def forget_checkpoint(job: Job, stage: str) -> None:
    """Remove the checkpoint of a finished stage. Collective."""
    job.comm.Barrier()
    on_root(job.comm, lambda: shutil.rmtree(_folder(job, stage), ignore_errors=True))


def _folder(job: Job, stage: str) -> Path:
    return job.directory / f"{stage}_checkpoint"


class _Parts:
    """The checkpoint files of this process."""

    def __init__(self, job: Job, stage: str, key: str) -> None:
        self._job, self._stage, self._key = job, stage, key
        self._folder = _folder(job, stage)
        self._waiting: list[Entry] = []
        self._first, self._written = 0, time.monotonic()
        self._rate = _RATE

    def _path(self, number: int) -> Path:
        comm = self._job.comm
        return self._folder / f"{comm.rank}of{comm.size}-{number:04d}.h5"

    def read(self) -> list[Entry]:
        """Results stored for the same inputs and process count; reports others. Collective."""
        entries: list[Entry] = []
        reason = "" if self._job.fresh else self._read(entries)
        reasons = [text for text in self._job.comm.allgather(reason) if text not in ("", "absent")]
        if reasons:
            console.say(f"  {self._folder.name} exists, but {reasons[0]}: only part of it is used")
        return entries

    def _read(self, entries: list[Entry]) -> str:
        """Append the usable parts to `entries`; returns why the next one is not."""
        input_hash = self._job.provenance(self._stage, self._key).input_hash
        while not (reason := store.why_not(self._path(len(entries)), input_hash, self._stage)):
            with store.opened(self._path(len(entries))) as file:
                entries += [_entry(file[name]) for name in sorted(file)]
        return reason

    def keep(self, number: int, entry: Entry) -> None:
        """Store a result; it is written with those before it once that pays off."""
        if not self._waiting:
            self._first = number
        self._waiting.append(entry)
        size = sum(array.nbytes for entry in self._waiting for array in entry.values())
        if time.monotonic() - self._written > max(LEAST, WORTH * size / self._rate):
            began = time.monotonic()
            self.flush()
            if size > _LARGE:
                self._rate = size / max(time.monotonic() - began, 1e-3)

    def flush(self) -> None:
        """Write the results that are waiting."""
        if not self._waiting:
            return
        provenance = self._job.provenance(self._stage, self._key)
        # If the result folder was removed, writing the file reports it.
        with suppress(FileNotFoundError):
            self._folder.mkdir(exist_ok=True)
        with store.writing(self._path(self._first), provenance) as file:
            for k, entry in enumerate(self._waiting):
                group = file.create_group(f"{k:04d}")
                for name, array in entry.items():
                    by_columns = array.flags.f_contiguous and not array.flags.c_contiguous
                    group[name] = array.T if by_columns else array
                    group[name].attrs[_COLUMNS] = by_columns
        self._waiting, self._written = [], time.monotonic()


def _entry(group) -> Entry:
    """The arrays of a result by name, including groups.

    Their memory order is restored, because the rounding of sums of products depends on it.
    """
    arrays: dict[str, np.ndarray] = {}

    def add(name: str, one) -> None:
        if hasattr(one, "shape"):
            array = np.asarray(one[()])
            arrays[name] = array.T if one.attrs[_COLUMNS] else array

    group.visititems(add)
    return arrays
