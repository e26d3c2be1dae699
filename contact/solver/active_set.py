"""Unilateral contact by active sets: factors that follow the set, pivoting, usual sets, the choice."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import inv
from scipy.linalg.lapack import dgetrf, dgetrs

from tireroad.contact.solver.conditions import (
    Array,
    ContactSolver,
    Index,
    Mask,
    check_residual,
    checked_compliance,
    complementarity_residual,
    penetration,
)
from tireroad.contact.solver.projected_cg import Compliance, MatrixCompliance, ProjectedCG
from tireroad.fem.errors import ConvergenceError, InputError

# Number of changes above which a new factor costs less: k right-hand sides each time against 2/3
# a^3.
FEWEST_CHANGES, SHARE = 4, 16


class ActiveFactor:
    """Solves A_NN x = r for a touching set N that changes by a few points per step.

    The result depends only on N and on the factorised set, not on the changes in between: `base`
    (n,) bool is all that a checkpoint needs. `factorisations` counts them.

    With the set B factorised, A_BB = L U, and the touching set N = B - R + S, the k = |R| + |S|
    changes border the system,

        [A_BB A_BS E_R] [x_B]   [r_B]
        [A_SB A_SS  0 ] [x_S] = [r_S],
        [E_R^T 0    0 ] [ l ]   [ 0 ]

    whose Schur complement is of size k: k more right-hand sides instead of a new factor. Source:
    Gill, Murray, Saunders and Wright, SIAM J. Matrix Anal. Appl. 5 (1984) 562.
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
        if len(changed) > len(self._members) // SHARE + FEWEST_CHANGES or not self._members.size:
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

    The factor is kept and bordered as points come and go: a step that ends
    in the set it began with needs no factorisation.

    The contact problem of one time step: f >= 0, g = A (f - f_ref) + q >= 0, f . g = 0.

    A (n, n) m/N is the same-step compliance, possibly slightly unsymmetric (rolling); f (n,) N are
    the total contact forces, g (n,) m the gaps, q (n,) m the gaps at f = f_ref. With a positive
    definite symmetric part A is a P-matrix and the solution unique (Cottle, Pang and Stone, The
    Linear Complementarity Problem, 3.1.6 and 3.3.7). Serial: every process that calls solves the
    same small problem for itself.
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

    def set_state(self, state: dict[str, Array | Mask]) -> None:
        """Continue from `state`."""
        self.active = np.asarray(state["active"], dtype=bool)
        self._signs = np.asarray(state["signs"], dtype=float)
        self._before = np.asarray(state["signs_before"], dtype=float)
        self.refactor(np.asarray(state["factorised"], dtype=bool))

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


class Pivot:
    """M (c, c) of the `taken` points (n,) bool, of which `base` (n,) are B; 20 c^3 bytes of work.

    `places` (c,): the points in the order of M, B first. InputError if A is not positive definite.

    Of the points considered, B usually touch and N do not. With forces in metres, a = diag(A) f,
    the unknowns z = (g_B, a_N) and their partners w = (a_B, g_N) solve a problem of the same kind,

        w = M z + h >= 0, z >= 0, w . z = 0,
        M = [ P, -P A_BN; A_NB P, A_NN - A_NB P A_BN ],  P = A_BB^-1,

    in which few z are nonzero if the contact is near B. M is a P-matrix if A is one. Source:
    Cottle, Pang and Stone, The Linear Complementarity Problem, 2.3 and 4.1.
    """

    def __init__(self, compliance: Compliance, taken: Mask, base: Mask) -> None:
        self.taken, self.base = taken, base
        self.places = np.concatenate([np.flatnonzero(base), np.flatnonzero(taken & ~base)])
        self._size = int(np.count_nonzero(base))
        whole = checked_compliance(compliance.block(self.places, self.places))
        # A power of two, so that forces return from metres to the last bit.
        self._unit = 2.0 ** np.round(np.log2(whole.diagonal()))
        self.matrix = self._pivoted(whole / self._unit)
        self._turned = np.ascontiguousarray(self.matrix[:, : self._size].T)
        self._reference: Array | None = None

    def _pivoted(self, whole: Array) -> Array:
        b = self._size
        inverse = inv(whole[:b, :b]) if b else whole[:b, :b]
        out = np.empty_like(whole)
        out[:b, :b] = inverse
        out[:b, b:] = -inverse @ whole[:b, b:]
        out[b:, :b] = whole[b:, :b] @ inverse
        out[b:, b:] = whole[b:, b:] + whole[b:, :b] @ out[:b, b:]
        return out

    def offset(self, q: Array, reference: Array) -> Array:
        """h (c,) m for gaps q (n,) m at forces `reference` (n,) N, which are 0 at points not taken.

        With q = 0 on B and a reference that is 0 elsewhere, h is that reference to the last bit.
        """
        if reference is not self._reference:
            self._reference, self._begun = reference, self._at(reference)
        own = q[self.places]
        own[: self._size], pushed = 0.0, own[: self._size] @ self._turned
        return self._begun + (own - pushed)

    def _at(self, reference: Array) -> Array:
        """The part of h due to the reference, (c,) m."""
        force = reference[self.places] * self._unit
        out = -(self.matrix[:, self._size :] @ force[self._size :])
        out[: self._size] += force[: self._size]
        return out

    def exchanged(self, active: Mask) -> Mask:
        """Nonzero z (c,) if `active` (n,) touch: of B those that do not, of N those that do."""
        out = active[self.places]
        out[: self._size] ^= True
        return out

    def forces(self, z: Array, w: Array) -> Array:
        """Contact forces (n,) N of the z and w (c,) m."""
        out = np.zeros(len(self.taken))
        b = self._size
        own = np.concatenate([w[:b], z[b:]])
        out[self.places] = np.maximum(own, 0.0) / self._unit
        return out


# Number of steps over which the frequency of touching is averaged.
MEMORY = 200
# Share of the time below which a point is dropped; one that always touched goes after 1400 steps.
SELDOM = 1e-3
# Operations of a new pivot, over c^3 of the c points taken: product, inverse, check, copies.
PRICE = 6.0
# Points are added in portions, a share of those taken but at least so many: each needs a new pivot.
PORTION, FEWEST_CANDIDATES = 0.05, 8


class UsualSet:
    """f >= 0, g = A (f - f_ref) + q >= 0, f . g = 0, by active set on the pivoted problem.

    Points far from the road are not included. Every gap is evaluated with A itself afterwards; if
    one is negative, more points are included and the step is solved again. A new base is chosen,
    and points that no longer touch are dropped, as soon as the savings would have paid for it. A
    step begins with the set of the previous step, whose factor exists: on a rough road that takes
    15 % less than an extrapolation of the signs (three Newton steps at 2.4 mm of road).

    On a road whose texture makes points touch and lift off, a step of a few millimetres exchanges a
    hundred points, so a factor of the touching set serves only one step. The set of points that
    touch more often than not remains the same. Relative to it the problem has as many nonzero
    unknowns as points differ: a third of those that touch, on a passenger tire, so a factor costs a
    thirtieth.
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

    def set_state(self, state: dict[str, Array | Mask]) -> None:
        """Continue from `state`."""
        if "taken" not in state:
            return
        masks = ("active", "pressed", "taken", "base", "exchanged")
        self.active, self._pressed, taken, base, exchanged = (
            np.array(state[name], dtype=bool) for name in masks
        )
        _, inner = self._take(taken, base)
        inner.refactor(exchanged)
        self._share, self._lost = np.array(state["share"], dtype=float), float(state["lost"])

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
        more = max(int(PORTION * np.count_nonzero(taken)), 2 * below, FEWEST_CANDIDATES)
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


def make_solver(name: str, matrix: Array | Compliance) -> ContactSolver:
    """The solver "active-set", "projected-cg" or "snes-vi" (`contact.solver`); else InputError.

    For a compliance that is a product, the active set is found from the set that usually touches,
    with a matrix of these points only.
    """
    if name == "snes-vi":
        from tireroad.contact.solver.snes_vi import SnesVI  # PETSc only if requested

        return SnesVI(matrix)
    if name not in ("active-set", "projected-cg"):
        raise InputError(
            f'contact.solver = "{name}" is unknown: take "active-set", "projected-cg" or "snes-vi"'
        )
    if isinstance(matrix, np.ndarray):
        whole = MatrixCompliance(checked_compliance(matrix))
        return ActiveSet(whole) if name == "active-set" else ProjectedCG(whole)
    return UsualSet(matrix) if name == "active-set" else ProjectedCG(matrix)
