"""Contact with friction: normal and tangential forces in turn, sticking and sliding points."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from tireroad.contact.choices import DENSE_POINTS
from tireroad.contact.solver.active_set import COMPILED, ActiveSet, UsualSet, array, guarded
from tireroad.contact.solver.conditions import Array, ContactSolver, Mask, check_residual
from tireroad.contact.tread.brush import Brush
from tireroad.contact.tread.shear import Shear
from tireroad.fem.errors import ConvergenceError

_C, _FFI = COMPILED.lib, COMPILED.ffi

SLIDING_TOLERANCE = 1e-10  # of the largest bound, or of the largest force where nothing is bounded
TURNS = int(_C.TURNS)
# Residual of the horizontal forces under the normal ones, relative to the largest bound. On a rough road under a passenger
# tire at mu = 1 the axle forces in third octaves from 31 to 630 Hz are then within 0.02 dB of those at 1e-8.
# Beside it, a step leaves at most 3 % of the residual it begins with, down to 1e-6 of that bound.
TOLERANCE = 1e-3


class CompressedRows:
    """A sparse matrix for the kernel: where its rows begin, columns and values."""

    def __init__(self, matrix: sparse.spmatrix) -> None:
        rows = sparse.csr_matrix(matrix)
        rows.sort_indices()
        self.begin, self.column = (
            COMPILED.ints(part.astype(np.int32)) for part in (rows.indptr, rows.indices)
        )
        self.value = COMPILED.doubles(rows.data.astype(float))

    def named(self, prefix: str) -> dict[str, Any]:
        """The three as members of a structure whose names begin so."""
        return {prefix + name: values for name, values in vars(self).items()}


class PlaneCompliance:
    """Displacements of c points under forces in the plane of the road: W A W^T of the tire, and the tread's.

    `tire` m/N between nodes, (2p, 2p) in x, then y, or (3p, 3p) of three `components`, in z before; `weights` W (c, p) from
    nodes to points (None: they are the same); `shear` of the tread, None: rigid. `own` (c,) m/N:
    compliance of each point, the mean of both directions; `bound` m/N of the largest singular value.
    """

    def __init__(
        self,
        tire: Array,
        weights: sparse.csr_matrix | None = None,
        shear: Shear | None = None,
        components: int = 2,
    ) -> None:
        self.tire, self.shear = tire, shear
        p = len(tire) // components
        self.weights = sparse.identity(p, format="csr") if weights is None else weights.tocsr()
        first = len(tire) - 2 * p
        beside = tire[first:, first:]
        mean = 0.5 * (beside[:p, :p] + beside[p:, p:])
        w = self.weights
        self.own = np.asarray(w.multiply(w @ mean).sum(axis=1)).ravel()
        if shear is not None:
            self.own = self.own + shear.own
        self._bound: float | None = None
        c, p = w.shape
        up, down = CompressedRows(w), CompressedRows(w.T)
        self._held: dict[str, Any] = {
            "points": c, "nodes": p, "hh": COMPILED.doubles(np.ascontiguousarray(beside.T)),
        } | up.named("w_") | down.named("t_")  # fmt: skip
        if first:
            self._held["zh"] = COMPILED.doubles(np.ascontiguousarray(tire[:p, p:].T))
            self._held["hz"] = COMPILED.doubles(np.ascontiguousarray(tire[p:, :p].T))
        if shear is not None:
            self._held |= shear.compiled(COMPILED)
        if first and c <= DENSE_POINTS:
            lift, beside = self._dense(first)
            self._held |= {"lift": COMPILED.doubles(lift), "beside": COMPILED.doubles(beside)}
        self.compiled = _FFI.new("plane *", self._held)
        _C.plane_begin(self.compiled)
        self._freed = _FFI.gc(self.compiled, _C.plane_end)

    def _dense(self, first: int) -> tuple[Array, Array]:
        """A_zt (2c, c) and [A_tz A_tt] (3c, 2c) between the points, by columns."""
        w, c = self.weights, self.weights.shape[0]

        def between(rows: slice, columns: slice) -> Array:
            block = self.tire[rows, columns]
            parts = [[w @ (w @ part.T).T for part in np.split(row, row.shape[1] // first, axis=1)]
                     for row in np.split(block, len(block) // first)]  # fmt: skip
            return np.block(parts)

        down, beside = slice(0, first), slice(first, None)
        lift, drag, plane = between(down, beside), between(beside, down), between(beside, beside)
        if self.shear is not None:
            every = np.arange(c)
            plane += self.shear.matrix(every)
            if self.shear.coupled:
                lifted = self.shear.lifted(every)
                lift += lifted
                drag += lifted.T
        return np.ascontiguousarray(lift.T), np.ascontiguousarray(np.hstack([drag, plane]).T)

    def drag(self, force: Array, pressed: Array) -> Array:
        """Displacements (2, c) m in the plane: the tire's under normal forces `force` and the tread's under
        `pressed` (c,) N."""
        return self._moved(_C.plane_drag, force, pressed)

    def sheared(self, force: Array) -> Array:
        """Displacements (2, c) m in the plane under forces (2, c) N in it."""
        return self._moved(_C.plane_shear, force)

    def _moved(self, kernel: Any, *forces: Array) -> Array:
        c = self.weights.shape[0]
        moved, every = np.empty((2, c)), np.arange(c, dtype=np.int32)
        held = [np.ascontiguousarray(each, float) for each in forces]
        given = *map(COMPILED.doubles, held), c, COMPILED.ints(every)
        kernel(self.compiled, *given, COMPILED.doubles(moved))
        return moved

    def precondition(self, spring: float) -> None:
        """Let Newton steps use the inverse of the tread in series with springs (m/N), where it is a grid."""
        if self.shear is not None:
            found = self.shear.inverse(COMPILED, spring)
            self._held |= found
            for name, value in found.items():
                setattr(self.compiled, name, value)

    @property
    def bound(self) -> float:
        """An upper bound of the largest singular value, m/N."""
        if self._bound is None:
            count = 2 * self.weights.shape[1]
            beside = self.tire[-count:, -count:]
            size = np.sqrt(np.linalg.norm(beside, 1) * np.linalg.norm(beside, np.inf))
            spread = sparse.linalg.norm(self.weights, 1) * sparse.linalg.norm(self.weights, np.inf)
            self._bound = float(size * spread) + (
                self.shear.bound if self.shear is not None else 0.0
            )
        return self._bound


def stick_slip(
    compliance: PlaneCompliance,
    constant: Array,
    bound: Array,
    guess: Array,
    spring: float | Array = 0.0,
) -> Array:
    """Tangential forces t (c, 2) N: B t + c = 0 within the bounds, against the slip on them, to 1e-10 of the largest.

    B is the `compliance` plus a `spring` (m/N, or (c,)) in series with each point, `constant` c (c, 2) m,
    `bound` (c,) N, infinite where nothing slips; from a `guess` (c, 2) N. That is, minimise t.B t/2 + c.t with
    |t_i| <= b_i at each point. Where |t_i| < b_i, (B t + c)_i = 0 and the point sticks; where |t_i| = b_i,
    (B t + c)_i = -lambda_i t_i, lambda_i >= 0, and it slips against its force. The solution is unique if the
    symmetric part of B is positive definite.

    Semismooth Newton on t = P_b(t - r (B t + c)), P_b the projection on the discs (Alart and Curnier, Comput.
    Methods Appl. Mech. Eng. 92 (1991) 353), r the inverse of B's diagonal; its linear problems by GMRES. If
    Newton cycles, projected gradients follow, slow but safe for symmetric B. ConvergenceError if they fail.
    """
    count = len(bound)
    springs = np.ascontiguousarray(np.broadcast_to(np.asarray(spring, float), count))
    force = np.ascontiguousarray(np.asarray(guess, float).T)
    given = {
        "spring": springs, "inverse": 1.0 / (compliance.own + springs),
        "constant": np.ascontiguousarray(np.asarray(constant, float).T),
        "bound": np.ascontiguousarray(bound, dtype=float), "force": force,
    }  # fmt: skip
    held = {name: COMPILED.doubles(values) for name, values in given.items()}
    held["index"] = COMPILED.ints(np.arange(count, dtype=np.int32))
    norm = compliance.bound + float(springs.max(initial=0.0))
    problem = _FFI.new(
        "stick_slip *", held | {"compliance": compliance.compiled, "count": count, "norm": norm}
    )
    if _C.stick_slip_solve(problem, SLIDING_TOLERANCE):
        raise ConvergenceError(
            "contact: no equilibrium of stick and slip was found; take a smaller [time] step, a smaller friction "
            "or a softer brush"
        )
    return force.T.copy()


class BrushFriction:
    """The brush on a tire with same-step response `tire` (3p, 3p) m/N in z, x, y of the nodes.

    `weights` W (c, p) interpolates from nodes to points (None: they are the same). `shear` of the
    tread, None: rigid in shear; `pressed` (c,) N: normal forces relative to which pressure shears
    it, None: the static ones. `tolerance`: residual of stick and slip relative to the largest
    bound, or to the largest force where nothing is bounded. `horizontal` (c, 2) N is the last
    solution, `turns` its number of iterations.

    Normal: f >= 0, g = A_zz (f - f_static) + A_zh t + q >= 0, f . g = 0. Tangential, at the
    touching points: t = -K_b (u + past) limited to |t| <= mu f, u = u_free + A_hz (f -
    f_static) + A_hh t. With a tread that shears (contact.tread.shear), A includes its part; its
    rubber is then in series with the bristles or, with K_b infinite, alone.

    In each turn the normal forces are exact for the horizontal ones, which one semismooth Newton step improves; in the
    first turns the normal forces, and the bounds with them, follow in that step while the same points touch. Its linear
    problem is solved to a tenth by GMRES, with the inverse of the endless tread, a few cells wide, as preconditioner.
    Where the residual does not fall, fewer points are taken for slipping (a smaller r in the projection): displacements of
    the whole footprint are a thousand times those of one point under its own force. Where that is not enough, stick and
    slip are solved in each turn, and Anderson's acceleration (J. ACM 12 (1965) 547) combines the last four results: block
    Gauss-Seidel, which converges while the same points touch and stick; with slip for mu ||A_zz^-1 A_zh|| < 1, where the
    solution is unique too. Turns begin with a linear extrapolation of the last two steps.
    A step may have no solution beyond mu ||A_zz^-1 A_zh|| = 1: after 40 turns normal forces take the horizontal ones of the step
    before and stick and slip these normal forces, which both have a solution (`lagging` counts such steps).
    Without a friction coefficient there may be no solution: a point at the edge may bear a force
    that lifts it off the road, where it bears none. In such a step its bristle bears none. Compiled (contact.c).
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
        self._brush = brush
        self._plane = plane = PlaneCompliance(tire, weights, shear, 3)
        plane.precondition(float(np.mean(1.0 / np.asarray(brush.law.stiffness))))
        c = plane.weights.shape[0]
        self._horizontal, self._before = np.zeros((2, c)), np.zeros((2, c))
        self._kept = self._before.copy(), self._horizontal.copy()  # before the last step
        self._touched = brush.touched
        law = brush.law
        rows = brush.rows
        self._slip = np.broadcast_to(brush.slip, (c, 2)).T.copy()
        doubles = {
            "stiffness": np.ascontiguousarray(np.broadcast_to(np.asarray(law.stiffness, float), c)),
            "slip": self._slip, "own": plane.own,
            "deflection": brush.deflected, "moved": brush.moved, "tip": brush.tip,
            "along": rows.along, "entry": rows.entry, "weight": rows.weight,
            "horizontal": self._horizontal, "before": self._before,
        }  # fmt: skip
        self.shear, self.pressed, self.own, self._dragged = (
            shear,
            pressed,
            plane.own,
            np.zeros((2, c)),
        )
        self.unbounded, self.coefficient = law.friction is None, law.friction
        self.stiffness = doubles["stiffness"]
        self._static: Array | None = None
        self._another: tuple[ContactSolver, tuple[Any, ...], list[BaseException]] | None = None
        doubles["dragged"] = self._dragged
        self._held: dict[str, Any] = {
            name: COMPILED.doubles(values) for name, values in doubles.items()
        }
        self._held |= {
            "compliance": plane.compiled, "spring_kind": law.kind == "spring", "tolerance": tolerance,
            "friction": -1.0 if law.friction is None else law.friction, "norm": plane.bound,
            "lines": len(rows.line) - 1, "shift": rows.shift, "every": rows.every, "waited": COMPILED.ints(brush.waited),
            "touched": COMPILED.flags(self._touched), "slid": COMPILED.flags(brush.slid),
        }  # fmt: skip
        numbers = {"ahead": brush.ahead, "line": rows.line, "cell": rows.cell, "beside": rows.beside,
                   "first": rows.first, "foremost": rows.foremost, "stands": brush.stands}  # fmt: skip
        self._held |= {name: COMPILED.ints(values) for name, values in numbers.items()}
        self.compiled = _FFI.new("brush *", self._held)
        _C.brush_begin(self.compiled)
        self._freed = _FFI.gc(self.compiled, _C.brush_end)

    def creep(self, slip: Array | tuple[float, float]) -> None:
        """Set the slip (s_x, s_y), or (c, 2) at the points, of the steps to come (contact.tread.brush)."""
        way = self._brush.way * np.array([-1.0, 1.0])
        self._slip[:] = np.broadcast_to(way * np.asarray(slip), self._slip.T.shape).T

    @property
    def horizontal(self) -> Array:
        """The last solution (c, 2) N."""
        return self._horizontal.T.copy()

    @property
    def turns(self) -> int:
        """Turns that the last solution took."""
        return int(self.compiled.turns)

    @property
    def lagging(self) -> int:
        """Number of steps so far in which normal and horizontal forces each took the other's of the step before."""
        return int(self.compiled.lagged)

    def begin(self, again: bool) -> tuple[Mask, Array]:
        """Begin a step, before which bristles move on, or the last one once more, from the forces before it: the points (c,) whose
        bristles bear, and past (2, c) m of their deflections u + past at its end (contact.tread.brush)."""
        if again:
            self._before[:], self._horizontal[:] = self._kept
        else:
            self._kept = self._before.copy(), self._horizontal.copy()
            _C.brush_travel(self.compiled)
        bears, past = np.empty(len(self._touched), bool), np.empty((2, len(self._touched)))
        _C.brush_offer(self.compiled, COMPILED.flags(bears), COMPILED.doubles(past))
        return bears, past

    def carried(self, force: Array) -> Array:
        """Forces (3, c) N where a step has carried the road that they are of."""
        return np.ascontiguousarray((self._brush.upstream @ force.T).T)

    def limit(self, first: float, most: float) -> float:
        """Residual (N) that a step may leave, of its `first` one (N) and the `most` (N) that a point may bear."""
        return float(_C.brush_limit(self.compiled, first, most))

    def advance(self, force: Array, moved: Array, lags: bool) -> None:
        """End the step with forces (3, c) N, z, x, y, and bases of bristles `moved` (2, c) m; whether normal and horizontal forces
        have each `lags` behind the other. ConvergenceError after 40 such steps in a row."""
        self.compiled.lagged += lags
        self.compiled.streak = self.compiled.streak + 1 if lags else 0
        if self.compiled.streak > _C.LAGS:
            raise self.unsolved()
        self._before[:], self._horizontal[:] = self._horizontal, force[1:]
        self._brush.moved[:] = moved
        normal, plane = COMPILED.doubles(force[0]), COMPILED.doubles(force[1:])
        _C.brush_conclude(self.compiled, normal, plane)

    def largest_unique(self, touching: Mask, normal: ContactSolver) -> float:
        """Largest friction coefficient with a unique solution, with these points touching."""
        index, plane = np.flatnonzero(touching), self._plane
        if not len(index):
            return np.inf
        own, w = normal.block(index), plane.weights[index]
        p = w.shape[1]
        zh = plane.tire[:p, p:]
        lifted = np.hstack([w @ (w @ part.T).T for part in (zh[:, :p], zh[:, p:])])
        if plane.shear is not None and plane.shear.coupled:
            lifted = lifted + plane.shear.lifted(index)
        coupling = np.linalg.solve(own, lifted)
        return 1.0 / max(float(np.linalg.norm(coupling, 2)), 1e-300)

    def state(self) -> dict[str, Array]:
        """The state that a checkpoint keeps; the order of points `held` decides how sums are rounded."""
        held = np.empty(len(self._touched), np.int32)
        held = held[: _C.plane_held(self._plane.compiled, COMPILED.ints(held))]
        kept = {
            "horizontal": self.horizontal,
            "horizontal_before": self._before.T.copy(),
            "held": held,
            "lagging": np.array([self.compiled.lagged, self.compiled.streak]),
        }
        return self._brush.state() | kept

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from `state`."""
        self._horizontal[:], self._before[:] = state["horizontal"].T, state["horizontal_before"].T
        self._brush.set_state(state)
        self.compiled.lagged, self.compiled.streak = state["lagging"].tolist()
        held = np.ascontiguousarray(state["held"], np.int32)
        _C.plane_hold(self._plane.compiled, len(held), COMPILED.ints(held))

    def solve(
        self,
        normal: ContactSolver,
        q: Array,
        guess: Mask | None,
        static: Array,
        free: Array,
        again: bool = False,
        rough: bool = False,
    ) -> tuple[Array, Array]:
        """Normal (c,) and horizontal (c, 2) forces, N, the latter until the next call; `free` (2c,) m, x then y.

        `guess`: the points that touch, by default those of the last step; `again`: the last step is solved once more, from
        the state of the bristles before it; `rough`: by one turn, as a guess. After 40 turns without convergence the step is
        split; ConvergenceError after 40 such steps in a row, or where nothing bounds the horizontal forces.
        """
        if static is not self._static:
            self._static = static
            self._dragged[:] = self._plane.drag(
                static, static if self.pressed is None else self.pressed
            )
        if isinstance(normal, UsualSet):
            guess = normal.begin(q, guess, static)
        given = (
            COMPILED.doubles(np.ascontiguousarray(q)),
            _FFI.NULL if guess is None else COMPILED.flags(np.ascontiguousarray(guess, dtype=bool)),
            COMPILED.doubles(np.ascontiguousarray(static)), COMPILED.doubles(np.ascontiguousarray(free)),
        )  # fmt: skip
        force = np.empty(len(q))
        self.compiled.again, self.compiled.rough = again, rough
        contact, raised = self._contact(normal)
        failed = _C.brush_solve(self.compiled, contact, *given, COMPILED.doubles(force))
        if raised:
            raise raised.pop()
        if failed == _C.UNSOLVED:
            raise self.unsolved()
        if isinstance(normal, (ActiveSet, UsualSet)):
            normal.check(failed)
        elif failed:
            check_residual("contact", np.nan)
        return force, self._horizontal.T

    def _contact(self, normal: ContactSolver) -> tuple[Any, list[BaseException]]:
        """The normal problem for the kernel, and where it keeps what it raises."""
        if isinstance(normal, ActiveSet):
            return normal.contact, []
        if isinstance(normal, UsualSet):
            return normal.contact, normal.raised
        if self._another is None or self._another[0] is not normal:
            raised: list[BaseException] = []
            self._another = normal, self._called(normal, raised), raised
        _, (contact, _), raised = self._another
        return contact, raised

    def _called(self, normal: ContactSolver, raised: list[BaseException]) -> tuple[Any, Any]:
        """The normal problem of a solver that is called back, and the callback, which must live as long."""
        size = len(self._touched)

        def solve(q: Any, guess: Any, force: Any) -> int:
            touching = None if guess == _FFI.NULL else array(guess, size, bool).copy()
            array(force, size)[:] = normal.solve(
                array(q, size).copy(), touching, reference=self._static
            )
            return int(_C.SOLVED)

        solver = _FFI.callback("normal_solver", guarded(solve, raised))
        return _FFI.new("normal_contact *", {"another": solver}), solver

    def unsolved(self) -> ConvergenceError:
        """ConvergenceError of a step whose forces do not converge."""
        unbounded = self._brush.law.friction is None
        cure = (
            "give contact.friction, which bounds them, or a smaller brush stiffness or time.step"
            if unbounded
            else "lower contact.friction, or take a smaller time.step"
        )
        return ConvergenceError(
            f"contact: normal and horizontal forces do not converge in {TURNS} iterations; the horizontal forces "
            f"are too large for this step: {cure}"
        )
