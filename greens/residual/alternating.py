"""The response to forces that alternate in sign from step to step, as in a chattering contact.

With f_n = (-1)^n F, linear in between, every state settles at z_n = (-1)^n Z,

    -Z = e^{sh} Z + b0 P F - b1 P F   =>   Z = (b1 - b0) P F / (1 + e^{sh})

(greens.recursion). The mass of a mode alone gives -h^2 / (12 m): the tire moves towards a force
that pushes it, as if it were a negative spring. Forces constant over the step give zero.
"""

from __future__ import annotations

import numpy as np

from tireroad.greens.one_step import block_steps, weights
from tireroad.greens.response import Response


def alternating(response: Response, step: float) -> np.ndarray:
    """Displacement (r, k) m/N under unit forces of alternating sign, without the residual.

    `response` as the loop uses it (Response.resolved), `step` s; forces linear over the step.
    """
    x = response.eigenvalue * step
    old, new = weights(x, step, "linear")
    out = ((response.output * ((new - old) / (1 + np.exp(x)))) @ response.input).real
    if len(response.block):
        decay, old, new = block_steps(response.block, response.block_input, step, "linear")
        out += response.block_output @ np.linalg.solve(np.eye(len(decay)) + decay, new - old)
    return out


def at_once(response: Response) -> np.ndarray:
    """The residual's contribution (r, k) m/N; that of a pulse, half of it a step late, cancels."""
    return np.zeros_like(response.residual) if response.pulse else response.residual
