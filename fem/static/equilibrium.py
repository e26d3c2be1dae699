"""Static equilibrium under inflation, steady rolling and a smooth frictionless road.

F_int(u) + p F_pressure(u) + Omega^2 S (X + u) + gamma1 Omega B u + gamma2 Omega K M^-1 B u = f,
with f >= 0 and z + u_z >= z_road at the tread dofs, one of the two an equality. On roads other than
a level plane they move in road coordinates (curved.unrolled). Friction: fem.static.friction.
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
_SERVES = 0.2  # error ratio up to which a tangent is reused, at 1/20 of a new one's cost
_STAYS = 1e-10  # of the wall: rounding when a state is transferred from half the ring and back
_DIVERGED = 1e8  # times the force scale, beyond which Newton's method does not recover


class Equilibrium(Forces):
    """The nonlinear problem of one body; its solver is created once. Collective.

    `solve` starts from the body's displacement and restores it on failure. `road_height` (m), that
    of the last converged state, is under the axle if `shape` is not flat; `force_scale` N.
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
        """Solver for the active set within a step; None if the road is not flat."""
        return LinearContact(self.body.comm, self._system, self.road) if self.shape.flat else None

    @property
    def _in_its_coordinates(self) -> Unrolled | None:
        """Coordinates in which Newton's method currently works; None: the wheel's axes."""
        return self._unrolled if self.road.height > -np.inf else None

    def _out(self) -> np.ndarray:
        """Residual forces at the owned unknowns, N. Collective."""
        out, along = self._assemble_residual(), self._in_its_coordinates
        if along is not None:
            along.turn(self._work.array)
        return out

    @property
    def rounding(self) -> float:
        """Force below which residuals are rounding, N."""
        return TOLERANCE * self.force_scale

    def solve(
        self, road_height: float | None = None, load: float | None = None, allowed: float = 0.0
    ) -> Step:
        """`_solve`, or its result from the `history` of an interrupted computation. Collective."""
        return self.history.solve(self, lambda: self._solve(road_height, load, allowed))

    def _solve(self, road_height: float | None, load: float | None, allowed: float) -> Step:
        """Equilibrium with the road at the given height (m), or without a road (None). Collective.

        With a `load` (N) the road moves from that height until it carries it. `allowed` N of
        residual may remain in an intermediate state. Newton's method and the active set share one
        loop: a dof is held if f - c gap > 0 with its own stiffness c, which is complementarity for
        any c > 0 (Hintermueller, Ito, Kunisch 2003, doi 10.1137/S1052623401383558). Each new
        tangent settles the set (LinearContact) and is reused while each step leaves at most a fifth
        of the error, or what a new one would leave (`lag`)."""
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
            if not reason and (changed or not error < max(_SERVES, self.lag) * last):
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
        """Record the outcome: the body is in the state found, or restored if there is none."""
        if step.converged:
            self._solved = self.body.u.x.array.copy()
            self.road_height = None if self.road.height == -np.inf else self.road.height
        else:
            self._contact = None
        return step

    def predict(self, road_height: float) -> bool:
        """`_predict`, or its outcome in the `history` if the next solution is known. Collective."""
        return self.history.predict(lambda: self._predict(road_height))

    def _predict(self, road_height: float) -> bool:
        """Move from the last solution to the estimate for `road_height` (m) by the last tangent and
        its sets. False if there is none, the body has left that state or it fails. Collective."""
        moved = np.abs(self._solved - self.body.u.x.array).max(initial=0.0)
        stays = bool(moved <= _STAYS * self.body.ring.thickness)
        if self._contact is None or not self.body.comm.allreduce(stays, op=MPI.LAND):
            return False
        self._out()
        on_road = self.road.height > -np.inf
        rise = road_height - self.road.height if on_road else 0.0
        if not on_road:  # no node touches the road yet, so raising it moves none
            self.road.height = road_height
        return not self._move(None, None, rise)

    def _stopped(self, error: float, changed: bool, tangents: int, allowed: float) -> str:
        """Reason to stop, or an empty string. Collective."""
        if not error < _DIVERGED:
            return "the residual grows without bound"
        enough = error <= TOLERANCE or (tangents > 0 and error <= allowed)
        if enough and not changed:
            return "an element is inside out" if self._inside_out() else "converged"
        return "" if tangents < MOST_STEPS else f"no convergence in {MOST_STEPS} Newton steps"

    def _error(self, load: float | None) -> float:
        """Norm of residual, gaps of held dofs (as forces) and missing load over the force scale."""
        with self.cost("assembly"):
            out = self._out().copy()
        self.road.take_off(out)
        distance = self.road.distance()
        parts = np.array([out @ out + distance @ distance, self.road.force.sum()])
        square, total = self.body.comm.allreduce(parts)
        missing = 0.0 if load is None else load - total
        return float(np.hypot(np.sqrt(square), missing)) / self.force_scale

    def out_of_balance(self) -> float:
        """Norm of the residual (N) in the present state under its road forces. Collective."""
        return self._error(None) * self.force_scale

    def _take_tangent(self) -> bool:
        """Assemble and factorise the tangent at the present state, held dofs moving to the road."""
        with self.cost("assembly"):
            self._assemble_tangent()
            if (along := self._in_its_coordinates) is not None:
                along.tangent(self.matrix)
        taken = self._system.take(self.matrix, self.road.held, *self.road.steps())
        self._contact = self._make_contact() if taken else None
        return taken

    def _move(self, closing: Moved | None, load: float | None, rise: float | None = None) -> str:
        """One linearised step; the road may `rise` (m). Reason for failure, or "". Collective."""
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
        """Road force gained per metre of rise, N/m, with the present contact nodes. Collective."""
        self._before.x.array[:] = self.body.u.x.array
        if not self._take_tangent():
            return float("nan")
        raising, lacking = self._system.raising, np.zeros(len(self._work.array_r))
        for _ in range(self.rounds):
            change, force = self._system.solve(-lacking, raising)
            force += lacking[self.road.held]
            lacking = self.lacking(change, self._in_its_coordinates)
        return self.body.comm.allreduce(self.road.upward(force))

    def sinking(self, weights: np.ndarray, load: float) -> tuple[float, float]:
        """Rise (m) of the face in a Newton step under a vertical traction, without a road, and rise
        per newton. `weights` (s,) of the outer face, of sum 1, distribute the `load` (N) and
        average the rise. Raises ConvergenceError for a singular tangent. Collective."""
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
        """Number of nodes loaded by the road. Collective."""
        return self.road.points()

    def contact_force(self) -> np.ndarray:
        """Vertical road force (nodes,) N on the owned nodes, not negative. Not collective."""
        return self.road.at_nodes()

    def resume(self, displacement: np.ndarray, force: np.ndarray, height: float | None) -> Step:
        """Solve from displacement (n, 3) m and road force (n,) N of all lattice nodes, road at
        `height` (m). A state already in equilibrium stays unchanged. Collective."""
        self.body.set_displacement(displacement)
        if height is not None:
            self.road.take(force[self.body.ids], height)
        return self.solve(height)

    def _yardsticks(self) -> float:
        """Force scale (N): the undeformed body's typical dof stiffness times the wall thickness;
        1e-12 of it is far below any load of interest. The road takes the stiffness of its dofs."""
        self._before.x.array[:] = self.body.u.x.array
        self._assemble_tangent()
        diagonal = self.matrix.getDiagonal()
        self.road.weigh(diagonal.array)
        return self.body.ring.thickness * diagonal.norm() / np.sqrt(diagonal.size)
