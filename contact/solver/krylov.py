"""Generalised minimal residuals for a few hundred unknowns, without a restart."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def gmres(apply: Callable[[Array], Array], right: Array, tolerance: float) -> Array:
    """x (n,) with |A x - b| <= tolerance |b|, `apply` v -> A v.

    After n steps it is exact, whatever A: what is left then is rounding, and x is returned.
    Source: Saad and Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856.
    """
    n = len(right)
    size = float(np.linalg.norm(right))
    if size == 0.0:
        return np.zeros(n)
    basis = np.empty((min(n, 30) + 1, n))
    basis[0] = right / size
    columns, turns, left = [], [], [size]
    for k in range(n):
        new = apply(basis[k])
        column = basis[: k + 1] @ new
        new -= column @ basis[: k + 1]
        again = basis[: k + 1] @ new  # once is not enough where new is nearly a combination
        new -= again @ basis[: k + 1]
        length = float(np.linalg.norm(new))
        columns.append(_turned([*(column + again).tolist(), length], turns, left))
        if abs(left[-1]) <= tolerance * size or length <= 1e-15 * size or k == n - 1:
            break
        if k + 2 > len(basis):
            basis = np.concatenate([basis, np.empty_like(basis)])
        basis[k + 1] = new / length
    return _combined(columns, left, basis)


def _turned(column: list[float], turns: list, left: list[float]) -> list[float]:
    """The new Hessenberg column after all rotations, its own too; the right-hand side with it."""
    for i, (c, s) in enumerate(turns):
        column[i], column[i + 1] = (
            c * column[i] + s * column[i + 1],
            c * column[i + 1] - s * column[i],
        )
    k = len(turns)
    length = float(np.hypot(column[k], column[k + 1])) or 1.0
    c, s = column[k] / length, column[k + 1] / length
    turns.append((c, s))
    left.append(-s * left[k])
    left[k] *= c
    return [*column[:k], length]


def _combined(columns: list[list[float]], left: list[float], basis: Array) -> Array:
    """The combination of basis vectors that the triangular system asks for."""
    share = [0.0] * len(columns)
    for i in reversed(range(len(columns))):
        rest = left[i] - sum(columns[j][i] * share[j] for j in range(i + 1, len(columns)))
        share[i] = rest / columns[i][i]
    return np.array(share) @ basis[: len(columns)]
