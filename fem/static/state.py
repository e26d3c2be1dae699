"""Result of a static solve: small arrays held by every process, and no dolfinx object.

The force of every cord is given at the integration points of its ply,

    f = E A_c (lambda - 1),  with the modulus in compression below lambda = 1, N per cord.

With one Gauss point per direction fewer than full integration, these are the points where the
elements' strains are most accurate (Barlow 1976, doi 10.1002/nme.1620100202). The grid is (ring,
along): ring angles ascending from the lowest point towards +x, then along the ply's line from its
first end (lower y at its middle) to its last.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import ufl
from mpi4py import MPI

from tireroad.fem import compat, kinematics
from tireroad.fem.sections import mesh2d
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.footprint import Evenness, Footprint, evenness, footprint, nodal_area
from tireroad.fem.static.road import FLAT, RoadShape
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.cords import TAUT, Cords
from tireroad.fem.tire.material import Material
from tireroad.fem.tire.mesh import NodeGrid, position
from tireroad.fem.tire.plies import RULE, Sheet, edge_rule, face_points


@dataclass(frozen=True)
class CordForce:
    """Cord force of one ply: undeformed `points` (a, b, 3) m, `force` (a, b) N per cord, tension
    positive, and `area` (a, b) m2 of the undeformed ply associated with each point.
    """

    points: np.ndarray
    force: np.ndarray
    area: np.ndarray

    @property
    def compressed(self) -> float:
        """Fraction of the ply's area whose cords are in compression."""
        return float(self.area[self.force < 0].sum() / self.area.sum())


def cord_forces(body: Body) -> dict[str, CordForce]:
    """Cord forces by ply at the present displacement, on every process. Collective."""
    forces = {}
    for number, cord in enumerate(body.plies.cords):
        chain = body.ring.section.plies[cord.name]
        values = np.zeros((2, *_grid(body, chain)))
        for sheet in body.plies.sheets:
            _read(body, sheet, number, chain, values)
        body.comm.Allreduce(MPI.IN_PLACE, values)
        forces[cord.name] = CordForce(_points(body, chain), values[0], values[1])
    return forces


def _line(body: Body) -> np.ndarray:
    return edge_rule(body.ring.order, RULE)[0]


def _grid(body: Body, chain: np.ndarray) -> tuple[int, int]:
    count = len(_line(body))
    return body.ring.segments * count, len(chain) * count


def _ascends(body: Body, chain: np.ndarray) -> np.ndarray:
    """Whether each edge's local coordinate runs along the chain."""
    section = body.ring.section
    return section.side(chain)[:, 0] == section.chain(chain)[:: section.order][:-1]


def _read(body: Body, sheet: Sheet, number: int, chain: np.ndarray, values: np.ndarray) -> None:
    """Write this process's part of force and area into `values` (2, a, b)."""
    tire, face = body.tire, sheet.face
    owned = tire.mesh.topology.index_map(3).size_local
    cells = np.flatnonzero(sheet.owner[:owned] == number)
    edges = chain[:, 1] == 2 * (face.axis - 1) + face.side
    place = np.full(len(body.ring.section.cells), -1)
    place[chain[edges, 0]] = np.flatnonzero(edges)
    edge = place[tire.section_cell[cells]]
    cells, edge = cells[edge >= 0], edge[edge >= 0]
    line, weight = edge_rule(body.ring.order, RULE)
    n = len(line)
    points = face_points(face.axis, face.side, line)
    stretched = ufl.dot(kinematics.deformation_gradient(body.u), sheet.direction)
    stretch = ufl.sqrt(ufl.dot(stretched, stretched))
    cords = body.plies.cords[number]
    # A face's area is |J^-T n| |det J| per unit of the reference face.
    area = face.area * abs(ufl.det(ufl.Jacobian(tire.mesh)))
    stretch, area = (compat.evaluate(e, points, tire.mesh, cells) for e in (stretch, area))
    modulus = np.where(stretch < TAUT, cords.compression, 1.0) * cords.youngs_modulus
    strain = np.where(np.abs(stretch - 1) > 1 - TAUT, stretch - 1, 0.0)  # else rounding
    force = modulus * cords.area * strain
    area = area * np.outer(weight, weight).ravel()
    segment = np.asarray(tire.mesh.topology.original_cell_index)[cells] // len(place)
    along = np.where(_ascends(body, chain)[edge][:, None], np.arange(n), np.arange(n)[::-1])
    i = (segment[:, None] * n + np.arange(n))[:, :, None]
    j = (edge[:, None] * n + along)[:, None, :]
    for out, part in zip(values, (force, area), strict=True):
        out[i, j] = part.reshape(-1, n, n)


def _points(body: Body, chain: np.ndarray) -> np.ndarray:
    """Undeformed positions (a, b, 3) m of the grid."""
    line, ring = _line(body), body.ring
    angle = (np.diff(ring.ring_corners)[:, None] * line + ring.ring_corners[:-1, None]).ravel()
    t = np.where(_ascends(body, chain)[:, None], line, 1 - line)
    cell, side = np.repeat(chain, len(line), axis=0).T
    fixed = (side % 2).astype(float)
    xi = np.where(side < 2, fixed, t.ravel())
    eta = np.where(side < 2, t.ravel(), fixed)
    edge = mesh2d.equispaced(ring.order)
    shape = mesh2d.tensor(mesh2d.lagrange(edge, xi), mesh2d.lagrange(edge, eta))
    section = ring.section
    place = np.einsum("ka,kax->kx", shape, section.nodes[section.cells[cell]])
    both = np.repeat(angle, len(place)), np.tile(place, (len(angle), 1))
    return position(*both).reshape(len(angle), len(place), 3)


@dataclass(frozen=True, kw_only=True)
class StaticState:
    """The static state of the tire on the `road`.

    `displacement` (n, 3) m of all lattice nodes. On the outer face, in its node order: `points` (s,
    3) m undeformed; `moved` (s, 3) m displacement; `force` (s,) N of the road on the tire along the
    wheel's z; `area` (s,) m2 associated with each node for uniform pressure; `half_sizes` (s, 2) m
    of the deformed rectangle around each node (x and y); `ring_rate` (s,) m/rad derivative of the
    deformed x with respect to the ring angle.

    `road_height` (m) is None without a road; `inflation` (Pa) and the steady `rolling` are the
    loads of this state. `cords` by name of the ply; `mass` (kg) of wall and cords; `ring`, `materials` by region and
    `plies`: fingerprint of the mesh, rubbers and cords of the tire, empty for a state from a file; `fine_extent`: contact extent on finer
    elements if known (fem.static.load_error).

    With friction: `pull` (s, 2) N, force of the road on the tire along and across it, and for a
    rolling tire `travel`, m per radian along the road without the wheel's slip.
    """

    displacement: np.ndarray
    points: np.ndarray
    moved: np.ndarray
    force: np.ndarray
    area: np.ndarray
    half_sizes: np.ndarray
    ring_rate: np.ndarray
    shape: tuple[int, int]
    touch_height: float
    road_height: float | None
    inflation: float = 0.0
    rolling: Rolling = AT_REST
    cords: Mapping[str, CordForce] = field(default_factory=dict)
    mass: float = 0.0
    materials: Mapping[str, Material] = field(default_factory=dict)
    ring: str = ""
    plies: tuple[Cords, ...] = ()
    road: RoadShape = FLAT
    fine_extent: Footprint | None = None
    pull: np.ndarray | None = None
    travel: float | None = None

    @property
    def load(self) -> float:
        """Total force along the road's normal under the axle, N."""
        if self.pull is None or self.road.flat:
            return float(self.force.sum()) / self.road.upright
        return float((self.push @ self.road.up).sum())

    @property
    def deflection(self) -> float | None:
        """Deflection along that normal from first touch, m; None without a road."""
        if self.road_height is None:
            return None
        return (self.road_height - self.touch_height) * self.road.upright

    @property
    def frames(self) -> np.ndarray | None:
        """Unit vectors (s, 3, 3) along, across and normal to the road; None on a level plane."""
        return None if self.road.flat else self.road.frames(*self.positions[:, :2].T)

    @property
    def push(self) -> np.ndarray:
        """Force (s, 3) N of the road, in the wheel's axes."""
        slopes = self.road.slopes(*self.positions[:, :2].T)
        push = np.stack([*(-self.force * slope for slope in slopes), self.force], axis=-1)
        if self.pull is None:
            return push
        frames = self.frames
        if frames is None:
            push[:, :2] += self.pull
            return push
        return push + np.einsum("st,sti->si", self.pull, frames[:, :2])

    @property
    def moment(self) -> np.ndarray:
        """Moment (3,) N m of the road's forces about the axle's centre."""
        return np.cross(self.positions, self.push).sum(axis=0)

    @property
    def normal_force(self) -> np.ndarray:
        """Force (s,) N normal to the road."""
        return self.force * self.road.stretch(*self.positions[:, :2].T)

    @property
    def positions(self) -> np.ndarray:
        """Deformed positions of the outer face, (s, 3) m."""
        return self.points + self.moved

    @property
    def seen(self) -> np.ndarray:
        """Positions (s, 3) m with heights relative to the road's shape, as if on a level plane."""
        places = self.positions
        places[:, 2] -= self.road.height(*places[:, :2].T)
        return places

    @property
    def gap(self) -> np.ndarray:
        """Height of the outer face above the road, (s,) m; 0 in contact."""
        gap = self.seen[:, 2] - self.road_height
        return np.where(self.force > 0, 0.0, gap)

    @property
    def penetration(self) -> float:
        """Largest penetration of outer-face nodes into the road, m; 0 without a road."""
        if self.road_height is None:
            return 0.0
        return max(float((self.road_height - self.seen[:, 2]).max()), 0.0)

    def rolling_radius(self) -> float:
        """Effective rolling radius, m: material speed over the road per unit speed of rotation.

        r_e = dx/dtheta of the deformed surface, averaged over the footprint with the contact force
        (the speed at which that material would stick), or at the lowest crown point without a road.
        With friction: the travel per radian of that solution.
        """
        if self.travel is not None:
            return self.travel
        if self.force.any():
            return float(self.ring_rate @ self.force / self.force.sum())
        crown = np.argmin(self.positions[:, 2])
        return float(self.ring_rate[crown])

    @property
    def pressure(self) -> np.ndarray:
        """Contact pressure, (s,) Pa."""
        touching = self.force > 0
        return np.divide(self.force, self.area, out=np.zeros_like(self.force), where=touching)

    def footprint(self) -> Footprint:
        """Extent of the contact, from finer elements if available; zeros without a road."""
        if self.fine_extent is not None:
            return self.fine_extent
        if self.road_height is None:
            return Footprint(0.0, 0.0, 0.0)
        return footprint(self.shape, self.positions, self.pressure, self.gap)

    def evenness(self) -> Evenness | None:
        """How the footprint is loaded across its width; None without one, or on too few nodes."""
        if self.road_height is None or not self.force.any():
            return None
        return evenness(self.shape, self.positions, self.force, self.area, self.gap)


def static_state(equilibrium: Equilibrium, touch_height: float) -> StaticState:
    """Gather the converged state on every process. Collective."""
    body, road_height = equilibrium.body, equilibrium.road_height
    displacement = body.displacement()
    face = body.lattice.face
    points = body.lattice.points(face)
    moved = displacement[face]
    force = (
        body.surface(equilibrium.contact_force())
        if road_height is not None
        else np.zeros(len(face))
    )
    pull = equilibrium.road.pulled() if road_height is not None else None
    half_sizes, ring_rate, shape = _surface_metric(body.lattice, points + moved)
    return StaticState(
        displacement=displacement,
        points=points,
        moved=moved,
        force=force,
        area=nodal_area(body.lattice, points + moved),
        half_sizes=half_sizes,
        ring_rate=ring_rate,
        shape=shape,
        touch_height=touch_height,
        road_height=road_height,
        inflation=float(equilibrium.pressure.value),
        rolling=equilibrium.rolling,
        road=equilibrium.shape,
        pull=None if pull is None else body.surface(pull),
        travel=equilibrium.road.travel,
        cords=cord_forces(body),
        mass=body.comm.allreduce(float(body.nodal_mass()[::3].sum())),
        materials=body.materials,
        ring=body.ring.fingerprint,
        plies=tuple(body.plies.cords),
    )


def _surface_metric(
    lattice: NodeGrid, positions: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
    """Half sizes of each node's rectangle, dx/dtheta, and the shape (around, along) of the face."""
    shape = lattice.face_shape
    grid = positions.reshape(*shape, 3)
    ring = np.concatenate([grid[-1:], grid, grid[:1]])
    angle = np.concatenate(
        [lattice.ring[-1:] - 2 * np.pi, lattice.ring, lattice.ring[:1] + 2 * np.pi]
    )
    rate = np.gradient(ring[..., 0], angle, axis=0)[1:-1]
    around = np.linalg.norm(np.diff(ring, axis=0), axis=-1)
    along = np.linalg.norm(np.diff(grid, axis=1), axis=-1)
    along = np.pad(along, ((0, 0), (1, 1)))
    half = np.stack([around[1:] + around[:-1], along[:, 1:] + along[:, :-1]], axis=-1) / 4
    return half.reshape(-1, 2), rate.ravel(), shape
