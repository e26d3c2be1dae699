"""Demand of a run beside what the machine has: memory, disk and time."""

from __future__ import annotations

import shutil
from pathlib import Path

from tireroad.fem.errors import InputError
from tireroad.runs.process.surroundings import available_memory
from tireroad.runs.scene.estimate import KEYS, Estimate, duration, memory_of

# The estimate is within a factor of 1.5: above CERTAIN a run cannot succeed, above DOUBTFUL it may
# not.
CERTAIN, DOUBTFUL = 1.5, 0.8
LONG = 3600.0  # s: runs estimated to take longer cause a warning


def check_demand(demand: Estimate, directory: Path, processes: int = 1) -> list[str]:
    """Warnings about memory, disk and time. Raises InputError if they cannot suffice.

    `directory`: result folder, which need not exist yet. If memory is short, factors are kept on
    disk.
    """
    on_disk = out_of_core(demand, processes)
    memory_taken = memory_of(demand, processes, on_disk)
    memory, free = sum(memory_taken.values()), available_memory()
    room = shutil.disk_usage(_existing(directory)).free
    warnings = []
    if on_disk:
        warnings.append(
            f"memory is short: factors are kept on disk in {directory} (MUMPS out of core), which takes longer"
        )
    for what, where, parts, needed, there in (
        ("memory", "", memory_taken, memory, free),
        ("disk", f" in {directory}", demand.disk, sum(demand.disk.values()), float(room)),
    ):
        if needed < DOUBTFUL * there:
            continue
        text = (
            f"the run takes about {needed / 1e9:.3g} GB of {what}{where}, and "
            f"{there / 1e9:.3g} GB are free; most of it for {_largest(parts)}"
        )
        if needed > CERTAIN * there:
            raise InputError(text)
        warnings.append(text)
    seconds = sum(demand.seconds.values())
    if seconds > LONG:
        warnings.append(
            f"the run takes about {duration(seconds)} of one core, most of it for "
            f"{_largest(demand.seconds)}"
        )
    return warnings


def out_of_core(demand: Estimate, processes: int) -> bool:
    """Whether factors must be kept on disk because this machine's memory is too small for them."""
    return sum(memory_of(demand, processes).values()) > DOUBTFUL * available_memory()


def _largest(parts: dict[str, float]) -> str:
    """The largest part, with the keys that determine its size."""
    name = max(parts, key=parts.__getitem__)
    return f"{name} ({KEYS[name]})" if name in KEYS else name


def _existing(directory: Path) -> Path:
    directory = directory.absolute()
    return next(folder for folder in (directory, *directory.parents) if folder.exists())
