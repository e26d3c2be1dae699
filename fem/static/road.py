"""The flat road under the tread nodes of one body: which touch it, and with what force."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from tireroad.fem.tire.body import Body


class Road:
    """A plane at `height` (m; -inf: none) and the owned tread nodes that can meet it, in the order of `body.tread`:
    `dofs` their vertical unknowns, `active` those that touch, `force` N on each, `stiffness` N/m of each unknown.
    """

    def __init__(self, body: Body) -> None:
        self._body = body
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

    def tread_height(self) -> np.ndarray:
        """Height z + u_z of the owned tread nodes, m."""
        return self._z + self._body.u.x.array[self.dofs]

    def gap(self) -> np.ndarray:
        """Height of the owned tread nodes above the road, m; infinite without one."""
        return self.tread_height() - self.height

    def distance(self) -> np.ndarray:
        """Of the nodes that touch, to the road, as the unknown's force (N)."""
        return (self.stiffness * self.gap())[self.active]

    def choose(self) -> bool:
        """Take the active set of the present state; whether it is another one on any process. Collective."""
        wanted = self.force > self.stiffness * self.gap()
        changed = bool((wanted != self.active).any())
        self.active = wanted
        self.force[~wanted] = 0.0
        return self._body.comm.allreduce(changed, op=MPI.LOR)

    def lay_on(self) -> None:
        """Put what touches on the road to the last bit: rounding would leave a gap or a penetration. Collective."""
        field = self._body.u.x
        field.array[self.held] = (self.height - self._z)[self.active]
        field.scatter_forward()

    def take(self, force: np.ndarray, height: float) -> None:
        """Start from the forces (N) of the owned nodes on a road at `height` (m). Collective."""
        self.force, self.height = force[self._body.tread], height
        self.active = self.force > 0
        self.lay_on()

    def at_nodes(self) -> np.ndarray:
        """Force on all owned nodes, N; not negative."""
        force = np.zeros(self._body.nodes)
        force[self._body.tread] = self.force
        return force

    def load(self) -> float:
        """Total force, N. Collective."""
        return self._body.comm.allreduce(float(self.force.sum()))

    def points(self) -> int:
        """Nodes pressed on. Collective."""
        return self._body.comm.allreduce(int((self.force > 0).sum()))
