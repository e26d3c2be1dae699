"""Static equilibrium under inflation, steady rolling and a smooth, frictionless road (friction: fem.static.friction).

F_int(u) + p F_pressure(u) + Omega^2 S (X + u) + gamma1 Omega B u + gamma2 Omega K M^-1 B u = f, f >= 0 on the tread dofs,
z + u_z >= z_road and one of both zero. On roads that are no level plane the tread's nodes move in the road's coordinates
(fem.static.curved.unrolled).
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.curved.shape import FLAT, RoadShape
from tireroad.fem.static.curved.unrolled import Unrolled
from tireroad.fem.static.forces import Forces
from tireroad.fem.static.held_system import HeldSystem, Moved, System
from tireroad.fem.static.linear_contact import LinearContact, held_step
from tireroad.fem.static.path.history import History
from tireroad.fem.static.path.step import Step
from tireroad.fem.static.road import Road
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.body import Body

MOST_STEPS = 25  # tangents; a load step that needs more is better halved
TOLERANCE = 1e-12  # of the force scale
_SERVES = 0.2  # a step with an old tangent costs a twentieth of one with a new tangent
_STAYS = 1e-10  # of the wall: rounding, as a state is carried from half the ring and back
_DIVERGED = 1e8  # times the force scale: nothing comes back from there


class Equilibrium(Forces):
    """The nonlinear problem of one body. Its solver is made once. Collective.

    `solve` starts from the body's displacement and puts it back when it does not converge. `road_height` (m) is that
    of the last state that did, under the axle where its `shape` is no level plane; `force_scale`: N, by which
    residuals are measured.
    """

    def __init__(self, body: Body, rolling: Rolling = AT_REST, shape: RoadShape = FLAT) -> None:
        super().__init__(body, rolling)
        self.road_height: float | None = None
        self.shape = shape
        self.road = self._make_road()
        self._unrolled = None if shape.flat else Unrolled(body, self.road)
        self.force_scale = self._yardsticks()
        self._damped = bool(rolling.speed * (rolling.damping + rolling.stiffness_damping))
        self._system = self._make_system("lu" if self._damped else "cholesky")
        self._contact: LinearContact | None = None
        self._solved = body.u.x.array.copy()
        self.history = History(None)

    def _make_road(self) -> Road:
        return Road(self.body, self.shape)

    def _make_system(self, kind: str) -> System:
        return HeldSystem(self.body.comm, self.matrix, kind, self.cost)

    def _make_contact(self) -> LinearContact | None:
        """Settles the sets of contact within a step; None where the road is not flat."""
        return LinearContact(self.body.comm, self._system, self.road) if self.shape.flat else None

    @property
    def _in_its_coordinates(self) -> Unrolled | None:
        """Those in which Newton's method works now; None: the wheel's axes."""
        return self._unrolled if self.road.height > -np.inf else None

    def _out(self) -> np.ndarray:
        """Forces out of balance at the owned unknowns, N. Collective."""
        out, along = self._assemble_residual(), self._in_its_coordinates
        if along is not None:
            along.turn(self._work.array)
        return out

    @property
    def rounding(self) -> float:
        """Force below which nothing is balanced, N."""
        return TOLERANCE * self.force_scale

    def solve(
        self, road_height: float | None = None, load: float | None = None, allowed: float = 0.0
    ) -> Step:
        """As `_solve`, or as the `history` of a computation that was stopped has it. Collective."""
        return self.history.solve(self, lambda: self._solve(road_height, load, allowed))

    def _solve(self, road_height: float | None, load: float | None, allowed: float) -> Step:
        """Equilibrium with the road plane at the given height (m), or without a road. Collective.

        With a `load` (N) the road is moved, from the given height on, until it carries that. `allowed` N may stay
        out of balance in a state that is only on the way to another. Newton's method and the active set of the
        road in one loop: a dof is held where f - c gap > 0, with c the dof's own stiffness, which is complementarity
        for any c > 0 (Hintermueller, Ito, Kunisch 2003, doi 10.1137/S1052623401383558); a new tangent settles its
        sets (LinearContact), and serves while each step with it leaves a fifth of the error or less.
        """
        field = self.body.u.x
        kept, self._contact = (field.array.copy(), self.road.kept()), None
        self.road.height = -np.inf if road_height is None else road_height
        self._before.x.array[:] = field.array
        error, tangents = 0.0, 0
        while True:
            changed, last = self.road.choose(), error
            error = self._error(load)
            reason = self._stopped(error, changed, tangents, allowed / self.force_scale)
            if reason == "converged":
                return self.solved(Step(True, tangents, error, reason))
            closing = None
            changed = changed or bool(self._contact and self._contact.changed)
            if not reason and (changed or not error < _SERVES * last):
                tangents += 1
                reason = "" if self._take_tangent() else "the tangent is singular"
                closing = self._system.closing
            reason = reason or self._move(closing, load)
            if reason:
                break
        field.array[:] = kept[0]
        self.road.put_back(kept[1])
        return self.solved(Step(False, tangents, error, reason))

    def solved(self, step: Step) -> Step:
        """The step: the body is in the state that it has found, or was put back where it found none."""
        if step.converged:
            self._solved = self.body.u.x.array.copy()
            self.road_height = None if self.road.height == -np.inf else self.road.height
        else:
            self._contact = None
        return step

    def predict(self, road_height: float) -> bool:
        """As `_predict`, or as the `history` has it: the solution that follows is known then. Collective."""
        return self.history.predict(lambda: self._predict(road_height))

    def _predict(self, road_height: float) -> bool:
        """Go from the state that was solved for last to near that on a road at `road_height` (m) by its last tangent, which
        settles the sets of contact; whether there is such a tangent, and the body still in that state. Collective.
        """
        moved = np.abs(self._solved - self.body.u.x.array).max(initial=0.0)
        stays = bool(moved <= _STAYS * self.body.ring.thickness)
        if self._contact is None or not self.body.comm.allreduce(stays, op=MPI.LAND):
            return False
        self._out()
        on_road = self.road.height > -np.inf
        rise = road_height - self.road.height if on_road else 0.0
        if not on_road:  # nothing touches it yet, so nothing is raised by it
            self.road.height = road_height
        return not self._move(None, None, rise)

    def _stopped(self, error: float, changed: bool, tangents: int, allowed: float) -> str:
        """Why not to go on; empty while there is hope. Collective."""
        if not error < _DIVERGED:
            return "the residual grows without bound"
        enough = error <= TOLERANCE or (tangents > 0 and error <= allowed)
        if enough and not changed:
            return "an element is inside out" if self._inside_out() else "converged"
        return "" if tangents < MOST_STEPS else f"no convergence in {MOST_STEPS} Newton steps"

    def _error(self, load: float | None) -> float:
        """Norm of what is out of balance over the force scale, distance to the road as the dof's force."""
        with self.cost("assembly"):
            out = self._out().copy()
        self.road.take_off(out)
        distance = self.road.distance()
        parts = np.array([out @ out + distance @ distance, self.road.force.sum()])
        square, total = self.body.comm.allreduce(parts)
        missing = 0.0 if load is None else load - total
        return float(np.hypot(np.sqrt(square), missing)) / self.force_scale

    def out_of_balance(self) -> float:
        """Norm of the forces (N) that are, in the present state under the present forces of the road. Collective."""
        return self._error(None) * self.force_scale

    def _take_tangent(self) -> bool:
        """Assemble and factorise at the present state, the held dofs on their way to the road."""
        with self.cost("assembly"):
            self._assemble_tangent()
            along = self._in_its_coordinates
            matrix = self.matrix if along is None else along.tangent(self.matrix)
        taken = self._system.take(matrix, self.road.held, *self.road.steps())
        self._contact = self._make_contact() if taken else None
        return taken

    def _move(self, closing: Moved | None, load: float | None, rise: float | None = None) -> str:
        """One linearised step to balance, of a road that may `rise` (m). Why it cannot be taken, or nothing. Collective."""
        given = self.road.rows(self._work.array_r.copy()), closing, load
        if self._contact is None or self.road.height == -np.inf:
            step = held_step(self.body.comm, self._system, self.road, given)
        else:
            step = self._contact.step(*given, rise)
        if step is None:
            return "the road meets no resistance"
        (change, reaction), field = step, self.body.u.x
        self._before.x.array[:] = field.array
        along = self._in_its_coordinates
        field.array[: len(change)] += change if along is None else along.spread(change)
        self.road.lay_on()
        self.road.react(reaction)
        return ""

    def road_stiffness(self) -> float:
        """Force (N) the road gains per metre it rises with the points that touch it now. Collective."""
        self._before.x.array[:] = self.body.u.x.array
        if not self._take_tangent():
            return float("nan")
        force = self._system.solve(np.zeros(len(self._work.array_r)), self._system.raising)[1]
        return self.body.comm.allreduce(self.road.upward(force))

    def sinking(self, weights: np.ndarray, load: float) -> tuple[float, float]:
        """Under a vertical traction in place of the road: the height (m) that the face gains by one step of
        Newton's method from the present state, and that by a newton more. Collective.
        `weights` (s,) of the outer face's nodes, of sum 1, say where the `load` (N) acts and the height is read."""
        self._before.x.array[:], self._contact = self.body.u.x.array, None
        out = self._assemble_residual().copy()
        self._assemble_tangent()
        if not self._system.take(self.matrix, np.zeros(0, np.intp), *np.zeros((2, 0))):
            raise ConvergenceError("static: the tangent without a road is singular")
        face, push = self.body.surface, np.zeros(len(out))
        push[3 * face.local + 2] = weights[face.place]
        push[self._rim] = 0.0
        gained = [push @ self._system.solve(right)[0] for right in (load * push - out, push)]
        return tuple(self.body.comm.allreduce(np.array(gained)))

    def load(self) -> float:
        """Total vertical force of the road, N. Collective."""
        return self.road.load()

    def points(self) -> int:
        """Nodes that the road presses on. Collective."""
        return self.road.points()

    def contact_force(self) -> np.ndarray:
        """Vertical force of the road on the owned nodes (nodes,), N; not negative. Not collective."""
        return self.road.at_nodes()

    def resume(self, displacement: np.ndarray, force: np.ndarray, height: float | None) -> Step:
        """Solve from a state found by other means: displacement (n, 3) m and force of the road (n,) N of all
        lattice nodes, on a road at `height` (m). What is in balance stays as it is. Collective."""
        self.body.set_displacement(displacement)
        if height is not None:
            self.road.take(force[self.body.ids], height)
        return self.solve(height)

    def _yardsticks(self) -> float:
        """Force scale (N): the undeformed body's typical stiffness of a dof times the wall, so that 1e-12 of it is far
        below any load of interest. The road's stiffness is that of its dofs."""
        self._before.x.array[:] = self.body.u.x.array
        self._assemble_tangent()
        diagonal = self.matrix.getDiagonal()
        self.road.weigh(diagonal.array)
        return self.body.ring.thickness * diagonal.norm() / np.sqrt(diagonal.size)
