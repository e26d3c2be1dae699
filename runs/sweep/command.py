"""The command `sweep`: runs all members, here or in a batch system; writes a table and a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from tireroad.fem.errors import ConvergenceError
from tireroad.runs.files.folder import held
from tireroad.runs.files.store import stage_hash
from tireroad.runs.process import console
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.sweep import local
from tireroad.runs.sweep.definition import Member, Sweep, read
from tireroad.runs.sweep.page import gather, write, write_page


def sweep(path: Path, out: Path | None, *, at_once: int, batch: bool, only_gather: bool) -> None:
    """Run the sweep defined in a file. Not collective: members are separate processes.

    Raises ConvergenceError, after everything is gathered, if a member failed: the same command runs
    that member again and reuses what is finished.
    """
    family = read(path)
    folder = out or Path("results") / family.name
    with held(folder):
        if batch:
            _queue(family, folder, path)
        else:
            _run(family, folder, at_once, only_gather)


def _run(family: Sweep, folder: Path, at_once: int, only_gather: bool) -> None:
    """Run all members locally, unless only gathering, then write the table and the page."""
    failed: list[str] = []
    if not only_gather:
        number, limit = local.at_once(family, at_once)
        if limit:
            console.say(f"{number} member(s) at a time, limited by {limit}")
        ended = local.run(family, folder, number)
        failed = [one.line for one in ended if one.status]
    _gather(family, folder, failed)
    if failed:
        raise ConvergenceError(
            f"sweep: {len(failed)} of {len(family.members)} members failed, see above. The "
            "others are kept; the same command runs these again"
        )


def _gather(family: Sweep, folder: Path, failed: Sequence[str]) -> None:
    """Write the table and the page of the available results."""
    table = gather(family, folder)
    write(table, folder)
    page = write_page(table, folder, family.name, failed)
    for name in table.missing:
        console.say(f"  {name}: no results of a finished run of this scene")
    console.say(f"{page} and sweep.csv, sweep.h5 beside it")


def _queue(family: Sweep, folder: Path, source: Path) -> None:
    """Write the job scripts and submit them."""
    first, rest = shared_first(family)
    scripts = local.write_scripts(family, folder, first, rest, source)
    for script in scripts.values():
        console.say(f"{script.path}")
    jobs = local.submit(family, scripts)
    console.say("submitted: " + ", ".join(f"{name} as job {job}" for name, job in jobs.items()))


def shared_first(family: Sweep) -> tuple[list[Member], list[Member]]:
    """(one member per group that shares its static state and modes, all others)."""
    seen: set[str] = set()
    first: list[Member] = []
    rest: list[Member] = []
    for member in family.members:
        key = _group(family.load(member))
        (rest if key in seen else first).append(member)
        seen.add(key)
    return first, rest


def _group(scene: Scene) -> str:
    """One key for everything that the static state and the modes depend on."""
    from mpi4py import MPI

    from tireroad.runs.stages.stage import Job
    from tireroad.runs.stages.static import StaticStage

    static = StaticStage(job=Job(scene, Path("."), MPI.COMM_SELF))
    return stage_hash({"static": static.inputs(), "modal": asdict(scene.modes)})
