"""The answer to forces that change their sign in every step: what a chattering contact feels.

With f_n = (-1)^n F, linear in between, every state settles at z_n = (-1)^n Z,

    -Z = e^{sh} Z + b0 P F - b1 P F   =>   Z = (b1 - b0) P F / (1 + e^{sh})

(greens.recursion). A mode's mass alone gives -h^2 / (12 m): the tire comes towards a force that pushes it,
as if it were a negative spring. Forces constant over the step give zero there.
"""

from __future__ import annotations

import numpy as np

from tireroad.greens.one_step import block_steps, weights
from tireroad.greens.response import Response


def alternating(response: Response, step: float) -> np.ndarray:
    """Displacement (r, k) m/N at the outputs under unit forces of alternating sign; no residual in it.

    `response` as the loop takes it (Response.resolved), `step` s; forces linear over the step.
    """
    x = response.eigenvalue * step
    old, new = weights(x, step, "linear")
    out = ((response.output * ((new - old) / (1 + np.exp(x)))) @ response.input).real
    if len(response.block):
        decay, old, new = block_steps(response.block, response.block_input, step, "linear")
        out += response.block_output @ np.linalg.solve(np.eye(len(decay)) + decay, new - old)
    return out


def at_once(response: Response) -> np.ndarray:
    """What the residual adds to it (r, k) m/N: a pulse, half of the step before, cancels."""
    return np.zeros_like(response.residual) if response.pulse else response.residual
