"""Generalised minimal residuals for a few hundred unknowns, without a restart."""

import inspect
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import linalg

Array = NDArray[np.float64]
FEW, SHORT = 200, 40  # unknowns from which on a short cycle is tried first, and its steps

# Debian 12's SciPy calls it `tol`, Debian 13's knows only `rtol`.
_RELATIVE = "rtol" if "rtol" in inspect.signature(linalg.gmres).parameters else "tol"


def gmres(apply: Callable[[Array], Array], right: Array, tolerance: float) -> Array:
    """x (n,) with |A x - b| <= tolerance |b|, `apply` v -> A v, by SciPy.

    One cycle of at most n steps: in exact arithmetic that is the solution whatever A, and what is
    left then is rounding, so that x is returned. Of many unknowns a short one is tried first: SciPy clears the memory of the longest
    it might take, which for 800 unknowns took as long as the steps themselves.
    """
    n = len(right)
    matrix = linalg.LinearOperator((n, n), matvec=apply, dtype=float)
    options = {_RELATIVE: tolerance, "atol": 0.0, "maxiter": 1}
    short = SHORT if n > FEW else n
    found, left = linalg.gmres(matrix, right, restart=short, **options)
    return found if short == n or not left else linalg.gmres(matrix, right, restart=n, **options)[0]
