"""The loop of a contact: tire, solver, brush and tread memory of a setup; and the steady rolling in which it begins."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from tireroad.contact.loop import ContactProblem, LinearTire, Loop, RoadMet, turning
from tireroad.contact.model import ContactSpec, step_solver, tread_memory, tread_shear
from tireroad.contact.patch import Patch
from tireroad.contact.setup import ContactSetup, SteadyRolling
from tireroad.contact.solver.conditions import Array
from tireroad.contact.solver.stick_slip import TOLERANCE, BrushFriction
from tireroad.contact.tread.between_nodes import without
from tireroad.contact.tread.brush import Brush, BrushLaw, next_ahead
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.response import Response

PASSAGES = 100  # lengths of the footprint, within which a tire is to roll steadily
# Of them in steps of a point, from which the loop's own steps go on: in steps so long a footprint may stick and slip sideways for ever
# (12 of -248 N in turns of seven lengths, a radial tire of 20 equal elements), which in the loop's own steps settles.
ROUGH = 30
FEWEST_STEPS = 8  # of a length
# Lengths that a passenger tire takes in steps of a point and then of the loop.
USUAL = 7, 5
STEADY = 1e-4  # of the load: changes of the forces from one length to the next
MOST_SLIP = (-0.2, 0.2)
# Share of the footprint's mean displacement across the road that is left out; without all of it forces turn the footprint before
# they shift it, and a step may have several solutions.
WITHOUT = 0.75
FIRST_SLIP = 2e-3  # of a wheel that is to slip; doubled with each step
FINE = 1e-6  # tolerance of stick and slip, so that the slip is not that of its residual


def make_loop(
    spec: ContactSpec,
    setup: ContactSetup,
    tire: LinearTire,
    step: float,
    tolerance: float = TOLERANCE,
) -> Loop:
    """The loop in steps of `step` s of a `tire` and the contact that the `spec` asks for, at rest or in `setup.steady`.

    `tolerance`: of stick and slip (contact.solver.stick_slip.BrushFriction).

    InputError if the contact problem is not affordable or has no unique solution. Collective when the tire looks ahead.
    """
    patch = setup.patch
    p, felt = len(patch.index), without(tire.same_step, setup.resolved)
    memory = tread_memory(spec, patch, setup.rolled.speed, step)
    at_once = memory.at_once if memory else 1.0
    solver = step_solver(spec, patch, felt[:p, :p], at_once)
    friction = _friction(spec, setup, felt, step, at_once, tolerance) if spec.has_friction else None
    problem = ContactProblem(patch, felt, solver, friction, of_nodes=tire.same_step)
    loop = Loop(tire, problem, memory, slips=setup.slips if turning(tire) else None)
    return loop.begun_at(setup.steady.state, setup.steady.change) if setup.steady else loop


def bristles(spec: ContactSpec, patch: Patch) -> float | Array | None:
    """Bristle stiffness (N/m) per point, or (c,); inf if rigid, None without friction."""
    if not spec.has_friction:
        return None
    if spec.brush_stiffness_per_area is not None:
        return spec.brush_stiffness_per_area * patch.area
    return spec.brush_stiffness or np.inf


def _friction(
    spec: ContactSpec,
    setup: ContactSetup,
    felt: Array,
    step: float,
    at_once: float,
    tolerance: float,
) -> BrushFriction:
    """The brush at rest, on a tire of the compliance `felt` (3p, 3p) m/N.

    Shear of the tread by pressure counts from the static state, like all motion. If the slip of the
    static shape counts (free rolling), the shear of its tread does too, except for a tread that
    creeps, and for one that is the tire's own, whose elements have it in that shape.
    """
    patch, stiffness = setup.patch, bristles(spec, setup.patch)
    assert stiffness is not None
    shear, pressed, moved = tread_shear(spec, patch, at_once), None, None
    beside = spec.in_series and spec.law.creep is None
    if shear is not None and setup.shape_slip is not None and beside:
        drag = shear.drag(patch.force)
        pressed, moved = np.zeros(len(patch.points)), np.stack([drag.real, drag.imag], axis=-1)
    law = BrushLaw(stiffness, spec.friction, setup.slips, spec.brush)
    brush = Brush(law, patch.points[:, 0], patch.line, setup.rolled.speed, step)
    brush.begin(patch.force > 0, moved)
    return BrushFriction(brush, felt, patch.weights, shear, pressed, tolerance)


class StaticTire:
    """A tire that follows its forces at once: the response (r, k) m/N to constant forces, of a tire that rolls steadily."""

    comm = MPI.COMM_SELF

    def __init__(self, flexibility: Array) -> None:
        self.same_step = flexibility
        self._free = np.zeros(len(flexibility))

    def predict(self) -> Array:
        """No displacement (r,) m is left of earlier forces."""
        return self._free

    def advance(self, force: Array) -> None:
        """Nothing moves on."""

    def inertia_force(self) -> Array:
        """None (3,)."""
        return np.zeros(3)

    def snapshot(self) -> dict[str, Array]:
        """No state."""
        return {}

    def restore(self, state: dict[str, Array]) -> None:
        """No state."""


def rolling_steadily(
    spec: ContactSpec, setup: ContactSetup, response: Response, step: float
) -> ContactSetup:
    """The setup (settled) with the state in which its tire rolls steadily, and with the slip of free rolling if it is free.

    The contact problem on a smooth road, in steps of a point each and then in the loop's own of `step` s, of a tire that
    follows its forces at once (`response` at 0 Hz). Freely rolling, the slip along the road is set from stretch to stretch so that
    nothing has to drive the wheel: the road's forces have no moment M_y about the axle,

        s+ = s_0 - D / (K l),   s_0 = s' - (D - D before) / (K way),   D = -M_y / R,

    D the force along the road with their moment, the mean of a stretch, R the height of the axle, K the tire's stiffness along the road, `way` that
    of a stretch, s' the slip between the middles of two, and l the length of the footprint: s_0 is the slip at which D would not have changed. A
    stretch is a number of passages of a point, whose entry and exit move D. Of a tire that loses nothing D is the force along the
    road; what the losses of rolling move ahead of the axle, the road's drag makes up for. What
    `setup.slip` has along the road comes on top, afterwards. Steady: from one length of the footprint to the next forces
    change by less than 1e-4 of the load. The setup itself where bristles do not roll: without friction, at standstill,
    with springs in their place. ConvergenceError if nothing is steady
    after 100 lengths of the footprint. Not collective: each process finds the same.
    """
    patch, given = setup.patch, setup.slip
    touching = patch.force > 0
    rolls = spec.has_friction and spec.brush == "rolling" and setup.rolled.speed > 0
    if not (rolls and touching.any()) or setup.steady is not None:
        return setup
    p, pitch, way = len(patch.index), _pitch(patch), setup.rolled.speed * step
    flexibility = (response.static() + response.residual)[: 3 * p, : 3 * p]
    length = float(np.ptp(patch.points[touching, 0])) + pitch
    shifted = np.zeros(3 * p) if response.offset is None else response.offset[: 3 * p]
    found, guesses = setup, way < pitch
    rolled = _Rolled(spec, setup, flexibility, shifted, length, pitch, guesses=guesses)
    if setup.free:
        found = setup.with_slip(rolled.freely(given[1]))
    if given[0] or not setup.free:
        rolled.held(found.slip)
        rolled.until_steady()
    if guesses:
        rolled = _Rolled(spec, setup, flexibility, shifted, length, way, rolled)
        if setup.free and not given[0]:
            found = setup.with_slip(rolled.freely(given[1]))
        else:
            rolled.held(found.slip)
            rolled.until_steady()
    contact = rolled.loop.contact
    forces = contact.vertical.copy(), contact.horizontal.T.copy()
    return replace(
        found, steady=SteadyRolling(rolled.state(), contact.change.copy(), *forces, rolled.way)
    )


def usual_steps(patch: Patch, way: float, finer: float = 1.0) -> float:
    """Steps that a tire on a grid `finer` than this one usually takes until it rolls steadily, in the loop's own of `way` m."""
    touching = patch.points[patch.force > 0, 0]
    pitch = _pitch(patch) / finer
    length = float(np.ptp(touching)) + pitch if len(touching) else 0.0
    return length * (USUAL[0] / max(pitch, way) + USUAL[1] / way)


class _Rolled:
    """A tire that follows its forces at once, rolled over a smooth road step by step."""

    def __init__(
        self,
        spec: ContactSpec,
        setup: ContactSetup,
        flexibility: Array,
        shifted: Array,
        length: float,
        way: float,
        before: _Rolled | None = None,
        guesses: bool = False,
    ) -> None:
        """In steps of `way` m, from rest or where it was `before`; if it `guesses` for other steps, it need not be steady; `flexibility` (3p, 3p) m/N to constant forces, and where the
        nodes are `shifted` (3p,) m to by what always acts inside the tire."""
        patch, p = setup.patch, len(setup.patch.index)
        step = way / setup.rolled.speed
        self._load, self._step = float(patch.force.sum()), way
        self._count = _in_a_stretch(way, _pitch(patch), length)
        self._stretches = math.ceil(max(length / way, FEWEST_STEPS) / self._count)
        share = patch.force / self._load
        nodes = share if patch.weights is None else patch.weights.T @ share
        stiffness = 1.0 / float(nodes @ flexibility[p : 2 * p, p : 2 * p] @ nodes)
        # The footprint's mean displacement across the road means nothing while it does not change, but takes many lengths to
        # settle (the relaxation length: cornering over lateral stiffness): the tire has only a part of it.
        self._left_out: Array = WITHOUT * (nodes @ flexibility[2 * p :])
        held = flexibility.copy()
        held[2 * p :] -= self._left_out
        self.loop = make_loop(spec, setup.smooth(step), StaticTire(held), step, FINE)
        # N of force along the road for a stretch, and for the length of the footprint, at a slip of 1.
        self._more, self._whole = stiffness * way * self._count, stiffness * length
        self._road, self._free = RoadMet.level(patch), np.zeros(3 * p)
        self._patch, self._shifted, self._flexibility = patch, shifted, flexibility
        self._shape = replace(setup, slip=(0.0, 0.0)).slips
        self._across: float | None = None
        self._before: tuple[float, float] | None = None  # drag and slip of the last stretch
        self._slip, self.way = (0.0, 0.0), 0.0
        self._guesses = guesses
        if before is not None:
            self._slip, self.way = before._slip, before.way
            self.loop.contact.set_state(before.loop.contact.state())
            if self.loop.memory and before.loop.memory:
                self.loop.memory.set_state(before.loop.memory.state())

    def freely(self, across: float) -> float:
        """The slip along the road with which the wheel rolls freely and steadily, with a slip `across`."""
        self.held((self.slip, across))
        self._across = across
        self.until_steady()
        return self.slip

    def held(self, slip: tuple[float, float]) -> None:
        """From now on the wheel slips so, reached step by step: a sudden slip moves more than a step can solve."""
        self._across = None
        begun, more = np.array(self._slip), np.subtract(slip, self._slip)
        part, whole = FIRST_SLIP, float(np.hypot(*more))
        while part < whole:
            self._creep(*(begun + part / whole * more))
            self._roll()
            part *= 2.0
        self._creep(*slip)

    @property
    def slip(self) -> float:
        """The slip along the road."""
        return self._slip[0]

    def _creep(self, along: float, across: float) -> None:
        self._slip = along, across
        self.loop.contact.creep(self._shape + (along, across))

    def until_steady(self) -> None:
        """Roll until the mean forces of a length of the footprint are those of the one before, or for a guess `ROUGH` lengths."""
        last = None
        for _ in range(ROUGH if self._guesses else PASSAGES):
            mean = np.mean([self._stretch() for _ in range(self._stretches)], axis=0)
            if last is not None:
                drag = abs(mean[2]) if self._across is not None else 0.0
                if max(drag, *np.abs(mean - last)) <= STEADY * self._load:
                    return
            last = mean
        if self._guesses:
            return
        wanted = (
            "no slip at which the road does not drag the tire"
            if self._across is not None
            else "no steady rolling"
        )
        raise ConvergenceError(
            f"contact: {wanted} was found within {self.way:.3g} m of a smooth road (last {mean[2]:.3g} N of drag and "
            f"{mean[1]:.3g} N across it): raise contact.friction, or take rotation.free_rolling = false"
        )

    def _stretch(self) -> Array:
        """The mean of `_roll` over a stretch, after which the slip of a tire that rolls freely is set anew."""
        mean: Array = np.mean([self._roll() for _ in range(self._count)], axis=0)
        if self._across is not None:
            drag, n = float(mean[2]), self._count
            before, slip = self._before or (drag, self.slip)
            between = ((n - 1) * slip + (n + 1) * self.slip) / (2 * n)
            unchanged = between - (drag - before) / self._more
            self._before = drag, self.slip
            self._creep(float(np.clip(unchanged - drag / self._whole, *MOST_SLIP)), self._across)
        return mean

    def state(self) -> dict[str, Array]:
        """The state of a loop of the whole tire that begins so."""
        contact, memory = self.loop.contact, self.loop.memory
        state = contact.state() | (memory.state() if memory else {})
        state["lagging"] = np.zeros(2, int)  # counted from the loop's first step on
        if "secants" in state:  # of this tire, not of the whole one
            state["secants"] = state["secants"][:, :0]
        for name in ("moved", "tip"):
            state[name] = state[name] + [0.0, self._left_out @ contact.change]
        return state

    def _roll(self) -> Array:
        """A step; the road's forces along and across it, and the drag of their moment, (3,) N."""
        contact, memory = self.loop.contact, self.loop.memory
        tread = memory.predict() if memory else None
        contact.commit(contact.solve(self._road, tread, self._free))
        if memory:
            memory.advance(contact.at_points)
        self.way += self._step
        return np.array([*contact.resultant[:2], self._drag()])

    def _drag(self) -> float:
        """Force along the road, N, whose moment about the axle is that of the road's forces, where the points have moved to."""
        contact, patch = self.loop.contact, self._patch
        moved = (self._shifted + self._flexibility @ contact.change).reshape(3, -1)
        moved = np.stack([patch.at_points(part) for part in moved[[1, 2, 0]]], axis=-1)
        force = np.column_stack([contact.horizontal.T, contact.vertical])
        if patch.frames is not None:
            moved, force = (np.einsum("ci,cij->cj", one, patch.frames) for one in (moved, force))
        places = patch.points + moved
        moment = float(places[:, 2] @ force[:, 0] - places[:, 0] @ force[:, 2])
        return moment * self._load / float(places[:, 2] @ patch.force)


def _in_a_stretch(way: float, pitch: float, length: float) -> int:
    """Number of steps of a `way` m, at most a quarter of the footprint's `length` unless a point's `pitch` is more, that come
    nearest to a number of pitches."""
    least = max(round(pitch / way), 1)
    counts = np.arange(least, max(int(length / 4 / way), least) + 1)
    passages = counts * way / pitch
    return int(counts[np.argmin(np.abs(passages - np.maximum(np.round(passages), 1)))])


def _pitch(patch: Patch) -> float:
    """The usual distance (m) of points that follow each other along the road."""
    _, pitch = next_ahead(patch.points[:, 0], patch.line)
    return float(np.median(pitch[pitch > 0]))
