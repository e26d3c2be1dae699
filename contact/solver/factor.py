"""The factor of the touching points' compliance, kept while points come and go.

With the set B factorised, A_BB = L U, and the touching set N = B - R + S, the k = |R| + |S| changes
border the system,

    [A_BB A_BS E_R] [x_B]   [r_B]
    [A_SB A_SS  0 ] [x_S] = [r_S],
    [E_R^T 0    0 ] [ l ]   [ 0 ]

whose Schur complement is of size k: k more right-hand sides instead of a new factor. Source: Gill,
Murray, Saunders and Wright, SIAM J. Matrix Anal. Appl. 5 (1984) 562.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from tireroad.contact.solver.grid_compliance import Compliance
from tireroad.fem.errors import ConvergenceError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Number of changes above which a new factor costs less: k right-hand sides each time against 2/3
# a^3.
FEWEST, SHARE = 4, 16


class ActiveFactor:
    """Solves A_NN x = r for a touching set N that changes by a few points per step.

    The result depends only on N and on the factorised set, not on the changes in between: `base`
    (n,) bool is all that a checkpoint needs. `factorisations` counts them.
    """

    def __init__(self, compliance: Compliance) -> None:
        self._compliance = compliance
        self.base: Mask = np.zeros(len(compliance.diagonal), dtype=bool)
        self.index = np.flatnonzero(self.base)
        self.factorisations = 0
        self._members = self._changed = self.index
        self._key = b""

    def take(self, active: Mask) -> None:
        """Prepare for the touching set. ConvergenceError if its compliance is singular."""
        key = active.tobytes()
        if key == self._key:
            return
        self.index = np.flatnonzero(active)
        changed = np.flatnonzero(active ^ self.base)
        if len(changed) > len(self._members) // SHARE + FEWEST or not self._members.size:
            self.rebase(active)
        else:
            self._border(active, changed)
        self._key = key

    def rebase(self, base: Mask) -> None:
        """Factorise this set, which then is the touching set too."""
        self.base, self.index = base.copy(), np.flatnonzero(base)
        self._members, self._changed = self.index, self.index[:0]
        self._key = base.tobytes()
        self.factorisations += 1
        self._around = self._compliance.around(self.index)
        if len(self.index):  # LAPACK refuses empty blocks
            self._lu, self._pivots, info = dgetrf(self._around.block(), overwrite_a=True)
            self._check(info)

    def solve(self, right: Array) -> Array:
        """x (a,) on the touching points for r (a,) m there."""
        if len(self.index) == 0:
            return right
        if len(self._changed) == 0:
            return dgetrs(self._lu, self._pivots, right)[0]
        whole = np.zeros(len(self.base))
        whole[self.index] = right
        inner, _ = dgetrs(self._lu, self._pivots, whole[self._members])
        rest = -self._rows @ inner
        rest[: len(self._entered)] += whole[self._entered]
        outer, _ = dgetrs(self._schur, self._turns, rest)
        whole[self._members] = inner - self._columns @ outer
        whole[self._entered] = outer[: len(self._entered)]
        return whole[self.index]

    def spread(self, force: Array) -> Array:
        """A f (n,) m for forces f (n,) N that are nonzero at the factorised set and few others."""
        return self._around.spread(force)

    def _border(self, active: Mask, changed: NDArray[np.intp]) -> None:
        """The Schur complement of the changes since the factorisation."""
        self._changed = changed
        if len(changed) == 0:
            return
        entered, left = changed[active[changed]], changed[~active[changed]]
        place = np.searchsorted(self._members, left)
        s, k, b = len(entered), len(changed), len(self._members)
        columns, rows = np.zeros((b, k), order="F"), np.zeros((k, b))
        columns[:, :s] = self._compliance.block(self._members, entered)
        rows[:s] = self._compliance.block(entered, self._members)
        columns[place, np.arange(s, k)] = rows[np.arange(s, k), place] = 1.0
        self._columns, _ = dgetrs(self._lu, self._pivots, columns, overwrite_b=True)
        schur = -rows @ self._columns
        schur[:s, :s] += self._compliance.block(entered, entered)
        self._schur, self._turns, info = dgetrf(schur)
        self._check(info)
        self._entered, self._rows = entered, rows

    def _check(self, info: int) -> None:
        if info > 0:
            self._key, self._members = b"", self.index[:0]
            raise ConvergenceError(
                f"contact: the compliance of {len(self.index)} touching points is singular; add "
                "tread compliance or a residual flexibility"
            )
