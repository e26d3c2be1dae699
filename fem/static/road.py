"""The smooth road under the tread nodes of one body: nodes in contact and their forces."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from tireroad.fem.static.curved.shape import FLAT, RoadShape
from tireroad.fem.tire.body import Body


class Road:
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

    def weigh(self, diagonal: np.ndarray) -> None:
        """Set the stiffness (N/m) from the diagonal over the owned unknowns."""
        self.stiffness = diagonal[self.dofs].copy()

    def take_off(self, out: np.ndarray) -> None:
        """Subtract the road's forces from the forces (N) at the owned unknowns."""
        out[self.dofs] -= self.force

    def rows(self, out: np.ndarray) -> np.ndarray:
        """The residual (N) in the unknowns that Newton's method solves for."""
        return out

    def upward(self, reaction: np.ndarray) -> float:
        """Sum of those reactions (N) at held unknowns that carry the load. Not collective."""
        return float(reaction.sum())

    def react(self, reaction: np.ndarray) -> None:
        """Take the reactions (N) at the held unknowns as the road's forces. Collective."""
        self.force[self.active] = reaction

    def kept(self) -> tuple[Any, ...]:
        """The state for `put_back`."""
        return self.active.copy(), self.force.copy(), self.height

    def put_back(self, kept: tuple[Any, ...]) -> None:
        """Restore a state from `kept`."""
        self.active, self.force, self.height = kept

    def choose(self) -> bool:
        """Update the active set; True if it changed on any process. Collective."""
        wanted = self.pressing() > self.stiffness * self.gap()
        changed = bool((wanted != self.active).any())
        self.active = wanted
        self.force[~wanted] = 0.0
        return self._body.comm.allreduce(changed, op=MPI.LOR)

    def lay_on(self) -> None:
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
        self.lay_on()

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
