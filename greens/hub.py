"""Moments on the hub among a response's outputs: the loads' own less what the motion of the tire takes up,

    m = R^T f - (A_2 u'' + A_1 u' + A_0 u),

A as in modal.corner.Corner.moments, u all that moves: states, and what follows a force statically. Of states z' = s z + P f
with coordinates q = C z (real part) the rates are  q' = C s z + C P f  and  q'' = C s^2 z + C s P f;  C P f', which a
complete set of states does not have, is left out, as for the momentum (Response.direct_momentum_rate).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from tireroad.greens.response import Response
from tireroad.modal.states import StateModes


def reading(
    response: Response, states: StateModes, wanted: sparse.csr_matrix, rows: np.ndarray
) -> Response:
    """The `response` whose outputs read, by the weights `wanted` (r, 3), less A_2 q'' + A_1 q' + A_0 q of its own
    `states`; `rows` (9, m): A_0, A_1 and A_2 on their m coordinates.
    """
    if not wanted.nnz:
        return response
    s, block = states.eigenvalue, states.block
    by_state, by_block = np.zeros((3, len(s)), complex), np.zeros((3, len(block)))
    for part in np.split(rows, 3)[::-1]:  # Horner's rule: a rate more has the jump of what it was
        direct = (by_state @ response.input).real + by_block @ response.block_input
        by_state = by_state * s - part @ states.right
        by_block = by_block @ block - part @ states.block_right
    return replace(
        response,
        output=response.output + wanted @ by_state,
        block_output=response.block_output + wanted @ by_block,
        residual=response.residual + wanted @ direct,
    )
