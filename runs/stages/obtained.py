"""The product of a stage, from its own file, from the shared cache, or computed; and its failures.

Failures of stages: entered in the summary, and kept during a sweep.

Members of a sweep that share a stage do not repeat its failure.

The environment variable TIREROAD_FAILURES names a folder with a file for each stage that has
failed, by its name and the hash of its inputs. A sweep on this machine gives its workers an empty
one. Without it nothing is remembered: a run by itself may be tried again.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from mpi4py import MPI

from tireroad.fem.collective import collect
from tireroad.fem.errors import ConvergenceError
from tireroad.runs.files import store
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.folder import Summary
from tireroad.runs.process import console
from tireroad.runs.process.mpi import on_root
from tireroad.runs.process.signals import Stopped
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.stage import Done, Record, Stage

VARIABLE = "TIREROAD_FAILURES"


@contextmanager
def entered(stage: str, summary: Summary, comm: MPI.Comm) -> Iterator[None]:
    """Within the context, an error or a stop is entered in the summary by the root process."""
    try:
        yield
    except BaseException as error:
        if comm.rank == 0:
            stopped = isinstance(error, Stopped)
            told = f"stopped by {error}: resume continues" if stopped else str(error) or repr(error)
            with suppress(Exception):  # of the first error, whatever else goes wrong
                summary.end(stage, told)
        raise


def remember(stage: str, key: str, run: str, error: ConvergenceError) -> None:
    """Keep why the stage of a `run` failed, if failures are kept. Root process only."""
    if (file := _file(stage, key)) and not file.exists():
        with suppress(OSError):
            write_text(file, f"{error} (as in {run}, which failed first and has the same inputs)")


def check(stage: str, key: str) -> None:
    """Raise ConvergenceError if the stage has failed on these inputs. Root process only."""
    file = _file(stage, key)
    if file and file.exists():
        raise ConvergenceError(file.read_text(encoding="utf-8"))


def _file(stage: str, key: str) -> Path | None:
    folder = os.environ.get(VARIABLE)
    return Path(folder) / f"{stage}-{key}.txt" if folder else None


_MUMPS = "MUMPS through PETSc, ICNTL(14) = 100 %"


def solver_settings(stage: str, scene: Scene) -> str:
    """One line about the solvers that a stage of the scene uses; "" if it has none.

    Options given after `--` are logged where they are taken and change those of their prefix.
    """
    told = _TOLD.get(stage)
    return f"{stage:9s} solver: {told(scene)}" if told else ""


def _static(scene: Scene) -> str:
    from tireroad.fem.static.equilibrium import MOST_STEPS, TOLERANCE
    from tireroad.fem.static.load_steps import LOAD_TOLERANCE

    return (
        f"Newton's method, residual at most {TOLERANCE:g} of the force scale, at most {MOST_STEPS} "
        f"tangents a load step; load to {LOAD_TOLERANCE:g}; tangents factorised by {_MUMPS}, options -static_…"
    )


def _modes(scene: Scene) -> str:
    from tireroad.modal.solver.slicing import AUTO, BLOCK, TOLERANCE
    from tireroad.modal.solver.undamped import ORTHONORMALITY_TOLERANCE, RESIDUAL_TOLERANCE

    solver = AUTO if scene.modes.solver == "auto" else scene.modes.solver
    how = {
        "lanczos": f"block Lanczos, {BLOCK} vectors a block, on (A - sigma I)^-1 of each slice",
        "slepc": "SLEPc's spectrum slicing, Krylov-Schur, options -modes_…",
    }[solver]
    rotation = scene.rotation
    shapes = f"; rotation shapes of {rotation.shape_tolerance:g} and more" if rotation else ""
    return (
        f"{how} to {TOLERANCE:g}; counted by "
        f"the inertia of L D L^T, {_MUMPS}; residual at most {RESIDUAL_TOLERANCE:g}, orthonormal to "
        f"{ORTHONORMALITY_TOLERANCE:g}{shapes}"
    )


def _rotating(scene: Scene) -> str:
    if scene.rotation is None or scene.rotation.method == "projected":
        from tireroad.modal.rotating import LIMITS

        return f"LAPACK on the modal basis; residual at most {LIMITS[0]:g}, identities to {LIMITS[1]:g}"
    from tireroad.modal.solver.quadratic import ITERATIONS, RESIDUAL_TOLERANCE, TOLERANCE

    return (
        f"SLEPc PEP nearest to 0 by shift-and-invert to {TOLERANCE:g}, at most {ITERATIONS} restarts, {_MUMPS}, "
        f"options -rotating_…; residual at most {RESIDUAL_TOLERANCE:g}"
    )


def _greens(scene: Scene) -> str:
    if scene.greens.residual == "none":
        return "none: states alone"
    from tireroad.fem.matrices.direct import RESIDUAL_TOLERANCE

    return f"static shapes by {_MUMPS}; residual at most {RESIDUAL_TOLERANCE:g}"


def _contact(scene: Scene) -> str:
    from tireroad.contact.solver.conditions import TOLERANCE

    assert scene.contact is not None, "the stage runs with [contact] only"
    parts = [f"{scene.contact.solver}, complementarity to {TOLERANCE:g} of the scale"]
    if scene.contact.solver == "snes-vi":
        from tireroad.contact.solver.snes_vi import MAX_ITERATIONS

        parts.append(f"PETSc SNES vinewtonrsls, at most {MAX_ITERATIONS} iterations")
    if scene.contact.has_friction:
        from tireroad.contact.solver.stick_slip import TOLERANCE as change
        from tireroad.contact.solver.stick_slip import TURNS

        parts.append(f"friction to {change:g} of the largest force in at most {TURNS} iterations")
    return "; ".join([*parts, f"scheme {scene.time.scheme}"])


_TOLD: dict[str, Callable[[Scene], str]] = {
    "static": _static,
    "modes": _modes,
    "rotating": _rotating,
    "greens": _greens,
    "contact": _contact,
}


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
            console.say(f"{name:9s} computed anew: {path.name} exists, but {reason}")
        if settings := solver_settings(name, job.scene):
            console.log(settings)
        record = Record()
        with _remembering(stage, key):
            product = stage.produce(key, record)
        collect(job.comm)
        figures = vars(record).copy()
        on_root(job.comm, lambda: job.cache.keep(name, key, path, figures))
    return Obtained(done=Done(key, lambda: product), record=record)


@contextmanager
def _remembering(stage: Stage, key: str) -> Iterator[None]:
    """A failure within is remembered for the other members of a sweep."""
    try:
        yield
    except ConvergenceError as error:
        if stage.job.comm.rank == 0:  # not on_root: other processes need not have failed
            remember(stage.name, key, stage.job.scene.name, error)
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
        check(name, key)
        return reason, "", {}
    return "", "by another run", figures
