"""contact: the tire rolls over the road."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path

import numpy as np

from contact.brush import Brush, BrushLaw
from contact.friction import Friction
from contact.grid_patch import OnPoints, settle
from contact.model import solver_name, step_solver
from contact.rolling import Drive, roll
from greens.convolution import Convolution
from greens.recursion import Recursion
from greens.response import Response
from runs import observe, store
from runs.mpi import on_root
from runs.session import Session

# Radians a kept mode may turn in one automatic step: 0.3 leaves less than a percent in its phase.
_TURN = 0.3
_LEAST_STEPS = 200
_BLOCK = 512  # steps kept in memory between two writes


def inputs(session: Session) -> dict:
    """The Green's functions, the contact, the road (its file by content) and the time."""
    scene = session.scene
    return {
        "greens": session.hashes["greens"],
        "contact": asdict(scene.contact),
        "road": asdict(scene.road),
        "file": store.file_hash(scene.road.file) if scene.road.file else None,
        "speed": session.road_speed,
        "time": {k: v for k, v in asdict(scene.time).items() if k != "checkpoint"},
    }


def compute(session: Session, path: Path) -> None:
    """The time loop, written block by block. Collective."""
    record = session.record
    shortest = _shortest_period(session)
    tire, step, steps, scheme = integration(session, session.contact_response, shortest)
    with record.timing("tread and solver"):
        _settled(session)
        tire, solver, friction = _on_points(session, tire, step)
    patch = session.patch
    drive = Drive(session.road.height, session.motion, session.road_speed)
    totals = _Totals()
    with ExitStack() as stack:
        writer = _Writer(session, {"step": step, "scheme": scheme})
        on_root(session.comm, lambda: writer.open(stack, path))
        with record.timing("time loop"), observe.Progress("contact", steps) as bar:
            for instant in roll(tire, solver, patch, drive, step, steps, friction):
                patch.check_edge(instant.force, instant.time, session.reach)
                totals.add(instant)
                writer.add(instant)
                bar.advance()
        on_root(session.comm, writer.flush)
    _describe(session, totals, solver, step, steps, scheme)


def integration(session: Session, response: Response, shortest: float):
    """(tire, step, steps, scheme) for the scene's time table; what was chosen is shown. Collective.

    `shortest` (s): the shortest period in the excitation.
    """
    wanted = session.scene.time
    fastest = np.abs(response.eigenvalue).max(initial=0.0)
    step = wanted.step
    if step == "auto":
        limits = [wanted.duration / _LEAST_STEPS, shortest / 16]
        if fastest > 0:
            limits.append(_TURN / fastest)
        step = min(limits)
    steps = max(int(np.ceil(wanted.duration / step * (1 - 1e-9))), 1)
    if wanted.step == "auto":
        step = wanted.duration / steps
    scheme = "linear" if wanted.scheme == "auto" else wanted.scheme
    kept = response.resolved(step)
    moved = len(response.eigenvalue) - len(kept.eigenvalue)
    observe.say(
        f"  step {step:.4g} s, {steps} steps, scheme {scheme}; fastest mode {fastest:.4g} 1/s, "
        f"{moved} states too fast for the step follow statically"
    )
    session.record.indicators["states moved to the residual"] = (moved, "-")
    if scheme == "convolution":
        return Convolution(kept, step, steps), step, steps, scheme
    return Recursion(kept, step, scheme, session.comm), step, steps, scheme


def _shortest_period(session: Session) -> float:
    """Time in which the road's finest detail, or its motion, passes a point, s."""
    motion, road = session.scene.road.motion, session.road
    passing = 2 * road.spacing / session.road_speed if session.road_speed else np.inf
    return min(passing, 1 / motion.frequency) if motion.kind == "sine" else passing


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
    if patch.weights is not None:
        tire = OnPoints(tire, patch.weights, 1 if friction is None else 3)
    return tire, solver, friction


def _friction(session: Session, tire, step: float) -> Friction:
    """The brush of the scene, at rest."""
    spec, patch = session.scene.contact, session.patch
    law = BrushLaw(spec.brush_stiffness, spec.friction, spec.slip, spec.brush)
    brush = Brush(law, patch.points[:, 0], patch.line, session.road_speed, step)
    brush.begin(patch.force > 0)
    return Friction(brush, tire.same_step, patch.weights)


class _Totals:
    """Running figures of the loop."""

    def __init__(self) -> None:
        self.steps = 0
        self.sum = self.residual = self.penetration = 0.0
        self.least, self.most, self.most_active = np.inf, -np.inf, 0

    def add(self, instant) -> None:
        load = instant.force.sum()
        self.steps += 1
        self.sum += load
        self.least, self.most = min(self.least, load), max(self.most, load)
        self.most_active = max(self.most_active, instant.active)
        self.residual = max(self.residual, instant.residual)
        self.penetration = max(self.penetration, -instant.gap.min())


def _describe(session: Session, totals: _Totals, solver, step, steps, scheme) -> None:
    record = session.record
    record.headline |= {
        "mean load": (float(totals.sum / totals.steps), "N"),
        "least load": (float(totals.least), "N"),
        "largest load": (float(totals.most), "N"),
        "points touching at most": (totals.most_active, "-"),
        "step": (step, "s"),
        "scheme": (scheme, "-"),
        "time a step": (record.cost["time loop"] / steps * 1e6, "us"),
    }
    record.indicators |= {
        "worst complementarity residual": (float(totals.residual), "-"),
        "largest penetration": (float(totals.penetration), "m"),
        "factorisations": (solver.factorisations, "-"),
    }
    if session.scene.force:
        record.warnings.append(
            "the point forces of [[force]] act in response.h5 alone, not in the contact"
        )
    if totals.least == 0:
        record.warnings.append("the tire lost contact with the road for a while")


class _Writer:
    """contact.h5 as the loop goes, on the root process: blocks of steps, compressed."""

    def __init__(self, session: Session, attributes: dict):
        self._session = session
        self._attributes = attributes | {
            "road": session.scene.road.kind,
            "speed": session.speed,
            "road_speed": session.road_speed,
        }
        self._stack: list = []
        self._done = 0

    def open(self, stack: ExitStack, path: Path) -> None:
        """Make the temporary file with its growing datasets; the stack puts it in place at its end,
        or removes it after an error. Root process only."""
        provenance = self._session.provenance("contact")
        self._file = stack.enter_context(store.writing(path, provenance))
        patch = self._session.patch
        c = len(patch.points)
        store.put(self._file, "points", patch.points, "m")
        store.put(self._file, "area", patch.area, "m2")
        for name, (shape, unit) in _LAYOUT.items():
            width = tuple(c if n is None else n for n in shape)
            dataset = self._file.create_dataset(
                name,
                (0, *width),
                maxshape=(None, *width),
                chunks=(_BLOCK, *width),
                compression="gzip" if width == (c,) else None,
                compression_opts=1 if width == (c,) else None,
                shuffle=width == (c,),
            )
            dataset.attrs["unit"] = unit
        self._file.attrs.update(self._attributes)

    def add(self, instant) -> None:
        """Keep a step; write when a block is full. Collective every 512 steps."""
        self._stack.append(instant)
        if len(self._stack) == _BLOCK:
            on_root(self._session.comm, self.flush)
            self._stack.clear()

    def flush(self) -> None:
        """Write the steps kept so far. Root process only."""
        if not self._stack:
            return
        end = self._done + len(self._stack)
        for name, values in _columns(self._stack).items():
            dataset = self._file[name]
            dataset.resize(end, axis=0)
            dataset[self._done :] = values
        self._done = end


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


def reuse(session: Session, path: Path) -> None:
    """Later stages read the file themselves."""
