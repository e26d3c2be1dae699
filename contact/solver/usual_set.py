"""The active set on a rough road with hundreds of points, relative to the set that usually touches.

On a road whose texture makes points touch and lift off, a step of a few millimetres exchanges a
hundred points, so a factor of the touching set serves only one step. The set of points that touch
more often than not remains the same. Relative to it (contact.solver.pivot) the problem has as many
nonzero unknowns as points differ: a third of those that touch, on a passenger tire, so a factor
costs a thirtieth.
"""

from __future__ import annotations

import numpy as np

from tireroad.contact.solver.complementarity import ROUNDING, ActiveSet
from tireroad.contact.solver.conditions import (
    Array,
    Index,
    Mask,
    check_residual,
    complementarity_residual,
    penetration,
)
from tireroad.contact.solver.grid_compliance import Compliance, MatrixCompliance
from tireroad.contact.solver.pivot import Pivot

# Number of steps over which the frequency of touching is averaged.
MEMORY = 200
# Share of the time below which a point is dropped; one that always touched goes after 1400 steps.
SELDOM = 1e-3
# Operations of a new pivot, over c^3 of the c points taken: product, inverse, check, copies.
PRICE = 6.0
# Points are added in portions, a share of those taken but at least so many: each needs a new pivot.
PORTION, FEWEST = 0.05, 8


class UsualSet:
    """f >= 0, g = A (f - f_ref) + q >= 0, f . g = 0, by active set on the pivoted problem.

    Points far from the road are not included. Every gap is evaluated with A itself afterwards; if
    one is negative, more points are included and the step is solved again. A new base is chosen,
    and points that no longer touch are dropped, as soon as the savings would have paid for it. A
    step begins with the set of the previous step, whose factor exists: on a rough road that takes
    15 % less than an extrapolation of the signs (three Newton steps at 2.4 mm of road).
    """

    def __init__(self, compliance: Compliance) -> None:
        self._compliance = compliance
        self._diagonal = compliance.diagonal
        n = len(self._diagonal)
        self.active: Mask = np.zeros(n, dtype=bool)
        self.gap: Array = np.zeros(n)
        self.penetration = 0.0
        self.residual = 0.0
        self.iterations = 0
        self._share = np.zeros(n)
        self._pressed: Mask = np.zeros(n, dtype=bool)
        self._lost = 0.0
        self._made = 0
        self._problem: tuple[Pivot, ActiveSet] | None = None

    def solve(
        self, q: Array, guess_active: Mask | None = None, reference: Array | None = None
    ) -> Array:
        """Forces f (n,) N; see ActiveSet.solve."""
        if not np.all(np.isfinite(q)):
            check_residual("active-set", np.nan)
        base = np.zeros(len(q)) if reference is None else reference
        guess = self.active if guess_active is None else guess_active
        pivot, inner = self._prepared(q, guess if guess.any() else q < 0.0, base != 0.0)
        while True:
            z = inner.solve(pivot.offset(q, base), pivot.exchanged(guess))
            self.iterations = inner.iterations
            force = pivot.forces(z, inner.gap)
            gap = q + self._compliance.apply(force - base)
            scale = float(np.abs(q).max() + (self._diagonal * force).max())
            if not (gap[~pivot.taken] < -ROUNDING * scale).any():
                return self._finish(force, gap, scale)
            guess = force > 0.0
            pivot, inner = self._widened(pivot.taken, pivot.base, gap)

    def state(self) -> dict[str, Array | Mask]:
        """The state from which the next solve starts."""
        if self._problem is None:
            return {}
        pivot, inner = self._problem
        kept = {"active": self.active, "share": self._share, "lost": np.array(self._lost)}
        kept |= {"taken": pivot.taken, "base": pivot.base, "pressed": self._pressed}
        return kept | {"exchanged": inner.factorised}

    def set_state(self, kept: dict[str, Array | Mask]) -> None:
        """Continue from `state`."""
        if "taken" not in kept:
            return
        masks = ("active", "pressed", "taken", "base", "exchanged")
        self.active, self._pressed, taken, base, exchanged = (
            np.array(kept[name], dtype=bool) for name in masks
        )
        _, inner = self._take(taken, base)
        inner.refactor(exchanged)
        self._share, self._lost = np.array(kept["share"], dtype=float), float(kept["lost"])

    @property
    def factorisations(self) -> int:
        """Number of factorisations, including those of the pivots."""
        return self._made + (self._problem[1].factorisations if self._problem else 0)

    def block(self, index: Index) -> Array:
        """A between the points `index`, (a, a) m/N."""
        return self._compliance.block(index, index)

    def _prepared(self, q: Array, touching: Mask, pressed: Mask) -> tuple[Pivot, ActiveSet]:
        """The problem, rebuilt if there is none or the reference presses on points left out."""
        if self._problem is None:
            self._share, self._pressed = touching.astype(float), pressed
            return self._widened(touching | pressed, touching, q)
        pivot = self._problem[0]
        if (pressed & ~pivot.taken).any():
            self._pressed = self._pressed | pressed
            return self._take(pivot.taken | pressed, pivot.base)
        return self._problem

    def _widened(self, taken: Mask, base: Mask, gap: Array) -> tuple[Pivot, ActiveSet]:
        """The problem with a further portion of points, nearest by their gaps (n,) m."""
        left = np.flatnonzero(~taken)
        below = int(np.count_nonzero(gap[left] < 0.0))
        more = max(int(PORTION * np.count_nonzero(taken)), 2 * below, FEWEST)
        wider = taken.copy()
        wider[left[np.argsort(gap[left], kind="stable")[:more]]] = True
        return self._take(wider, base)

    def _take(self, taken: Mask, base: Mask) -> tuple[Pivot, ActiveSet]:
        self._made = self.factorisations + 1
        pivot = Pivot(self._compliance, taken, base)
        self._problem = pivot, ActiveSet(MatrixCompliance(pivot.matrix))
        self._lost = 0.0
        return self._problem

    def _finish(self, force: Array, gap: Array, scale: float) -> Array:
        self.residual = complementarity_residual(force, gap, self._diagonal, scale)
        check_residual("active-set", self.residual)
        self.penetration = penetration(gap)
        self.active = force > 0.0
        self.gap = np.where(self.active, 0.0, gap)
        self._reconsider()
        return force

    def _reconsider(self) -> None:
        """Make the set that usually touches the base, once that would have been cheaper."""
        assert self._problem is not None, "after a solution"
        pivot = self._problem[0]
        self._share += (self.active - self._share) / MEMORY
        needed = (self._share > SELDOM) | self._pressed
        differ = float(np.count_nonzero(self.active ^ pivot.base))
        usual = float(np.minimum(self._share, 1.0 - self._share).sum())
        now, then = len(pivot.places), int(np.count_nonzero(needed))
        self._lost += max(_work(differ, now) - _work(usual, then), 0.0)
        if self._lost > PRICE * now**3:
            self._take(needed, (self._share > 0.5) & needed)


def _work(differ: float, count: int) -> float:
    """Operations of a step with `differ` nonzero unknowns of `count`: factor and products."""
    return 2.0 / 3.0 * differ**3 + 4.0 * differ * count + 2.0 * count**2
