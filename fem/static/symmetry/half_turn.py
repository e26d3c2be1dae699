"""Symmetry of the standing tire under a half turn about the vertical: half of the ring suffices.

With P from the motion of the half ring's free nodes to all its nodes,

    P^T (F_int(P v) + p F_pressure(P v) + Omega^2 S (X + P v)) = P^T f.

On the two cut faces, at the lowest and the highest point, the node at (r, -y) moves as that at (r,
y), rotated: (-u_x, -u_y, u_z). The boundary terms of the cut faces cancel between the halves.
Angled belts keep this symmetry, although they break both mirror symmetries. Damping breaks it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from tireroad.fem.sections.ring import Ring
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.path.step import Step
from tireroad.fem.static.symmetry.cut import TURN, Cut
from tireroad.fem.static.symmetry.folded_system import FoldedSystem
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import Lattice

_SAME = 1e-9  # of the section's size: distance of a cell's centre from another's image


def looks_the_same(ring: Ring, rolling: Rolling) -> bool:
    """Whether a half turn maps the ring of elements and its loads to themselves.

    Corners around and the section's cells are compared, but not cords, so the state found must be
    checked on the whole ring.
    """
    corners, section = ring.ring_corners, ring.section
    if not ring.closed or ring.segments % 2 or rolling.damping or rolling.stiffness_damping:
        return False
    if not np.allclose(corners + corners[::-1], 2 * np.pi, rtol=0, atol=1e-9):
        return False
    middle = section.nodes[section.cells].mean(axis=1)
    small = _SAME * np.ptp(section.nodes)
    distance, image = cKDTree(middle).query(middle * [1, -1])
    return bool(distance.max() < small and (section.region[image] == section.region).all())


class HalfTurnEquilibrium(Equilibrium):
    """Equilibrium of half a ring, from the lowest point over x > 0 to the highest. Collective.

    The state is `body.u` of its own `body`; loads passed and returned are those of the whole
    tire.
    """

    def __init__(self, whole: Body, rolling: Rolling, ring: Ring | None = None) -> None:
        """From the elements of the `whole` body, or from another `ring` of elements of its tire."""
        ring = ring or whole.ring
        corners = ring.ring_corners[: ring.segments // 2 + 1]
        half = replace(ring, ring_corners=corners, coarser=lambda: None)
        body = Body(whole.comm, half, whole.materials, cords=whole.plies.cords)
        self._cut = Cut.of(body)
        body.tread = np.setdiff1d(body.tread, self._cut.follower)
        self._paired = ~np.isin(body.tread, self._cut.axis)
        super().__init__(body, rolling)

    def _make_system(self, kind: str) -> FoldedSystem:
        return FoldedSystem(self.body.comm, self.matrix, kind, self.cost, self._cut)

    def solve(
        self, road_height: float | None = None, load: float | None = None, allowed: float = 0.0
    ) -> Step:
        """As for the whole tire; the half carries half of its load."""
        return super().solve(road_height, None if load is None else load / 2, allowed / 2)

    def load(self) -> float:
        """Load of the whole tire, N. Collective."""
        return 2 * super().load()

    def points(self) -> int:
        """Number of nodes of the whole tire in contact. Collective."""
        paired = self.body.comm.allreduce(int((self.road.force[self._paired] > 0).sum()))
        return super().points() + paired

    def _error(self, load: float | None) -> float:
        """Upper bound for the whole tire's error, from two halves with the same forces."""
        return 2 * super()._error(load)

    def _assemble_residual(self) -> np.ndarray:
        """Residual forces at the leading nodes, N."""
        super()._assemble_residual()
        self._cut.fold(self._work.array)
        return self._work.array_r

    def start(self, whole: Equilibrium) -> None:
        """Start from the whole body's present state, inflated and without a road. Collective."""
        self.body.set_displacement(whole.body.displacement())  # the half's nodes come first
        self.road.active[:], self.road.force[:] = False, 0.0
        self.pressure.value = float(whole.pressure.value)

    def sinking(self, weights: np.ndarray, load: float) -> tuple[float, float]:
        """As for the whole tire, for a traction that the half turn preserves. Leaders take the
        weights of their followers, and each half takes half of those on the axis."""
        face, own = self.body.surface, weights.copy()
        own[face.place[np.isin(face.local, self._cut.follower)]] = 0.0
        own[face.place[np.isin(face.local, self._cut.axis)]] /= 2
        further, compliance = super().sinking(own, load)
        return 2 * further, 2 * compliance

    def on(self, lattice: Lattice) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (n, 3) m and road force (n,) N on the whole ring's lattice. Collective."""
        count, around = lattice.shape[1], lattice.shape[0]
        moved = self.body.displacement().reshape(-1, count, 3)
        force = self.body.everywhere(self.contact_force()).reshape(-1, count)
        image = self._cut.image
        for end in self._cut.ends:  # a node on the axis has half of its force in each half
            moved[end, self._cut.low] = TURN * moved[end, image[self._cut.low]]
            force[end, self._cut.low] = force[end, image[self._cut.low]]
            force[end, self._cut.middle] *= 2
        first = np.arange(len(moved))
        other = np.arange(len(moved), around)
        displacement, road = np.empty((around, count, 3)), np.empty((around, count))
        displacement[first], road[first] = moved, force
        displacement[other] = TURN * moved[around - other][:, image]
        road[other] = force[around - other][:, image]
        return displacement.reshape(-1, 3), road.ravel()
