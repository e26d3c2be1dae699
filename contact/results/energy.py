"""The energy that road and drive give to the tire, its balance, and the running figures of a loop."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy import linalg

from tireroad.contact.patch import LEAST_REACH, Patch
from tireroad.contact.results.chatter import Alternation, Chatter
from tireroad.greens.response import Response
from tireroad.greens.schemes import SCHEMES
from tireroad.modal.damping import modal_damping
from tireroad.modal.rolling import RollingModes, pencil

AT_ONCE = 64  # steps of which the work is computed at a time: it takes nine arrays of their size

# Times the patch's reach, or the smallest default reach: a scene may give one that is far smaller
# than what the tire moves.
RUNAWAY = 100.0


class Work:
    """Work (J) of the changes of the contact forces on the tire, summed over the steps.

    Trapezoidal rule: sum (f + f_before).(u - u_before)/2, second order in the step. `lead`: the
    additional work of the mean forces that a `scheme` applies during the steps
    (greens.schemes.Scheme.ahead_of_mean); `begun`: energy (J) that was in the tire before. A checkpoint keeps them, with the
    last forces and displacement.
    """

    def __init__(self, scheme: str = "linear") -> None:
        self.total = self.lead = self.begun = 0.0
        self._scheme = scheme
        self._forces = np.zeros((2, 1))  # of the last two steps
        self._moved = np.zeros(1)

    def begin(self, change: np.ndarray, moved: np.ndarray, energy: float) -> None:
        """Begin at `change` (k,) N and `moved` (k,) m, with an energy (J) in the tire, in place of 0."""
        self._forces, self._moved, self.begun = np.stack([change, change]), moved, energy

    def add(self, change: np.ndarray, moved: np.ndarray) -> None:
        """Count n steps: `change` (n, k) N and `moved` (n, k) m of contact.rolling.Instant."""
        for first in range(0, len(change), AT_ONCE):
            some = slice(first, first + AT_ONCE)
            self._add(change[some], moved[some])

    def _add(self, change: np.ndarray, moved: np.ndarray) -> None:
        before = np.broadcast_to(self._forces, (2, change.shape[1]))
        path = np.concatenate([before, change])
        force, ahead = path[1:], SCHEMES[self._scheme].ahead_of_mean(path)
        place = np.concatenate([np.broadcast_to(self._moved, (1, moved.shape[1])), moved])
        mean, way = 0.5 * (force[1:] + force[:-1]), np.diff(place, axis=0)
        # Step by step, so that the sum does not depend on how steps are blocked.
        for work, more in np.stack([mean * way, ahead * way]).sum(axis=2).T.tolist():
            self.total += work
            self.lead += more
        self._forces, self._moved = path[-2:].copy(), moved[-1].copy()  # not the whole block

    def state(self) -> dict[str, np.ndarray]:
        """The state that a checkpoint keeps."""
        return {
            "work": np.array([self.total, self.lead, self.begun]),
            "work_forces": self._forces,
            "work_moved": self._moved,
        }

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Continue from `state`."""
        self.total, self.lead, self.begun = state["work"].tolist()
        self._forces, self._moved = state["work_forces"], state["work_moved"]


class Dissipation:
    """Energy that the material of a rolling tire dissipates, and that the drive supplies, J.

    With r = q' + Omega P q the body rate of the coordinates q, D the damping of the modes:

        lost = int r . D r dt >= 0,   drive = int (Omega P q) . D r dt,

    so that work of the forces + drive = change of the energy of `stored` + lost. Summed over the
    steps by the trapezoidal rule. Where the wheel moves, q is `held` times all coordinates, the motion of
    tire and air relative to it, and the dampers of its `hub` lose q' . C q' of all of them.
    """

    def __init__(
        self,
        damping: np.ndarray,
        turning: np.ndarray,
        step: float,
        held: np.ndarray | None = None,
        hub: np.ndarray | None = None,
    ) -> None:
        """`damping` (n, n) 1/s; `turning` Omega P (n, n) 1/s; `step` s; `held` (n, m); `hub` C (m, m) 1/s."""
        self._damping, self._turning, self._step = damping, turning, step
        self._held, self._hub = held, hub
        self.lost = self.drive = 0.0
        self._last = np.zeros(2)

    def add(self, coordinates: np.ndarray, rates: np.ndarray) -> None:
        """Count n steps: coordinates and rates (m, n) at their ends."""
        beside = np.zeros(rates.shape[1]) if self._hub is None else _power(rates, self._hub @ rates)
        if self._held is not None:
            coordinates, rates = self._held @ coordinates, self._held @ rates
        turned = self._turning @ coordinates
        body = rates + turned
        braked = self._damping @ body
        power = np.stack([_power(body, braked) + beside, _power(turned, braked)])
        power = np.column_stack([self._last, power])
        # Step by step, so that the sums do not depend on how steps are blocked.
        for lost, drive in (self._step * (power[:, 1:] + power[:, :-1]) / 2).T.tolist():
            self.lost += lost
            self.drive += drive
        self._last = power[:, -1]

    def state(self) -> dict[str, np.ndarray]:
        """The state that a checkpoint keeps."""
        return {"dissipation": np.array([self.lost, self.drive]), "dissipation_last": self._last}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Continue from `state`."""
        self.lost, self.drive = state["dissipation"].tolist()
        self._last = state["dissipation_last"]


def _power(rates: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Power (n,) of forces (m, n) at rates (m, n)."""
    return (rates * forces).sum(axis=0)


class Circulation:
    """Work (J) on the skew part of a flexibility, int f . G_a df, by the trapezoidal rule.

    The symmetric part of a residual flexibility stores the work done on it. The skew part, which a
    rolling tire has, does not: its work is what the truncated modes dissipate, less what the drive
    supplies to them. `lead`: work on the symmetric part that is not stored, as the mean forces of
    a `scheme` during the steps are ahead (greens.schemes.Scheme.ahead_of_mean).
    """

    def __init__(self, flexibility: np.ndarray, scheme: str = "linear") -> None:
        """`flexibility` (k, k) m/N."""
        self._scheme = scheme
        self._skew = (flexibility - flexibility.T) / 2
        self._even = (flexibility + flexibility.T) / 2
        self.work = self.lead = 0.0
        self._forces = np.zeros((2, len(flexibility)))  # of the last two steps

    def add(self, forces: np.ndarray) -> None:
        """Count n steps: forces (n, k) N at their ends."""
        whole = np.concatenate([self._forces, forces])
        path, ahead = whole[1:], SCHEMES[self._scheme].ahead_of_mean(whole)
        # Of many nodes few carry points that touch: products of these alone.
        loaded = np.flatnonzero(whole.any(axis=0))
        some = np.ix_(loaded, loaded)
        path, ahead = path[:, loaded], ahead[:, loaded]
        # f_a . G_a (f_b - f_a) = f_a . G_a f_b, since f . G_a f = 0.
        jump = np.diff(path, axis=0)
        turned = np.einsum("ni,ni->n", path[:-1], path[1:] @ self._skew[some].T)
        jumped = np.einsum("ni,ni->n", ahead, jump @ self._even[some])
        for work, more in zip(turned.tolist(), jumped.tolist(), strict=True):
            self.work += work
            self.lead += more
        self._forces = whole[-2:]

    def begin(self, forces: np.ndarray) -> None:
        """Begin at forces (k,) N in place of none."""
        self._forces = np.stack([forces, forces])

    def state(self) -> dict[str, np.ndarray]:
        """The state that a checkpoint keeps."""
        return {
            "circulation": np.array([self.work, self.lead]),
            "circulation_forces": self._forces,
        }

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Continue from `state`."""
        self.work, self.lead = state["circulation"].tolist()
        self._forces = state["circulation_forces"]


class Relaxed:
    """Energy (J) that slow rubber dissipates and holds (greens.slow).

    A pole -1/tau with output and input l is a spring and a dashpot side by side under the force a = l f: its state z,
    tau z' + z = a, moves the points by l z, holds z^2 / 2 and

        lost = tau int z'^2 dt.

    Rates are those in the middle of each step, of the mean force that the `scheme` applies during it.
    """

    def __init__(self, rate: np.ndarray, step: float, scheme: str = "linear") -> None:
        """`rate` 1/tau (p,) 1/s; `step` s."""
        self._rate, self._step, self._scheme = rate, step, scheme
        self.lost = 0.0
        self._forces, self._state = np.zeros((2, len(rate))), np.zeros(len(rate))

    def begin(self, state: np.ndarray, push: np.ndarray) -> None:
        """Begin in a state (p,) under pushes (p,) a / tau in place of none."""
        self._forces, self._state = np.stack([push / self._rate] * 2), state

    def add(self, states: np.ndarray, pushes: np.ndarray) -> None:
        """Count n steps: states and pushes (n, p) at their ends."""
        forces = np.concatenate([self._forces, pushes / self._rate])
        path = np.concatenate([self._state[None], states])
        acting = (forces[2:] + forces[1:-1]) / 2 + SCHEMES[self._scheme].ahead_of_mean(forces)
        lag = acting - (path[1:] + path[:-1]) / 2
        # Step by step, so that the sum does not depend on how steps are blocked.
        for lost in (self._step * (lag**2 @ self._rate)).tolist():
            self.lost += lost
        self._forces, self._state = forces[-2:], path[-1]

    @staticmethod
    def held(state: np.ndarray) -> float:
        """Energy (J) in a state (p,)."""
        return float(0.5 * state @ state)

    def state(self) -> dict[str, np.ndarray]:
        """The state that a checkpoint keeps."""
        return {
            "relaxed": np.array([self.lost]),
            "relaxed_forces": self._forces,
            "relaxed_state": self._state,
        }

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Continue from `state`."""
        (self.lost,) = state["relaxed"].tolist()
        self._forces, self._state = state["relaxed_forces"], state["relaxed_state"]


def stored(coordinates: np.ndarray, rates: np.ndarray, stiffness: np.ndarray) -> float:
    """Energy (J) of modal coordinates (m,) and rates (m,): kinetic, and in `stiffness` (m, m) 1/s2.

    In the non-rotating frame; in a rolling tire the symmetric part of the stiffness includes the
    negative convective term.
    """
    return float(0.5 * rates @ rates + 0.5 * coordinates @ stiffness @ coordinates)


def own_states(response: Response, rolling: RollingModes) -> bool:
    """Whether the response consists of the modes' own states.

    With residual states or states of the full matrices, the modal coordinates are not known here;
    with attachment modes they are those of `rolling` if these have joined it.
    """
    if rolling.full:
        return False
    states, own = rolling.states, response.eigenvalue[response.of_modes]
    return np.array_equal(own, states.eigenvalue) and len(response.block) == len(states.block)


def springs(response: Response, force: np.ndarray) -> float:
    """Elastic energy (J) in the residual flexibility, with static states, at forces (k,) N.

    The first outputs are the displacements of the forces; readings may follow them (contact.loop).
    """
    if response.pulse:
        return 0.0
    return float(0.5 * force @ response.residual[: len(force)] @ force)


class StateMotion:
    """Coordinates and rates from the states of a time loop, and their dissipation.

    For a tire that rolls on its own states only. Its air loses energy as it does, at the rate relative to
    the wheel, and the dampers of a corner theirs.
    """

    def __init__(self, rolling: RollingModes, slow: np.ndarray, step: float) -> None:
        states, projection, turning = rolling.states, rolling.basis.projection, rolling.turning
        right = states.right[:, slow]
        self._real, self._imaginary = right.real.copy(), right.imag.copy()
        self._eigenvalue = states.eigenvalue[slow][:, None]
        self._block, self._block_right = states.block, states.block_right
        damping = modal_damping(turning.damping, projection)
        _, _, body = projection.rotating(turning.inertia)
        if projection.air is not None:
            duct = projection.air.duct
            damping = linalg.block_diag(damping, np.diag(duct.loss))
            body = linalg.block_diag(body, duct.gyroscopic)
        moving = projection.hub_damping() if projection.moves else (None, None)
        self.losses = Dissipation(damping, turning.speed * body, step, *moving)

    @staticmethod
    def known(rolling: RollingModes, response: Response) -> bool:
        """Whether the dissipation of these states can be computed."""
        return not rolling.full and rolling.turning.speed > 0 and own_states(response, rolling)

    def add(self, states: np.ndarray, pushes: np.ndarray, block: np.ndarray) -> np.ndarray:
        """Count n steps: all states and pushes (n, q), and the block's states (n, b), at their ends.

        Returns the coordinates (n, m) there.
        """
        z, defective = states.T, block.reshape(len(states), -1).T
        coordinates = self._coordinates(z) + self._block_right @ defective
        rates = self._coordinates(self._eigenvalue * z + pushes.T)
        self.losses.add(coordinates, rates + self._block_right @ (self._block @ defective))
        return coordinates.T

    def _coordinates(self, z: np.ndarray) -> np.ndarray:
        # Contiguous, or BLAS is not used.
        real, imaginary = (np.ascontiguousarray(part) for part in (z.real, z.imag))
        return self._real @ real - self._imaginary @ imaginary


def energy_left(rolling: RollingModes, kept: dict[str, np.ndarray], slow: np.ndarray) -> float:
    """Energy (J) of the modes in a tire's snapshot; `slow` (q,) marks those it contains, whose states are first."""
    states, count = rolling.states, np.count_nonzero(slow)
    state, push = kept["state"][:count], kept["push"][:count]
    right = states.right[:, slow]
    coordinates = (right @ state).real + states.block_right @ kept["block_state"]
    rates = (right @ (states.eigenvalue[slow] * state + push)).real
    rates += states.block_right @ (states.block @ kept["block_state"])
    # Damping's contribution to the rolling stiffness stores nothing: it is work of the drive.
    projection = rolling.basis.projection
    if projection.air is not None:
        air = projection.air
        duct = replace(air.duct, loss=np.zeros_like(air.duct.loss))
        projection = replace(projection, air=replace(air, duct=duct))
    _, stiffness = pencil(projection, replace(rolling.turning, damping=(0.0, 0.0)))
    return stored(coordinates, rates, stiffness)


@dataclass
class StepScalars:
    """The scalars that a checkpoint keeps: N, the complementarity residual, m.

    `excursion`: the largest displacement of a contact point from the static state relative to the
    wheel.
    """

    steps: int = 0
    sum: float = 0.0
    residual: float = 0.0
    penetration: float = 0.0
    least: float = np.inf
    most: float = -np.inf
    most_active: int = 0
    excursion: float = 0.0


@dataclass
class Totals:
    """Results and work of the steps so far, with checks of the contact.

    Points at the edge of the `patch` must not touch (`reach` in m), and at most the share `limit`
    of the points may alternate. `work` is that of the loop's own scheme.
    """

    patch: Patch
    reach: float
    limit: float = np.inf
    figures: StepScalars = field(default_factory=StepScalars)
    work: Work = field(default_factory=Work)
    alternation: Alternation = field(default_factory=Alternation)

    def add(self, steps: dict[str, np.ndarray]) -> None:
        """Count a block as `ContactFile.flush` passes it.

        ConvergenceError if an edge point touches; Chatter if the motion grows without bound, or if
        more points than `limit` open and close from step to step.
        """
        self.alternation.add(steps["normal_force"])
        self.alternation.check(self.limit)
        self._check_bounded(steps)
        self.patch.check_edge(steps["normal_force"], steps["time"], self.reach)
        self.work.add(steps["change"], steps["moved"])
        old, load = self.figures, steps["total_force"][:, 2]
        self.figures = StepScalars(
            steps=old.steps + len(load),
            # Step by step: the same bits however steps are blocked.
            sum=float(np.cumsum([old.sum, *load])[-1]),
            residual=max(old.residual, float(steps["residual"].max())),
            penetration=max(old.penetration, float(steps["penetration"].max())),
            least=min(old.least, float(load.min())),
            most=max(old.most, float(load.max())),
            most_active=max(old.most_active, int(steps["active"].max())),
            excursion=max(old.excursion, float(np.abs(self._beside_wheel(steps)).max(initial=0.0))),
        )

    def finish(self) -> None:
        """After the last step; raises Chatter as in `add`."""
        self.alternation.finish()
        self.alternation.check(self.limit)

    def _beside_wheel(self, steps: dict[str, np.ndarray]) -> np.ndarray:
        """Displacements (n, c) m, less the wheel's height, of the points that touch at rest."""
        touching = self.patch.force > 0
        return steps["displacement"][:, touching] - steps.get("wheel_height", np.zeros(1))[:, None]

    def _check_bounded(self, steps: dict[str, np.ndarray]) -> None:
        """Raise Chatter if a point moved by much more than the road could move it."""
        far = np.abs(steps["displacement"]).max(axis=1)
        bound = RUNAWAY * max(self.reach, LEAST_REACH)
        when = np.flatnonzero(~(far <= bound))
        if len(when):
            raise Chatter(
                f"contact: at t = {steps['time'][when[0]]:.6g} s a contact point of the tire has moved by "
                f"{far[when[0]]:.3g} m, more than {bound:.3g} m: the motion grows without bound. Take a smaller "
                'time.step, or time.scheme = "constant" or "auto"'
            )

    def state(self) -> dict[str, np.ndarray]:
        """The state that a checkpoint keeps."""
        return {n: np.array(v) for n, v in vars(self.figures).items()} | (
            self.work.state() | self.alternation.state()
        )

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Continue from `state`."""
        self.figures = StepScalars(**{name: state[name].item() for name in vars(self.figures)})
        self.work.set_state(state)
        self.alternation.set_state(state)
