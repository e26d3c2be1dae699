"""The stages in order: what is reused, what is computed, what is skipped, and what each cost."""

from __future__ import annotations

import time
from pathlib import Path

from mpi4py import MPI

from tireroad.runs.files import store
from tireroad.runs.files.checksum import signed
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.folder import Summary
from tireroad.runs.process import observe
from tireroad.runs.process.memory import peak_memory
from tireroad.runs.process.mpi import on_root
from tireroad.runs.scene.demand import check_demand, duration
from tireroad.runs.scene.estimate import estimate
from tireroad.runs.scene.plan import STAGES, skipped
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.road_check import check_road
from tireroad.runs.scene.tables import Scene
from tireroad.runs.stages import (
    contact,
    greens,
    modes,
    response,
    rotating,
    spectra,
    static,
    stiffness,
)
from tireroad.runs.stages.session import Session

_MODULES = {
    "static": static,
    "stiffness": stiffness,
    "modes": modes,
    "rotating": rotating,
    "greens": greens,
    "contact": contact,
    "response": response,
    "spectra": spectra,
}


def run_scene(
    scene: Scene,
    directory: Path,
    comm: MPI.Comm,
    *,
    until: str | None,
    fresh: bool,
    petsc_options: list[str],
) -> Session:
    """Run the stages a scene needs into the directory; what they left in memory. Collective."""
    session = Session(scene, directory, comm, fresh)
    summary = on_root(comm, lambda: Summary(directory, scene.name, comm.size))
    on_root(comm, lambda: write_text(directory / "scene.toml", signed(dumps(scene))))
    if scene.road is not None:
        # A road file that cannot be used should be told before hours of solving, not after.
        on_root(comm, lambda: check_road(scene))
    _say_demand(scene, directory, comm, until)
    reasons = skipped(scene, until)
    if petsc_options:
        observe.say(f"PETSc options: {' '.join(petsc_options)}")
    for stage in STAGES[:-1]:
        if stage in reasons:
            observe.say(f"{stage:9s} skipped: {reasons[stage]}")
            on_root(comm, lambda s=stage: summary.record(s, "skipped", reason=reasons[s]))
        else:
            _run_stage(session, stage, summary, fresh)
    _check_options(petsc_options)
    if "report" in reasons:
        on_root(comm, lambda: summary.record("report", "skipped", reason=reasons["report"]))
    else:
        on_root(comm, lambda: _report(directory, summary))
    return session


def _say_demand(scene: Scene, directory: Path, comm: MPI.Comm, until: str | None) -> None:
    """What the run will take; InputError where the machine has too little by far. Collective."""
    wanted = on_root(comm, lambda: estimate(scene, until))  # it may read the road's file
    for text in on_root(comm, lambda: check_demand(wanted, directory, comm.size)):
        observe.warn(text)
    observe.say(
        f"estimated: {sum(wanted.memory.values()) / 1e9:.2g} GB a process, "
        f"{sum(wanted.disk.values()) / 1e9:.2g} GB of disk, "
        f"{duration(sum(wanted.seconds.values()))} of one core"
    )


def _run_stage(session: Session, stage: str, summary: Summary, fresh: bool) -> None:
    """Reuse the stage's file or compute it, and enter it in the summary. Collective."""
    module, comm = _MODULES[stage], session.comm
    began = time.perf_counter()
    wanted = store.wanted_hash(stage, module.inputs(session))
    session.hashes[stage] = wanted
    path = session.directory / f"{stage}.h5"
    reason = on_root(comm, lambda: "absent" if fresh else store.why_not(path, wanted, stage))
    if not reason:
        module.reuse(session, path)
        observe.say(f"{stage:9s} reused: computed from the same inputs before")
        on_root(comm, lambda: summary.record(stage, "reused", reason="same inputs"))
        return
    if reason != "absent":
        observe.say(f"{stage:9s} computed anew: {path.name} is there, but {reason}")
    with session.recording(stage) as record:
        module.compute(session, path)
        record.indicators["largest memory of a process so far"] = (_peak(comm), "GB")
    seconds = time.perf_counter() - began
    for text in record.warnings:
        observe.warn(f"{stage}: {text}")
    observe.say(f"{stage:9s} done in {seconds:.1f} s: {record.line()}")
    on_root(
        comm,
        lambda: summary.record(
            stage,
            "computed",
            seconds=seconds,
            headline=record.headline,
            indicators=record.indicators,
            warnings=record.warnings,
            cost=record.cost,
        ),
    )


def _peak(comm: MPI.Comm) -> float:
    """Largest resident memory of any process since it began, GB. Collective."""
    return 1e-9 * comm.allreduce(peak_memory(), MPI.MAX)


def _report(directory: Path, summary: Summary) -> None:
    """Root process only. The entry comes first: the page shows itself too."""
    from tireroad.runs.report.page import write_report

    began = time.perf_counter()
    summary.record("report", "computed")
    path = write_report(directory)
    seconds = time.perf_counter() - began
    summary.record("report", "computed", seconds=seconds)
    observe.say(f"{'report':9s} done in {seconds:.1f} s: {path}")


def _check_options(petsc_options: list[str]) -> None:
    """An option that nothing read is most likely misspelt: say so."""
    unused = [o for o in petsc_options if o.startswith("-") and not _was_read(o.lstrip("-"))]
    if unused:
        observe.warn(f"PETSc options that nothing read: {' '.join(unused)}")


def _was_read(name: str) -> bool:
    """Whether PETSc has looked for an option; petsc4py tells it from 3.19 on."""
    import ctypes

    from petsc4py import PETSc

    options = PETSc.Options()
    if hasattr(options, "used"):
        return options.used(name)
    found = ctypes.c_int(0)
    ctypes.CDLL(PETSc.__file__).PetscOptionsUsed(None, name.encode(), ctypes.byref(found))
    return bool(found.value)
