"""The standing tire looks the same after half a turn about the vertical: half of the ring has all of its state.

With P from the motion of half the ring's free nodes to all nodes of that half,

    P^T (F_int(P v) + p F_pressure(P v) + Omega^2 S (X + P v)) = P^T f.

On the two cut faces, at the lowest and at the highest point, the node at (r, -y) moves as that at (r, y) does,
turned: (-u_x, -u_y, u_z). What one half's cut faces do is taken back by the other's, so they drop out. Belts at an
angle keep this symmetry, where they break both mirror planes. Damping breaks it.
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

_SAME = 1e-9  # of the section: the distance of a node from another's image


def looks_the_same(ring: Ring, rolling: Rolling) -> bool:
    """Whether a half turn takes the ring of elements and its loads to themselves.

    By the corners around and the section's cells; cords are not looked at, so the state found is to be held against
    the whole ring.
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
    """Equilibrium of half of a body's ring, from the lowest point over x > 0 to the highest. Collective.

    The state is `body.u` of its own `body`; loads asked for and returned are the whole tire's.
    """

    def __init__(self, whole: Body, rolling: Rolling, ring: Ring | None = None) -> None:
        """Of the elements of a `whole` body, or of another `ring` of elements of its tire."""
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
        """As of the whole tire, whose half of the load this half carries."""
        return super().solve(road_height, None if load is None else load / 2, allowed / 2)

    def load(self) -> float:
        """Of the whole tire, N. Collective."""
        return 2 * super().load()

    def points(self) -> int:
        """Nodes of the whole tire that touch. Collective."""
        paired = self.body.comm.allreduce(int((self.road.force[self._paired] > 0).sum()))
        return super().points() + paired

    def _error(self, load: float | None) -> float:
        """At least the whole tire's: of two halves, by the same forces."""
        return 2 * super()._error(load)

    def _assemble_residual(self) -> np.ndarray:
        """Forces out of balance at the nodes that lead, N."""
        super()._assemble_residual()
        self._cut.fold(self._work.array)
        return self._work.array_r

    def start(self, whole: Equilibrium) -> None:
        """Start from the present state of the whole body, inflated and without a road. Collective."""
        self.body.set_displacement(whole.body.displacement())  # the half's nodes are its first ones
        self.road.active[:], self.road.force[:] = False, 0.0
        self.pressure.value = float(whole.pressure.value)

    def sinking(self, weights: np.ndarray, load: float) -> tuple[float, float]:
        """As of the whole tire, of a traction that half a turn leaves as it is: on the cut faces leaders take what acts on
        their followers, and either half carries half of what acts on the axis."""
        face, own = self.body.surface, weights.copy()
        own[face.place[np.isin(face.local, self._cut.follower)]] = 0.0
        own[face.place[np.isin(face.local, self._cut.axis)]] /= 2
        further, compliance = super().sinking(own, load)
        return 2 * further, 2 * compliance

    def on(self, lattice: Lattice) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (n, 3) m and force of the road (n,) N at the nodes of the whole ring's lattice. Collective."""
        count, around = lattice.shape[1], lattice.shape[0]
        moved = self.body.displacement().reshape(-1, count, 3)
        force = self.body.everywhere(self.contact_force()).reshape(-1, count)
        image = self._cut.image
        for (
            end
        ) in self._cut.ends:  # there a node of the middle has half of its force from either half
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
