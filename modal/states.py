"""The decoupled equations of motion, and which of their eigenvalues grow."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

# Of the largest |s|. A smaller growth rate is rounding: an undamped state has 0 with either sign.
GROWS = 1e-9
# Of the largest |s|^2: what rounding of the pencil may add to an s^2.
ROUNDING = 1e3 * np.finfo(float).eps


def growing(eigenvalue: np.ndarray) -> np.ndarray:
    """Mask (q,) of the eigenvalues (q,) 1/s of one problem that grow: Re s > 0 beyond rounding.

    Rounding perturbs s^2 by a fraction of the largest s^2, hence s by that over 2 |s|, which is
    large where s is near zero. A rigid motion, s^2 = 0, is computed with an s^2 of about
    1e-10 1/s^2 of either sign; it drifts but does not grow.
    """
    size = np.abs(eigenvalue)
    largest = size.max(initial=1.0)
    rate = eigenvalue.real
    return (rate > GROWS * largest) & (rate * size > ROUNDING * largest**2)


@dataclass(frozen=True, kw_only=True)
class StateModes:
    """The decoupled equations of motion of m modal coordinates.

    `eigenvalue` (q,) 1/s, Im >= 0; `right` (m, q), with the factor 2 of a conjugate pair included;
    `left` (q, m), transposed, not conjugated, and divided by a_q. Nearly defective states are kept
    as a real block: `block` (k, k), `block_right` (m, k), `block_left` (k, m). `residual`,
    `left_residual` (q,) are relative to the terms of the quadratic problem; `condition` is the
    worst condition of the eigenvectors that are kept. The last `rigid` states of the block belong
    to rigid modes: they drift and have no static response.
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

    def among(self, poles: np.ndarray) -> StateModes:
        """Only the `poles` (q,) bool, and the block."""
        return replace(
            self,
            eigenvalue=self.eigenvalue[poles],
            right=np.ascontiguousarray(self.right[:, poles]),
            left=self.left[poles],
            residual=self.residual[poles],
            left_residual=self.left_residual[poles],
        )

    @property
    def damping(self) -> np.ndarray:
        """Damping ratios -Re s / |s| (q,): 1 for what does not oscillate, negative for what grows."""
        return -self.eigenvalue.real / np.maximum(np.abs(self.eigenvalue), np.finfo(float).tiny)

    @property
    def every(self) -> np.ndarray:
        """All eigenvalues (q + k,) 1/s, those of the block last and with their conjugates."""
        return np.concatenate([self.eigenvalue, np.linalg.eigvals(self.block)])

    @property
    def unstable(self) -> int:
        """Number of eigenvalues that grow beyond rounding."""
        return int(growing(self.every).sum())

    @property
    def fastest_growth(self) -> float:
        """Largest Re s, 1/s."""
        return float(self.every.real.max(initial=-np.inf))
