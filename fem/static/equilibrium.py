"""Static equilibrium under inflation, steady rolling and a smooth frictionless road, by Newton's method.

F_int(u) + p F_pressure(u) + Omega^2 S (X + u) + gamma1 Omega B u + gamma2 Omega K M^-1 B u = f,
with f >= 0 and z + u_z >= z_road at the tread dofs, one of the two an equality. On roads other than
a level plane they move in road coordinates (fem.static.road). Friction: fem.static.friction_road.
"""

from __future__ import annotations

import hashlib
import math
import weakref
from dataclasses import dataclass

import numpy as np
import ufl
import ufl.algorithms
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from ufl.core.expr import Expr

from tireroad.fem import compat
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.checkpoint import Entry, Journal
from tireroad.fem.static.road import FLAT, RoadContact, RoadCoordinates, RoadShape
from tireroad.fem.static.tangent import (
    ConstrainedSystem,
    LinearContact,
    PrescribedMotion,
    System,
    held_step,
)
from tireroad.fem.static.virtual_work import (
    AT_REST,
    Rolling,
    body_rate_form,
    elastic_work,
    inverted_volume,
    static_residual,
    stress_prediction,
    tangent,
)
from tireroad.fem.timing import Timing
from tireroad.fem.tire.body import Body

_WEAK = 0.5  # spectral radius up to which the tangent does without the product
_MARGIN = 1.3  # over it: held nodes and the deformed tire's other tangent
_ROUNDS = 20  # of the power method: within 2 % of the spectral radius
_ROAD = "active", "force", "height"
MOST_STEPS = 25  # tangents; a load step that needs more is better halved
TOLERANCE = 1e-12  # of the force scale
_SERVES = 0.2  # error ratio up to which a tangent is reused, at 1/20 of a new one's cost
_STAYS = 1e-10  # of the wall: rounding when a state is transferred from half the ring and back
_DIVERGED = 1e8  # times the force scale, beyond which Newton's method does not recover


class ShapeDamping:
    """The force as the UFL form `work`, and the part of its derivative that UFL does not see.

    `convergence_rate`: bound on the error reduction per Newton step when the tangent omits this term; 0
    if the tangent has it. Call `update` before assembling `work`. All methods are collective.

    Stiffness-proportional damping in the steady shape is f = gamma2 Omega K(u) r, r = M^-1 B u: r
    is the body rate of the displacement per unit speed, projected on the finite-element space: its
    gradient exists, unlike that of grad(u) w across elements. For small motions f becomes the term
    gamma2 Omega K M^-1 B of the rotating pencil.

    That product couples each node with the neighbours of its neighbours: with it in the tangent a
    factorisation takes three to six times as long. Newton's method without it leaves K^-1 (gamma2
    Omega K M^-1 B) = gamma2 Omega M^-1 B of an error in each step, so it converges if the spectral
    radius of this is well below 1, to the same state, as the force is complete.
    """

    def __init__(self, body: Body, pressure: Expr, rolling: Rolling) -> None:
        self._body = body
        self._rate = fem.Function(body.space)
        self._factor = float(rolling.speed * rolling.stiffness_damping)
        elastic = elastic_work(body, pressure)
        factor = fem.Constant(body.mesh, self._factor)
        # Expanded at once: UFL numbers the arguments of nested derivatives wrongly.
        along = ufl.derivative(elastic, body.u, self._rate)
        self.work = factor * ufl.algorithms.expand_derivatives(along)
        self._clamp = [body.clamp()]
        self._rate_matrix, fastest = _rates(body, self._clamp)
        self._in, self._out = self._rate_matrix.createVecs()
        radius = abs(self._factor) * fastest
        self.convergence_rate = _MARGIN * radius if radius < _WEAK else 0.0
        self._stiffness_form = compat.form(ufl.derivative(elastic, body.u, body.trial))
        self._stiffness: PETSc.Mat | None = None
        self._assembled = False
        self._product: PETSc.Mat | None = None

    def update(self) -> None:
        """Set the rate of the body's present displacement."""
        self._in.array[:] = self._body.owned(self._body.u.x.array).ravel()
        self._rate_matrix.mult(self._in, self._out)
        self._body.owned(self._rate.x.array)[:] = self._out.array_r.reshape(-1, 3)
        self._rate.x.scatter_forward()

    def completed(self, tangent: PETSc.Mat) -> PETSc.Mat:
        """tangent + gamma2 Omega K M^-1 B, always in the same matrix; the tangent if it lags."""
        self._assembled = False
        if self.convergence_rate:
            return tangent
        stiffness = self._tangent_stiffness()
        self._product = stiffness.matMult(self._rate_matrix, result=self._product)
        self._product.scale(self._factor)
        self._product.axpy(1.0, tangent, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        return self._product

    def lacking(self, change: np.ndarray) -> np.ndarray:
        """Forces gamma2 Omega K M^-1 B change (N) at the owned unknowns that the last tangent lacks;
        `change` in m."""
        self._in.array[:] = change
        self._rate_matrix.mult(self._in, self._out)
        self._tangent_stiffness().mult(self._out, self._in)
        return self._factor * self._in.array_r

    def _tangent_stiffness(self) -> PETSc.Mat:
        """K at the displacement of the last tangent, of which it is a part."""
        if self._stiffness is None:
            self._stiffness = fem.petsc.create_matrix(self._stiffness_form)
        if not self._assembled:
            self._stiffness.zeroEntries()
            fem.petsc.assemble_matrix(self._stiffness, self._stiffness_form, bcs=self._clamp)
            self._stiffness.assemble()
            self._assembled = True
        return self._stiffness


def _rates(body: Body, clamp: list[fem.DirichletBC]) -> tuple[PETSc.Mat, float]:
    """M^-1 B with the lumped mass, and its spectral radius: strains per radian at most. Collective.

    The rim rotates rigidly with the wheel: it has no body rate and contributes to none.
    """
    rates = fem.petsc.assemble_matrix(compat.form(body_rate_form(body)), clamp, 0.0)
    rates.assemble()
    root, x = rates.createVecs()
    root.array[:] = np.sqrt(body.nodal_mass())
    inverse = root.copy()
    inverse.reciprocal()
    rates.diagonalScale(inverse, inverse)  # skew, so powers of it grow by its spectral radius
    start = np.random.default_rng(0).normal(size=(body.lattice.size, 3))
    fastest, before = 0.0, root.duplicate()
    x.array[:] = start[body.ids].ravel()
    for _ in range(_ROUNDS):
        x.normalize()
        x.swap(before)
        rates.mult(before, x)
        fastest = x.norm()
    rates.diagonalScale(inverse, root)
    return rates, fastest


class SolutionHistory:
    """Solutions of the equilibrium problems of one stage, in order; none without a `journal`.

    An interrupted load path is retraced without solving: it is a function of the
    outcomes and states of its solutions. From its start, each recorded solution is put in place.
    The solution after the last recorded one may use its tangent, which is not stored; the last
    solution of each problem is therefore solved again, from where it began.
    """

    def __init__(self, journal: Journal | None) -> None:
        self._journal = journal
        self._problems: list[weakref.ref[Equilibrium]] = []  # a past one may be freed
        self._predicted: list[bool] = []
        self._open: dict[str, np.ndarray] | None = None  # of the solution being computed
        entries = journal.found if journal else []
        last = {int(entry["problem"]): k for k, entry in enumerate(entries)}
        self._again = set(last.values())

    def retrace(self, problem: Equilibrium) -> SolveOutcome | None:
        """Outcome of the problem's next solution, with body and road as it left them. Collective.

        None if it has to be solved, from the present state, and passed to `add`.
        """
        if self._journal is None:
            return None
        number, comm = self._number(problem), problem.body.comm
        place = self._journal.done
        entry = self._journal.next(comm, lambda entry: _same_mesh(problem, entry))
        predicted, self._predicted = np.array(self._predicted, dtype=bool), []
        if entry is None:
            about = {"problem": np.array(number), "mesh": _mesh(problem), "predicted": predicted}
            self._open = _state(problem, "begin") | about
            return None
        again = place in self._again
        _put(problem, entry, "begin" if again else "end")
        return None if again else _read(entry)

    def add(self, problem: Equilibrium, step: SolveOutcome) -> None:
        """Record the solution of a problem that `retrace` did not know. Collective."""
        if self._journal is not None and self._open is not None:
            self._journal.add(self._open | _state(problem, "end") | _step(step))
        self._open = None

    def predicted(self) -> bool | None:
        """Whether the estimate before the next solution succeeded; None if it is to be made."""
        if self._journal is None or self._journal.done >= len(self._journal.found):
            return None
        known = self._journal.found[self._journal.done]["predicted"]
        return bool(known[len(self._predicted)])

    def add_prediction(self, success: bool) -> None:
        """Record whether an estimate before the next solution succeeded."""
        if self._journal is not None:
            self._predicted.append(success)

    def _number(self, problem: Equilibrium) -> int:
        for k, other in enumerate(self._problems):
            if other() is problem:
                return k
        self._problems.append(weakref.ref(problem))
        return len(self._problems) - 1


def _mesh(problem: Equilibrium) -> np.ndarray:
    """Hash of the lattice ids of this process's own nodes."""
    return np.frombuffer(hashlib.sha256(problem.body.ids.tobytes()).digest(), np.uint8)


def _same_mesh(problem: Equilibrium, entry: Entry) -> bool:
    return np.array_equal(_mesh(problem), entry["mesh"])


def _state(problem: Equilibrium, when: str) -> dict[str, np.ndarray]:
    state = {
        name: np.array(values) for name, values in zip(_ROAD, problem.road.snapshot(), strict=True)
    }
    state["field"] = problem.body.u.x.array.copy()
    return {f"{when}/{name}": value for name, value in state.items()}


def _put(problem: Equilibrium, entry: Entry, when: str) -> None:
    problem.body.u.x.array[:] = entry[f"{when}/field"]
    active, force, height = (entry[f"{when}/{name}"] for name in _ROAD)
    problem.road.restore((active.copy(), force.copy(), float(height)))


def _step(step: SolveOutcome) -> dict[str, np.ndarray]:
    counted = np.array([step.converged, step.iterations, step.residual], dtype=float)
    return {"step": counted, "reason": np.frombuffer(step.reason.encode(), np.uint8)}


def _read(entry: Entry) -> SolveOutcome:
    converged, iterations, residual = entry["step"]
    reason = bytes(entry["reason"]).decode()
    return SolveOutcome(bool(converged), int(iterations), float(residual), reason)


class RestoringSprings:
    """Springs of `stiffness` (owned unknowns,) N/m to the displacement at the last `here`."""

    def __init__(self, body: Body, stiffness: float) -> None:
        """Proportional to nodal mass, with mean `stiffness` (N/m) per unknown. Collective."""
        mass = body.nodal_mass()
        total, count = body.comm.allreduce(np.array([mass.sum(), len(mass)]))
        self._field = body.u.x
        self.stiffness = stiffness * mass * (count / total)
        self.here()

    def here(self) -> None:
        """Anchor the springs at the current displacement."""
        self._place = self._field.array[: len(self.stiffness)].copy()

    def add_to(self, out: np.ndarray) -> None:
        """Add the springs' forces (N) at the owned unknowns."""
        out += self.stiffness * (self._field.array[: len(out)] - self._place)

    def stiffen(self, tangent: PETSc.Mat) -> None:
        """Add the springs to the tangent. Collective."""
        diagonal = tangent.getDiagonal()
        diagonal.array[:] += self.stiffness
        tangent.setDiagonal(diagonal)


@dataclass(frozen=True)
class SolveOutcome:
    """Outcome of one solve: `iterations` tangents, `residual` relative to the force scale."""

    converged: bool
    iterations: int
    residual: float
    reason: str


class Forces:
    """All forces except those of the road. Forms and matrix are created once. Collective.

    `pressure` (Pa) may be changed, and `rolls`, the share of the inertial forces of rolling; `cost`:
    seconds by part; `springs`: springs that slow the body during a snap.
    """

    def __init__(self, body: Body, rolling: Rolling) -> None:
        self.body, self.rolling = body, rolling
        self.cost = Timing()
        self.springs: RestoringSprings | None = None
        self.pressure = fem.Constant(body.mesh, 0.0)
        self.rolls = fem.Constant(body.mesh, 1.0)
        self._before = fem.Function(body.space)
        residual = static_residual(body, self.pressure, rolling, self.rolls)
        self._damping: ShapeDamping | None = None
        if rolling.speed * rolling.stiffness_damping:
            self._damping = ShapeDamping(body, self.pressure, rolling)
            residual += self._damping.work
        self._residual_form = compat.form(residual)
        self._tangent = compat.form(tangent(body, residual) + stress_prediction(body, self._before))
        self._inverted = compat.form(inverted_volume(body))
        self._clamp = [body.clamp()]
        self._local_tangent = fem.petsc.create_matrix(self._tangent)
        self.matrix = self._local_tangent
        self._work = compat.force_vector(self._residual_form, body.space)
        self._rim = (3 * body.rim[body.rim < body.nodes, None] + np.arange(3)).ravel()

    @property
    def convergence_rate(self) -> float:
        """Bound on the error reduction per Newton step when the tangent is incomplete."""
        return self._damping.convergence_rate if self._damping else 0.0

    @property
    def correction_steps(self) -> int:
        """Solutions of a linear problem that complete it to 1e-9: 1 with a complete tangent."""
        return (
            1 + math.ceil(math.log(1e-9) / math.log(self.convergence_rate))
            if self.convergence_rate
            else 1
        )

    def lacking(self, change: np.ndarray, along: RoadCoordinates | None) -> np.ndarray:
        """Forces (N) of a `change` (m) that the tangent lacks, both in the road's coordinates
        `along` or the wheel's axes. Collective."""
        if not (self._damping and self.convergence_rate):
            return np.zeros_like(change)
        forces = self._damping.lacking(change if along is None else along.spread(change))
        if along is not None:
            along.turn(forces)
        return forces

    def _assemble_residual(self) -> np.ndarray:
        """Residual forces at the owned dofs, N; 0 on the rim, where the wheel takes them."""
        if self._damping:
            self._damping.update()
        with self._work.localForm() as local:
            local.set(0.0)
        fem.petsc.assemble_vector(self._work, self._residual_form)
        self._work.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        if self.springs:
            self.springs.add_to(self._work.array)
        self._work.array[self._rim] = 0.0
        return self._work.array_r

    def _assemble_tangent(self) -> None:
        self._local_tangent.zeroEntries()
        fem.petsc.assemble_matrix(self._local_tangent, self._tangent, bcs=self._clamp)
        self._local_tangent.assemble()
        if self.springs:
            self.springs.stiffen(self._local_tangent)
        if self._damping:
            self.matrix = self._damping.completed(self._local_tangent)

    def _inside_out(self) -> bool:
        """Whether det F <= 0 at some Gauss point: the energy does not distinguish J from -J."""
        return self.body.comm.allreduce(fem.assemble_scalar(self._inverted)) > 0


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
        self._unrolled = None if shape.flat else RoadCoordinates(body, self.road)
        self.force_scale = self._force_scale()
        self._damped = bool(rolling.speed * (rolling.damping + rolling.stiffness_damping))
        self._system = self._make_system("lu" if self._damped else "cholesky")
        self._contact: LinearContact | None = None
        self._solved = body.u.x.array.copy()
        self.history = SolutionHistory(None)

    def _make_road(self) -> RoadContact:
        return RoadContact(self.body, self.shape)

    def _make_system(self, kind: str) -> System:
        return ConstrainedSystem(self.body.comm, self.matrix, kind, self.cost)

    def _make_contact(self) -> LinearContact | None:
        """Solver for the active set within a step; None if the road is not flat."""
        return LinearContact(self.body.comm, self._system, self.road) if self.shape.flat else None

    @property
    def _in_its_coordinates(self) -> RoadCoordinates | None:
        """Coordinates in which Newton's method currently works; None: the wheel's axes."""
        return self._unrolled if self.road.height > -np.inf else None

    def _residual(self) -> np.ndarray:
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
    ) -> SolveOutcome:
        """`_solve`, or its result from the `history` of an interrupted computation. Collective."""
        step = self.history.retrace(self)
        if step is not None:
            return self.solved(step)
        step = self._solve(road_height, load, allowed)
        self.history.add(self, step)
        return step

    def _solve(self, road_height: float | None, load: float | None, allowed: float) -> SolveOutcome:
        """Equilibrium with the road at the given height (m), or without a road (None). Collective.

        With a `load` (N) the road moves from that height until it carries it. `allowed` N of
        residual may remain in an intermediate state. Newton's method and the active set share one
        loop: a dof is held if f - c gap > 0 with its own stiffness c, which is complementarity for
        any c > 0 (Hintermueller, Ito, Kunisch 2003, doi 10.1137/S1052623401383558). Each new
        tangent settles the set (LinearContact) and is reused while each step leaves at most a fifth
        of the error, or what a new one would leave (`convergence_rate`)."""
        field = self.body.u.x
        before, self._contact = (field.array.copy(), self.road.snapshot()), None
        self.road.height = -np.inf if road_height is None else road_height
        self._before.x.array[:] = field.array
        error, tangents = 0.0, 0
        while True:
            changed, last = self.road.choose(), error
            error = self._error(load)
            reason = self._stopped(error, changed, tangents, allowed / self.force_scale)
            if reason == "converged":
                return self.solved(SolveOutcome(True, tangents, error, reason))
            gap_closure = None
            changed = changed or bool(self._contact and self._contact.changed)
            if not reason and (changed or not error < max(_SERVES, self.convergence_rate) * last):
                tangents += 1
                reason = "" if self._take_tangent() else "the tangent is singular"
                gap_closure = self._system.gap_closure
            reason = reason or self._move(gap_closure, load)
            if reason:
                break
        field.array[:] = before[0]
        self.road.restore(before[1])
        return self.solved(SolveOutcome(False, tangents, error, reason))

    def solved(self, step: SolveOutcome) -> SolveOutcome:
        """Record the outcome: the body is in the state found, or restored if there is none."""
        if step.converged:
            self._solved = self.body.u.x.array.copy()
            self.road_height = None if self.road.height == -np.inf else self.road.height
        else:
            self._contact = None
        return step

    def predict(self, road_height: float) -> bool:
        """`_predict`, or its outcome in the `history` if the next solution is known. Collective."""
        success = self.history.predicted()
        if success is None:
            success = self._predict(road_height)
        self.history.add_prediction(success)
        return success

    def _predict(self, road_height: float) -> bool:
        """Move from the last solution to the estimate for `road_height` (m) by the last tangent and
        its sets. False if there is none, the body has left that state or it fails. Collective."""
        moved = np.abs(self._solved - self.body.u.x.array).max(initial=0.0)
        stays = bool(moved <= _STAYS * self.body.ring.thickness)
        if self._contact is None or not self.body.comm.allreduce(stays, op=MPI.LAND):
            return False
        self._residual()
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
            out = self._residual().copy()
        self.road.subtract_forces(out)
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
        factorised = self._system.take(self.matrix, self.road.held, *self.road.steps())
        self._contact = self._make_contact() if factorised else None
        return factorised

    def _move(
        self, gap_closure: PrescribedMotion | None, load: float | None, rise: float | None = None
    ) -> str:
        """One linearised step; the road may `rise` (m). Reason for failure, or "". Collective."""
        rows = self.road.rows(self._work.array_r.copy()), gap_closure, load
        if self._contact is None or self.road.height == -np.inf:
            step = held_step(self.body.comm, self._system, self.road, rows)
        else:
            step = self._contact.step(*rows, rise)
        if step is None:
            return "the road meets no resistance"
        (change, reaction), field = step, self.body.u.x
        self._before.x.array[:] = field.array
        along = self._in_its_coordinates
        field.array[: len(change)] += change if along is None else along.spread(change)
        self.road.project()
        self.road.set_reactions(reaction)
        return ""

    def road_stiffness(self) -> float:
        """Road force gained per metre of rise, N/m, with the present contact nodes. Collective."""
        self._before.x.array[:] = self.body.u.x.array
        if not self._take_tangent():
            return float("nan")
        road_rise, lacking = self._system.road_rise, np.zeros(len(self._work.array_r))
        for _ in range(self.correction_steps):
            change, force = self._system.solve(-lacking, road_rise)
            force += lacking[self.road.held]
            lacking = self.lacking(change, self._in_its_coordinates)
        return self.body.comm.allreduce(self.road.vertical_force(force))

    def uniform_traction_step(self, weights: np.ndarray, load: float) -> tuple[float, float]:
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

    def resume(
        self, displacement: np.ndarray, force: np.ndarray, height: float | None
    ) -> SolveOutcome:
        """Solve from displacement (n, 3) m and road force (n,) N of all lattice nodes, road at
        `height` (m). A state already in equilibrium stays unchanged. Collective."""
        self.body.set_displacement(displacement)
        if height is not None:
            self.road.take(force[self.body.ids], height)
        return self.solve(height)

    def _force_scale(self) -> float:
        """Force scale (N): the undeformed body's typical dof stiffness times the wall thickness;
        1e-12 of it is far below any load of interest. The road takes the stiffness of its dofs."""
        self._before.x.array[:] = self.body.u.x.array
        self._assemble_tangent()
        diagonal = self.matrix.getDiagonal()
        self.road.set_stiffness(diagonal.array)
        return self.body.ring.thickness * diagonal.norm() / np.sqrt(diagonal.size)
