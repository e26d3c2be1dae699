"""When a motion grows by itself: one criterion for all that ask."""

from __future__ import annotations

import numpy as np

GROWS = 1e-9  # of the largest |s|: a growth rate below is rounding, an undamped state's is 0 with either sign


def growing(eigenvalue: np.ndarray) -> np.ndarray:
    """Which of the eigenvalues (q,) 1/s of one problem belong to a growing motion: Re s beyond rounding."""
    return eigenvalue.real > GROWS * np.abs(eigenvalue).max(initial=1.0)
