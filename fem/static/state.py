"""Result of a static solve: small arrays held by every process, and no dolfinx object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.footprint import Evenness, Footprint, evenness, footprint, nodal_area
from tireroad.fem.static.road import FLAT, RoadShape
from tireroad.fem.static.virtual_work import AT_REST, Rolling
from tireroad.fem.tire.cord_forces import CordForce, cord_forces
from tireroad.fem.tire.material import Material
from tireroad.fem.tire.mesh import NodeGrid


@dataclass(frozen=True, kw_only=True)
class StaticState:
    """The static state of the tire on the `road`.

    `displacement` (n, 3) m of all lattice nodes. On the outer face, in its node order: `points` (s,
    3) m undeformed; `moved` (s, 3) m displacement; `force` (s,) N of the road on the tire along the
    wheel's z; `area` (s,) m2 associated with each node for uniform pressure; `half_sizes` (s, 2) m
    of the deformed rectangle around each node (x and y); `ring_rate` (s,) m/rad derivative of the
    deformed x with respect to the ring angle.

    `road_height` (m) is None without a road; `inflation` (Pa) and the steady `rolling` are the
    loads of this state. `cords` by name of the ply; `mass` (kg) of wall and cords; `materials` of
    the tire by region, empty for a state from a file; `fine_extent`: contact extent on finer
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
