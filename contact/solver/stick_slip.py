"""Contact with friction: normal and tangential forces in turn, sticking and sliding points.

GMRES (generalised minimal residual method) for a few hundred unknowns, without restarts.

Stick and slip under given normal forces: minimise t.B t/2 + c.t with |t_i| <= b_i at each point.

t_i lies in the plane of the road. Where |t_i| < b_i, (B t + c)_i = 0 and the point sticks; where
|t_i| = b_i, (B t + c)_i = -lambda_i t_i, lambda_i >= 0, and it slips against its force. The
solution is unique if the symmetric part of B is positive definite.

One step with horizontal forces: the normal and the tangential problem in turn, until both hold.

Normal: f >= 0, g = A_zz (f - f_static) + A_zh t + q >= 0, f . g = 0. Tangential, at the touching
points: t = -K_b (share u + past) limited to |t| <= mu f, u = u_free + A_hz (f - f_static) + A_hh t.
With a tread that shears (contact.tread.shear), A includes its part; its rubber is then in series
with the bristles or, with K_b infinite, alone. While the same points touch and stick this is block
Gauss-Seidel on a positive definite problem and converges; with slip convergence is certain for
mu ||A_zz^-1 A_zh|| < 1, where the solution is unique too. Without a friction coefficient there may
be no solution: a point at the edge may bear a force that lifts it off the road, where it bears
none. In such a step its bristle bears none.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

from tireroad.contact.solver.conditions import ContactSolver, Mask
from tireroad.contact.tread.brush import Brush
from tireroad.contact.tread.shear import Between, Shear
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.recursion import LoadedColumns

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


Plane = NDArray[np.complex128]

NEWTON_STEPS = 30
GRADIENT_STEPS = 5000
SLIDING_TOLERANCE = 1e-10  # of the largest bound, or of the largest force where nothing is bounded
INNER = 1e-2  # residual reduction in a Newton step; the slipping points are not known any better


class Carcass:
    """W A W^T between points: `matrix` A (2n, 2n) m/N, x and y of each node adjacent.

    `weights` W (a, n) from nodes to points, None where they are the same. `own` (a,) m/N: compliance of
    each point, the mean of both directions.
    """

    def __init__(self, matrix: Array, weights: sparse.csr_matrix | None = None) -> None:
        self._matrix, self._weights = matrix, weights
        if weights is None:
            self.own = matrix.diagonal().reshape(-1, 2).mean(axis=1)
            return
        self._down = weights.T.tocsr()
        mean = 0.5 * (matrix[::2, ::2] + matrix[1::2, 1::2])
        self.own = np.asarray(weights.multiply(weights @ mean).sum(axis=1)).ravel()

    def __call__(self, force: Plane) -> Plane:
        """Displacements (a,) m of forces (a,) N."""
        if self._weights is None:
            return (self._matrix @ force.view(float)).view(complex)
        nodal = self._down @ force.view(float).reshape(-1, 2)
        moved = self._weights @ (self._matrix @ nodal.ravel()).reshape(-1, 2)
        return moved.view(complex)[:, 0]

    def norm(self) -> float:
        """An upper bound of the largest singular value, m/N."""
        largest = float(np.linalg.norm(self._matrix, 2))
        if self._weights is not None:
            largest *= float(np.linalg.norm(self._weights.toarray(), 2)) ** 2
        return largest


class Stiffness:
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

    def norm(self) -> float:
        """An upper bound of the largest singular value, m/N."""
        largest = self._carcass.norm() + float(self._spring.max())
        return largest + (self._tread.bound if self._tread else 0.0)


def stick_slip(
    stiffness: Stiffness,
    constant: Array,
    bound: Array,
    guess: Array,
    within: float = SLIDING_TOLERANCE,
) -> Array:
    """Tangential forces t (a, 2) N.

    `stiffness` B, `constant` c (a, 2) m, `bound` (a,) N, infinite where nothing slips, `guess`
    (a, 2). Semismooth Newton on t = P_b(t - r (B t + c)), P_b the projection on the discs (Alart
    and Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353), r the inverse of B's diagonal. Its
    linear problems are close to the identity if the bristles are softer than the tire, and GMRES
    solves them in a few products with B. If Newton cycles, projected gradients follow: slow but
    safe for symmetric B. The residual is below `within` of the forces, or ConvergenceError is
    raised.
    """
    begin, moved = (np.ascontiguousarray(a).view(complex)[:, 0] for a in (guess, constant))
    force = _onto_discs(begin, bound)
    for _ in range(NEWTON_STEPS):
        trial = force - stiffness.inverse * (stiffness(force) + moved)
        residual = force - _onto_discs(trial, bound)
        if _small(residual, force, bound, within):
            return _onto_discs(force, bound).view(float).reshape(-1, 2)
        force = force + _newton(stiffness, trial, bound, residual)
    return _gradients(stiffness, moved, bound, begin).view(float).reshape(-1, 2)


def _newton(stiffness: Stiffness, trial: Plane, bound: Array, residual: Plane) -> Plane:
    """The step d of semismooth Newton: d + P' (r B d - d) = -residual."""
    length = np.abs(trial)
    slips = length > bound
    # Derivative P' of the projection: the identity where a point sticks, else b/|t| (I - n n^T).
    long = np.where(slips, length, 1.0)
    normal, share = np.where(slips, trial, 0.0) / long, np.where(slips, bound, 1.0) / long

    def apply(flat: Array) -> Array:
        step = flat.view(complex)
        moved = stiffness.inverse * stiffness(step) - step
        moved -= normal * (normal.real * moved.real + normal.imag * moved.imag)
        return (step + share * moved).view(float)

    return gmres(apply, -residual.view(float), INNER).view(complex)


def _gradients(stiffness: Stiffness, constant: Plane, bound: Array, guess: Plane) -> Plane:
    """Projected gradients with Nesterov's momentum, restarted where it points uphill."""
    step = 1.0 / stiffness.norm()
    force = ahead = _onto_discs(guess, bound)
    weight = 1.0
    for _ in range(GRADIENT_STEPS):
        new = _onto_discs(ahead - step * (stiffness(ahead) + constant), bound)
        if _small((new - ahead) * stiffness.inverse / step, new, bound):
            return new
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


def _small(residual: Plane, force: Plane, bound: Array, within: float = SLIDING_TOLERANCE) -> bool:
    largest = float(bound.max(initial=0.0))
    scale = max(largest if np.isfinite(largest) else 0.0, float(np.abs(force).max(initial=0.0)))
    return bool(np.abs(residual).max(initial=0.0) <= within * scale)


TURNS = 100
MIXED = 4  # results from which the next one is extrapolated
PATIENCE = 10  # turns after which a point that still comes and goes is lifted off by its bristle
TOLERANCE = 1e-6  # change in an iteration, relative to the largest normal force
# Accuracy of stick and slip in the first iteration, in later ones relative to the last change, and
# the finest.
ROUGHLY, CLOSER, EXACTLY = 1e-5, 1e-1, 1e-10


class Friction:
    """The brush on a tire with same-step response `tire` (3p, 3p) m/N in z, x, y of the nodes.

    `weights` W (c, p) interpolates from nodes to points (None: they are the same). `shear` of the
    tread, None: rigid in shear; `pressed` (c,) N: normal forces relative to which pressure shears
    it, None: the static ones. `horizontal` (c, 2) N is the last solution, `turns` its number of
    iterations.
    """

    def __init__(
        self,
        brush: Brush,
        tire: Array,
        weights: sparse.csr_matrix | None,
        shear: Shear | None = None,
        pressed: Array | None = None,
    ) -> None:
        p = len(tire) // 3
        self._nodal = weights is None
        w = sparse.identity(p, format="csr") if weights is None else weights
        self._brush, self._shear, self._pressed = brush, shear, pressed
        self._w, self._w2 = w, sparse.block_diag([w, w], format="csr")
        self._down, self._down2 = self._w.T.tocsr(), self._w2.T.tocsr()
        self._zh, self._hz = LoadedColumns(tire[:p, p:]), LoadedColumns(tire[p:, :p])
        self._hh = LoadedColumns(tire[p:, p:])
        self.horizontal = self._before = np.zeros((w.shape[0], 2))
        self.turns = 0
        self._key = b""

    def largest_unique(self, touching: NDArray[np.bool_], normal: ContactSolver) -> float:
        """Largest friction coefficient with a unique solution, with these points touching."""
        index = np.flatnonzero(touching)
        count = len(touching)
        own = normal.block(index)
        w, w2 = self._w[index], self._w2[np.concatenate([index, index + count])]
        lifted = w @ (w2 @ self._zh.columns).T
        if self._shear is not None and self._shear.coupled:
            lifted = lifted + self._shear.lifted(index)
        coupling = np.linalg.solve(own, lifted)
        return 1.0 / max(float(np.linalg.norm(coupling, 2)), 1e-300)

    def state(self) -> dict[str, Array]:
        """The state that a checkpoint keeps."""
        kept = {"horizontal": self.horizontal, "horizontal_before": self._before}
        return self._brush.state() | kept

    def set_state(self, kept: dict[str, Array]) -> None:
        """Continue from `state`."""
        self.horizontal, self._before = kept["horizontal"], kept["horizontal_before"]
        self._brush.set_state(kept)

    def solve(
        self, normal: ContactSolver, q: Array, guess: Mask | None, static: Array, free: Array
    ) -> tuple[Array, Array]:
        """Normal (c,) and horizontal (c, 2) forces, N; `free` (2c,) m, x then y.

        ConvergenceError after 100 iterations without convergence.
        """
        share, past = self._brush.offer()
        horizontal = 2.0 * self.horizontal - self._before  # linear extrapolation saves an iteration
        within, lifts = ROUGHLY, _Lifting(self._brush.law.friction is None)
        mixing = _Mixing()
        for self.turns in range(1, TURNS + 1):
            force = normal.solve(q + self._lift(horizontal), guess, reference=static)
            guess = None
            moved = free.reshape(2, -1).T + self._pushed(force, static)
            bearing = lifts.bearing(force, self.turns)
            new = self._stick_slip(bearing, moved, (share, past), horizontal, within)
            change, largest = np.abs(new - horizontal).max(), force.max(initial=0.0)
            found, horizontal = new, mixing.next(horizontal, new)
            # A guess within a coarse tolerance changes nothing; only an accurate solution proves
            # convergence.
            close = within <= 0.1 * TOLERANCE
            within = max(min(within, CLOSER * change / max(largest, 1e-300)), EXACTLY)
            if close and change <= TOLERANCE * largest:
                self._finish(force, moved, found)
                return force, found
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
        lifted = self._w @ (self._zh @ (self._down2 @ horizontal.T.ravel()))
        if self._shear is not None and self._shear.coupled:
            lifted += self._shear.lift(_complex(horizontal))
        return lifted

    def _pushed(self, force: Array, static: Array) -> Array:
        """A_hz (f - f_static) (c, 2) m for f (c,) N."""
        pushed = self._w2 @ (self._hz @ (self._down @ (force - static)))
        moved = pushed.reshape(2, -1).T
        if self._shear is not None and self._shear.coupled:
            before = static if self._pressed is None else self._pressed
            moved = moved + _real(self._shear.drag(force - before))
        return moved

    def _finish(self, force: Array, moved: Array, horizontal: Array) -> None:
        answer = self._w2 @ (self._hh @ (self._down2 @ horizontal.T.ravel()))
        moved = moved + answer.reshape(2, -1).T
        if self._shear is not None:
            moved = moved + _real(self._shear.spread(_complex(horizontal)))
        self._before, self.horizontal = self.horizontal, horizontal
        self._brush.take(horizontal, moved, force > 0)

    def _stick_slip(
        self,
        force: Array,
        moved: Array,
        bristles: tuple[Array, Array],
        guess: Array,
        within: float,
    ) -> Array:
        """Tangential forces t (c, 2): B t + c = 0, or slip, to `within` of stick_slip.

        B = A_hh + 1/(K share), c = u_other + past/share.
        """
        share, past = bristles
        law = self._brush.law
        out = np.zeros((len(force), 2))
        index = np.flatnonzero((force > 0) & (share > 1e-9))
        if len(index) == 0:
            return out
        springs = np.broadcast_to(law.stiffness, share.shape)[index] * share[index]
        carcass, tread = self._between(index)
        stiffness = Stiffness(carcass, 1.0 / springs, tread)
        constant = moved[index] + past[index] / share[index, None]
        bound = np.full(len(index), np.inf)
        if law.friction is not None:
            bound = law.friction * force[index]
        out[index] = stick_slip(stiffness, constant, bound, guess[index], within)
        return out

    def _between(self, index: NDArray[np.intp]) -> tuple[Carcass, Between | None]:
        """The parts of B between the points: of the nodes that carry them, and of the tread."""
        key = index.tobytes()
        if key != self._key:
            own, p = self._w[index], self._w.shape[1]
            nodes = np.unique(own.indices)
            both = np.stack([nodes, nodes + p], axis=-1).ravel()
            carcass = Carcass(self._hh.between(both, both), None if self._nodal else own[:, nodes])
            tread = None if self._shear is None else self._shear.between(index)
            self._carried, self._key = (carcass, tread), key
        return self._carried


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
