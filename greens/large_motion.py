"""Large motions in the time loop: the linear tire under the loads of the reduced nonlinear force.

With K the stiffness, V (n, k) and s = V^T r of fem.nonlinear.reduced, the tire is the linear one with the k further loads
-K V s. Its motion u_c at the nodes of the kept cells is one more reading of states and residual flexibility, so that

    s = s(u_c),   u_c = u_c,free + A_cw f - A_cv s

is solved within each step, with the contact, which gives the forces f for displacements w = w_free + A_ww f - A_wv s, as an
inner problem: Newton's method on the k numbers, the derivative of s - s(u_c(s)) by Broyden's updates, kept from step to
step. Where that does not do it is taken anew, 1 + (ds/du_c) (A_cv + A_cw f'(A_wv)), f' being how the forces yield where points
touch. (A plain fixed point diverges: ds/dq, q = V^T K u, has eigenvalues of up to 10.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import sparse

from tireroad.fem.collective import summed
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.compliance import LoadedShapes, on_own_rows
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.reduced import ReducedForce, at_nodes, extra_loads
from tireroad.greens.basis import Basis, Probes
from tireroad.greens.coupling import Wheel
from tireroad.greens.recursion import LoadedColumns, Recursion, Yields
from tireroad.greens.response import Response
from tireroad.greens.schemes import SCHEMES
from tireroad.modal.corner import READINGS
from tireroad.modal.solver.slicing import Modes

Array = np.ndarray

# Of the motion of the points. In the measure of K it says little: the belts' membrane energy, of which a road feels next to
# nothing on a stiff tire. Forces on a soft torus are then 0.05 % off.
TOLERANCE = 2e-5
FLOOR = 1e-4  # m: of that motion, all components together
TURNS, STALE = 25, 6  # evaluations of a step at most; after so many the derivative is taken anew
SPACES = 1e-9  # of s: changes that say nothing of the derivative
LEFT = 0.1  # of a rest by a step, at least: what one that was lucky does not promise for the next
# Evaluations from which on a rest of this share of the motion is small enough.
ENOUGH, ROUGH = 13, 1e-2


def large_response(
    wheel: Wheel,
    basis: Basis,
    modes: Modes,
    points: Probes,
    restoring: RestoringForce,
    force: ReducedForce,
    vectors: Array,
    loaded: int | None = None,
    shapes: LoadedShapes | None = None,
) -> Response:
    """The response between forces and motions of probes, and of the reduced force.

    Columns: forces N at the first c = `loaded` of the `points` (r, 3 s or wider; by default all), and K V (k,) J^(1/2). Rows:
    the motions of these c, K V, what is read at the other points, and the nodes of the kept cells (d,), relative to the
    wheel. K is what small motions have in the loop: where moduli depend on frequency, that of each mode, so that -K V s moves
    the tire by -V s at rest. `modes` on all unknowns, whose projection `basis` is; `vectors` V (n, k) on own unknowns. With
    the exact static flexibility of all of them (`shapes`: wheel.loaded_shapes(), by default made and destroyed). Collective.
    """
    operators, comm = wheel.operators, wheel.operators.body.comm
    pushed = extra_loads(restoring, vectors)
    at_kept = at_nodes(restoring, modes.vectors, force.nodes)
    along = summed(comm, pushed.T @ modes.vectors)
    d, k, face = len(at_kept), pushed.shape[1], basis.shape.shape[0]
    c = points.shape[0] if loaded is None else loaded
    # A probe of the wheel has columns of its own behind those of the face.
    width = face + READINGS

    def inside(pushes: Array) -> Basis:
        wheels = np.zeros((READINGS, basis.shape.shape[1]))
        return replace(basis, shape=np.vstack([basis.shape, wheels, pushes, at_kept]))

    def wide(probes: Probes) -> Probes:
        more = sparse.csr_matrix((probes.shape[0], width + k + d - probes.shape[1]))
        return sparse.hstack([probes, more], format="csr")

    within = sparse.hstack(
        [sparse.csr_matrix((k + d, width)), sparse.identity(k + d)], format="csr"
    )
    loads = sparse.vstack([wide(points[:c]), within[:k]], format="csr")
    outputs = sparse.vstack([loads, wide(points[c:]), within[k:]], format="csr")
    own, growth = on_own_rows(operators, points), wheel.growth or 1.0
    driven = sparse.hstack([own[:, :c], sparse.csr_matrix(growth * pushed)], format="csr")
    rows = _rows(restoring, force.nodes)
    read = sparse.vstack([driven.T, own[:, c:].T, rows], format="csr")
    true = (along / basis.projection.squares) @ basis.projection.stiffness
    bases = inside(true), inside(growth * along)
    return wheel.respond_inside(*bases, outputs, loads, read, driven, shapes)


def _rows(restoring: RestoringForce, nodes: Array) -> sparse.csr_matrix:
    """All components of lattice nodes from own unknowns, (d, n)."""
    body, unknowns = restoring.body, restoring.operators.unknowns
    place = np.full(3 * body.lattice.size, -1)
    components = (3 * body.ids[:, None] + np.arange(3)).ravel()[unknowns.free]
    place[components] = np.arange(len(components))
    wanted = place[(3 * np.asarray(nodes)[:, None] + np.arange(3)).ravel()]
    here = np.flatnonzero(wanted >= 0)
    ones = np.ones(len(here))
    return sparse.csr_matrix((ones, (here, wanted[here])), shape=(len(wanted), len(components)))


class _Newton:
    """Newton's method for s (k,) = s(s), the derivative of the rest s - s(s) by Broyden's updates, kept from one solution to
    the next; where that does not do it, taken anew.

    The contact is solved to a tolerance of its own (contact.loop.MEETING), by which s(s) jumps: where the rest falls no further,
    the best s is taken if its rest is small. `settled`: the s that `next` gave needs no evaluation, since its rest
    is small if it falls as it did last.
    """

    def __init__(self, count: int) -> None:
        self.derivative = np.eye(count)
        self.left = 1.0  # of a rest by the last step that was evaluated
        self.taken = self.rough = 0  # derivatives taken anew; solutions that stay at the best s

    def begin(self) -> None:
        """A solution begins."""
        self._turns, self.settled = 0, False
        self._off = np.inf
        self._tried: tuple[Array, Array] | None = None
        self._best: tuple[float, Array] = (np.inf, np.zeros(0))

    def next(
        self, s: Array, rest: Array, off: float, derivative: Callable[[], Array]
    ) -> Array | None:
        """The next s to be evaluated, None if this one is found; `off`: what its rest moves the points by, over their motion.
        ConvergenceError after 25 evaluations."""
        if off <= TOLERANCE:
            return None
        self._turns += 1
        if off < self._best[0]:
            self._best = off, s
        if self._turns > TURNS or not np.isfinite(off):
            raise ConvergenceError(
                "large motions: the reduced nonlinear force does not settle within a step; take a smaller time.step, or "
                'motion.kind = "linear"'
            )
        if self._turns >= ENOUGH and self._best[0] <= ROUGH:
            self.settled = True
            self.rough += 1
            return self._best[1]
        if self._turns % STALE == 0:
            self.derivative = derivative()
            self.taken += 1
        elif self._tried is not None:
            step, change = s - self._tried[0], rest - self._tried[1]
            if step @ step > SPACES**2 * (s @ s):
                lacking = change - self.derivative @ step
                self.derivative += np.outer(lacking, step) / (step @ step)
        if np.isfinite(self._off):
            self.left = max(off / self._off, LEFT)
        self.settled = off * self.left <= TOLERANCE
        self._tried, self._off = (s, rest), off
        return s - np.linalg.solve(self.derivative, rest)


class LargeTire:
    """A tire between forces at c points and motions (r,) at these and others, whose `linear` recursion has the rows and
    columns of `large_response` and integrates by `scheme`.

    A contact.loop.IteratedTire: `settle` tells whether s is that of the motion. After a step: `s` (k,) J^(1/2); `stored`
    J, the work done by the motion against the loads -K V s so far (trapezoidal rule), and `lead` J, what the mean loads that
    the scheme applies during the steps do beyond the same rule; `evaluations` of the reduced force, and `derivatives` taken
    anew. Not collective but for the linear tire's own calls.
    """

    def __init__(
        self, linear: Recursion, force: ReducedForce, points: int, scheme: str = "linear"
    ) -> None:
        self._linear, self._force, self.comm = linear, force, linear.comm
        self._scheme = scheme
        answers, c, d = linear.same_step, points, 3 * len(force.nodes)
        rows, k = len(answers), answers.shape[1] - c
        self._read_at, self._inner_at = slice(c, c + k), slice(rows - d, rows)
        self._seen_at = np.r_[0:c, c + k : rows - d]
        self.same_step = np.ascontiguousarray(answers[self._seen_at, :c])
        self._moved = np.ascontiguousarray(answers[self._seen_at, c:])
        inside = np.r_[rows - d : rows, c : c + k]
        self._inside, self._inner = LoadedColumns(answers[inside, :c]), d
        self._bent = np.ascontiguousarray(answers[inside, c:])
        self.s, self._before, self._older, self._read, self._begun = np.zeros((5, k))
        self._newton = _Newton(k)
        self.evaluations = 0
        self.stored = self.lead = 0.0
        self.ahead = linear.ahead

    @property
    def derivatives(self) -> int:
        """Number of derivatives taken anew."""
        return self._newton.taken

    @property
    def rough(self) -> int:
        """Number of steps in which s is right within 1 % of the points' motion only."""
        return self._newton.rough

    def predict(self) -> Array:
        """Displacements (r,) m at the end of the step without new forces of the contact. Collective."""
        free = self._linear.predict()
        self._free = free[self._seen_at]
        self._beside = np.concatenate([free[self._inner_at], free[self._read_at]])
        self._older, self._before, self.s = self._before, self.s, 2.0 * self.s - self._before
        self._newton.begin()
        return self._free - self._moved @ self.s

    def settle(self, force: Array, yields: Yields | None = None) -> Array | None:
        """None if the reduced force is that of the motion under contact forces (c,) N, else the displacements (r,) m for which
        the contact has to be solved again. `yields`: changes (c, m) N of these forces by displacements (r, m) m, by default
        none. ConvergenceError after 25 evaluations."""
        moved = self._beside + self._inside @ force - self._bent @ self.s
        self._now = moved[self._inner :]
        if self._newton.settled:
            return None
        found = self._next(moved[: self._inner], yields)
        if found is None:
            return None
        self.s = found
        return self._free - self._moved @ found

    def _next(self, inner: Array, yields: Yields | None) -> Array | None:
        """The next s to be tried where the kept nodes move by `inner`; None if it is the right one."""
        self.evaluations += 1
        rest = self.s - (self._force.evaluate(inner) - self._begun)
        moved = max(float(np.linalg.norm(self._free - self._moved @ self.s)), FLOOR)
        off = float(np.linalg.norm(self._moved @ rest)) / moved

        def derivative() -> Array:
            along = self._bent[: self._inner]
            if yields is not None:
                along = along + self._inside.columns.T[: self._inner] @ yields(self._moved)
            return np.eye(len(rest)) + self._force.jacobian(inner, along)

        return self._newton.next(self.s, rest, off, derivative)

    def advance(self, force: Array) -> None:
        """Set the contact forces (c,) N at the end of the step."""
        way = self._now - self._read
        ahead = SCHEMES[self._scheme].ahead_of_mean(np.stack([self._older, self._before, self.s]))[
            0
        ]
        self.stored += 0.5 * float((self.s + self._before) @ way)
        self.lead -= float(ahead @ way)
        self._read = self._now
        self._linear.advance(np.concatenate([force, -self.s]))

    def start(self, force: Array) -> None:
        """Begin at rest, with forces (c,) N that come at t = 0. Collective when looking ahead."""
        self._linear.start(np.concatenate([force, np.zeros_like(self.s)]))

    def start_steady(self, force: Array, sudden: Array | None = None) -> Array:
        """Begin at rest under contact forces (c,) N that always were, those of steady rolling, and `sudden` ones beside them; the
        displacement (r,) m, which is the linear tire's.

        The reduced force counts from there: the contact of steady rolling was found with the linear tire, and would jump
        with another displacement (by 5 % of the load on a passenger tire). Collective.
        """
        none = np.zeros_like(self.s)
        given = None if sudden is None else np.concatenate([sudden, none])
        moved = self._linear.start_steady(np.concatenate([force, none]), given)
        self._read = moved[self._read_at].copy()
        self._begun = self._force.evaluate(np.ascontiguousarray(moved[self._inner_at]))
        return moved[self._seen_at]

    def inertia_force(self) -> Array:
        """Rate of momentum (3,) N."""
        return self._linear.inertia_force()

    def snapshot(self) -> dict[str, Array]:
        """The linear tire's snapshot and the reduced force. Collective."""
        own = {
            "large_force": np.stack([self.s, self._before, self._older, self._read, self._begun]),
            "large_derivative": self._newton.derivative.copy(),
            "large_work": np.array([self.stored, self.lead, self._newton.left]),
            "large_count": np.array([self.evaluations, self.derivatives, self.rough]),
        }
        return self._linear.snapshot() | own

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from a snapshot. Collective when looking ahead."""
        self.s, self._before, self._older, self._read, self._begun = state["large_force"].copy()
        self._newton.derivative = state["large_derivative"].copy()
        newton = self._newton
        self.stored, self.lead, newton.left = state["large_work"].tolist()
        self.evaluations, newton.taken, newton.rough = (int(n) for n in state["large_count"])
        self._linear.restore(state)
