"""GMRES (generalised minimal residual method) for a few hundred unknowns, without restarts."""

import inspect
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import linalg

Array = NDArray[np.float64]
FEW, SHORT = 200, 40  # unknowns above which a short cycle is tried first, and its steps

# Called `tol` in the SciPy of Debian 12; that of Debian 13 has only `rtol`.
_RELATIVE = "rtol" if "rtol" in inspect.signature(linalg.gmres).parameters else "tol"


def gmres(apply: Callable[[Array], Array], right: Array, tolerance: float) -> Array:
    """x (n,) with |A x - b| <= tolerance |b|, `apply` v -> A v, by SciPy.

    One cycle of at most n steps yields the solution in exact arithmetic for any A, and the rest is
    rounding, so x is returned. With many unknowns a short cycle is tried first: SciPy initialises
    the memory of the longest possible one, which for 800 unknowns took as long as the steps
    themselves.
    """
    n = len(right)
    matrix = linalg.LinearOperator((n, n), matvec=apply, dtype=float)
    options = {_RELATIVE: tolerance, "atol": 0.0, "maxiter": 1}
    short = SHORT if n > FEW else n
    found, left = linalg.gmres(matrix, right, restart=short, **options)
    return found if short == n or not left else linalg.gmres(matrix, right, restart=n, **options)[0]
