"""Matrices of small motions about a static state, on the unknowns that its support leaves free.

For basis functions phi on the undeformed mesh and w = e_y x X (Omega factored out). K is the
tangent stiffness with its geometric and follower-pressure parts, the rubber's material part with
dynamic moduli at DYNAMIC_FREQUENCY:

    M_ij = int rho phi_i . phi_j                    G_ij = skew of int rho phi_i . (grad phi_j w)
    S_ij = -int rho (grad phi_i w) . (grad phi_j w) Q_ij = int rho phi_i . (e_y x phi_j),  B = G - Q
    S_B_ij = -int rho (grad phi_i w - e_y x phi_i) . (grad phi_j w - e_y x phi_j)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc
from scipy import sparse
from ufl.core.expr import Expr

from tireroad.fem import compat
from tireroad.fem.collective import from_local_rows, summed
from tireroad.fem.static.virtual_work import (
    AT_REST,
    Rolling,
    added_stress,
    body_convective_form,
    body_rate_form,
    convection_form,
    convective_form,
    static_residual,
    tangent,
)
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import Kind
from tireroad.fem.wheel import Axle

TURN = 3  # components 3, 4, 5 of an unknown: rotations about x, y, z
ROTATION = ("gyroscopic", "convective", "body", "body_convective")
TRANSLATIONS = slice(0, 3)
# The factors of 2 Omega and of Omega^2, by the inertia of rotation.
FELT = {"full": ("gyroscopic", "convective"), "doppler": ("body", "body_convective")}


@dataclass(frozen=True)
class Support:
    """`rim` "fixed" or "free"; `held`: own nodes whose vertical motion the road holds."""

    rim: str = "fixed"
    held: np.ndarray = field(default_factory=lambda: np.zeros(0, int))


FIXED = Support()


class Unknowns:
    """Unknowns of a supported body and the map T from them to its nodes. Collective to make.

    `free` (k,): this process's nodal dofs that are unknowns; the six of a free rim follow on the
    last process. For own unknowns: `mass` (n,) kg, the diagonal of T^T M T; `place` (n, 3) m,
    undeformed; `component` (n,): 0, 1, 2 for x, y, z and 3, 4, 5 for rotations; `carried` (3, n)
    kg: momentum per unit rate.
    """

    def __init__(self, body: Body, support: Support) -> None:
        self._body = body
        rim = body.rim[body.rim < body.nodes]
        known = np.zeros((body.nodes, 3), bool)
        known[rim] = True
        known[support.held, 2] = True
        self.free = np.flatnonzero(~known)
        nodal = body.nodal_mass()
        self.rim = Rim(body, rim, nodal.reshape(-1, 3)[rim, 0]) if support.rim == "free" else None
        points = body.lattice.points(body.ids)
        self.mass, self.place = nodal[self.free], points[self.free // 3]
        self.component = self.free % 3
        self.carried = self.mass * (self.component == np.arange(3)[:, None])
        if self.rim and self.rim.mine:
            self.mass = np.append(self.mass, np.ones(6))
            self.place = np.vstack([self.place, np.zeros((6, 3))])
            self.component = np.append(self.component, np.arange(6))
        if self.rim:
            moved = self.rim.momentum()
            self.carried = np.hstack([self.carried, moved[:, : 6 if self.rim.mine else 0]])
        self._prolongation = self._make_prolongation(self.rim) if self.rim else None
        first = 3 * body.space.dofmap.index_map.local_range[0]
        self._rows = PETSc.IS().createGeneral(
            (self.free + first).astype(PETSc.IntType), comm=body.comm
        )

    def _make_prolongation(self, rim: Rim) -> PETSc.Mat:
        """T as a distributed matrix. Collective."""
        comm, rows = self._body.comm, 3 * self._body.nodes
        own = len(self.mass)
        last = comm.allreduce(own)
        first = comm.exscan(own) or 0
        unit = sparse.csr_matrix(
            (np.ones(len(self.free)), (self.free, first + np.arange(len(self.free)))), (rows, last)
        )
        columns = np.tile(np.arange(last - 6, last), len(rim.dofs))
        values = (rim.shape.ravel(), (np.repeat(rim.dofs, 6), columns))
        csr = sparse.csr_matrix(unit + sparse.csr_matrix(values, (rows, last)))
        sizes = ((rows, PETSc.DETERMINE), (own, PETSc.DETERMINE))
        return from_local_rows(csr, sizes, comm)

    def reduced(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """T^T X T for a matrix X over all dofs of the body. Collective."""
        if self._prolongation is None:
            return matrix.createSubMatrix(self._rows, self._rows)
        return matrix.ptap(self._prolongation)

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Owned nodal values (nodes, 3, ...) from own unknowns (n, ...). Collective."""
        out = np.zeros((3 * self._body.nodes, *values.shape[1:]))
        out[self.free] = values[: len(self.free)]
        if self.rim:
            out[self.rim.dofs] = self.rim.shape @ self.rim.shared(values[len(self.free) :])
        return out.reshape(self._body.nodes, 3, *values.shape[1:])

    def restrict(self, nodal: np.ndarray) -> np.ndarray:
        """Own unknowns (n, ...) from owned nodal values (nodes, 3, ...) of an admissible motion.
        Collective."""
        flat = nodal.reshape(-1, *nodal.shape[2:])
        own = flat[self.free]
        if self.rim is None:
            return own
        on_rim = self.rim.unknowns(flat[self.rim.dofs])
        return np.concatenate([own, on_rim]) if self.rim.mine else own

    def rim_motion(self, values: np.ndarray) -> np.ndarray:
        """Translation and rotation of the free rim (6, ...), on every process. Collective."""
        assert self.rim is not None, "only a free rim moves"
        return self.rim.coordinates @ self.rim.shared(values[len(self.free) :])

    def loads(
        self, nodal: sparse.csr_matrix, on_rim: np.ndarray | None = None
    ) -> sparse.csr_matrix:
        """T^T of forces on own nodal dofs (3 nodes, k), plus forces and moments (6, k) on the rim.
        Collective."""
        nodal = nodal.tocsr()
        own = nodal[self.free]
        if self.rim is None:
            return own
        rim_loads = summed(self._body.comm, self.rim.shape.T @ nodal[self.rim.dofs].toarray())
        if on_rim is not None:
            rim_loads = rim_loads + self.rim.coordinates.T @ on_rim
        return (
            sparse.vstack([own, sparse.csr_matrix(rim_loads)], format="csr")
            if self.rim.mine
            else own
        )


class Rim:
    """The bead faces as one rigid body.

    Own `dofs` (d,); `shape` (d, 6): their motion per unknown; `coordinates` (6, 6): translation and
    rotation per unknown; `mine`: whether this process owns the unknowns.

    A free rim is an unsupported rigid body without mass of its own. On its nodes

        u_i = a + theta x x_i,   six unknowns R eta with R^T M R = 1,

    so that the diagonal mass stays diagonal. The static state is that of the clamped rim. The wheel
    still carries the rim's static forces r, which rotate with it, and a constant force at the
    axle's centre. The second-order work of rotating forces adds to K, on the rotations,

        W_ab = sum_i (r_a x_b + r_b x_a) / 2 - delta_ab r . x.

    A free tire without a road then has its six rigid modes at any inflation (a uniform pressure on
    the two equal bead circles of a rigid rim has no resultant), and K is symmetric.
    Mass-proportional damping then acts against the ground, as there is no wheel on an axle.
    """

    def __init__(self, body: Body, nodes: np.ndarray, mass: np.ndarray) -> None:
        self._comm = body.comm
        self._points = body.lattice.points(body.ids[nodes])
        self._mass = np.repeat(mass, 3)
        self.dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
        self.mine = body.comm.rank == body.comm.size - 1
        motions = rigid_motions(self._points)
        inertia = body.comm.allreduce(motions.T @ (self._mass[:, None] * motions))
        # With the Cholesky factor each unknown combines only its own and earlier motions, which
        # preserves mirror symmetries.
        self.coordinates = np.linalg.inv(np.linalg.cholesky(inertia)).T
        self.shape = motions @ self.coordinates

    def shared(self, values: np.ndarray) -> np.ndarray:
        """The owner's values (6, ...) on every process. Collective."""
        return self._comm.bcast(values if self.mine else None, root=self._comm.size - 1)

    def unknowns(self, motion: np.ndarray) -> np.ndarray:
        """The six unknowns (6, ...) of a rigid motion given on the rim's own dofs (d, ...).
        Collective."""
        weighted = self._mass.reshape(-1, *[1] * (motion.ndim - 1)) * motion
        return summed(self._comm, self.shape.T @ weighted)

    def momentum(self) -> np.ndarray:
        """Momentum (3, 6) kg per unit rate of the six unknowns. Collective."""
        weighted = self._mass[:, None] * self.shape
        return summed(self._comm, np.stack([weighted[d::3].sum(axis=0) for d in range(3)]))

    def turning_stiffness(self, force: np.ndarray) -> np.ndarray:
        """W (6, 6) of static forces (d,) N on the rim's dofs that rotate with it. Collective."""
        product = summed(self._comm, force.reshape(-1, 3).T @ self._points)
        whole = np.zeros((6, 6))
        whole[TURN:, TURN:] = turning_moments(product)
        return self.coordinates.T @ whole @ self.coordinates


def turning_moments(product: np.ndarray) -> np.ndarray:
    """W_ab (3, 3) N m/rad of forces that rotate with the rim, from sum_i r_a x_b N m."""
    return (product + product.T) / 2 - np.trace(product) * np.eye(3)


def rigid_motions(points: np.ndarray) -> np.ndarray:
    """Translations and rotations about the origin, (3 k, 6), of points (k, 3) m."""
    out = np.zeros((len(points), 3, 6))
    out[:, :, :3] = np.eye(3)
    for axis, unit in enumerate(np.eye(3)):
        out[:, :, TURN + axis] = np.cross(unit, points)
    return out.reshape(-1, 6)


class Rotation:
    """G, S and B of the full inertia and S_B of the doppler one, with Omega factored out.

    Each is assembled at first use (collective): a static flexibility needs only two of the four.
    """

    def __init__(self, body: Body, assemble: Callable[[ufl.Form], PETSc.Mat]) -> None:
        self._body, self._assemble = body, assemble

    @cached_property
    def gyroscopic(self) -> PETSc.Mat:
        """G, kg."""
        return self._assemble(convection_form(self._body))

    @cached_property
    def convective(self) -> PETSc.Mat:
        """S, kg."""
        return self._assemble(convective_form(self._body))

    @cached_property
    def body(self) -> PETSc.Mat:
        """B, kg."""
        return self._assemble(body_rate_form(self._body))

    @cached_property
    def body_convective(self) -> PETSc.Mat:
        """S_B, kg."""
        return self._assemble(body_convective_form(self._body))

    def coriolis(self, inertia: str) -> PETSc.Mat:
        """The factor of 2 Omega, kg: G, or B for the doppler inertia."""
        return self.gyroscopic if inertia == "full" else self.body

    def carrying(self, inertia: str) -> PETSc.Mat:
        """The factor of Omega^2, kg: S, or S_B for the doppler inertia."""
        return self.convective if inertia == "full" else self.body_convective


@dataclass(frozen=True)
class Compound:
    """The material part of the stiffness, N/m, of compounds of one kind.

    At DYNAMIC_FREQUENCY, where the imaginary part of the stiffness for complex moduli is the sum of
    `kind.loss_factor` times `stiffness` over the compounds.
    """

    kind: Kind
    stiffness: PETSc.Mat


class Operators:
    """Matrices on the unknowns of a body at its present displacement. Collective.

    `mass`: diagonal of the Gauss-Lobatto mass matrix, kg, positive and of the full order of the
    elements (the quadrature points are the nodes); `carried` (3, n) kg: momentum per unit rate of
    each unknown; `unknowns` describes them. With a free rim the static forces on the rim contribute
    to the stiffness, including those of the `rolling` shape (mass damping only).
    """

    def __init__(
        self,
        body: Body,
        inflation: float,
        support: Support = FIXED,
        rolling: Rolling = AT_REST,
        unknowns: Unknowns | None = None,
    ) -> None:
        """On the unknowns that a `support` leaves, or on given ones."""
        self.body = body
        self.unknowns = unknowns or Unknowns(body, support)
        self.mass, self.carried = self.unknowns.mass, self.unknowns.carried
        self.stiffness = self._assemble(_stiffness(body, inflation))
        if self.unknowns.rim:
            self._add_turning(self.unknowns.rim, inflation, rolling)
        self.stiffness.setOption(PETSc.Mat.Option.SYMMETRIC, True)

    def _add_turning(self, rim: Rim, inflation: float, rolling: Rolling) -> None:
        """Add the stiffness against rotations of the rim due to its static forces. Collective."""
        body = self.body
        pressure = fem.Constant(body.mesh, inflation)
        out = fem.petsc.assemble_vector(compat.form(static_residual(body, pressure, rolling)))
        out.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        turning = rim.turning_stiffness(out.array_r[rim.dofs])
        if rim.mine:
            end = self.stiffness.getOwnershipRange()[1]
            six = np.arange(end - 6, end, dtype=PETSc.IntType)
            self.stiffness.setValues(six, six, turning, PETSc.InsertMode.ADD)
        self.stiffness.assemble()

    def compounds(self) -> list[Compound]:
        """The compounds' own part of the stiffness, by kind. Collective."""
        return [
            Compound(kind, self._assemble(_material(self.body, share)))
            for kind, share in self.body.wall.kinds()
        ]

    def rotation(self) -> Rotation:
        """The matrices of the rotating frame."""
        return Rotation(self.body, lambda form: _without_zeros(self._assemble(form)))

    def consistent_mass(self) -> PETSc.Mat:
        """int rho phi_i . phi_j fully integrated, kg: reference for the diagonal. Collective."""
        body = self.body
        return self._assemble(body.inertia(ufl.inner(body.trial, body.test)))

    def _assemble(self, form: ufl.Form) -> PETSc.Mat:
        matrix = fem.petsc.assemble_matrix(compat.form(form))
        matrix.assemble()
        reduced = self.unknowns.reduced(matrix)
        matrix.destroy()
        return reduced

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Owned nodal values (nodes, 3, ...) from own unknowns (n, ...). Collective."""
        return self.unknowns.spread(values)

    def restrict(self, nodal: np.ndarray) -> np.ndarray:
        """Own unknowns (n, ...) from owned nodal values (nodes, 3, ...) of an admissible motion.
        Collective."""
        return self.unknowns.restrict(nodal)

    def trace(self, values: np.ndarray) -> np.ndarray:
        """Outer-face motion (3 s, m) of the motions (n, m), on every process. Collective.

        With a free rim its translation and rotation (6, m) follow.
        """
        face = self.body.surface(self.spread(values)).reshape(-1, values.shape[1])
        if self.unknowns.rim is None:
            return face
        return np.vstack([face, self.unknowns.rim_motion(values)])


def _without_zeros(matrix: PETSc.Mat) -> PETSc.Mat:
    """The matrix without its zero entries; the one given is destroyed.

    G and S couple like components alone, a third of the mesh's pattern: their products take a third
    of the time and of the memory. Collective.
    """
    sizes, comm = matrix.getSizes(), matrix.comm
    indptr, indices, values = matrix.getValuesCSR()
    matrix.destroy()
    own = sparse.csr_matrix((values, indices, indptr), sizes[0])
    own.eliminate_zeros()
    return from_local_rows(own, sizes, comm)


@dataclass(frozen=True)
class RimMotion:
    """Products of the matrices X with the rim's motions R, by the names of the matrices.

    `rows` (n, 6): X R on own unknowns of the tire with fixed rim; `whole`
    (6, 6): R^T X R including the rim's own part. kg, N/m; kg/rad, kg/rad2 and factors m, m2 for
    rotations. A standing wheel has no "gyroscopic", "convective", "body" and "body_convective" (B R
    and S_B R, of `rows` alone).

    Rigid motion of the rim with the whole tire: the products of the tire's matrices with it.

    R = (e_x, e_y, e_z, e_x x, e_y x, e_z x), x the deformed position relative to the axle's centre.
    K is that of the static state under constant road forces: K R = 0 for translations; for
    rotations K R is the moment of the loads that do not rotate with the tire. G R = S R = 0 for
    translations, as a uniform velocity does not change the flow of material through the ring.
    """

    rows: dict[str, np.ndarray]
    whole: dict[str, np.ndarray]

    def moments(self, speed: float, inertia: str = "full") -> np.ndarray:
        """A (3, 3, n) on own unknowns at `speed` (rad/s), for the moments at a fixed hub, N m.

        They are the moments of the loads minus A_2 u'' + A_1 u' + A_0 u
        (modal.corner.Corner.moments)."""
        turned = {name: rows[:, TURN:].T for name, rows in self.rows.items()}
        out = np.stack([turned["stiffness"], np.zeros_like(turned["mass"]), turned["mass"]])
        if speed:
            gyroscopic, convective = FELT[inertia]
            out[0] += speed**2 * turned[convective]
            out[1] -= 2 * speed * turned[gyroscopic]
        return out


def rim_motion(body: Body, inflation: float, rolling: Rolling, turns: bool) -> RimMotion:
    """Products with the rim's motions at the body's present displacement. Collective.

    The rim's static forces rotate with it. No matrix is assembled: stresses, cords and pressure
    rotate with the material, F(Q x) = Q F(x), so for a rotation about e_k  K R = e_k x F,  F being
    the nodal forces of the static state. The other matrices act on R as linear forms.
    """
    comm, unknowns = body.comm, Unknowns(body, FIXED)
    points = body.lattice.points(body.ids) + body.owned(body.u.x.array)
    motions = rigid_motions(points)
    force = _nodal_forces(body, inflation, AT_REST)
    products = {"mass": body.nodal_mass()[:, None] * motions, "stiffness": np.zeros_like(motions)}
    for k, unit in enumerate(np.eye(3)):
        products["stiffness"][:, TURN + k] = np.cross(unit, force).ravel()
    if turns:
        products |= _turning(body, motions)
    rows = {name: product[unknowns.free] for name, product in products.items()}
    for name in FELT["doppler"]:
        products.pop(name, None)
    whole = {name: summed(comm, motions.T @ product) for name, product in products.items()}
    # The wheel carries the forces on the rim: those of the tire's own nodes and those of rolling.
    rim = np.setdiff1d(np.arange(body.nodes), unknowns.free // 3)
    turned = _nodal_forces(body, inflation, rolling)[rim].T @ points[rim] - force.T @ points
    turned = summed(comm, turned)
    whole["stiffness"] = np.zeros((6, 6))
    whole["stiffness"][TURN:, TURN:] = turning_moments(turned)
    for name, sign in (("gyroscopic", -1), ("convective", 1)):
        if name in whole:
            whole[name] = (whole[name] + sign * whole[name].T) / 2
            whole[name][TRANSLATIONS] = whole[name][:, TRANSLATIONS] = 0.0
    return RimMotion(rows, whole)


def begin_forms(body: Body) -> None:
    """Begin to compile the largest forms of `Operators`, while a static state is sought. Collective."""
    compat.begin_form(_stiffness(body, 0.0))
    for _, share in body.wall.kinds()[:1]:  # the others have the same code
        compat.begin_form(_material(body, share))


def _stiffness(body: Body, inflation: float) -> ufl.Form:
    """The tangent of stresses and pressure (Pa), with the moduli of small motions."""
    static = tangent(body, static_residual(body, fem.Constant(body.mesh, inflation), AT_REST))
    return static + _material(body, body.wall.stiffening()) if body.wall.stiffens else static


def _material(body: Body, share: Expr) -> ufl.Form:
    """A share (constant in each cell) of the rubber's material tangent, in UFL."""
    here = fem.Function(body.space)
    here.x.array[:] = body.u.x.array
    return tangent(body, added_stress(body, share, here))


def _nodal_forces(body: Body, inflation: float, rolling: Rolling) -> np.ndarray:
    """Forces (nodes, 3) N of stresses, pressure and rolling on own nodes. Collective."""
    work = static_residual(body, fem.Constant(body.mesh, inflation), rolling)
    return _assembled(body, work)


def _assembled(body: Body, form: ufl.Form) -> np.ndarray:
    """Own rows (nodes, 3) of a linear form. Collective."""
    out = fem.petsc.assemble_vector(compat.form(form))
    out.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    forces = out.array_r.reshape(-1, 3).copy()
    out.destroy()
    return forces


def _turning(body: Body, motions: np.ndarray) -> dict[str, np.ndarray]:
    """G R, S R, B R and S_B R (3 nodes, 6). Collective.

    For translations G R and S R are set to 0: the assembled values are rounding, or the mesh's
    error in a closed surface."""
    field = fem.Function(body.space)
    forms = {
        "gyroscopic": convection_form(body),
        "convective": convective_form(body),
        "body": body_rate_form(body),
        "body_convective": body_convective_form(body),
    }
    acting = {name: ufl.action(form, field) for name, form in forms.items()}
    out = {name: np.zeros_like(motions) for name in forms}
    for k, motion in enumerate(motions.T):
        body.owned(field.x.array)[:] = motion.reshape(-1, 3)
        field.x.scatter_forward()
        for name, form in acting.items():
            if k >= TURN or name in FELT["doppler"]:
                out[name][:, k] = _assembled(body, form).ravel()
    return out


def carried_pencil(
    axle: Axle, whole: Mapping[str, np.ndarray], speed: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass, damping and stiffness (7, 7) of the rigid motions of rim and body at `speed` (rad/s).

    They comprise the tire carried along (`whole`, by the names of `RimMotion.whole`), the wheel and
    its suspension.
    """
    mass = np.zeros((7, 7))
    mass[:6, :6], mass[6, 6] = whole["mass"] + axle.mass, axle.body_mass or 1.0
    drag, stiffness = (
        axle.between_wheel_and_body(axle.damping),
        axle.between_wheel_and_body(axle.stiffness),
    )
    stiffness[:6, :6] += whole["stiffness"]
    if speed:
        drag[:6, :6] += speed * (2 * whole["gyroscopic"] + axle.gyroscopic)
        stiffness[:6, :6] += speed**2 * whole["convective"]
    return mass, drag, stiffness
