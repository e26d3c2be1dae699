"""Force on a held axle per force on the tread: from the momentum, and from the modes of a free rim.

The tire passes on what acts on it less what its momentum takes up,

    f_axle = sum f_c - d/dt int rho Du/Dt = sum f_c + omega^2 int rho u,

for the convective part of the momentum cancels around the ring. The other way is the thesis's (7.1)-(7.4), put right.
With the rigid rim's six motions r and the loads c, a rim that is held stands still under the forces

    f_r = -H_rr^-1 H_rc f_c     on the tire,

the opposite of which acts on the axle. Damping by the mass acts against the wheel and not against the
ground, so the axle carries  gamma1 int rho (s + Omega B) u = gamma1 (s - Omega e_y x) p  besides, with
p = int rho u the tire's first moment while the rim is held.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tireroad.greens.response import Response

_TURN = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])  # e_y x


def axle_transfer(
    receptance: np.ndarray, frequency: np.ndarray, speed: float, damping: float
) -> np.ndarray:
    """Force of the tire on the axle per unit load, (f, 3, k), -.

    `receptance` (f, 9, 6 + k): translation (m) and rotation (rad) of the free rim and first moment
    (kg m), per force and moment on the rim and per load, at `frequency` (f,) Hz above 0; `speed` rad/s,
    `damping` gamma1 1/s. Equal to sum of loads - d/dt momentum of the tire with a held rim.
    """
    rim, moment = receptance[:, :6], receptance[:, 6:]
    held = -np.linalg.solve(rim[:, :, :6], rim[:, :, 6:])
    first = moment[:, :, 6:] + moment[:, :, :6] @ held
    s = 2j * np.pi * frequency[:, None, None]
    return -held[:, :3] + damping * (s * first - speed * (_TURN @ first))


def from_moment(total: np.ndarray, moment: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Force on the axle per unit load (f, 3, k), -, from the `total` (3, k) of each load and the tire's first
    moment int rho u per unit load (f, 3, k) kg m/N, at `frequency` (f,) Hz.
    """
    return total + (2 * np.pi * frequency[:, None, None]) ** 2 * moment


def by_momentum(response: Response, total: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """The same of a held rim by the states of a response; what no state has follows statically, where its moment
    is known (Response.left_out).
    """
    nothing = np.zeros((3, response.residual.shape[1]))
    moment = replace(
        response,
        output=response.momentum,
        block_output=response.block_momentum,
        residual=nothing if response.left_out is None else response.left_out,
    )
    return from_moment(total, moment.receptance(frequency), frequency)
