"""Outputs of a response besides displacements: axle force and moment, hub force, vibration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from tireroad.fem.collective import summed
from tireroad.fem.matrices.operators import RimMotion
from tireroad.fem.wheel import Axle, Turning
from tireroad.greens.basis import Basis, Probes
from tireroad.greens.response import Response, couple
from tireroad.modal.corner import BODY, SEEN, Corner
from tireroad.modal.rotating import held_matrices
from tireroad.modal.solver.slicing import Modes

if TYPE_CHECKING:
    from tireroad.greens.coupling import Wheel

IMPEDANCE = 413.3  # N s/m3, rho c of air at 20 deg C and 1013 hPa


def axle_transfer(
    receptance: np.ndarray, frequency: np.ndarray, speed: float, damping: float
) -> np.ndarray:
    """Force, -, and moment, m, of the tire on the axle per unit load, (f, 6, k).

    `receptance` (f, 18, 6 + k) per force and moment on the rim and per load: translation (m) and
    rotation (rad) of the free rim, followed by R^T M u and R^T B u of the tire, at `frequency` (f,)
    Hz above 0; `speed` rad/s, `damping` gamma1 1/s.

    The tire transmits the forces on it less the rate of change of its momentum,

        f_axle = sum f_c - d/dt int rho Du/Dt = sum f_c + omega^2 int rho u,

    since the convective part of the momentum cancels around the ring. The doppler inertia has the
    body rate in place of D/Dt, and with it (d/dt - Omega e_y x)^2 in place of d^2/dt^2. The other
    way is the thesis's (7.1)-(7.4), corrected. With the six motions r of the rigid rim and the
    loads c, the rim stays at rest under the forces

        f_r = -H_rr^-1 H_rc f_c     on the tire,

    the opposite of which acts on the axle. Mass-proportional damping acts against the wheel and not
    against the ground, so the axle also carries gamma1 (s R^T M + Omega R^T B) u, with u the motion
    of the tire while the rim is held. R^T B = -(B R)^T; for the force it is gamma1 (s - Omega e_y
    x) int rho u.

    Both ways also yield the moments about the axle's centre, with the rotations R = e_k x of the
    rim, x the position in the loaded tire. By momentum they are

        m_axle = R^T f - [s^2 R^T M + 2 s Omega R^T G + R^T (K + Omega^2 S)] u,

    whose convective terms do not cancel (modal.corner.Corner.moments).
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


def substituted(
    basis: Basis, turning: Turning, loads: sparse.csr_matrix, frequency: np.ndarray
) -> np.ndarray:
    """Force on the hub (f, 3, k) per unit load at the probes (k, 3 s), `frequency` in Hz above 0.

    In directions in which the wheel moves it is that of springs and dampers, in locked ones that on
    the held rim.

        f = (Y_T + Y_S)^-1 Y_T f_blocked = Z_S (Z_T + Z_S)^-1 f_blocked,

    where f_blocked is the force of the tire on a held rim, and Y = 1/Z the mobility (here: the
    receptance) of the tire at its free rim (T) and of its support (S): wheel, springs and body. The
    coupled states yield the same force under the same loads without these matrices, so the
    comparison checks them entirely.
    """
    corner, held = basis.projection.wheel, basis.held
    drag, stiffness = held_matrices(
        held.projection, turning.speed, turning.damping, turning.inertia
    )
    m, n, axle = len(corner.mass), len(drag), corner.axle
    push, direct = held.seen(loads).T, corner.rigid(loads).T
    momentum = basis.projection.rim_momentum
    part = corner.taking_part
    out = np.empty((len(frequency), 3, loads.shape[0]), complex)
    for k, s in enumerate(2j * np.pi * frequency):
        meet = s**2 * momentum.T
        back = meet.T.copy()
        own = 2 * s * turning.speed * corner.gyroscopic
        turned = corner.stiffness + turning.speed**2 * corner.convective
        meet[:m, :BODY] += own + turned
        back[:BODY, :m] += (turned - own).T
        moved = np.linalg.solve(s**2 * np.eye(n) + s * drag + stiffness, np.hstack([push, meet]))
        blocked = direct - back @ moved[:, : push.shape[1]]
        z_tire = (
            _of_rim(corner, basis.projection.air_mass, s, turning.speed)
            - back @ moved[:, push.shape[1] :]
        )
        springs = axle.between_wheel_and_body(axle.stiffness + s * axle.damping)
        z_hub = springs + s**2 * _wheel(axle)
        z_hub[:BODY, :BODY] += s * turning.speed * axle.gyroscopic
        xi = np.zeros((SEEN, loads.shape[0]), complex)
        xi[part] = np.linalg.solve((z_tire + z_hub)[np.ix_(part, part)], blocked[part])
        on_hub = springs @ xi
        still = [d for d in range(3) if d not in axle.moving]
        on_hub[still] = (blocked - z_tire @ xi)[still]
        out[k] = on_hub[:3]
    return out


def _of_rim(corner: Corner, air_mass: float, s: complex, speed: float) -> np.ndarray:
    """Dynamic stiffness (7, 7) of the tire carried along as a rigid body."""
    out = np.zeros((SEEN, SEEN), complex)
    out[:BODY, :BODY] = s**2 * corner.own_mass + 2 * s * speed * corner.own_gyroscopic
    out[:BODY, :BODY] += corner.own_stiffness + speed**2 * corner.own_convective
    out[range(3), range(3)] += s**2 * air_mass
    return out


def _wheel(axle: Axle) -> np.ndarray:
    """Mass (7, 7) of wheel and body."""
    out = np.zeros((SEEN, SEEN))
    out[:BODY, :BODY] = axle.mass
    out[BODY, BODY] = axle.body_mass or 1.0
    return out


def by_states(basis: Basis, loads: sparse.csr_matrix, frequency: np.ndarray) -> np.ndarray:
    """The same (f, 3, k) from the coupled states: loads less the rate of their momentum."""
    response = basis.couple(loads, loads)
    count = loads.shape[0]
    moving = replace(
        response,
        output=response.momentum,
        block_output=response.block_momentum,
        residual=np.zeros((3, count)),
    )
    s = 2j * np.pi * frequency[:, None, None]
    return basis.projection.wheel.rigid(loads)[:, :3].T - s**2 * moving.receptance(frequency)


def disagreement(
    basis: Basis, turning: Turning, loads: sparse.csr_matrix, frequency: np.ndarray
) -> float | None:
    """Largest relative difference between the two over the frequencies, in the Frobenius norm.

    None if there is no force to compare: nothing holds a wheel that is free in x, y and z.
    """
    direct, other = (
        substituted(basis, turning, loads, frequency),
        by_states(basis, loads, frequency),
    )
    size = np.linalg.norm(direct, axis=(1, 2))
    some = size > 0
    if not some.any():
        return None
    return float((np.linalg.norm(direct - other, axis=(1, 2))[some] / size[some]).max())


@dataclass(frozen=True)
class Surface:
    """The outer face in the static state: `normal` (s, 3), m2, times the area of each node.

    The mean square of the velocity normal to the surface, over its area S, is w^2 a^H N a / (2 S)
    with N = sum_n (n A)_n Phi^T n_n n_n^T Phi: one small matrix for all frequencies. A plate that
    radiated all of it would have the equivalent radiated power rho c S <v^2>, an upper bound.
    """

    normal: np.ndarray

    @staticmethod
    def of(points: np.ndarray, quads: np.ndarray) -> Surface:
        """From nodes (s, 3) m and quadrilaterals (q, 4), whose area is divided among their nodes.

        The vector area of a quadrilateral is exactly half the cross product of its diagonals.
        """
        a, b, c, d = (points[quads[:, k]] for k in range(4))
        vector = np.cross(c - a, d - b) / 2
        normal = np.zeros_like(points)
        for k in range(4):
            np.add.at(normal, quads[:, k], vector / 4)
        return Surface(normal)

    @property
    def area(self) -> float:
        """S, m2."""
        return float(np.linalg.norm(self.normal, axis=1).sum())

    def gram(self, shape: np.ndarray) -> np.ndarray:
        """N (m, m) m2/kg of the shapes (3 s, m)."""
        size = np.linalg.norm(self.normal, axis=1)
        unit = self.normal / np.maximum(size, np.finfo(float).tiny)[:, None]
        seen = np.einsum("sk,skm->sm", unit, shape.reshape(len(size), 3, -1))
        return (seen * size[:, None]).T @ seen


def mean_square_velocity(
    a: np.ndarray, gram: np.ndarray, area: float, frequency: np.ndarray
) -> np.ndarray:
    """<v_n^2> (f,) m2/s2 of amplitudes a (f, m) at the frequencies (f,) Hz."""
    square = np.einsum("fm,mn,fn->f", a.conj(), gram, a, optimize=True).real
    return (2 * np.pi * frequency) ** 2 * square / (2 * area)


def radiated_power(velocity: np.ndarray, area: float) -> np.ndarray:
    """Equivalent radiated power, W, of mean-square velocities in m2/s2."""
    return IMPEDANCE * area * velocity
