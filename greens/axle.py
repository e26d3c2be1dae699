"""Force and moment on a held axle per force on the tread: by momentum, and by free-rim modes.

The tire transmits the forces on it less the rate of change of its momentum,

    f_axle = sum f_c - d/dt int rho Du/Dt = sum f_c + omega^2 int rho u,

since the convective part of the momentum cancels around the ring. The doppler inertia has the body
rate in place of D/Dt, and with it (d/dt - Omega e_y x)^2 in place of d^2/dt^2. The other way is the thesis's
(7.1)-(7.4), corrected. With the six motions r of the rigid rim and the loads c, the rim stays at
rest under the forces

    f_r = -H_rr^-1 H_rc f_c     on the tire,

the opposite of which acts on the axle. Mass-proportional damping acts against the wheel and not
against the ground, so the axle also carries  gamma1 (s R^T M + Omega R^T B) u, with u the motion of
the tire while the rim is held. R^T B = -(B R)^T; for the force it is  gamma1 (s - Omega e_y x) int
rho u.

Both ways also yield the moments about the axle's centre, with the rotations R = e_k x of the
rim, x the position in the loaded tire. By momentum they are

    m_axle = R^T f - [s^2 R^T M + 2 s Omega R^T G + R^T (K + Omega^2 S)] u,

whose convective terms do not cancel (modal.corner.Corner.moments).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from tireroad.fem.collective import summed
from tireroad.fem.matrices.rim_motion import RimMotion
from tireroad.greens.basis import Probes
from tireroad.greens.response import Response, couple
from tireroad.modal.solver.modes import Modes

if TYPE_CHECKING:
    from tireroad.greens.coupling import Wheel


def axle_transfer(
    receptance: np.ndarray, frequency: np.ndarray, speed: float, damping: float
) -> np.ndarray:
    """Force, -, and moment, m, of the tire on the axle per unit load, (f, 6, k).

    `receptance` (f, 18, 6 + k) per force and moment on the rim and per load: translation (m) and
    rotation (rad) of the free rim, followed by R^T M u and R^T B u of the tire, at `frequency` (f,)
    Hz above 0; `speed` rad/s, `damping` gamma1 1/s.
    """
    rim, rest = receptance[:, :6], receptance[:, 6:]
    held = -np.linalg.solve(rim[:, :, :6], rim[:, :, 6:])
    mass, rate = np.split(rest[:, :, 6:] + rest[:, :, :6] @ held, 2, axis=1)
    s = 2j * np.pi * frequency[:, None, None]
    return -held + damping * (s * mass + speed * rate)


def by_free_rim(
    wheel: Wheel, modes: Modes, loads: Probes, frequency: np.ndarray, motion: RimMotion
) -> np.ndarray:
    """Force, -, and moment, m, on the held axle per unit load (f, 6, k), `frequency` in Hz above 0.

    Computed from the `modes` of the `wheel` with a free rim, joined by attachment modes of the rim
    and of the `loads` (k, 3 s). `motion`: that of the rim at the same state. Collective.
    """
    width = loads.shape[1]
    rim = sparse.hstack([sparse.csr_matrix((6, width)), sparse.identity(6)])
    apart = sparse.hstack([loads, sparse.csr_matrix((loads.shape[0], 6))])
    probes = sparse.vstack([rim, apart], format="csr")
    grown, fields = wheel.standing_attachments(modes, probes)
    seen, carried = grown.seen(probes), grown.projection.carried
    rate = -motion.rows["body"] if wheel.speed else np.zeros_like(motion.rows["mass"])
    beside = np.hstack([motion.rows["mass"], rate])
    own = summed(wheel.operators.body.comm, beside.T @ fields[: len(beside)])
    # Only the tire has mass-proportional damping, not the air.
    own = np.pad(own, ((0, 0), (0, carried.shape[1] - own.shape[1])))
    response = couple(grown.states, np.vstack([seen[:6], own]), seen, carried)
    turning = wheel.speed, wheel.against_wheel
    return axle_transfer(response.receptance(frequency), frequency, *turning)


def from_moment(total: np.ndarray, moment: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Force on the axle per unit load (f, 3, k), -, at `frequency` (f,) Hz.

    `total` (3, k) is the sum of each load, `moment` (f, 3, k) kg m/N the first moment int rho u of
    the tire per unit load, or (f, 9, k) all that the axle feels of it (greens.basis.Basis.felt).
    """
    inertia, *rest = np.split(moment, moment.shape[1] // 3, axis=1)
    force = total + (2 * np.pi * frequency[:, None, None]) ** 2 * inertia
    if rest:
        force = force - 2j * np.pi * frequency[:, None, None] * rest[0] - rest[1]
    return force


def by_momentum(response: Response, total: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """The same for a held rim, from the states of a response.

    What no state contains follows statically, where its moment is known (Response.left_out).
    """
    nothing = np.zeros((len(response.momentum), response.residual.shape[1]))
    moment = replace(
        response,
        output=response.momentum,
        block_output=response.block_momentum,
        residual=nothing if response.left_out is None else response.left_out,
        slope=None,
    )
    return from_moment(total, moment.receptance(frequency), frequency)


def remaining(response: Response, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Rate of momentum (nt, 3) N of what no state contains, where its moment is known.

    It follows the forces statically, d/dt int rho u = left_out f'' (+ rows of f', greens.basis.Basis.felt;
    those of f are in Response.direct_momentum_rate). `first`, `second` (nt, k): the derivatives of the
    forces, N/s and N/s^2.
    """
    if response.left_out is None:
        return np.zeros((len(first), 3))
    inertia, *rest = np.split(response.left_out, len(response.left_out) // 3)
    rate = second @ inertia.T
    return rate + first @ rest[0].T if rest else rate
