"""Contact with friction: normal and tangential forces in turn, sticking and sliding points."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from copy import copy

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

from tireroad.contact.solver.conditions import ContactSolver, Index, Mask
from tireroad.contact.tread.brush import Brush
from tireroad.contact.tread.shear import Between, Shear
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.recursion import LoadedColumns

Array = NDArray[np.float64]
FEW, SHORT = 200, 40  # unknowns above which a short cycle is tried first, and its steps

# Called `tol` in the SciPy of Debian 12; that of Debian 13 has only `rtol`.
_RELATIVE = "rtol" if "rtol" in inspect.signature(linalg.gmres).parameters else "tol"


def gmres(
    apply: Callable[[Array], Array],
    right: Array,
    tolerance: float,
    precondition: Callable[[Array], Array] | None = None,
) -> Array:
    """x (n,) with |A x - b| <= tolerance |b|, `apply` v -> A v, by SciPy.

    `precondition` v -> M v, M about the inverse of A, is applied on the right, so that the residual
    is that of A itself. One cycle of at most n steps yields the solution in exact arithmetic for
    any A, and the rest is rounding, so x is returned. With many unknowns a short cycle is tried
    first: SciPy initialises the memory of the longest possible one, which for 800 unknowns took as
    long as the steps themselves.
    """
    if precondition is not None:
        inner = gmres(lambda v: apply(precondition(v)), right, tolerance)
        return precondition(inner)
    n = len(right)
    matrix = linalg.LinearOperator((n, n), matvec=apply, dtype=float)
    options = {_RELATIVE: tolerance, "atol": 0.0, "maxiter": 1}
    short = SHORT if n > FEW else n
    found, left = linalg.gmres(matrix, right, restart=short, **options)
    return found if short == n or not left else linalg.gmres(matrix, right, restart=n, **options)[0]


Plane = NDArray[np.complex128]

NEWTON_STEPS = 30
GRADIENT_STEPS = 5000
SLIDING_TOLERANCE = 1e-10  # of the largest bound, or of the largest force where nothing is bounded
INNER = 5e-2  # residual reduction in a Newton step; the slipping points are not known any better
MOST_KEPT = 8  # matrices of carrying nodes


class Carcass:
    """W A W^T between points: `matrix` A (2n, 2n) m/N, x and y of each node adjacent.

    `weights` W (c, n) from nodes to all points, None where they are the same. `own` (c,) m/N:
    compliance of each point, the mean of both directions. `between` selects points; the matrices of
    the nodes that carry them are kept, since nodes change less often than points.
    """

    def __init__(self, matrix: Array, weights: sparse.csr_matrix | None = None) -> None:
        nodes = len(matrix) // 2
        w = sparse.identity(nodes, format="csr") if weights is None else weights
        self._whole, self._weights = matrix, w
        self._carries = abs(w).T.tocsr()
        mean = 0.5 * (matrix[::2, ::2] + matrix[1::2, 1::2])
        self.own = np.asarray(w.multiply(w @ mean).sum(axis=1)).ravel()
        self._carried: dict[bytes, tuple[Index, Array, sparse.csr_matrix, sparse.csr_matrix]] = {}
        self._select(np.arange(w.shape[0]))

    def between(self, points: Index) -> Carcass:
        """The same between these `points` (a,) alone."""
        other = copy(self)
        other.own = self.own[points]
        other._select(points)
        return other

    def _select(self, points: Index) -> None:
        """Take these points; their nodes carry further points, whose weights are kept with them."""
        bearing = np.zeros(self._weights.shape[0])
        bearing[points] = 1.0
        nodes = self._carries @ bearing > 0.0
        key = nodes.tobytes()
        if key not in self._carried:
            if len(self._carried) >= MOST_KEPT:
                self._carried.clear()
            self._carried[key] = self._kept(np.flatnonzero(nodes))
        place, self._matrix, self._w, self._down = self._carried[key]
        self._place = place[points]

    def _kept(self, nodes: Index) -> tuple[Index, Array, sparse.csr_matrix, sparse.csr_matrix]:
        """Of the nodes: the place (c,) of each point among those they carry, A, W and its transpose."""
        some = np.stack([2 * nodes, 2 * nodes + 1], axis=-1).ravel()
        beyond = np.ones(self._weights.shape[1])
        beyond[nodes] = 0.0
        inside = self._carries.T @ beyond == 0.0
        w = self._weights[inside][:, nodes].astype(complex)
        return np.cumsum(inside) - 1, self._whole[np.ix_(some, some)], w, w.T.tocsr()

    def __call__(self, force: Plane) -> Plane:
        """Displacements (a,) m of forces (a,) N."""
        points = np.zeros(self._w.shape[0], dtype=complex)
        points[self._place] = force
        nodal = self._down @ points
        return (self._w @ (self._matrix @ nodal.view(float)).view(complex))[self._place]

    def norm(self) -> float:
        """An upper bound of the largest singular value, m/N."""
        weights = float(np.linalg.norm(self._w.toarray(), 2))
        return float(np.linalg.norm(self._matrix, 2)) * weights**2


class SlidingStiffness:
    """B = W A W^T + diag(spring), plus S of the `tread`, between the points.

    `spring` (a,) m/N. Forces and displacements in the plane are complex, x + iy.
    """

    def __init__(
        self, carcass: Carcass, spring: Array | float = 0.0, tread: Between | None = None
    ) -> None:
        self._carcass, self._tread = carcass, tread
        self._spring = np.broadcast_to(np.asarray(spring, dtype=float), carcass.own.shape)
        self.inverse = 1.0 / (carcass.own + self._spring + (tread.own if tread else 0.0))

    def __call__(self, force: Plane) -> Plane:
        """B t (a,) m for t (a,) N."""
        moved = self._carcass(force) + self._spring * force
        return moved + self._tread.apply(force) if self._tread else moved

    @property
    def precondition(self) -> Callable[[Plane], Plane] | None:
        """About the inverse of B, (a,) m to (a,) N, or None where its diagonal is the best known."""
        return self._tread.precondition if self._tread else None

    def norm(self) -> float:
        """An upper bound of the largest singular value, m/N."""
        largest = self._carcass.norm() + float(self._spring.max())
        return largest + (self._tread.bound if self._tread else 0.0)


class StickSlip:
    """Tangential forces t (a, 2) N: B t + c = 0 within the bounds, against the slip on them.

    `stiffness` B, `constant` c (a, 2) m, `bound` (a,) N, infinite where nothing slips. Semismooth
    Newton on t = P_b(t - r (B t + c)), P_b the projection on the discs (Alart and Curnier, Comput.
    Methods Appl. Mech. Eng. 92 (1991) 353), r the inverse of B's diagonal. Its linear problems are
    solved by GMRES, preconditioned where the tread knows its inverse.

    Stick and slip under given normal forces: minimise t.B t/2 + c.t with |t_i| <= b_i at each
    point.

    t_i lies in the plane of the road. Where |t_i| < b_i, (B t + c)_i = 0 and the point sticks;
    where |t_i| = b_i, (B t + c)_i = -lambda_i t_i, lambda_i >= 0, and it slips against its force.
    The solution is unique if the symmetric part of B is positive definite.
    """

    def __init__(self, stiffness: SlidingStiffness, constant: Array, bound: Array) -> None:
        self._stiffness, self._bound = stiffness, bound
        self._constant = _complex(constant)

    def begin(self, guess: Array) -> float:
        """Take a guess (a, 2) N, cut to the bounds; its residual, N."""
        return self._take(_onto_discs(_complex(guess), self._bound))

    @property
    def forces(self) -> Array:
        """The present forces (a, 2) N, within the bounds."""
        return _real(_onto_discs(self._force, self._bound))

    @property
    def largest(self) -> float:
        """The largest bound, or the largest force where nothing is bounded, N."""
        bound = float(self._bound.max(initial=0.0))
        force = float(np.abs(self._force).max(initial=0.0))
        return max(bound if np.isfinite(bound) else 0.0, force)

    def improved(self) -> Array:
        """The forces (a, 2) N after a Newton step, whose residual is not evaluated."""
        return _real(_onto_discs(self._stepped(), self._bound))

    def solved(self) -> Array:
        """The forces (a, 2) N, to SLIDING_TOLERANCE of the largest.

        If Newton cycles, projected gradients follow: slow but safe for symmetric B.
        ConvergenceError if they fail.
        """
        begin = self._force
        for _ in range(NEWTON_STEPS):
            if self._off <= SLIDING_TOLERANCE * self.largest:
                return self.forces
            self._take(self._stepped())
        self._gradients(begin)
        return self.forces

    def _take(self, force: Plane) -> float:
        self._force = force
        self._trial = force - self._stiffness.inverse * (self._stiffness(force) + self._constant)
        self._residual = force - _onto_discs(self._trial, self._bound)
        self._off = float(np.abs(self._residual).max(initial=0.0))
        return self._off

    def _stepped(self) -> Plane:
        return self._force + self._newton_step()

    def _newton_step(self) -> Plane:
        """d of semismooth Newton: d + P' (r B d - d) = -residual."""
        stiffness, length = self._stiffness, np.abs(self._trial)
        inverse = stiffness.precondition
        slips = length > self._bound
        # Derivative P' of the projection: the identity where a point sticks, else
        # b/|t| (I - n n^T).
        long = np.where(slips, length, 1.0)
        normal = np.where(slips, self._trial, 0.0) / long
        share = np.where(slips, self._bound, 1.0) / long

        def apply(flat: Array) -> Array:
            step = flat.view(complex)
            moved = stiffness.inverse * stiffness(step) - step
            moved -= normal * (normal.real * moved.real + normal.imag * moved.imag)
            return (step + share * moved).view(float)

        def precondition(flat: Array) -> Array:
            # What slips is close to the identity as it is.
            assert inverse is not None
            step = flat.view(complex)
            sticking = inverse(np.where(slips, 0.0, step / stiffness.inverse))
            return np.where(slips, step, sticking).view(float)

        right = -self._residual.view(float)
        found = gmres(apply, right, INNER, precondition if inverse else None)
        return found.view(complex)

    def _gradients(self, guess: Plane) -> None:
        """Projected gradients with Nesterov's momentum, restarted where it points uphill."""
        rate = 1.0 / self._stiffness.norm()
        force = ahead = guess
        weight = 1.0
        for _ in range(GRADIENT_STEPS):
            moved = self._stiffness(ahead) + self._constant
            new = _onto_discs(ahead - rate * moved, self._bound)
            if np.abs((new - ahead) * self._stiffness.inverse / rate).max() <= (
                SLIDING_TOLERANCE * self.largest
            ):
                self._force = new
                return
            if np.vdot(ahead - new, new - force).real > 0.0:
                weight = 1.0
            later = 0.5 + np.sqrt(0.25 + weight**2)
            ahead = new + (weight - 1.0) / later * (new - force)
            force, weight = new, later
        raise ConvergenceError(
            "contact: no equilibrium of stick and slip was found; take a smaller [time] step, a smaller friction "
            "or a softer brush"
        )


def _onto_discs(force: Plane, bound: Array) -> Plane:
    length = np.abs(force)
    outside = length > bound
    return np.where(outside, bound / np.where(outside, length, 1.0), 1.0) * force


def stick_slip(stiffness: SlidingStiffness, constant: Array, bound: Array, guess: Array) -> Array:
    """Tangential forces t (a, 2) N of the problem StickSlip from a `guess` (a, 2), to rounding."""
    problem = StickSlip(stiffness, constant, bound)
    problem.begin(guess)
    return problem.solved()


TURNS = 100
FLAT = 30  # turns of one Newton step each, after which stick and slip are solved in each
MIXED = 4  # results from which the next one is extrapolated
PATIENCE = 10  # turns after which a point that still comes and goes is lifted off by its bristle
# Residual of the horizontal forces under the normal ones, relative to the largest bound. On a
# passenger tire at mu = 1 the forces up to 400 Hz then differ by at most 0.2 % from those at 1e-8.
TOLERANCE = 1e-4


class BrushFriction:
    """The brush on a tire with same-step response `tire` (3p, 3p) m/N in z, x, y of the nodes.

    `weights` W (c, p) interpolates from nodes to points (None: they are the same). `shear` of the
    tread, None: rigid in shear; `pressed` (c,) N: normal forces relative to which pressure shears
    it, None: the static ones. `tolerance`: residual of stick and slip relative to the largest
    bound, or to the largest force where nothing is bounded. `horizontal` (c, 2) N is the last
    solution, `turns` its number of iterations.

    Normal: f >= 0, g = A_zz (f - f_static) + A_zh t + q >= 0, f . g = 0. Tangential, at the
    touching points: t = -K_b (share u + past) limited to |t| <= mu f, u = u_free + A_hz (f -
    f_static) + A_hh t. With a tread that shears (contact.tread.shear), A includes its part; its
    rubber is then in series with the bristles or, with K_b infinite, alone. While the same points
    touch and stick this is block Gauss-Seidel on a positive definite problem and converges; with
    slip convergence is certain for mu ||A_zz^-1 A_zh|| < 1, where the solution is unique too.
    Without a friction coefficient there may be no solution: a point at the edge may bear a force
    that lifts it off the road, where it bears none. In such a step its bristle bears none.
    """

    def __init__(
        self,
        brush: Brush,
        tire: Array,
        weights: sparse.csr_matrix | None,
        shear: Shear | None = None,
        pressed: Array | None = None,
        tolerance: float = TOLERANCE,
    ) -> None:
        p = len(tire) // 3
        w = sparse.identity(p, format="csr") if weights is None else weights
        self._brush, self._shear, self._pressed = brush, shear, pressed
        self._tolerance = tolerance
        # Forces and displacements in the plane are x + iy: x and y of each node adjacent.
        beside = np.arange(2 * p).reshape(2, p).T.ravel() + p
        self._w, self._down = w, w.T.tocsr()
        self._plane, self._down_plane = w.astype(complex), self._down.astype(complex)
        self._zh, self._hz = LoadedColumns(tire[:p, beside]), LoadedColumns(tire[beside, :p])
        self._carcass = Carcass(tire[np.ix_(beside, beside)], weights)
        self._soft = float(np.mean(1.0 / np.asarray(brush.law.stiffness)))
        self.horizontal = self._before = np.zeros((w.shape[0], 2))
        self.turns = 0

    def largest_unique(self, touching: NDArray[np.bool_], normal: ContactSolver) -> float:
        """Largest friction coefficient with a unique solution, with these points touching."""
        index = np.flatnonzero(touching)
        own, w = normal.block(index), self._w[index]
        lifted = np.hstack([w @ (w @ self._zh.columns[part::2]).T for part in (0, 1)])
        if self._shear is not None and self._shear.coupled:
            lifted = lifted + self._shear.lifted(index)
        coupling = np.linalg.solve(own, lifted)
        return 1.0 / max(float(np.linalg.norm(coupling, 2)), 1e-300)

    def state(self) -> dict[str, Array]:
        """The state that a checkpoint keeps."""
        kept = {"horizontal": self.horizontal, "horizontal_before": self._before}
        return self._brush.state() | kept

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from `state`."""
        self.horizontal, self._before = state["horizontal"], state["horizontal_before"]
        self._brush.set_state(state)

    def solve(
        self, normal: ContactSolver, q: Array, guess: Mask | None, static: Array, free: Array
    ) -> tuple[Array, Array]:
        """Normal (c,) and horizontal (c, 2) forces, N; `free` (2c,) m, x then y.

        In each turn the normal forces are exact for the horizontal ones, which one Newton step
        improves; after `FLAT` turns stick and slip are solved in each. ConvergenceError after 100
        turns without convergence.
        """
        bristles = self._brush.offer()
        horizontal = 2.0 * self.horizontal - self._before  # linear extrapolation saves a turn
        lifts, mixing = _Lifting(self._brush.law.friction is None), _Mixing()
        for self.turns in range(1, TURNS + 1):
            force = normal.solve(q + self._lift(horizontal), guess, reference=static)
            guess = None
            moved = free.reshape(2, -1).T + self._pushed(force, static)
            bearing = lifts.bearing(force, self.turns)
            index, problem = self._sticking(bearing, moved, bristles)
            off = problem.begin(horizontal[index])
            found = np.zeros_like(horizontal)
            found[index] = problem.forces
            # What the bounds have cut off still acted on the normal forces.
            cut = float(np.abs(found - horizontal).max())
            if max(off, cut) <= self._tolerance * problem.largest:
                self._finish(force, moved, found)
                return force, found
            found[index] = problem.improved() if self.turns <= FLAT else problem.solved()
            horizontal = mixing.next(horizontal, found)
        raise self._unsolved()

    def _unsolved(self) -> ConvergenceError:
        unbounded = self._brush.law.friction is None
        key = (
            "give contact.friction, which bounds them," if unbounded else "lower contact.friction,"
        )
        return ConvergenceError(
            f"contact: normal and horizontal forces do not converge in {TURNS} iterations; the horizontal forces "
            f"are too large for this step: {key} the brush's stiffness or time.step"
        )

    def _lift(self, horizontal: Array) -> Array:
        """A_zh t (c,) m for t (c, 2) N."""
        plane = _complex(horizontal)
        lifted = self._w @ (self._zh @ (self._down_plane @ plane).view(float))
        if self._shear is not None and self._shear.coupled:
            lifted += self._shear.lift(plane)
        return lifted

    def _pushed(self, force: Array, static: Array) -> Array:
        """A_hz (f - f_static) (c, 2) m for f (c,) N."""
        moved = self._plane @ (self._hz @ (self._down @ (force - static))).view(complex)
        if self._shear is not None and self._shear.coupled:
            before = static if self._pressed is None else self._pressed
            moved += self._shear.drag(force - before)
        return _real(moved)

    def _finish(self, force: Array, moved: Array, horizontal: Array) -> None:
        plane = _complex(horizontal)
        answer = self._carcass(plane)
        if self._shear is not None:
            answer = answer + self._shear.spread(plane)
        self._before, self.horizontal = self.horizontal, horizontal
        self._brush.take(horizontal, moved + _real(answer), force > 0)

    def _sticking(
        self, force: Array, moved: Array, bristles: tuple[Array, Array]
    ) -> tuple[Index, StickSlip]:
        """The points (a,) whose bristles bear, and their problem: B t + c = 0, or slip.

        B = A_hh + 1/(K share), c = u_other + past/share.
        """
        share, past = bristles
        law = self._brush.law
        index = np.flatnonzero((force > 0) & (share > 1e-9))
        springs = np.broadcast_to(law.stiffness, share.shape)[index] * share[index]
        tread = None
        if self._shear is not None and len(index):
            tread = self._shear.between(index, self._soft)
        stiffness = SlidingStiffness(self._carcass.between(index), 1.0 / springs, tread)
        constant = moved[index] + past[index] / share[index, None]
        bound = np.full(len(index), np.inf)
        if law.friction is not None:
            bound = law.friction * force[index]
        return index, StickSlip(stiffness, constant, bound)


class _Mixing:
    """Anderson's acceleration of x = G(x) (J. ACM 12 (1965) 547): the next x from the last few.

    The combination of the last results whose residuals G(x) - x cancel best. It starts anew where a residual has
    grown, as when points come and go.
    """

    def __init__(self) -> None:
        self._results: list[Array] = []
        self._residuals: list[Array] = []

    def next(self, given: Array, result: Array) -> Array:
        """The next x, from `given` x and `result` G(x)."""
        residual = result - given
        if self._residuals and np.abs(residual).max() > np.abs(self._residuals[-1]).max():
            self._results, self._residuals = [], []
        self._results, self._residuals = (
            [*held, new][-MIXED:]
            for held, new in ((self._results, result), (self._residuals, residual))
        )
        if len(self._residuals) < 2:
            return result
        apart = np.array([(residual - other).ravel() for other in self._residuals[:-1]])
        shares = np.linalg.lstsq(apart.T, residual.ravel(), rcond=1e-10)[0]
        steps = (result - other for other in self._results[:-1])
        return result - sum(share * step for share, step in zip(shares, steps, strict=True))


class _Lifting:
    """Points whose own bristle lifts them off the road, where nothing else bounds its force."""

    def __init__(self, unbounded: bool) -> None:
        self._unbounded = unbounded
        self._before: Mask | None = None
        self._lifted: Mask | bool = False

    def bearing(self, force: Array, turn: int) -> Array:
        """The normal forces (c,) N, zero where the bristles bear none."""
        if not self._unbounded:
            return force
        touching = force > 0
        if turn > PATIENCE and self._before is not None:
            self._lifted = self._lifted | (touching != self._before)
        self._before = touching
        return np.where(self._lifted, 0.0, force)


def _complex(plane: Array) -> NDArray[np.complex128]:
    """(c, 2) as x + iy."""
    return np.ascontiguousarray(plane).view(complex)[:, 0]


def _real(plane: NDArray[np.complex128]) -> Array:
    """x + iy as (c, 2)."""
    return np.ascontiguousarray(plane).view(float).reshape(-1, 2)
