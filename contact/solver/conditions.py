"""The interface of the contact solvers, their checks of compliance and solution, and what speeds up their fixed points."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import ConvergenceError, InputError, UnsuitedSettings

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

# Largest complementarity residual of a solution, as a share of the scale.
TOLERANCE = 1e-9
MIXED = 5  # places that Anderson's acceleration combines


class ContactSolver(Protocol):
    """The interface that the time loop needs; `active`, `gap` (m), ... are of the last solve.

    `diagonal` (n,) m/N is the compliance of each point under its own force. `gap` is 0 at touching points; `penetration` (m) is that of the deepest point in the solution
    itself.
    """

    diagonal: Array
    active: Mask
    gap: Array
    penetration: float
    residual: float
    iterations: int

    @property
    def factorisations(self) -> int: ...

    def solve(
        self, q: Array, guess_active: Mask | None = None, reference: Array | None = None
    ) -> Array: ...

    def block(self, index: Index) -> Array: ...

    def state(self) -> dict[str, NDArray[Any]]: ...

    def set_state(self, state: dict[str, NDArray[Any]]) -> None: ...


def penetration(gap: Array) -> float:
    """Depth (m) of the deepest of the gaps (n,) m below 0."""
    return max(-float(gap.min(initial=0.0)), 0.0)


def checked_compliance(matrix: Array) -> Array:
    """The matrix (n, n) m/N as a C-ordered copy; InputError if the solution would not be unique."""
    matrix = np.array(matrix, dtype=float, order="C")
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.shape[0] == 0:
        raise InputError(f"contact: the compliance must be a square matrix, not {matrix.shape}")
    if not np.all(np.isfinite(matrix)):
        raise InputError("contact: the compliance has entries that are not finite (m/N)")
    symmetric = 0.5 * (matrix + matrix.T)
    try:
        np.linalg.cholesky(symmetric)
    except np.linalg.LinAlgError:
        eigenvalues = np.linalg.eigvalsh(symmetric)
        raise UnsuitedSettings(
            "contact: the compliance is not positive definite (eigenvalues of its symmetric part "
            f"from {eigenvalues[0]:.3g} to {eigenvalues[-1]:.3g} m/N), so the contact forces are "
            "not unique; add tread compliance ([contact] tread) or a residual flexibility "
            '([greens] residual = "static")'
        ) from None
    return matrix


def complementarity_residual(force: Array, gap: Array, diagonal: Array, scale: float) -> float:
    """max |min(diag(A) f, g)| over `scale` (m); 0 at the solution, also if the scale is 0."""
    worst = float(np.abs(np.minimum(force * diagonal, gap)).max())
    return worst / scale if scale > 0.0 else worst


def check_residual(name: str, residual: float) -> None:
    """ConvergenceError if the relative residual is above the tolerance or not a number."""
    if np.isnan(residual):
        raise ConvergenceError(
            f"contact ({name}): the gaps are not finite: the motion has grown without bound; take "
            'a smaller [time] step or scheme = "constant"'
        )
    if residual > TOLERANCE:
        raise ConvergenceError(
            f"contact ({name}): complementarity residual {residual:.2g} of the largest gap, above "
            f"{TOLERANCE:g}; add tread compliance or a residual flexibility, or take another solver"
        )


class Mixed:
    """Anderson's acceleration of places p that are sought where their rest d(p) = 0: the last few are combined so that
    their rests, weighted, cancel as well as they can."""

    def __init__(self) -> None:
        self._place: list[Array] = []
        self._rest: list[Array] = []
        self._weighted: list[Array] = []

    def next(self, place: Array, rest: Array, weight: Array) -> Array:
        """The next place, from one and its rest; `weight`: what the rest is judged by."""
        self._place.append(place)
        self._rest.append(rest)
        self._weighted.append((weight * rest).sum(axis=0))
        for held in (self._place, self._rest, self._weighted):
            del held[:-MIXED]
        ahead: Array = place + rest
        if len(self._place) == 1:
            return ahead
        last = self._weighted[-1]
        apart = np.stack([last - one for one in self._weighted[:-1]], axis=1)
        share, *_ = np.linalg.lstsq(apart, last, rcond=1e-6)
        for one, p, d in zip(share, self._place[:-1], self._rest[:-1], strict=True):
            ahead = ahead - one * (place + rest - p - d)
        return ahead
