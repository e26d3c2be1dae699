"""The product of a stage, from its own file, from the shared cache, or computed."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, TypeVar

from tireroad.fem.collective import collect
from tireroad.fem.errors import ConvergenceError
from tireroad.runs.files import store
from tireroad.runs.process import observe
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages.base import failed
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.base.solver_settings import solver_settings
from tireroad.runs.stages.base.stage import Done, Stage

P = TypeVar("P")


@dataclass(frozen=True, kw_only=True)
class Obtained:
    """A stage that is `done`.

    `record` of the computation; for a reused product, by which run it was computed (`reused`) and
    the figures `known` from there.
    """

    done: Done
    record: Record | None = None
    reused: str = ""
    known: dict[str, Any] = field(default_factory=dict)


def obtained(stage: Stage) -> Obtained:
    """Reuse the stage's product from its folder or the shared cache, or compute it. Collective."""
    job, name = stage.job, stage.name
    key, path = store.wanted_hash(name, stage.inputs()), job.path(name)
    with ExitStack() as claim:
        reason, source, known = on_root(job.comm, lambda: _looked_up(stage, key, claim))
        if not reason:
            return Obtained(done=Done(key, stage.stored), reused=source, known=known)
        if reason != "absent":
            observe.say(f"{name:9s} computed anew: {path.name} exists, but {reason}")
        if settings := solver_settings(name, job.scene):
            observe.log(settings)
        record = Record()
        product = _produced(stage, key, record)
        collect(job.comm)
        figures = vars(record).copy()
        on_root(job.comm, lambda: job.cache.keep(name, key, path, figures))
    return Obtained(done=Done(key, lambda: product), record=record)


def _produced(stage: Stage[P], key: str, record: Record) -> P:
    """The computed product; a failure is kept for the other members of a sweep. Collective."""
    try:
        return stage.produce(key, record)
    except ConvergenceError as error:
        if stage.job.comm.rank == 0:  # not on_root: other processes need not have failed
            failed.remember(stage.name, key, stage.job.scene.name, error)
        raise


def _looked_up(stage: Stage, key: str, claim: ExitStack) -> tuple[str, str, dict[str, Any]]:
    """Look for a stored product.

    Returns why the stage has to be computed ("" if not), by which run the product was computed, and
    the figures that this folder's summary lacks. A stage to be computed is claimed: another run
    that needs it waits until it is in the cache. Raises ConvergenceError if another member of the
    sweep failed to compute it. Root process only.
    """
    job, name = stage.job, stage.name
    if job.fresh:
        return "absent", "", {}
    path = job.path(name)
    reason = store.why_not(path, key, name)
    if not reason:
        return "", "before", {}
    claim.enter_context(job.cache.claimed(name, key))
    figures = job.cache.fetch(name, key, path)
    if figures is None:
        failed.check(name, key)
        return reason, "", {}
    return "", "by another run", figures
