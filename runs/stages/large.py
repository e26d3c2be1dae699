"""Large motions in the time loop of a run: the tire, what it stores, and how far it leaves its training."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from tireroad.contact.loop import LinearTire
from tireroad.fem.matrices.compliance import factorise, on_own_rows, solve_columns
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.reduced import extra_loads, outside, sizes
from tireroad.greens.basis import Basis, Probes
from tireroad.greens.coupling import Wheel
from tireroad.greens.large_motion import LargeTire
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.modal.corner import READINGS
from tireroad.modal.rolling import RollingModes
from tireroad.modal.solver.slicing import Modes
from tireroad.runs.process import console
from tireroad.runs.stages.nonlinear import Nonlinear
from tireroad.runs.stages.stage import Record

Array = np.ndarray

KEPT = 10  # instants, those of the greatest reduced force
FAR = 0.06  # of the motion: what may be outside the training without a warning
_SLIGHT = 0.1  # J^(1/2): motions of which nothing is said


class Instants:
    """The instants of the greatest reduced force, `kept` in its order: its norm J^(1/2), the time s, and all states (q,), the
    block's (b,) and the loads (c + k,) then. Of a tire with a `linear` recursion; none are kept without one."""

    def __init__(self, tire: LargeTire | None, linear: LinearTire) -> None:
        self._tire, self._linear = tire, linear
        self.kept: list[tuple[float, float, Array, Array, Array]] = []

    def see(self, time: float) -> None:
        """Keep the present instant if it is one of the greatest. Collective where the tire is."""
        if self._tire is None:
            return
        size = float(np.linalg.norm(self._tire.s))
        if len(self.kept) == KEPT and size <= self.kept[-1][0]:
            return
        held = self._linear.snapshot()
        self.kept.append((size, time, held["state"], held["block_state"], held["push_force"]))
        self.kept.sort(key=lambda one: (-one[0], one[1]))
        del self.kept[KEPT:]

    def state(self) -> dict[str, Array]:
        """The state that a checkpoint keeps."""
        names = "size", "time", "states", "block", "loads"
        if not self.kept:
            return {}
        columns = zip(names, zip(*self.kept, strict=True), strict=True)
        return {f"instants_{name}": np.array(values) for name, values in columns}

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from a `state`."""
        names = "size", "time", "states", "block", "loads"
        if "instants_size" in state:
            columns = [state[f"instants_{name}"] for name in names]
            self.kept = [(float(a), float(b), *rest) for a, b, *rest in zip(*columns, strict=True)]


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """Motion outside the training (n,) J^(1/2) at n instants `time` (n,) s, and the `size` (n,) of the whole, in the same
    measure (fem.nonlinear.reduced.outside, sizes)."""

    time: Array
    motion: Array
    size: Array

    @property
    def share(self) -> float:
        """The greatest share of the motion that is outside."""
        return float((self.motion / np.maximum(self.size, _SLIGHT)).max(initial=0.0))


@dataclass(frozen=True, kw_only=True)
class LargeMotion:
    """Parts of a run's large motions: the stored training, the elements' force, the `response`
    (greens.large_motion.large_response), the probes `points` (r, 3 s or wider), and modes with fields, of the states of
    `rolling`."""

    trained: Nonlinear
    restoring: RestoringForce
    response: Response
    points: Probes
    wheel: Wheel
    rolling: RollingModes

    @property
    def loaded(self) -> int:
        """Number of points that carry forces, c."""
        return self.response.residual.shape[1] - self.trained.shape.shape[-1]

    def tire(self, linear: Recursion, scheme: str) -> LargeTire:
        """The tire on a `linear` recursion of the response. Collective."""
        return LargeTire(linear, self.trained.force(self.restoring), self.loaded, scheme)

    def left_out(self, instants: Instants, step: float) -> LeftOut:
        """How far the motion at the instants is outside the training. Collective.

        The motion is that of the states and what all loads cause beside them (Wheel.beyond_modes).
        """
        operators, restoring = self.restoring.operators, self.restoring
        vectors = self.trained.on_unknowns(restoring)
        own = on_own_rows(operators, self.points[: self.loaded])
        pushed = (self.wheel.growth or 1.0) * extra_loads(restoring, vectors)
        loads = np.stack([one[-1] for one in instants.kept], axis=1)
        acting = own @ loads[: self.loaded] + pushed @ loads[self.loaded :]
        motions = self.wheel.beyond_modes(Basis.of(self.rolling), self._modes, acting)
        motions += self._modes.vectors @ self._coordinates(instants, step)
        forces = restoring.nonlinear(motions)
        factor = factorise(operators.stiffness)
        answers = solve_columns(factor, operators.stiffness, forces)
        factor.destroy()
        return LeftOut(
            time=np.array([one[1] for one in instants.kept]),
            motion=outside(restoring, vectors, answers, forces),
            size=sizes(restoring, motions, answers),
        )

    @property
    def _modes(self) -> Modes:
        assert self.rolling.basis.modes is not None, "the modes on all unknowns"
        return self.rolling.basis.modes

    def _coordinates(self, instants: Instants, step: float) -> Array:
        """The coordinates (m, n) of the modes at the instants, relative to the wheel."""
        states, slow = self.rolling.states, self.response.slow(step)
        z, y = (np.stack([one[part] for one in instants.kept], axis=1) for part in (2, 3))
        found = (states.right[:, slow] @ z).real
        if len(y) == states.block_right.shape[1]:
            found += states.block_right @ y
        basis, m = Basis.of(self.rolling), self._modes.vectors.shape[1]
        face = len(basis.shape)
        inside = np.vstack([basis.shape, np.zeros((READINGS, m)), np.eye(m)])
        probes = sparse.hstack(
            [sparse.csr_matrix((m, face + READINGS)), sparse.identity(m)], format="csr"
        )
        return replace(basis, shape=inside).seen(probes) @ found


def describe(
    record: Record, tire: LargeTire, left_out: LeftOut | None, steps: int, excursion: float
) -> None:
    """Record what the reduced force took, what it stores, and how far the motion is outside its training; warn if far."""
    record.headline["motion"] = ("large", "-")
    record.indicators |= {
        "largest motion of the contact beyond the static state": (excursion, "m"),
        "evaluations of the reduced force a step": (tire.evaluations / max(steps, 1), "-"),
        "derivatives of it by differences": (tire.derivatives, "-"),
    }
    if left_out is None:
        return
    share = left_out.share
    record.headline["motion outside the training at most"] = (100 * share, "%")
    when = left_out.time[(left_out.motion / np.maximum(left_out.size, _SLIGHT)).argmax()]
    console.say(
        f"  large motions: {100 * share:.2g} % of the motion is outside the training at most, at t = {when:.4g} s "
        f"(of {len(left_out.time)} instants of the greatest nonlinear force); {tire.evaluations / max(steps, 1):.2g} evaluations a step"
    )
    if share > FAR:
        record.warnings.append(
            f"the motion leaves the training of the nonlinear force by {100 * share:.2g} % at t = {when:.4g} s, and forces may "
            "be off by as much: the road moves the tire there as no road of the training does. Take a lower speed or road, "
            'or motion.kind = "linear" to see by how much both differ'
        )
