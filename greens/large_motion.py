"""Large motions in the time loop: the linear tire under the loads of the reduced nonlinear force.

With K the stiffness, V (n, k) and s = V^T r of fem.nonlinear.reduced, the tire is the linear one with the k further loads
-K V s. Its motion u_c at the nodes of the kept cells is one more reading of states and residual flexibility, so that

    s = s(u_c),   u_c = u_c,free + A_cw f - A_cv s

is solved within each step, with the contact, which gives the forces f for displacements w = w_free + A_ww f - A_wv s, as an
inner problem: Newton's method on the k numbers, the derivative of s - s(u_c(s)) by Broyden's updates, kept from step to
step. Where that does not do it is taken anew by differences, for each of which the contact is solved: the forces f, with
friction too, follow s. (A plain fixed point diverges: ds/dq, q = V^T K u, has eigenvalues of up to 10.)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse

from tireroad.fem.collective import summed
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.compliance import on_own_rows
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.reduced import ReducedForce, at_nodes, extra_loads
from tireroad.greens.basis import Basis
from tireroad.greens.coupling import Wheel
from tireroad.greens.recursion import LoadedColumns, Recursion
from tireroad.greens.response import Response
from tireroad.modal.solver.slicing import Modes

Array = np.ndarray

TOLERANCE = 1e-3  # of s, over the tire's whole motion in the same measure
FLOOR = 0.1  # J^(1/2): of that motion
TURNS, STALE = 25, 6  # evaluations of a step at most; after so many the derivative is taken anew
SPACES = 1e-9  # of a motion: changes that say nothing of the derivative
PROBE = 1e-4  # of a motion: differences


def large_response(
    wheel: Wheel,
    basis: Basis,
    modes: Modes,
    points: sparse.csr_matrix,
    restoring: RestoringForce,
    force: ReducedForce,
    vectors: Array,
) -> Response:
    """The response of the contact `points` (c, 3 s), the nodes of the kept cells (d,) and K V (k,) to forces at the points and K V.

    Rows c + d + k, m and J^(1/2); columns c + k, N and J^(1/2). K is what small motions have in the loop: where moduli
    depend on frequency, that of each mode, so that -K V s moves the tire by -V s at rest. `modes` on all unknowns, whose projection `basis` is;
    `vectors` V (n, k) on own unknowns. With the exact static flexibility of all of them. Collective.
    """
    operators, comm = wheel.operators, wheel.operators.body.comm
    # Columns beyond the face would be a corner's, which a held wheel does not need.
    projection = replace(basis.projection, corner=None)
    pushed = extra_loads(restoring, vectors)
    rows = _rows(restoring, force.nodes)
    at_kept = at_nodes(restoring, modes.vectors, force.nodes)
    along = summed(comm, pushed.T @ modes.vectors)
    d, k, face = len(at_kept), pushed.shape[1], basis.shape.shape[0]

    def inside(pushes: Array) -> Basis:
        return replace(
            basis, shape=np.vstack([basis.shape, at_kept, pushes]), projection=projection
        )

    more = sparse.identity(d + k, format="csr")
    outputs = sparse.block_diag([points, more], format="csr")
    unread = sparse.csr_matrix((k, face + d))
    loads = sparse.vstack(
        [
            sparse.hstack([points, sparse.csr_matrix((points.shape[0], d + k))]),
            sparse.hstack([unread, sparse.identity(k)]),
        ],
        format="csr",
    )
    own, growth = on_own_rows(operators, points), wheel.growth or 1.0
    driven = sparse.hstack([own, sparse.csr_matrix(growth * pushed)], format="csr")
    read = sparse.vstack([own.T, rows, sparse.csr_matrix(growth * pushed.T)], format="csr")
    true = (along / projection.squares) @ projection.stiffness
    bases = inside(true), inside(growth * along)
    return wheel.respond_inside(*bases, outputs, loads, read, driven)


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


class _Differences:
    """Differences of the `rest` (k,) at `base` (k,) along each of its k numbers."""

    def __init__(self, base: Array, rest: Array, size: float) -> None:
        self.base, self.rest, self._size = base, rest, size
        self.found: list[Array] = []

    def next(self) -> Array:
        """The next place to be evaluated."""
        place = self.base.copy()
        place[len(self.found)] += self._size
        return place

    def add(self, rest: Array) -> None:
        """The rest found there."""
        self.found.append((rest - self.rest) / self._size)


class LargeTire:
    """A tire between its contact points' c forces and displacements whose `linear` recursion has the rows and columns of
    `large_response`.

    A contact.loop.IteratedTire: `settle` tells whether s is that of the motion. After a step: `s` (k,) J^(1/2); `stored`
    J, the work done by the motion against the loads -K V s so far (trapezoidal rule); `evaluations` of the reduced force,
    and `derivatives` taken by differences. Not collective but for the linear tire's own calls.
    """

    def __init__(self, linear: Recursion, force: ReducedForce, points: int) -> None:
        self._linear, self._force, self.comm = linear, force, linear.comm
        answers, c, d = linear.same_step, points, 3 * len(force.nodes)
        self._count, self._inner = c, d
        self.same_step = np.ascontiguousarray(answers[:c, :c])
        self._inside = LoadedColumns(np.ascontiguousarray(answers[c:, :c]))
        self._moved, self._bent = answers[:c, c:].copy(), answers[c:, c:].copy()
        k = answers.shape[1] - c
        self.s, self._before, self._read = np.zeros(k), np.zeros(k), np.zeros(k)
        self._derivative = np.eye(k)
        self._probing: _Differences | None = None
        self._tried: tuple[Array, Array] | None = None
        self.evaluations = self.derivatives = 0
        self.stored, self.ahead = 0.0, linear.ahead

    def predict(self) -> Array:
        """Displacements (c,) m at the end of the step without new forces of the contact. Collective."""
        free = self._linear.predict()
        self._free, self._beside = np.split(free, [self._count])
        self.s, self._before = 2.0 * self.s - self._before, self.s
        self._turns, self._tried = 0, None
        return self._free - self._moved @ self.s

    def settle(self, force: Array) -> Array | None:
        """None if the reduced force is that of the motion under contact forces (c,) N, else the displacements (c,) m for which
        the contact has to be solved again. ConvergenceError after 25 evaluations."""
        moved = self._beside + self._inside @ force - self._bent @ self.s
        inner, read = moved[: self._inner], moved[self._inner :]
        rest = self.s - self._force.evaluate(inner)
        self.evaluations += 1
        size = max(float(np.linalg.norm(read + self.s)), FLOOR)
        if self._probing is not None:
            return self._probed(rest)
        if np.linalg.norm(rest) <= TOLERANCE * size:
            self._now = read
            return None
        self._turns += 1
        if self._turns > TURNS or not np.isfinite(rest).all():
            raise ConvergenceError(
                "large motions: the reduced nonlinear force does not settle within a step; take a smaller time.step, or "
                'motion.kind = "linear"'
            )
        if self._tried is not None:
            step, change = self.s - self._tried[0], rest - self._tried[1]
            if step @ step > (SPACES * size) ** 2:
                lacking = change - self._derivative @ step
                self._derivative += np.outer(lacking, step) / (step @ step)
        if self._turns % STALE == 0:
            self._probing = _Differences(self.s, rest, PROBE * size)
            return self._freed(self._probing.next())
        return self._corrected(rest)

    def _corrected(self, rest: Array) -> Array:
        self._tried = self.s, rest
        return self._freed(self.s - np.linalg.solve(self._derivative, rest))

    def _probed(self, rest: Array) -> Array:
        """Take one more difference, and the step that they lead to after the last."""
        probing = self._probing
        assert probing is not None
        probing.add(rest)
        if len(probing.found) < len(self.s):
            return self._freed(probing.next())
        self._derivative, self._probing = np.stack(probing.found, axis=1), None
        self.derivatives += 1
        self.s = probing.base
        return self._corrected(probing.rest)

    def _freed(self, s: Array) -> Array:
        self.s = s
        return self._free - self._moved @ s

    def advance(self, force: Array) -> None:
        """Set the contact forces (c,) N at the end of the step."""
        self.stored += 0.5 * float((self.s + self._before) @ (self._now - self._read))
        self._read = self._now
        self._linear.advance(np.concatenate([force, -self.s]))

    def start_steady(self, force: Array, sudden: Array | None = None) -> Array:
        """Begin at rest under contact forces (c,) N that always were, without a nonlinear force; the displacement (c,) m."""
        none = np.zeros_like(self.s)
        given = None if sudden is None else np.concatenate([sudden, none])
        moved = self._linear.start_steady(np.concatenate([force, none]), given)
        self._read = moved[self._count + self._inner :].copy()
        return moved[: self._count]

    def inertia_force(self) -> Array:
        """Rate of momentum (3,) N."""
        return self._linear.inertia_force()

    def snapshot(self) -> dict[str, Array]:
        """The linear tire's snapshot and the reduced force. Collective."""
        own = {
            "large_force": np.stack([self.s, self._before, self._read]),
            "large_derivative": self._derivative.copy(),
            "large_stored": np.array([self.stored, self.evaluations, self.derivatives]),
        }
        return self._linear.snapshot() | own

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from a snapshot."""
        self.s, self._before, self._read = state["large_force"].copy()
        self._derivative = state["large_derivative"].copy()
        self.stored = float(state["large_stored"][0])
        self.evaluations, self.derivatives = (int(count) for count in state["large_stored"][1:])
        self._linear.restore(state)
