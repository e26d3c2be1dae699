"""Large motions in the time loop of a run: the tire, its motion on all unknowns, and how far that is outside the training."""

from __future__ import annotations

from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from tireroad.contact.loop import STEPS_AHEAD, ContactProblem, LinearTire
from tireroad.fem.collective import summed
from tireroad.fem.errors import NearlySingular
from tireroad.fem.matrices.compliance import (
    LoadedShapes,
    factorise,
    on_own_rows,
    solve_columns,
)
from tireroad.fem.nonlinear.felt import felt_by_road
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.reduced import ReducedForce, at_nodes, extra_loads, outside, sizes
from tireroad.greens.basis import Basis, Probes
from tireroad.greens.coupling import Wheel
from tireroad.greens.large_motion import LargeTire, large_response
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.modal.corner import READINGS
from tireroad.modal.rolling import RollingModes
from tireroad.modal.solver.slicing import Modes
from tireroad.runs.process import console
from tireroad.runs.stages.stage import Record

Array = np.ndarray

KEPT = 10  # instants, those of the greatest reduced force
FELT = 5  # of them, of which it is found what the road feels
SEEN = 8  # steps from one instant that is looked at to the next
FAR = 0.1  # of the force's change: what the training may leave out without a warning
LEFT_OUT = "force left out by the nonlinear training"
_SLIGHT = 1 / 20  # of the largest motion: smaller ones are not told from none
Instant = tuple[float, Array, Array, Array, Array]
_PARTS = "time", "states", "block", "loads", "touching"  # of an instant


class Instants:
    """The states (q,) and the block's (b,) of a `linear` recursion, its loads (c + k,), and where points of the `contact` touch
    (ContactProblem.touching), at some times, s."""

    def __init__(self, linear: LinearTire, contact: ContactProblem) -> None:
        """The instants of a loop that begins. Collective where the recursion is."""
        self._linear, self.contact = linear, contact
        self.begun = self._now(0.0)
        self.kept: list[Instant] = []

    def add(self, time: float) -> None:
        """Keep the present instant. Collective where the recursion is."""
        self.kept.append(self._now(time))

    def _now(self, time: float) -> Instant:
        held = self._linear.snapshot()
        states = held["state"], held["block_state"], held["push_force"]
        return time, *states, self.contact.touching.T

    def __len__(self) -> int:
        return len(self.kept)

    @property
    def columns(self) -> tuple[Array, ...]:
        """Times (n,) s, states (q, n), the block's (b, n), loads (c + k, n), contacts (p, 3, n)."""
        return tuple(np.array(part).T for part in zip(*self.kept, strict=True))

    @property
    def at_begin(self) -> Instants:
        """The one in which the loop began."""
        return self._of([self.begun])

    def some(self, which: Array) -> Instants:
        """Those of the numbers (m,)."""
        return self._of([self.kept[k] for k in which])

    def _of(self, kept: list[Instant]) -> Instants:
        found = copy(self)
        found.kept = kept
        return found


class Greatest(Instants):
    """The instants of the greatest reduced force of a `tire`; none of a linear one. `apart`: steps from one that is seen to the
    next."""

    def __init__(self, tire: LargeTire | None, linear: LinearTire, contact: ContactProblem) -> None:
        self._tire, self.kept = tire, []
        self.apart = STEPS_AHEAD if tire is None else SEEN
        if tire is not None:
            super().__init__(linear, contact)

    def see(self, time: float) -> None:
        """Keep the present instant if it is one of the greatest. Collective where the tire is."""
        if self._tire is None:
            return
        size = float(np.linalg.norm(self._tire.s))
        if len(self) == KEPT and size <= self._size(self.kept[-1]):
            return
        self.add(time)
        self.kept.sort(key=lambda one: (-self._size(one), one[0]))
        del self.kept[KEPT:]

    def _size(self, one: Instant) -> float:
        assert self._tire is not None
        return float(np.linalg.norm(one[3][len(one[3]) - len(self._tire.s) :]))

    def state(self) -> dict[str, Array]:
        """The state that a checkpoint keeps."""
        if not self.kept:
            return {}
        return {f"instants_{k}": v for k, v in zip(_PARTS, self.columns, strict=True)}

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from a `state`."""
        if "instants_time" in state:
            columns = [state[f"instants_{name}"].T for name in _PARTS]
            self.kept = [(float(t), *rest) for t, *rest in zip(*columns, strict=True)]


@dataclass(frozen=True, kw_only=True)
class Felt:
    """The force of the road by what a reduced force leaves out, at i instants `time` (i,) s: `force` (i, 3) N
    (fem.nonlinear.felt), beside the force that has `changed` (i, 3) N since the loop began."""

    time: Array
    force: Array
    changed: Array

    @property
    def share(self) -> float:
        """The force left out over the one that has changed, each in the median of the instants: at some of a run with friction the
        tangent is nearly singular, and its answer as large as the load."""
        left_out, changed = (
            float(np.median(np.linalg.norm(one, axis=1))) for one in (self.force, self.changed)
        )
        return left_out / max(changed, np.finfo(float).tiny)

    @property
    def largest(self) -> tuple[float, float]:
        """The largest force (N) left out, and its time (s)."""
        size = np.linalg.norm(self.force, axis=1)
        return float(size.max()), float(self.time[size.argmax()])


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """The motion (n, i) m at i instants `time` (i,) s and its `answer` K^-1 r (n, i), on own unknowns; J^(1/2) (i,): what is
    `outside` the vectors of the training, what its weighted cells have `misread`, and the `size` of the whole in the same
    measure (fem.nonlinear.reduced)."""

    time: Array
    motion: Array
    answer: Array
    outside: Array
    misread: Array
    size: Array

    @property
    def shares(self) -> Array:
        """The share (i,) of the motion that is outside the training or misread, of the smallest over a twentieth of the largest."""
        return self._of_size(np.hypot(self.outside, self.misread))

    @property
    def misread_shares(self) -> Array:
        """The share (i,) of it that is misread."""
        return self._of_size(self.misread)

    def _of_size(self, part: Array) -> Array:
        least = _SLIGHT * self.size.max(initial=0.0)
        return part / np.maximum(np.maximum(self.size, least), np.finfo(float).tiny)


class Factors:
    """Factors of the stiffness of the tire, standing and as it rolls: made on first use and kept, since a training takes them
    after each of its runs. Collective."""

    def __init__(self, wheel: Wheel, restoring: RestoringForce, points: Probes) -> None:
        """`points` (p, 3 s or wider): probes whose loads are those of every run."""
        self._wheel, self._stiffness = wheel, restoring.operators.stiffness
        self._loads = on_own_rows(restoring.operators, points)

    @cached_property
    def rolling(self) -> LoadedShapes:
        """Shapes of the wheel's full matrices under constant loads, those of the points kept."""
        shapes = self._wheel.loaded_shapes()
        shapes.remember(self._loads)
        return shapes

    @cached_property
    def _standing(self) -> Any:
        return factorise(self._stiffness)

    def answers(self, forces: Array) -> Array:
        """K^-1 of forces (n, s) N, own rows."""
        return solve_columns(self._standing, self._stiffness, forces)

    def destroy(self) -> None:
        """Free them; what is needed again is made again."""
        for name in ("rolling", "_standing"):
            if (held := self.__dict__.pop(name, None)) is not None:
                held.destroy()


@dataclass(frozen=True, kw_only=True)
class LargeMotion:
    """Parts of a run's large motions, or of its linear ones before the training: the elements' force, the reduced one with its
    `vectors` V (n, k) on own unknowns (None, k = 0), the `response` (greens.large_motion.large_response), the probes `points`
    (r, 3 s or wider), of which the first `loaded` carry forces, and modes with fields, of the states of `rolling`."""

    restoring: RestoringForce
    force: ReducedForce | None
    vectors: Array
    response: Response
    points: Probes
    loaded: int
    wheel: Wheel
    rolling: RollingModes
    factors: Factors

    def trained(self, force: ReducedForce, vectors: Array) -> LargeMotion:
        """The same with a reduced force, and the response to it. Collective."""
        given = self.points, self.restoring, force, vectors, self.loaded, self.factors.rolling
        response = large_response(self.wheel, self._basis, self._modes, *given)
        return replace(self, force=force, vectors=vectors, response=response)

    def tire(self, linear: Recursion, scheme: str) -> LargeTire | None:
        """The tire on a `linear` recursion of the response; None if its motion is linear."""
        return LargeTire(linear, self.force, self.loaded, scheme) if self.force else None

    def motions(self, instants: Instants, step: float) -> Array:
        """The motion (n, i) m on own unknowns at the instants, relative to the wheel: that of the states, and what all loads
        cause beside them (Wheel.beyond_modes). Collective."""
        _, z, y, loads, _ = instants.columns
        pushed = (self.wheel.growth or 1.0) * extra_loads(self.restoring, self.vectors)
        own = on_own_rows(self.restoring.operators, self.points[: self.loaded])
        acting = own @ loads[: self.loaded] + pushed @ loads[self.loaded :]
        beyond = self.wheel.beyond_modes(self._basis, self._modes, acting, self.factors.rolling)
        return beyond + self._modes.vectors @ self._coordinates(z, y, step)

    def left_out(self, instants: Instants, step: float) -> LeftOut:
        """How far the motion at the instants is outside the training. Collective."""
        motion, restoring = self.motions(instants, step), self.restoring
        forces = restoring.nonlinear(motion)
        answer = self.factors.answers(forces)
        right = summed(restoring.body.comm, self.vectors.T @ forces)
        return LeftOut(
            time=instants.columns[0],
            motion=motion,
            answer=answer,
            outside=outside(restoring, self.vectors, answer, forces),
            misread=np.linalg.norm(right - self._read(motion), axis=0),
            size=sizes(restoring, motion, answer),
        )

    def felt(self, instants: Instants, step: float) -> Felt | None:
        """The force of the road by what the reduced force leaves out, at some of the instants; None if at all of them the tire has
        no stiffness of its own. Collective."""
        some, contact = instants.some(self._spread(instants)), instants.contact
        begun, count = instants.at_begin, len(contact.change)
        motions = self.motions(some, step)
        loads = self._lacking(motions) - self._lacking(self.motions(begun, step))
        own = on_own_rows(self.restoring.operators, self.points[:count]).tocsc()
        force = np.full((len(some), 3), np.nan)
        for k, touching in enumerate(np.moveaxis(some.columns[4], -1, 0)):
            lean, tread = contact.bearing(touching)
            given = motions[:, k], loads[:, k], (own @ lean.T).tocsr(), tread
            with suppress(NearlySingular):
                force[k] = contact.total(lean.T @ felt_by_road(self.restoring, *given))
        pushed = some.columns[3][:count] - begun.columns[3][:count]
        changed = np.stack([contact.total(one) for one in pushed.T])
        known = np.isfinite(force[:, 0])
        if not known.any():
            return None
        return Felt(time=some.columns[0][known], force=force[known], changed=changed[known])

    def _lacking(self, motion: Array) -> Array:
        """The load r - K V s (n, i) N that the reduced force leaves out of motions (n, i). Collective."""
        pushed = extra_loads(self.restoring, self.vectors) @ self._read(motion)
        return self.restoring.nonlinear(motion) - pushed

    def _spread(self, instants: Instants) -> Array:
        """Numbers of at most FELT instants with at least half of the largest reduced force, spread over time."""
        time, _, _, loads, _ = instants.columns
        size = np.linalg.norm(loads[self.loaded :], axis=0)
        great = np.flatnonzero(size >= 0.5 * size.max())
        great = great[np.argsort(time[great])]
        return great[np.unique(np.linspace(0, len(great) - 1, FELT).round().astype(int))]

    def _read(self, motion: Array) -> Array:
        """s (k, i) of motions (n, i) on own unknowns. Collective."""
        if self.force is None:
            return np.zeros((0, motion.shape[1]))
        read = at_nodes(self.restoring, motion, self.force.nodes)
        found = [self.force.evaluate(np.ascontiguousarray(one)) for one in read.T]
        return np.stack(found, axis=1)

    @property
    def _basis(self) -> Basis:
        return Basis.of(self.rolling)

    @property
    def _modes(self) -> Modes:
        assert self.rolling.basis.modes is not None, "the modes on all unknowns"
        return self.rolling.basis.modes

    def _coordinates(self, z: Array, y: Array, step: float) -> Array:
        """The coordinates (m, i) of the modes, relative to the wheel, from states (q, i) and the block's (b, i)."""
        states, slow = self.rolling.states, self.response.slow(step)
        found = (states.right[:, slow] @ z).real
        if len(y) == states.block_right.shape[1]:
            found += states.block_right @ y
        basis, m = self._basis, self._modes.vectors.shape[1]
        face = len(basis.shape)
        inside = np.vstack([basis.shape, np.zeros((READINGS, m)), np.eye(m)])
        probes = sparse.hstack(
            [sparse.csr_matrix((m, face + READINGS)), sparse.identity(m)], format="csr"
        )
        return replace(basis, shape=inside).seen(probes) @ found


def describe(
    record: Record, tire: LargeTire, felt: Felt | None, steps: int, excursion: float
) -> None:
    """Record what the reduced force took, and what the road feels of what it leaves out; warn if that is much."""
    record.headline["motion"] = ("large", "-")
    record.indicators |= {
        "largest motion of the contact beyond the static state": (excursion, "m"),
        "evaluations of the reduced force a step": (tire.evaluations / max(steps, 1), "-"),
        "derivatives of it taken anew": (tire.derivatives, "-"),
        "steps in which it is right within 1 % of the points' motion only": (tire.rough, "-"),
    }
    if felt is None:
        return
    (largest, when), share = felt.largest, felt.share
    record.headline[LEFT_OUT] = (100 * share, "%")
    record.indicators["largest force that the training leaves out"] = (largest, "N")
    console.say(
        f"  large motions: the training leaves out {100 * share:.2g} % of what the road's force has changed by (median of "
        f"{len(felt.time)} instants of great nonlinear forces), at most {largest:.3g} N at t = {when:.4g} s; "
        f"{tire.evaluations / max(steps, 1):.2g} evaluations a step"
    )
    if share > FAR:
        record.warnings.append(
            f"the training of the nonlinear force leaves out {100 * share:.2g} % of what the road's force has changed by, and forces "
            "may be off by as much: the run moves the tire as no state of the training did. Take a lower speed or road, "
            'or motion.kind = "linear" to see by how much both differ'
        )
