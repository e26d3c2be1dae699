"""The force on a compliant hub from the force on a rigid one: substructuring by the blocked force.

    f = (Y_T + Y_S)^-1 Y_T f_blocked = Z_S (Z_T + Z_S)^-1 f_blocked,

where f_blocked is the force of the tire on a held rim, and Y = 1/Z the mobility (here: the
receptance) of the tire at its free rim (T) and of its support (S): wheel, springs and body. The
coupled states yield the same force under the same loads without these matrices, so the comparison
checks them entirely.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from tireroad.fem.axle import Axle
from tireroad.fem.turning import Turning
from tireroad.greens.basis import Basis
from tireroad.modal.corner import BODY, SEEN, Corner
from tireroad.modal.rotating import held_matrices


def substituted(
    basis: Basis, turning: Turning, loads: sparse.csr_matrix, frequency: np.ndarray
) -> np.ndarray:
    """Force on the hub (f, 3, k) per unit load at the probes (k, 3 s), `frequency` in Hz above 0.

    In directions in which the wheel moves it is that of springs and dampers, in locked ones that on
    the held rim.
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
        springs = axle.joined(axle.stiffness + s * axle.damping)
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
    one, other = substituted(basis, turning, loads, frequency), by_states(basis, loads, frequency)
    size = np.linalg.norm(one, axis=(1, 2))
    some = size > 0
    if not some.any():
        return None
    return float((np.linalg.norm(one - other, axis=(1, 2))[some] / size[some]).max())
