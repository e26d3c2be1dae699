"""The contact problem of one time step: f >= 0, g = A (f - f_ref) + q >= 0, f . g = 0.

A (n, n) m/N is the same-step compliance, possibly slightly unsymmetric (rolling); f (n,) N are the
total contact forces, g (n,) m the gaps, q (n,) m the gaps at f = f_ref. With a positive definite
symmetric part A is a P-matrix and the solution unique (Cottle, Pang and Stone, The Linear
Complementarity Problem, 3.1.6 and 3.3.7). Serial: every process that calls solves the same small
problem for itself.
"""

import numpy as np

from tireroad.contact.solver.conditions import (
    Array,
    Index,
    Mask,
    check_residual,
    checked_compliance,
    complementarity_residual,
    penetration,
)
from tireroad.contact.solver.factor import ActiveFactor
from tireroad.contact.solver.grid_compliance import Compliance, MatrixCompliance
from tireroad.fem.errors import ConvergenceError

# A sign error below this share of the scale is rounding: otherwise a point whose force and gap are
# both 0 would enter and leave for ever.
ROUNDING = 1e-12
# Full exchanges that may fail to reduce the number of wrong signs before single exchanges take
# over.
PATIENCE = 10


class ActiveSet:
    """Semismooth Newton (primal-dual active set), safeguarded as block principal pivoting.

    A step exchanges every point of wrong sign (f < 0 where active, g < 0 where not). When
    `PATIENCE` steps in a row do not reduce their number, only the last wrong point is exchanged
    (Murty's rule) until it falls, which is finite for every P-matrix. Random matrices, n = 200:
    with a skew part three times the symmetric one 15 steps are needed; with ten times the step
    limit is exceeded. Source: Judice and Pires, Computers Ops Res. 21 (1994) 587.

    The factor is kept and bordered as points come and go (contact.solver.factor): a step that ends
    in the set it began with needs no factorisation.
    """

    def __init__(self, matrix: Array | Compliance) -> None:
        if isinstance(matrix, np.ndarray):
            matrix = MatrixCompliance(checked_compliance(matrix))
        self._compliance = matrix
        self._diagonal = matrix.diagonal
        self._scale = float(self._diagonal.max())
        n = len(self._diagonal)
        self.active: Mask = np.zeros(n, dtype=bool)
        self.gap: Array = np.zeros(n)
        self.penetration = 0.0
        self.residual = 0.0
        self.iterations = 0
        self._factor = ActiveFactor(matrix)
        self._lifted = b"", b""
        self._reference: Array | None = None
        self._signs = self._before = np.zeros(n)

    def solve(
        self, q: Array, guess_active: Mask | None = None, reference: Array | None = None
    ) -> Array:
        """Forces f (n,) N with f >= 0, g = A (f - f_ref) + q >= 0, f . g = 0.

        q (n,) m; guess_active (n,) bool, by default extrapolated from the last two solutions;
        reference f_ref (n,) N, by default 0. With a reference, q = 0 where f_ref > 0 and q >= 0
        elsewhere returns f_ref bit for bit, so that the state at rest cannot drift.
        ConvergenceError if q is not finite or the residual max |min(diag(A) f, g)| exceeds 1e-9 of
        max |q| + max diag(A) max f.
        """
        n = len(self._diagonal)
        active = self._guess() if guess_active is None else np.asarray(guess_active, dtype=bool)
        largest = float(np.abs(q).max())
        if not np.isfinite(largest):
            check_residual("active-set", np.nan)
        best, patience = n + 1, PATIENCE
        for self.iterations in range(1, 20 * n + 100):
            force, gap = self._at(active, q, reference)
            scale = largest + self._scale * float(np.abs(force).max())
            wrong = np.where(active, force * self._diagonal, gap) < -ROUNDING * scale
            count = int(np.count_nonzero(wrong))
            if count == 0:
                return self._finish(active, force, gap, scale)
            if count < best:
                best, patience = count, PATIENCE
            else:
                patience -= 1
            if patience < 0:
                last = np.flatnonzero(wrong)[-1]
                wrong = np.zeros(n, dtype=bool)
                wrong[last] = True
            active = active ^ wrong
        raise ConvergenceError(
            f"contact: no consistent set of the {n} points in {self.iterations} exchanges; A is "
            "close to singular or far from symmetric: add tread compliance or a residual "
            'flexibility, or take solver = "snes-vi"'
        )

    def state(self) -> dict[str, Array | Mask]:
        """The state from which the next solve starts."""
        signs = {"signs": self._signs, "signs_before": self._before}
        return {"active": self.active, "factorised": self.factorised} | signs

    def set_state(self, kept: dict[str, Array | Mask]) -> None:
        """Continue from `state`."""
        self.active = np.asarray(kept["active"], dtype=bool)
        self._signs = np.asarray(kept["signs"], dtype=float)
        self._before = np.asarray(kept["signs_before"], dtype=float)
        self.refactor(np.asarray(kept["factorised"], dtype=bool))

    @property
    def factorised(self) -> Mask:
        """The set (n,) whose factor is kept."""
        return self._factor.base

    def refactor(self, touching: Mask) -> None:
        """Factorise this set (n,), from whose factor the next solve starts."""
        self._factor.rebase(touching)

    @property
    def factorisations(self) -> int:
        """Number of factorisations; changes in between only border the factor."""
        return self._factor.factorisations

    def block(self, index: Index) -> Array:
        """A between the points `index`, (a, a) m/N."""
        return self._compliance.block(index, index)

    def _guess(self) -> Mask:
        """The last active set, without points about to lift off and with those about to touch.

        On a rolling patch this is the right set in four steps of five, the last set in one of five.
        """
        ahead = 2.0 * self._signs - self._before
        return (ahead > 0.0) | ((ahead == 0.0) & self.active)

    def _at(self, active: Mask, q: Array, reference: Array | None) -> tuple[Array, Array]:
        """Forces and gaps when exactly the active points touch (g = 0 there, f = 0 elsewhere)."""
        self._factor.take(active)
        index, force = self._factor.index, np.zeros(len(q))
        change, right = np.zeros(len(q)), -q[index]
        if reference is not None:
            lifted = np.flatnonzero(~active & (reference != 0.0))
            change[lifted] = -reference[lifted]
            if len(lifted):
                right += self._missed(index, lifted, reference)
        change[index] = self._factor.solve(right)
        gap = q + self._factor.spread(change)
        force[index] = change[index] if reference is None else reference[index] + change[index]
        return force, gap

    def _missed(self, index: Index, lifted: Index, reference: Array) -> Array:
        """Displacement (m) at touching points due to reference forces at points lifted off."""
        key = index.tobytes(), lifted.tobytes()
        if key != self._lifted or reference is not self._reference:
            self._lifted, self._reference = key, reference
            self._gone = self._compliance.block(index, lifted) @ reference[lifted]
        return self._gone

    def _finish(self, active: Mask, force: Array, gap: Array, scale: float) -> Array:
        """Clear signs at rounding level, measure the residual, keep the state for the next step."""
        np.maximum(force, 0.0, out=force)
        self.residual = complementarity_residual(force, gap, self._diagonal, scale)
        check_residual("active-set", self.residual)
        self.penetration = penetration(gap)
        gap[active] = 0.0
        self.active, self.gap = active, gap
        self._before, self._signs = self._signs, force * self._diagonal - gap
        return force
