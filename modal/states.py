"""The decoupled equations of motion, and when a motion grows by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

GROWS = 1e-9  # of the largest |s|: a growth rate below is rounding, an undamped state's is 0 with either sign
ROUNDING = (
    1e3 * np.finfo(float).eps
)  # of the largest |s|^2: what rounding of the pencil may add to an s^2


def growing(eigenvalue: np.ndarray) -> np.ndarray:
    """Which of the eigenvalues (q,) 1/s of one problem belong to a growing motion: Re s beyond rounding.

    Rounding changes s^2 by a part of the largest one, hence s by that over 2 |s|: much where s is next to 0. A
    rigid motion, s^2 = 0, comes out with s^2 of 1e-10 1/s^2 and either sign, and drifts but does not grow.
    """
    size = np.abs(eigenvalue)
    largest = size.max(initial=1.0)
    rate = eigenvalue.real
    return (rate > GROWS * largest) & (rate * size > ROUNDING * largest**2)


@dataclass(frozen=True, kw_only=True)
class StateModes:
    """The decoupled equations of motion for m modal coordinates.

    `eigenvalue` (q,) 1/s, Im >= 0; `right` (m, q) with the weight 2 of a pair already in it; `left`
    (q, m), transposed and not conjugated, divided by a_q; `block` (k, k), `block_right` (m, k),
    `block_left` (k, m). `residual`, `left_residual` (q,) relative to the terms of the quadratic
    problem; `condition` the worst eigenvector condition among those kept as vectors. The last `rigid`
    states of the block belong to rigid modes: they drift, and have no static answer.
    """

    eigenvalue: np.ndarray
    right: np.ndarray
    left: np.ndarray
    block: np.ndarray
    block_right: np.ndarray
    block_left: np.ndarray
    residual: np.ndarray
    left_residual: np.ndarray
    condition: float
    rigid: int = 0

    @property
    def every(self) -> np.ndarray:
        """All eigenvalues (q + k,) 1/s, the block's last; complex ones of the block with their conjugates."""
        return np.concatenate([self.eigenvalue, np.linalg.eigvals(self.block)])

    @property
    def unstable(self) -> int:
        """Eigenvalues with a growing motion, beyond rounding."""
        return int(growing(self.every).sum())

    @property
    def fastest_growth(self) -> float:
        """Largest Re s, 1/s."""
        return float(self.every.real.max(initial=-np.inf))
