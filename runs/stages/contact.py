"""contact: the tire rolls over the road."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from tireroad.contact.driven import Driven
from tireroad.contact.grid_patch import OnPoints, settle
from tireroad.contact.model import solver_name, step_solver
from tireroad.contact.rolling import Drive, Loop, roll
from tireroad.contact.solver.friction import Friction
from tireroad.contact.totals import Figures, Totals
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.runs.files import store
from tireroad.runs.process import observe
from tireroad.runs.process.signals import Deferred, Stopped
from tireroad.runs.stages.contact_balance import balance
from tireroad.runs.stages.contact_file import ContactFile
from tireroad.runs.stages.point_forces import directions, histories, shortest_period
from tireroad.runs.stages.session import Session
from tireroad.runs.stages.stepping import integration, passing_period

_TOGETHER = 8  # steps between two agreements of several processes on whether to stop


def inputs(session: Session) -> dict:
    """The Green's functions, the contact, the road (its file by content) and the time."""
    scene = session.scene
    return {
        "greens": session.hashes["greens"],
        "contact": asdict(scene.contact),
        "road": asdict(scene.road),
        "file": store.file_hash(scene.road.file) if scene.road.file else None,
        "speed": session.road_speed,
        "axle_force": scene.output.axle_force,
        "forces": [asdict(force) for force in scene.force],
        "time": {k: v for k, v in asdict(scene.time).items() if k != "checkpoint"},
    }


def compute(session: Session, path: Path) -> None:
    """The time loop, written block by block, from the last checkpoint where there is one. Collective."""
    record = session.record
    road, forces = session.road, session.scene.force
    shortest = min(
        passing_period(session.scene.road, road.spacing, session.road_speed),
        shortest_period(forces),
    )
    tire, step, steps, scheme = integration(session, session.contact_response, shortest)
    with record.timing("tread and solver"):
        _settled(session)
        driven = _driven(session, tire, step, steps)
        loop = Loop(*_on_points(session, driven or tire, step))
    totals = Totals(session.patch, session.reach)
    with ExitStack() as stack, record.timing("time loop"):
        file = ContactFile(session, {"step": step, "scheme": scheme})
        kept = file.open(stack, path)
        if kept is not None:
            loop.restore(kept)
            totals.set_state(kept)
            observe.say(f"  goes on from the checkpoint at t = {totals.figures.steps * step:.6g} s")
        done, began = totals.figures.steps, time.thread_time()
        _run(session, loop, driven, file, totals, step, steps)
        # Of this process's own thread: what a step takes where nobody else wants the cores.
        busy = (time.thread_time() - began) / max(steps - done, 1)
        record.indicators["processor time a step"] = (1e6 * busy, "us")
        file.finish()
    _describe(session, totals.figures, loop.solver, step, steps - done, scheme)
    if scheme != "convolution":
        balance(session, loop, totals.work.total, driven.work if driven else 0.0, step)


def _driven(session: Session, tire, step: float, steps: int) -> Driven | None:
    """The tire under the scene's prescribed forces, where there are any."""
    forces = session.scene.force
    if not forces:
        return None
    return Driven(tire, histories(forces, step * np.arange(steps + 1)), directions(forces))


def _run(session: Session, loop: Loop, driven, file: ContactFile, totals, step, steps) -> None:
    """Take the steps that are left; stop between two of them when asked to. Collective."""
    done = totals.figures.steps
    drive = Drive(session.road.height, session.motion, session.road_speed)
    instants = roll(loop.tire, loop.solver, session.patch, drive, step, steps, loop.friction, done)
    watch = _Watch(session)
    with (
        Deferred() as deferred,
        observe.Progress("contact", steps, begun=done) as bar,
        # A step's matrices, a megabyte, are read as fast by one core as by two; threads that wait for
        # each other in every product took ten times as long where cores are shared.
        threadpool_limits(1, "blas"),
    ):
        for instant in instants:
            full = file.add(instant, driven.reading if driven else None)
            bar.advance()
            stop, due = watch(deferred.asked)
            if full or stop or due:
                file.flush(totals.add)
            if stop or due:
                file.checkpoint(loop.snapshot() | totals.state())
            if stop:
                raise Stopped(stop)
        file.flush(totals.add)


class _Watch:
    """Whether to stop, and whether a checkpoint is due: the same answer on every process."""

    def __init__(self, session: Session) -> None:
        self._comm, self._every = session.comm, session.scene.time.checkpoint
        self._last = time.monotonic()
        self._count = 0

    def __call__(self, asked: str) -> tuple[str, bool]:
        """Collective every few steps."""
        self._count += 1
        if self._comm.size > 1 and self._count % _TOGETHER:
            return "", False
        due = time.monotonic() - self._last > self._every
        if self._comm.size > 1:
            answers = self._comm.allgather((asked, due))
            asked = max(name for name, _ in answers)
            due = answers[0][1]
        if due:
            self._last = time.monotonic()
        return asked, due


def _settled(session: Session) -> None:
    """A grid of points takes up the static load that the finite elements gave to nodes."""
    patch = session.patch
    if patch.weights is None:
        return
    response = session.contact_response
    p = len(patch.index)
    flexibility = (response.static() + response.residual)[:p, :p]
    nodal = session.static.force[patch.index]
    solver = step_solver(session.scene.contact, patch, flexibility)
    session.patch, rise = settle(patch, solver, flexibility, nodal)
    session.record.indicators["rise of the tire as it settles on the grid"] = (rise, "m")


def _on_points(session: Session, tire, step: float):
    """(tire as seen at the patch's points, normal solver, friction or None); the choice is shown."""
    spec, patch = session.scene.contact, session.patch
    p = len(patch.index)
    solver = step_solver(spec, patch, tire.same_step[:p, :p])
    observe.say(
        f"  {len(patch.points)} contact points on {p} nodes, tread {spec.tread}, "
        f"solver {solver_name(spec, patch)}"
    )
    friction = None
    if spec.brush_stiffness is not None:
        friction = _friction(session, tire, step)
        limit = friction.largest_unique(patch.force > 0, solver)
        session.record.indicators["friction up to which a step has one answer"] = (limit, "-")
        session.record.warnings += beyond_unique(spec.friction, limit)
    if patch.weights is not None:
        tire = OnPoints(tire, patch.weights, 1 if friction is None else 3)
    return tire, solver, friction


def beyond_unique(friction: float | None, limit: float) -> list[str]:
    """A warning where points that slip may leave a step with more than one answer."""
    if friction is None or friction <= limit:
        return []
    return [
        f"contact.friction = {friction:g} is more than {limit:.3g}, up to which a step is sure to have "
        "one answer: where points slip there may be another; lower it, or take a softer tread"
    ]


def _friction(session: Session, tire, step: float) -> Friction:
    """The brush of the scene, at rest."""
    spec, patch = session.scene.contact, session.patch
    law = BrushLaw(spec.brush_stiffness, spec.friction, spec.slip, spec.brush)
    brush = Brush(law, patch.points[:, 0], patch.line, session.road_speed, step)
    brush.begin(patch.force > 0)
    return Friction(brush, tire.same_step, patch.weights)


def _describe(session: Session, totals: Figures, solver, step, taken, scheme) -> None:
    """`taken`: the steps of this run, without those before its checkpoint."""
    record = session.record
    record.headline |= {
        "mean load": (float(totals.sum / totals.steps), "N"),
        "least load": (float(totals.least), "N"),
        "largest load": (float(totals.most), "N"),
        "points touching at most": (totals.most_active, "-"),
        "step": (step, "s"),
        "scheme": (scheme, "-"),
        "time a step": (record.cost["time loop"] / max(taken, 1) * 1e6, "us"),
    }
    record.indicators |= {
        "worst complementarity residual": (float(totals.residual), "-"),
        "largest penetration": (float(totals.penetration), "m"),
        "factorisations": (solver.factorisations, "-"),
    }
    if totals.least == 0:
        record.warnings.append("the tire lost contact with the road for a while")


def reuse(session: Session, path: Path) -> None:
    """Later stages read the file themselves."""
