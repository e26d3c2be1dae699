"""States that follow statically, and what hub moments and the axle force lose by it.

A state z' = s z + P f, seen by C, answers a slow force by

    C P / (D - s) f = -C P / s f - C P / s^2 f' - ...,   D = d/dt.

The first term joins the residual. The second is small in a displacement, and would feed a rate of
the force back into a contact. But the rate of momentum and hub moments weight a state with s^2
(greens.hub), so that however fast it is it answers a rate of force with C P / s^2: by as much as
the states that stay now lack of completeness, Re(C P / s^2) = 0 over all of them. That part is the
response's `slope`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from tireroad.greens.residual.parted import parted

if TYPE_CHECKING:
    from tireroad.greens.response import Response


def poles_made_static(response: Response, keep: np.ndarray) -> Response:
    """The poles where `keep` (q,) is true stay dynamic; the others follow statically."""
    s = response.eigenvalue[~keep, None]
    following = response.input[~keep] / s
    gone, left_out = response.output[:, ~keep] @ following, response.left_out
    if left_out is not None:
        left_out = left_out - (response.momentum[:, ~keep] @ following).real
    slope = _rates(response, response.output, response.inertia[0])[:, ~keep] @ (following / s)
    return replace(
        response,
        left_out=left_out,
        eigenvalue=response.eigenvalue[keep],
        output=response.output[:, keep],
        input=response.input[keep],
        momentum=response.momentum[:, keep],
        residual=response.residual - gone.real,
        slope=added(response.slope, -slope.real),
    )


def block_made_static(response: Response, values: np.ndarray, stays: np.ndarray) -> Response:
    """The same for the block, by its eigenvalues, `values` (b - rigid,) 1/s."""
    held, output, push = response.held_block()
    k = len(held)
    momentum, rates = response.block_momentum[:, :k], response.inertia[1][:, :k]
    kept = parted(held, values, stays)
    following = kept.following(push)
    left_out = response.left_out
    if left_out is not None:
        left_out = left_out - momentum @ following
    slope = _rates(response, output, rates) @ kept.following(following)
    return replace(
        response,
        block=linalg.block_diag(kept.block, response.block[k:, k:]),
        block_output=np.hstack([output @ kept.right, response.block_output[:, k:]]),
        block_input=np.vstack([kept.left @ push, response.block_input[k:]]),
        block_momentum=np.hstack([momentum @ kept.right, response.block_momentum[:, k:]]),
        residual=response.residual - output @ following,
        left_out=left_out,
        slope=added(response.slope, -slope),
    )


def _rates(response: Response, output: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Rows (r + 3, n) of what is weighted with s^2: hub moments, zeros for other outputs, and the
    rate of momentum."""
    moments = response.moments
    own = np.zeros_like(output) if moments is None else output * moments[:, None]
    return np.vstack([own, inertia])


def added(one: np.ndarray | None, other: np.ndarray | None) -> np.ndarray | None:
    """The sum of two slopes, where None is none."""
    return other if one is None else one if other is None else one + other
