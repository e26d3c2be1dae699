"""Unilateral contact by active sets: the kernel of a step, pivoting, usual sets, the choice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import inv

from tireroad.contact.solver.conditions import (
    Array,
    Index,
    Mask,
    check_residual,
    checked_compliance,
    complementarity_residual,
    penetration,
)
from tireroad.contact.solver.projected_cg import Compliance, MatrixCompliance
from tireroad.fem.compiled import library
from tireroad.fem.errors import ConvergenceError

COMPILED = library(Path(__file__).with_name("contact.c"))
_C, _FFI = COMPILED.lib, COMPILED.ffi

# A sign error below this share of the scale is rounding: otherwise a point whose force and gap are
# both 0 would enter and leave for ever.
ROUNDING = 1e-12

# Number of steps over which the frequency of touching is averaged.
MEMORY = 200
# Share of the time below which a point is dropped; one that always touched goes after 1400 steps.
SELDOM = 1e-3
# Operations of a new pivot, over c^3 of the c points taken: product, inverse, check, copies.
PRICE = 6.0
# Points are added in portions, a share of those taken but at least so many: each needs a new pivot.
PORTION, FEWEST_CANDIDATES = 0.05, 8


class ActiveSet:
    """Semismooth Newton (primal-dual active set), safeguarded as block principal pivoting.

    The contact problem of one time step: f >= 0, g = A (f - f_ref) + q >= 0, f . g = 0.

    A (n, n) m/N is the same-step compliance, possibly slightly unsymmetric (rolling); f (n,) N are
    the total contact forces, g (n,) m the gaps, q (n,) m the gaps at f = f_ref. With a positive
    definite symmetric part A is a P-matrix and the solution unique (Cottle, Pang and Stone, The
    Linear Complementarity Problem, 3.1.6 and 3.3.7). Serial: every process that calls solves the
    same small problem for itself.

    A step exchanges every point of wrong sign (f < 0 where active, g < 0 where not). When ten
    steps in a row do not reduce their number, only the last wrong point is exchanged (Murty's rule)
    until it falls, which is finite for every P-matrix. Random matrices, n = 200: with a skew part
    three times the symmetric one 15 steps are needed; with ten times the step limit is exceeded.
    Source: Judice and Pires, Computers Ops Res. 21 (1994) 587.

    The factor of a set B is kept, A_BB = L U. The touching set N = B - R + S differs from it by k =
    |R| + |S| points, which border the system,

        [A_BB A_BS E_R] [x_B]   [r_B]
        [A_SB A_SS  0 ] [x_S] = [r_S],
        [E_R^T 0    0 ] [ l ]   [ 0 ]

    whose Schur complement is of size k: k more right-hand sides instead of a new factor, which is
    made beyond |B| / 16 + 4 changes. Source: Gill, Murray, Saunders and Wright, SIAM J. Matrix Anal.
    Appl. 5 (1984) 562. The result depends only on N and B, so a checkpoint keeps these. Compiled
    (contact.c).
    """

    def __init__(self, matrix: Array | MatrixCompliance) -> None:
        if isinstance(matrix, np.ndarray):
            matrix = MatrixCompliance(checked_compliance(matrix))
        self._compliance = matrix
        rows, columns = matrix.stored
        n = len(rows)
        self.active: Mask = np.zeros(n, dtype=bool)
        self.gap: Array = np.zeros(n)
        self._base: Mask = np.zeros(n, dtype=bool)
        self._signs, self._before, self.diagonal = np.zeros(n), np.zeros(n), matrix.diagonal
        doubles = {
            "rows": rows, "columns": columns, "diagonal": self.diagonal, "gap": self.gap,
            "signs": self._signs, "signs_before": self._before,
        }  # fmt: skip
        self._held: dict[str, Any] = {
            name: COMPILED.doubles(array) for name, array in doubles.items()
        }
        self._held |= {"active": COMPILED.flags(self.active), "base": COMPILED.flags(self._base)}
        self.compiled = _FFI.new("active_set *", {"n": n} | self._held)
        _C.active_set_begin(self.compiled)
        self._freed = _FFI.gc(self.compiled, _C.active_set_end)
        self.contact = _FFI.new("normal_contact *", {"all": self.compiled})

    def solve(
        self, q: Array, guess_active: Mask | None = None, reference: Array | None = None
    ) -> Array:
        """Forces f (n,) N with f >= 0, g = A (f - f_ref) + q >= 0, f . g = 0.

        q (n,) m; guess_active (n,) bool, by default extrapolated from the last two solutions: without
        points about to lift off and with those about to touch; reference f_ref (n,) N, by default 0.
        With a reference, q = 0 where f_ref > 0 and q >= 0 elsewhere returns f_ref bit for bit, so that
        the state at rest cannot drift. ConvergenceError if q is not finite or the residual
        max |min(diag(A) f, g)| exceeds 1e-9 of max |q| + max diag(A) max f.
        """
        force, self.compiled.again = np.empty(len(self.active)), False
        given = (
            COMPILED.doubles(np.ascontiguousarray(q)),
            _FFI.NULL
            if guess_active is None
            else COMPILED.flags(np.ascontiguousarray(guess_active, dtype=bool)),
            _FFI.NULL if reference is None else COMPILED.doubles(np.ascontiguousarray(reference)),
        )
        self.check(_C.active_set_solve(self.compiled, *given, COMPILED.doubles(force)))
        return force

    def check(self, failure: int) -> None:
        """ConvergenceError for what the kernel could not do, and for too large a residual."""
        if failure == _C.SINGULAR:
            raise ConvergenceError(
                "contact: the compliance between the touching points is singular; add tread compliance or a "
                "residual flexibility"
            )
        if failure == _C.NO_SET:
            raise ConvergenceError(
                f"contact: no consistent set of the {len(self.active)} points in {self.iterations} exchanges; A is "
                "close to singular or far from symmetric: add tread compliance or a residual "
                'flexibility, or take solver = "snes-vi"'
            )
        check_residual("active-set", np.nan if failure else self.residual)

    residual = property(lambda self: self.compiled.residual)
    penetration = property(lambda self: self.compiled.penetration)
    iterations = property(lambda self: self.compiled.iterations)
    factorisations = property(lambda self: self.compiled.factorisations)

    def state(self) -> dict[str, Array | Mask]:
        """The state from which the next solve starts."""
        signs = {"signs": self._signs.copy(), "signs_before": self._before.copy()}
        return {"active": self.active.copy(), "factorised": self.factorised} | signs

    def set_state(self, state: dict[str, Array | Mask]) -> None:
        """Continue from `state`."""
        self.active[:] = state["active"]
        self._signs[:], self._before[:] = state["signs"], state["signs_before"]
        self.refactor(np.asarray(state["factorised"], dtype=bool))

    @property
    def factorised(self) -> Mask:
        """The set (n,) whose factor is kept."""
        return self._base.copy()

    def refactor(self, touching: Mask) -> None:
        """Factorise this set (n,), from whose factor the next solve starts."""
        self._base[:] = touching
        self.check(_C.active_set_refactor(self.compiled))

    def block(self, index: Index) -> Array:
        """A between the points `index`, (a, a) m/N."""
        return self._compliance.block(index, index)


def guarded(work: Callable[..., int], raised: list[BaseException]) -> Callable[..., int]:
    """`work` for a kernel to call: what it raises is appended to `raised`, for the caller of the kernel to raise."""

    def run(*arguments: Any) -> int:
        try:
            return int(work(*arguments))
        except BaseException as error:  # carried over the kernel
            raised.append(error)
            return int(_C.REFUSED)

    return run


def array(pointer: Any, size: int, kind: Any = float) -> NDArray[Any]:
    """The array (size,) behind a pointer that a kernel passed, which lasts as long as the call."""
    width = np.dtype(kind).itemsize
    return np.frombuffer(_FFI.buffer(pointer, size * width), kind)


class Pivot:
    """The contact problem of the `taken` points (n,) bool relative to `base` (n,) B, those that usually touch.

    M (c, c) takes 28 c^2 bytes of work to make. `places` (c,): the points in the order of M, B first. InputError if
    A is not positive definite.

    With forces in metres, a = diag(A) f, the unknowns z = (g_B, a_N) and their partners w = (a_B, g_N) solve a problem
    of the same kind,

        w = M z + h >= 0, z >= 0, w . z = 0,
        M = [ P, -P A_BN; A_NB P, A_NN - A_NB P A_BN ],  P = A_BB^-1,

    in which few z are nonzero if the contact is near B. M is a P-matrix if A is one. h is linear in the gaps at the
    reference forces: with q = 0 on B and forces of 0 elsewhere it is the reference to the last bit. Compiled
    (contact.c). Source: Cottle, Pang and Stone, The Linear Complementarity Problem, 2.3 and 4.1.
    """

    def __init__(self, compliance: Compliance, taken: Mask, base: Mask) -> None:
        self.taken, self.base = taken, base
        places = np.concatenate([np.flatnonzero(base), np.flatnonzero(taken & ~base)])
        b, c = int(np.count_nonzero(base)), len(places)
        whole = checked_compliance(compliance.block(places, places))
        # A power of two, so that forces return from metres to the last bit.
        self._unit = 2.0 ** np.round(np.log2(whole.diagonal()))
        self._matrix = _pivoted(whole / self._unit, b)
        self.exchanged = ActiveSet(MatrixCompliance(self._matrix))
        self.places, self._begun = places, np.zeros(c)
        self._reference: Array | None = None
        doubles = {"unit": self._unit, "begun": self._begun} | {
            name: np.empty(c) for name in ("own", "pushed", "value")
        }
        self._held: dict[str, Any] = {
            name: COMPILED.doubles(values) for name, values in doubles.items()
        }
        self._held |= {
            name: COMPILED.ints(values)
            for name, values in {"places": places.astype(np.int32), "which": np.empty(c, np.int32)}.items()
        }  # fmt: skip
        self._held |= {
            "differ": COMPILED.flags(np.empty(c, bool)), "points": len(taken), "taken": c, "base": b,
            "columns": self.exchanged.compiled.columns, "exchanged": self.exchanged.compiled,
        }  # fmt: skip
        self.compiled = _FFI.new("pivot *", self._held)

    def refer(self, reference: Array) -> None:
        """Set the forces (n,) N at which the gaps q of what follows are, 0 at points not taken."""
        if reference is self._reference:
            return
        self._reference, b = reference, self.compiled.base
        force = reference[self.places] * self._unit
        self._begun[:] = -(self._matrix[:, b:] @ force[b:])
        self._begun[:b] += force[:b]

    def solve(self, q: Array, touching: Mask) -> Array:
        """Forces f (n,) N for gaps q (n,) m, from a guess of the touching points (n,)."""
        force = np.empty(len(q))
        given = COMPILED.doubles(np.ascontiguousarray(q)), COMPILED.flags(touching)
        self.exchanged.check(_C.pivot_solve(self.compiled, *given, COMPILED.doubles(force)))
        return force


def _pivoted(whole: Array, b: int) -> Array:
    """M of a matrix whose first `b` rows are the base."""
    inverse = inv(whole[:b, :b]) if b else whole[:b, :b]
    out = np.empty_like(whole)
    out[:b, :b] = inverse
    out[:b, b:] = -inverse @ whole[:b, b:]
    out[b:, :b] = whole[b:, :b] @ inverse
    out[b:, b:] = whole[b:, b:] + whole[b:, :b] @ out[:b, b:]
    return out


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
        self.diagonal = compliance.diagonal
        n = len(self.diagonal)
        self.active: Mask = np.zeros(n, dtype=bool)
        self.gap: Array = np.zeros(n)
        self.penetration = 0.0
        self.residual = 0.0
        self.iterations = 0
        self._share = np.zeros(n)
        self._pressed: Mask = np.zeros(n, dtype=bool)
        self._lost = 0.0
        self._made = 0
        self._pivot: Pivot | None = None
        self._base: Array = np.zeros(n)
        self.raised: list[BaseException] = []  # in `others`, for the caller of the kernel to raise
        self._others = _FFI.callback("look", guarded(self._look, self.raised))
        self.contact = _FFI.new("normal_contact *", {"others": self._others})

    def solve(
        self, q: Array, guess_active: Mask | None = None, reference: Array | None = None
    ) -> Array:
        """Forces f (n,) N; see ActiveSet.solve."""
        guess = self.begin(q, guess_active, reference)
        while True:
            assert self._pivot is not None, "begun"
            force = self._pivot.solve(q, guess)
            if self._settled(q, force):
                return force
            guess = force > 0.0

    def begin(self, q: Array, guess_active: Mask | None, reference: Array | None) -> Mask:
        """Prepare for a step; the guess (n,) of the touching points."""
        if not np.all(np.isfinite(q)):
            check_residual("active-set", np.nan)
        self._base = np.zeros(len(q)) if reference is None else reference
        guess = self.active if guess_active is None else guess_active
        pressed = self._base != 0.0
        touching = guess if guess.any() else q < 0.0
        if self._pivot is None:
            self._share, self._pressed = touching.astype(float), pressed
            self._widen(touching | pressed, touching, q)
        elif (pressed & ~self._pivot.taken).any():
            self._pressed = self._pressed | pressed
            self._take(self._pivot.taken | pressed, self._pivot.base)
        else:
            self._pivot.refer(self._base)
        return np.ascontiguousarray(guess)

    def check(self, failure: int) -> None:
        """ConvergenceError for what the kernel could not do."""
        if failure and self._pivot:
            self._pivot.exchanged.check(failure)

    def _look(self, q: Any, force: Any) -> int:
        """For the kernel: whether no other point touches, or there are more to be taken."""
        n = len(self.active)
        settled = self._settled(array(q, n).copy(), array(force, n).copy())
        return int(_C.SOLVED if settled else _C.AGAIN)

    def _settled(self, q: Array, force: Array) -> bool:
        """Whether no point that was left out touches; if so the step is concluded, else more are taken."""
        pivot = self._pivot
        assert pivot is not None, "after a solution"
        self.iterations = pivot.exchanged.iterations
        gap = q + self._compliance.apply(force - self._base)
        scale = float(np.abs(q).max() + (self.diagonal * force).max())
        if (gap[~pivot.taken] < -ROUNDING * scale).any():
            self._widen(pivot.taken, pivot.base, gap)
            return False
        self._finish(force, gap, scale)
        return True

    def state(self) -> dict[str, Array | Mask]:
        """The state from which the next solve starts."""
        pivot = self._pivot
        if pivot is None:
            return {}
        state = {"active": self.active, "share": self._share, "lost": np.array(self._lost)}
        state |= {"taken": pivot.taken, "base": pivot.base, "pressed": self._pressed}
        return state | {"exchanged": pivot.exchanged.factorised}

    def set_state(self, state: dict[str, Array | Mask]) -> None:
        """Continue from `state`."""
        if "taken" not in state:
            return
        masks = ("active", "pressed", "taken", "base", "exchanged")
        self.active, self._pressed, taken, base, exchanged = (
            np.array(state[name], dtype=bool) for name in masks
        )
        self._take(taken, base).exchanged.refactor(exchanged)
        self._share, self._lost = np.array(state["share"], dtype=float), float(state["lost"])

    @property
    def factorisations(self) -> int:
        """Number of factorisations, including those of the pivots."""
        return self._made + (self._pivot.exchanged.factorisations if self._pivot else 0)

    def block(self, index: Index) -> Array:
        """A between the points `index`, (a, a) m/N."""
        return self._compliance.block(index, index)

    def _widen(self, taken: Mask, base: Mask, gap: Array) -> None:
        """Take a further portion of points, nearest by their gaps (n,) m."""
        left = np.flatnonzero(~taken)
        below = int(np.count_nonzero(gap[left] < 0.0))
        more = max(int(PORTION * np.count_nonzero(taken)), 2 * below, FEWEST_CANDIDATES)
        wider = taken.copy()
        wider[left[np.argsort(gap[left], kind="stable")[:more]]] = True
        self._take(wider, base)

    def _take(self, taken: Mask, base: Mask) -> Pivot:
        self._made = self.factorisations + 1
        self._pivot = Pivot(self._compliance, taken, base)
        self._pivot.refer(self._base)
        self.contact.usual = self._pivot.compiled
        self._lost = 0.0
        return self._pivot

    def _finish(self, force: Array, gap: Array, scale: float) -> Array:
        self.residual = complementarity_residual(force, gap, self.diagonal, scale)
        check_residual("active-set", self.residual)
        self.penetration = penetration(gap)
        self.active = force > 0.0
        self.gap = np.where(self.active, 0.0, gap)
        self._reconsider()
        return force

    def _reconsider(self) -> None:
        """Make the set that usually touches the base, once that would have been cheaper."""
        pivot = self._pivot
        assert pivot is not None, "after a solution"
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
