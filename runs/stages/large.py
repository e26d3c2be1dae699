"""Large motions in the time loop of a run: the tire, its motion on all unknowns, and how far that is outside the training."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from tireroad.contact.loop import LinearTire
from tireroad.fem.collective import summed
from tireroad.fem.matrices.compliance import (
    LoadedShapes,
    factorise,
    on_own_rows,
    solve_columns,
)
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
FAR = 0.1  # of the motion: what may be outside the training without a warning
_SLIGHT = 1 / 20  # of the largest motion: smaller ones are not told from none


class Instants:
    """The states (q,) and the block's (b,) of a `linear` recursion, and its loads (c + k,), at some times, s."""

    def __init__(self, linear: LinearTire) -> None:
        self._linear = linear
        self.kept: list[tuple[float, Array, Array, Array]] = []

    def add(self, time: float) -> None:
        """Keep the present instant. Collective where the recursion is."""
        held = self._linear.snapshot()
        self.kept.append((time, held["state"], held["block_state"], held["push_force"]))

    def __len__(self) -> int:
        return len(self.kept)

    @property
    def columns(self) -> tuple[Array, ...]:
        """Times (n,) s, states (q, n), the block's (b, n), loads (c + k, n)."""
        return tuple(np.array(part).T for part in zip(*self.kept, strict=True))


class Greatest(Instants):
    """The instants of the greatest reduced force of a `tire`; none of a linear one."""

    def __init__(self, tire: LargeTire | None, linear: LinearTire) -> None:
        super().__init__(linear)
        self._tire = tire

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

    def _size(self, one: tuple[float, Array, Array, Array]) -> float:
        assert self._tire is not None
        return float(np.linalg.norm(one[3][len(one[3]) - len(self._tire.s) :]))

    def state(self) -> dict[str, Array]:
        """The state that a checkpoint keeps."""
        names = "time", "states", "block", "loads"
        if not self.kept:
            return {}
        return {f"instants_{k}": v for k, v in zip(names, self.columns, strict=True)}

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from a `state`."""
        if "instants_time" in state:
            names = "time", "states", "block", "loads"
            columns = [state[f"instants_{name}"].T for name in names]
            self.kept = [(float(t), *rest) for t, *rest in zip(*columns, strict=True)]


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

    def __init__(self, wheel: Wheel, restoring: RestoringForce) -> None:
        self._wheel, self._stiffness = wheel, restoring.operators.stiffness

    @cached_property
    def rolling(self) -> LoadedShapes:
        """Shapes of the wheel's full matrices under constant loads."""
        return self._wheel.loaded_shapes()

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
        _, z, y, loads = instants.columns
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
        return LeftOut(
            time=instants.columns[0],
            motion=motion,
            answer=answer,
            outside=outside(restoring, self.vectors, answer, forces),
            misread=self._misread(motion, forces),
            size=sizes(restoring, motion, answer),
        )

    def _misread(self, motion: Array, forces: Array) -> Array:
        """|V^T r - s| (s,) J^(1/2) at motions and their forces r (n, s): what the weighted cells are off. Collective."""
        if self.force is None:
            return np.zeros(motion.shape[1])
        right = summed(self.restoring.body.comm, self.vectors.T @ forces)
        read = at_nodes(self.restoring, motion, self.force.nodes)
        found = [self.force.evaluate(np.ascontiguousarray(one)) for one in read.T]
        return np.linalg.norm(right - np.stack(found, axis=1), axis=0)

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
    record: Record, tire: LargeTire, left_out: LeftOut | None, steps: int, excursion: float
) -> None:
    """Record what the reduced force took and how far the motion is outside its training; warn if far."""
    record.headline["motion"] = ("large", "-")
    record.indicators |= {
        "largest motion of the contact beyond the static state": (excursion, "m"),
        "evaluations of the reduced force a step": (tire.evaluations / max(steps, 1), "-"),
        "derivatives of it taken anew": (tire.derivatives, "-"),
        "steps in which it is right within 2 % of the motion only": (tire.rough, "-"),
    }
    if left_out is None:
        return
    share, when = float(left_out.shares.max()), left_out.time[left_out.shares.argmax()]
    record.headline["motion outside the training at most"] = (100 * share, "%")
    console.say(
        f"  large motions: at most {100 * share:.2g} % of the motion is outside the training, at t = {when:.4g} s "
        f"(of {len(left_out.time)} instants of the greatest nonlinear force); "
        f"{tire.evaluations / max(steps, 1):.2g} evaluations a step"
    )
    if share > FAR:
        record.warnings.append(
            f"{100 * share:.2g} % of the motion at t = {when:.4g} s is outside the training of the nonlinear force, and forces "
            "may be off by as much: the run moves the tire there as no run of the training did. Take a lower speed or road, "
            'or motion.kind = "linear" to see by how much both differ'
        )
