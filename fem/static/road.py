"""The road in the static state: contact, the shape of a drum or a cambered plane, its coordinates."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.collective import from_local_rows
from tireroad.fem.tire.body import Body

Array = np.ndarray
_REACH = 0.9  # of the drum's radius


@dataclass(frozen=True, kw_only=True)
class RoadShape:
    """`camber` rad; `drum_radius` m, None: flat road; `inside`: the tire runs inside the drum.

    In the wheel's axes the surface is z = h + s(x, y), h being its height under the axle. The wheel
    is tilted by gamma about x (its top to the right, -y, for gamma > 0), so the road's normal is
    (0, sin gamma, cos gamma) there, and

        s = -y tan gamma + d(x) / cos gamma,
        d = sqrt(R^2 - x^2) - R on a drum, R - sqrt(R^2 - x^2) inside one,

    for a drum with a horizontal axis. Beyond 0.9 R a drum is continued by its tangent; there is no
    contact there.

    All of these surfaces are developable. A point on the road has the coordinates xi = R asin(x/R)
    (x on a plane) along it and eta = y cos gamma - z sin gamma across it. A body on the road that
    moves up with it keeps both.
    """

    camber: float = 0.0
    drum_radius: float | None = None
    inside: bool = False

    @property
    def flat(self) -> bool:
        """Whether the road is a level plane."""
        return self.camber == 0.0 and self.drum_radius is None

    @property
    def upright(self) -> float:
        """cos gamma: component of the road's normal along the wheel's z."""
        return math.cos(self.camber)

    def height(self, x: Array, y: Array) -> Array:
        """s (m) at x, y (m)."""
        lean = -math.tan(self.camber) * y
        if self.drum_radius is None:
            return lean
        near, radius, sign = self._near(x), self.drum_radius, self._sign
        drop = np.sqrt(radius**2 - near**2) - radius
        beyond = -near / np.sqrt(radius**2 - near**2) * (x - near)
        return lean + sign * (drop + beyond) / self.upright

    def slopes(self, x: Array, y: Array) -> tuple[Array, Array]:
        """ds/dx, ds/dy."""
        across = np.full(np.shape(x), -math.tan(self.camber))
        if self.drum_radius is None:
            return np.zeros(np.shape(x)), across
        near = self._near(x)
        return -self._sign * near / np.sqrt(self.drum_radius**2 - near**2) / self.upright, across

    def bending(self, x: Array) -> Array:
        """Curvature along xi towards the road's normal, 1/m: -1/R on a drum, 1/R inside one."""
        if self.drum_radius is None:
            return np.zeros(np.shape(x))
        return np.where(self._near(x) == x, -self._sign / self.drum_radius, 0.0)

    def unrolled(self, places: Array) -> Array:
        """xi, eta (n, 2) m of positions (n, 3) m."""
        if self.flat:
            return places[:, :2]
        x, y, z = places.T
        along = x
        if self.drum_radius is not None:
            near, radius = self._near(x), self.drum_radius
            cosine = np.sqrt(1.0 - (near / radius) ** 2)
            along = radius * np.arcsin(near / radius) + (x - near) / cosine
        return np.stack([along, y * self.upright - z * math.sin(self.camber)], axis=-1)

    def frames(self, x: Array, y: Array) -> Array:
        """Unit vectors (n, 3, 3) in the wheel's axes: along the road, to its left, normal to it."""
        along, across = self.slopes(x, y)
        unit, nothing = np.ones(len(along)), np.zeros(len(along))
        left = _unit(np.stack([nothing, unit, across], axis=-1))
        normal = _unit(np.stack([-along, -across, unit], axis=-1))
        forward = _unit(np.asarray(np.cross(left, normal), dtype=np.float64))
        return np.stack([forward, left, normal], axis=1)

    @property
    def up(self) -> Array:
        """The road's normal (3,) under the axle, along which it is raised."""
        return np.array([0.0, math.sin(self.camber), self.upright])

    def stretch(self, x: Array, y: Array) -> Array:
        """Ratio of the normal force to its component along the wheel's z, and of height to
        distance, at x, y (m)."""
        along, across = self.slopes(x, y)
        return np.sqrt(1.0 + along**2 + across**2)

    @property
    def _sign(self) -> float:
        return -1.0 if self.inside else 1.0

    def _near(self, x: Array) -> Array:
        assert self.drum_radius is not None, "the road is not a drum"
        reach = _REACH * self.drum_radius
        return np.clip(x, -reach, reach)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


FLAT = RoadShape()


class RoadContact:
    """A surface of given `shape` at `height` (m under the axle; -inf: no road).

    Arrays run over the owned tread nodes, in the order of `body.tread`: `dofs`: vertical unknowns;
    `active`: in contact; `force` N, work-conjugate to the road's height; `stiffness` N/m of each
    unknown.
    """

    def __init__(self, body: Body, shape: RoadShape = FLAT) -> None:
        self._body, self.shape = body, shape
        self._z = body.space.tabulate_dof_coordinates()[body.tread, 2]
        self.dofs = 3 * body.tread + 2
        self.height = -np.inf
        self.active = np.zeros(len(body.tread), dtype=bool)
        self.force = np.zeros(len(body.tread))
        self.stiffness = np.ones(len(body.tread))

    @property
    def held(self) -> np.ndarray:
        """Owned unknowns that the road holds."""
        return self.dofs[self.active]

    def places(self) -> np.ndarray:
        """Deformed positions (n, 3) m of the owned tread nodes."""
        body = self._body
        points = body.space.tabulate_dof_coordinates()[body.tread]
        return points + body.owned(body.u.x.array)[body.tread]

    def tread_height(self) -> np.ndarray:
        """Height z + u_z of the owned tread nodes over the road's shape, m."""
        height = self._z + self._body.u.x.array[self.dofs]
        return height if self.shape.flat else height - self.shape.height(*self.places().T[:2])

    def pressing(self) -> np.ndarray:
        """Component of the normal force along the wheel's z, (n,) N."""
        return self.force

    def gap(self) -> np.ndarray:
        """Height of the owned tread nodes above the road, m; infinite without a road."""
        return self.tread_height() - self.height

    def distance(self) -> np.ndarray:
        """Gaps of the active nodes times their stiffness, N."""
        return (self.stiffness * self.gap())[self.active]

    def steps(self) -> tuple[np.ndarray, np.ndarray]:
        """Motion (m) of the held unknowns to the road, and their motion per metre of rise."""
        return -self.gap()[self.active], np.ones(int(self.active.sum()))

    def set_stiffness(self, diagonal: np.ndarray) -> None:
        """Set the stiffness (N/m) from the diagonal over the owned unknowns."""
        self.stiffness = diagonal[self.dofs].copy()

    def subtract_forces(self, out: np.ndarray) -> None:
        """Subtract the road's forces from the forces (N) at the owned unknowns."""
        out[self.dofs] -= self.force

    def rows(self, out: np.ndarray) -> np.ndarray:
        """The residual (N) in the unknowns that Newton's method solves for."""
        return out

    def vertical_force(self, reaction: np.ndarray) -> float:
        """Sum of those reactions (N) at held unknowns that carry the load. Not collective."""
        return float(reaction.sum())

    def set_reactions(self, reaction: np.ndarray) -> None:
        """Take the reactions (N) at the held unknowns as the road's forces. Collective."""
        self.force[self.active] = reaction

    def snapshot(self) -> tuple[Any, ...]:
        """The state for `restore`."""
        return self.active.copy(), self.force.copy(), self.height

    def restore(self, state: tuple[Any, ...]) -> None:
        """Restore a state from `state`."""
        self.active, self.force, self.height = state

    def choose(self) -> bool:
        """Update the active set; True if it changed on any process. Collective."""
        pressing = self.pressing() > self.stiffness * self.gap()
        changed = bool((pressing != self.active).any())
        self.active = pressing
        self.force[~pressing] = 0.0
        return self._body.comm.allreduce(changed, op=MPI.LOR)

    def project(self) -> None:
        """Place active nodes exactly on the road, without gaps by rounding. Collective."""
        field, level = self._body.u.x, np.full(len(self.dofs), self.height)
        if not self.shape.flat:
            level += self.shape.height(*self.places().T[:2])
        field.array[self.dofs[self.active]] = (level - self._z)[self.active]
        field.scatter_forward()

    def take(self, force: np.ndarray, height: float) -> None:
        """Start from forces (N) of the owned nodes on a road at `height` (m). Collective."""
        self.force, self.height = force[self._body.tread], height
        self.active = self.force > 0
        self.project()

    def at_nodes(self) -> np.ndarray:
        """Normal force on all owned nodes, its component along the wheel's z, N; not negative."""
        force = np.zeros(self._body.nodes)
        force[self._body.tread] = self.pressing()
        return force

    @property
    def travel(self) -> float | None:
        """Travel per radian of a wheel rolling with friction, m; None for all others."""
        return None

    def pulled(self) -> np.ndarray | None:
        """Force (nodes, 2) N along and across the road on own nodes; None without friction."""
        return None

    def load(self) -> float:
        """Total force, N. Collective."""
        return self._body.comm.allreduce(float(self.force.sum()))

    def points(self) -> int:
        """Number of nodes in contact with positive force. Collective."""
        return self._body.comm.allreduce(int((self.force > 0).sum()))


class RoadCoordinates:
    """Road coordinates of the owned nodes that can touch a `road`, at their present positions. All
    methods except `turn` and `spread` are collective.

    X = X(xi, eta, w): the point of the surface at xi, eta along and across it (`RoadShape`),
    displaced by w along the direction in which the road is raised, cos gamma n_0 per metre of
    height, n_0 being its normal under the axle. With B = dX/d(xi, eta, w), whose columns are e_xi,
    e_eta and cos gamma n_0, residual forces and tangent become

        B^T out,    B^T K B + out . d2X,    d2X/dxi2 = -n/R  on a drum, n/R inside one, all others 0,

    so that a node is held in w alone, or in all three coordinates if it sticks, as on a level road.
    A frictionless road exerts f = N n_z along the wheel's z, N being the normal force; f is the
    reaction at w.
    """

    def __init__(self, body: Body, road: RoadContact) -> None:
        self._body, self._road = body, road
        self._blocks = 3 * body.tread[:, None] + np.arange(3)

    def _basis(self) -> Array:
        """B (n, 3, 3), its columns along the last axis."""
        shape, places = self._road.shape, self._road.places()
        basis = shape.frames(*places.T[:2]).transpose(0, 2, 1)
        basis[:, :, 2] = shape.upright * shape.up
        return basis

    def turn(self, out: Array) -> None:
        """Replace the forces (N) of the owned unknowns by B^T out, in place."""
        out[self._blocks] = np.einsum("nij,ni->nj", self._basis(), out[self._blocks])

    def spread(self, change: Array) -> Array:
        """Motion of the owned unknowns in the wheel's axes, m, from one in road coordinates."""
        change = change.copy()
        change[self._blocks] = np.einsum("nij,nj->ni", self._basis(), change[self._blocks])
        return change

    def tangent(self, matrix: PETSc.Mat) -> None:
        """Replace K by B^T K B plus the stiffness of the rotating normal forces, in place.

        B - 1 has entries of the tread only, so rows and columns are added: a general triple product
        takes longer than the factorisation where the matrix has many entries in a row.
        """
        same, off = PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN, self._basis() - np.eye(3)
        for blocks, first in ((off.transpose(0, 2, 1), True), (off, False)):
            turning = self._in_blocks(matrix, blocks)
            added = turning.matMult(matrix) if first else matrix.matMult(turning)
            matrix.axpy(1.0, added, same)
            added.destroy()
            turning.destroy()
        road = self._road
        x, y, _ = road.places().T
        normal = road.pressing() * road.shape.stretch(x, y) * road.active
        diagonal = matrix.getDiagonal()
        diagonal.array[self._blocks[:, 0]] += road.shape.bending(x) * normal
        matrix.setDiagonal(diagonal)
        diagonal.destroy()

    def _in_blocks(self, matrix: PETSc.Mat, blocks: Array) -> PETSc.Mat:
        """A matrix with the blocks (n, 3, 3) of the tread's nodes and no other entries."""
        sizes, first = matrix.getSizes(), matrix.getOwnershipRange()[0]
        rows = np.repeat(self._blocks, 3, axis=1).ravel()
        columns = np.tile(self._blocks, 3).ravel() + first
        local = sparse.csr_matrix(
            (blocks.ravel(), (rows, columns)), shape=(sizes[0][0], sizes[0][1])
        )
        return from_local_rows(local, sizes, self._body.comm)
