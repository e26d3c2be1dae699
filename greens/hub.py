"""Hub moments as outputs of a response: those of the loads less those of the tire's motion,

    m = R^T f - (A_2 u'' + A_1 u' + A_0 u),

with A as in modal.corner.Corner.moments, and u the motion of the states and of what follows a force
statically. States z' = s z + P f with coordinates q = C z (real part) have the rates
q' = C s z + C P f  and  q'' = C s^2 z + C s P f + C P f'.  C P vanishes for a complete set of states; what it
is where some are made static is the response's slope (residual.made_static).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from tireroad.modal.states import StateModes

if TYPE_CHECKING:
    from tireroad.greens.response import Response


def rates(response: Response) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rows of its momentum per state (3, q) and per state of the block (3, b), two pairs.

    First A_2 s + A_1, by which a force changes the axle force at once, then A_2 s^2 + A_1 s + A_0.
    """
    s, block = response.eigenvalue, response.block
    poles = _horner(response.momentum, lambda rows: rows * s)
    return list(
        zip(poles, _horner(response.block_momentum, lambda rows: rows @ block), strict=True)
    )


def _horner(rows: np.ndarray, rate: Callable[[np.ndarray], np.ndarray]) -> list[np.ndarray]:
    """Both of `rates`; `rows` (3, n) are A_2 alone, (9, n) are A_2, A_1 and A_0 (Basis.felt)."""
    inertia, *rest = np.split(rows, len(rows) // 3)
    first, still = rest or (0.0, 0.0)
    direct = rate(inertia) + first
    return [direct, rate(direct) + still]


def at_once(response: Response) -> np.ndarray:
    """Rate of momentum (3, k) due to each force at the same instant, A_0 u of what follows it too."""
    poles, block = rates(response)[0]
    direct = (poles @ response.input).real + block @ response.block_input
    follows = response.left_out
    return direct if follows is None or len(follows) == 3 else direct + follows[6:]


def reading(
    response: Response, states: StateModes, wanted: sparse.csr_matrix, rows: np.ndarray
) -> Response:
    """The `response` with -(A_2 q'' + A_1 q' + A_0 q) of its own `states` added to its outputs.

    `wanted` (r, 3): the weights of the moments in the outputs; `rows` (9, m): A_0, A_1 and A_2 on
    the m coordinates.
    """
    if not wanted.nnz:
        return response
    s, block = states.eigenvalue, states.block
    by_state, by_block = np.zeros((3, len(s)), complex), np.zeros((3, len(block)))
    # Horner's rule: each further rate has the jump of the one before.
    for part in np.split(rows, 3)[::-1]:
        direct = (by_state @ response.input).real + by_block @ response.block_input
        by_state = by_state * s - part @ states.right
        by_block = by_block @ block - part @ states.block_right
    return replace(
        response,
        output=response.output + wanted @ by_state,
        block_output=response.block_output + wanted @ by_block,
        residual=response.residual + wanted @ direct,
        moments=np.diff(wanted.tocsr().indptr) > 0,
    )
