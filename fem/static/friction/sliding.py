"""Slip of each tread node on the road: since the last load step, or since the node ahead of it.

A standing tire slips by g = (x - d) - (x - d)_before between load steps, x being the node's
position and d the road's. For a steadily rolling tire the nodes are fixed in space: material at the
angle theta comes from the node ahead, at theta + D, while the road passes by r D, r being the
wheel's travel per radian. Meanwhile it slips by

    g = x(theta) - x(theta + D) + D r (1 - s_x, s_y),

s_x > 0 for a driven wheel, s_y > 0 for one drifting towards +y (contact.tread.brush). Where it
sticks, g = 0: the steps along a streamline add up to the convective rate of the stuck displacement
for any step length. On an inclined road and on a drum x is the developed position on the road, xi
and eta (fem.static.curved.shape).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from tireroad.fem.static.curved.shape import FLAT, RoadShape
from tireroad.fem.tire.body import Body

Array = np.ndarray


class Sliding(Protocol):
    """Slip of the n owned tread nodes, in the order of `body.tread`, on a road of given `shape`."""

    shape: RoadShape

    def slid(self) -> Array:
        """g (n, 2) m. Collective."""
        ...

    def commit(self) -> None:
        """Make the present state the start of the next load step. Collective."""
        ...

    def led(self, sticks: Array) -> tuple[Array, Array, Array]:
        """Sticking nodes that move with a node ahead of them. Collective.

        `sticks` (n,) bool. Returns their indices in n (k,), the global block numbers (three
        unknowns each) of the leading nodes (k,), and their lag (k, 2) m, the sum of g from node to
        node."""
        ...

    def ahead(self, members: Array) -> Array:
        """Global block numbers of the nodes ahead of `members`; -1: none. Not collective."""
        ...


class Standing:
    """Slip under a standing tire; `place` (2,) m: position of the road, along and across."""

    def __init__(self, body: Body, shape: RoadShape = FLAT) -> None:
        self._body, self.shape = body, shape
        self._points = body.space.tabulate_dof_coordinates()[body.tread]
        self.place = np.zeros(2)
        self.commit()

    def _relative(self) -> Array:
        moved = self._body.owned(self._body.u.x.array)[self._body.tread]
        return self.shape.unrolled(self._points + moved) - self.place

    def slid(self) -> Array:
        return self._relative() - self._before

    def commit(self) -> None:
        self._before = self._relative()

    def led(self, sticks: Array) -> tuple[Array, Array, Array]:
        nothing = np.zeros(0, np.intp)
        return nothing, nothing, np.zeros((0, 2))

    def ahead(self, members: Array) -> Array:
        return np.full(len(members), -1)


class Passing:
    """Slip in steady rolling: travel per radian `radius` m, and `slip` (s_x, s_y)."""

    def __init__(
        self,
        body: Body,
        radius: float,
        slip: tuple[float, float] = (0.0, 0.0),
        shape: RoadShape = FLAT,
    ) -> None:
        self._body, lattice = body, body.lattice
        self.radius, self.slip, self.shape = radius, slip, shape
        self._around, self._along = lattice.face_shape
        self._points = lattice.points(lattice.face)
        number = body.space.dofmap.index_map.local_range[0] + np.arange(body.nodes)
        self._number = body.surface(number.astype(float)).astype(np.int64)
        where = np.zeros(body.nodes, np.intp)
        where[body.surface.local] = body.surface.place
        self._own = where[body.tread]
        i, j = np.divmod(np.arange(len(self._points)), self._along)
        self._next = (i + 1) % self._around * self._along + j
        self._angle = (np.roll(lattice.ring, -1) - lattice.ring)[i] % (2 * np.pi)

    def _steps(self) -> Array:
        """g (s, 2) m of all nodes of the outer face. Collective."""
        moved = self._body.surface(self._body.owned(self._body.u.x.array))
        place = self.shape.unrolled(self._points + moved)
        travel = self.radius * np.array([1.0 - self.slip[0], self.slip[1]])
        return place - place[self._next] + self._angle[:, None] * travel

    def slid(self) -> Array:
        return self._steps()[self._own]

    def commit(self) -> None:
        """No effect: a steady state has no history."""

    def led(self, sticks: Array) -> tuple[Array, Array, Array]:
        body = self._body
        flags = np.zeros(body.nodes)
        flags[body.tread] = sticks
        stuck = (body.surface(flags) > 0).reshape(self._around, self._along)
        steps = self._steps().reshape(self._around, self._along, 2)
        if stuck.all(axis=0).any():
            raise AssertionError("a streamline sticks all round")
        lead = np.arange(stuck.size).reshape(stuck.shape)
        lag = np.zeros_like(steps)
        # Against the flow of the material, twice round: from each node to the first free one ahead.
        for i in range(2 * self._around - 1, -1, -1):
            here, front = i % self._around, (i + 1) % self._around
            on = stuck[here]
            lead[here] = np.where(on, lead[front], lead[here])
            lag[here] = np.where(on[:, None], lag[front] + steps[here], 0.0)
        own = self._own[sticks]
        return (
            np.flatnonzero(sticks),
            self._number[lead.ravel()[own]],
            lag.reshape(-1, 2)[own],
        )

    def ahead(self, members: Array) -> Array:
        return self._number[self._next[self._own[members]]]
