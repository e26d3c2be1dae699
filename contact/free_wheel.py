"""A wheel that turns freely: the rate of its rotation follows the moment about the axle.

In the frame that does not rotate, a rate Omega + w moves the material of tire and rim faster through the same shape. With R_y a rigid
turn, it loads the coordinates q of the tire by its inertia and by the change of centrifugal forces, and is a slip (contact.tread.brush):

    J w' = M_y - M_0,   f_w = -Phi^T M R_y w' - 2 Omega Phi^T G R_y w,   s_x = s_0 + w / Omega,

J the moment of inertia of rim and brake about the axle, M_y the moment of the tire on them (modal.corner), which bears -J_t w' of the
tire's own inertia; M_0 what the drive bears as the loop begins: nothing of a wheel that rolls freely and steadily. The first two hold at the
end of each step, where w = w_0 + h (w_0' + w') / 2, so that w' is eliminated from it; the slip follows with the next step, which is stable while
C R^2 h < 2 v J (C the slip stiffness in N: 0.01 of that on a passenger tire in steps of 50 us).

Left out: that material flows through a flattened footprint, not around a circle, in both loads; and of q, terms of order w / Omega (1e-3).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from tireroad.contact.loop import PushedTire, SteadyTire, looking_ahead
from tireroad.contact.results.energy import own_states
from tireroad.fem.errors import InputError
from tireroad.greens.basis import Basis
from tireroad.greens.response import Response, couple, reading
from tireroad.greens.schemes import SCHEMES
from tireroad.modal.corner import HUB_MOMENTS, MOMENTS
from tireroad.modal.rolling import RollingModes

_Y = 1  # of the three moments


def with_spin(response: Response, rolling: RollingModes) -> Response:
    """The response (r + 2, k + 2) with w' in 1/s2 and w in 1/s as its last inputs, and what does work with them, q . f_w / w' and
    q . f_w / w in kg m2 and kg m2/s, as its last outputs.

    `response` of the states of `rolling`, its last outputs the hub moments. What no state contains is not moved by these
    loads. InputError where some states are not the modes' own, or the hub moments are not read. Not collective.
    """
    corner, states = rolling.basis.projection.corner, rolling.states
    if corner is None or response.moments is None or not own_states(response, rolling):
        raise InputError(
            'rotation.wheel = "free" needs the hub moments, and all states of the modes in the loop: output.axle_force, no '
            'greens.dynamic, and rotation.method = "projected"'
        )
    basis, turning = Basis.of(rolling), rolling.turning
    moments = basis.projection.moments(turning.speed, turning.inertia)
    push = np.stack([-moments[2, _Y], moments[1, _Y]])
    # The hub moments, and what does work with the loads, as they read these alone.
    outputs = np.vstack([np.zeros((HUB_MOMENTS, push.shape[1])), push])
    hub = sparse.eye(len(outputs), HUB_MOMENTS, format="csr")
    wheel = couple(states, outputs, push, basis.carried)
    wheel = reading(wheel, states, hub, moments.reshape(3 * HUB_MOMENTS, -1))
    wheel.residual[:HUB_MOMENTS, 0] -= corner.own_mass[MOMENTS, MOMENTS][:, _Y]
    r, k = response.residual.shape
    residual = np.zeros((r + 2, k + 2))
    residual[:r, :k], residual[r - HUB_MOMENTS :, k:] = response.residual, wheel.residual
    none, own = np.zeros((response.relaxing, 2)), slice(HUB_MOMENTS, None)
    slope = response.slope
    return replace(
        response,
        output=np.vstack([response.output, np.hstack([wheel.output[own], none.T])]),
        input=np.hstack([response.input, np.vstack([wheel.input, none])]),
        block_output=np.vstack([response.block_output, wheel.block_output[own]]),
        block_input=np.hstack([response.block_input, wheel.block_input]),
        residual=residual,
        moments=np.append(response.moments, [False, False]),
        left_out=_beside(response.left_out),
        slope=None if slope is None else _beside(np.insert(slope, [r, r], 0.0, axis=0)),
        offset=None if response.offset is None else np.append(response.offset, [0.0, 0.0]),
    )


def _beside(known: np.ndarray | None) -> np.ndarray | None:
    """Rows (n, k) of the loads with zeros for those of the wheel beside them."""
    return None if known is None else np.hstack([known, np.zeros((len(known), 2))])


class FreeWheel:
    """A tire on a wheel that turns freely, as the contact sees it: w is found with the forces of each step, not given.

    `tire`: of a response `with_spin`; `inertia` J kg m2; `rotation` Omega rad/s; steps of `step` s by the `scheme`. Its last displacement is
    the rate w in rad/s. After each `advance`: `rate` w, `work` (J) of f_w on the tire so far (trapezoidal rule) and `lead`,
    the additional work of the mean that the `scheme` applies during the steps (greens.schemes.Scheme.ahead_of_mean).
    """

    def __init__(
        self, tire: PushedTire, inertia: float, rotation: float, step: float, scheme: str
    ) -> None:
        self._tire, self.comm, self._rotation = tire, tire.comm, rotation
        whole, self._half = tire.same_step, 0.5 * step
        self._at = len(whole) - 2 - HUB_MOMENTS + _Y
        # Under w' of this step, and under w of the last one and what w' of that adds.
        self._by_rate = whole[:, -1].copy()
        self._own = whole[:, -2] + self._half * self._by_rate
        self._answer = whole[-2:, :-2].copy()
        self._share = 1.0 / (inertia - float(self._own[self._at]))
        self._turns = self._share * whole[self._at, :-2]
        self.same_step = self._wheel_last(
            whole[:, :-2] + np.outer(self._own, self._turns), self._half * self._turns
        )
        self.ahead, self.turning = looking_ahead(tire), self
        self._scheme = SCHEMES[scheme]
        self.work = self.lead = self._held = 0.0
        self._along, self._loads = np.zeros(2), np.zeros((2, 2))  # w', w after the last two steps

    @staticmethod
    def _wheel_last(seen: np.ndarray, rate: np.ndarray | float) -> np.ndarray:
        """Outputs with the rate in place of what does work with the wheel's loads."""
        seen[-2] = rate
        return seen[:-1]

    @property
    def rate(self) -> float:
        """w, 1/s, at the end of the last step."""
        return float(self._loads[-1, 1])

    @property
    def slip(self) -> float:
        """The slip along the road by the rate."""
        return self.rate / self._rotation

    def start(self, force: np.ndarray) -> None:
        """Begin with a force (k,) N at t = 0, at rest."""
        self._tire.start(np.append(force, [0.0, 0.0]))

    def start_steady(self, force: np.ndarray, sudden: np.ndarray | None = None) -> np.ndarray:
        """Begin at rest under a force (k,) N that always was, and a `sudden` one; the displacement (r,) m. Collective."""
        assert isinstance(self._tire, SteadyTire), "a convolution begins at rest only"
        at_once = None if sudden is None else np.append(sudden, [0.0, 0.0])
        moved = self._tire.start_steady(np.append(force, [0.0, 0.0]), at_once)
        self._held, self._along = float(moved[self._at]), moved[-2:].copy()
        return self._wheel_last(moved, 0.0)

    def predict(self) -> np.ndarray:
        """Displacement (r,) m at the end of the step without new forces, of a wheel that follows. Collective."""
        self._known = self.rate + self._half * self._loads[-1, 0]
        self._free = self._tire.predict() + self._by_rate * self._known
        self._follows = self._share * (float(self._free[self._at]) - self._held)
        moved = self._free + self._own * self._follows
        return self._wheel_last(moved, self._known + self._half * self._follows)

    def advance(self, force: np.ndarray) -> None:
        """Set the forces (k,) N at the end of the step."""
        now = self._follows + float(self._turns @ force)
        path = np.vstack([self._loads, [now, self._known + self._half * now]])
        self._tire.advance(np.concatenate([force, path[-1]]))
        along = self._free[-2:] + self._answer @ force + self._own[-2:] * now
        way, mean = along - self._along, 0.5 * (path[1] + path[2])
        self.work += float(mean @ way)
        self.lead += float(self._scheme.ahead_of_mean(path)[0] @ way)
        self._loads, self._along = path[1:], along

    def inertia_force(self) -> np.ndarray:
        """Rate of momentum (3,) N."""
        return self._tire.inertia_force()

    def snapshot(self) -> dict[str, np.ndarray]:
        """The tire's snapshot, whose forces are those of the contact, and the wheel. Collective if the tire's is."""
        kept = self._tire.snapshot()
        own = [self.work, self.lead, self._held, *self._along, *self._loads.ravel()]
        return kept | {"push_force": kept["push_force"][:-2], "spin": np.array(own)}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from a snapshot."""
        spin = state["spin"]
        self.work, self.lead, self._held = spin[:3].tolist()
        self._along, self._loads = spin[3:5].copy(), spin[5:].reshape(2, 2).copy()
        acting = np.concatenate([state["push_force"], self._loads[-1]])
        self._tire.restore(state | {"push_force": acting})
