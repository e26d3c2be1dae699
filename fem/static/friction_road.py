"""A road with Coulomb friction: sliding and sticking nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI

from tireroad.fem.static.road import FLAT, RoadContact, RoadShape
from tireroad.fem.tire.body import Body

Array = np.ndarray
_ROUNDING, _BRINK = 1e-9, 1e-7  # of a node's friction bound
# k over c of a node about to stick: with 1e6 the rounding of g prevented convergence
_STIFFEST = 1e3


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


class StandingFriction:
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
    """Slip in steady rolling: travel per radian `radius` m, and `slip` (s_x, s_y).

    A standing tire slips by g = (x - d) - (x - d)_before between load steps, x being the node's
    position and d the road's. For a steadily rolling tire the nodes are fixed in space: material at
    the angle theta comes from the node ahead, at theta + D, while the road passes by r D, r being
    the wheel's travel per radian. Meanwhile it slips by

        g = x(theta) - x(theta + D) + D r (1 - s_x, s_y),

    s_x > 0 for a driven wheel, s_y > 0 for one drifting towards +y (contact.tread.brush). Where it
    sticks, g = 0: the steps along a streamline add up to the convective rate of the stuck
    displacement for any step length. On an inclined road and on a drum x is the developed position
    on the road, xi and eta (fem.static.road).
    """

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


@dataclass(frozen=True, kw_only=True)
class Couplings:
    """Changes to the tangent's rows of slipping nodes: for `unknowns` (k, 2) along the road
    `shares` (k, 2, m) of the rows of `sources` (k, m), `own` (k, 2, 2) N/m on themselves, and
    `springs` (k, 2, 2) N/m to the nodes `ahead` (k,), block numbers, -1: none."""

    unknowns: Array
    sources: Array
    shares: Array
    own: Array
    springs: Array
    ahead: Array


class RubbingRoad(RoadContact):
    """`RoadContact` with friction: `pull` (n, 2) N along and across the road; `sticks` (n,) bool.

    For a node in contact with normal force f, horizontal road force t, slip distance g and
    stiffness c,

        t = P(t - c g),   P the projection on |t| <= mu f:

    it sticks, g = 0, or it slips, |t| = mu f against g (Alart and Curnier, Comput. Methods Appl.
    Mech. Eng. 92 (1991) 353). Newton's method node by node, with n along t - c g, m normal to n and
    b = mu f / |t - c g| < 1:

        t+ = mu f+ n - k m (m . g+),   k = b c / (1 - b),

    f+ and g+ being those of the linearised problem: t has no step of its own. Once a node slips, k
    is |t| / |g|: friction is a spring across its path, and along it only mu times the normal force.

    Unless the road is a level plane, t and g are along and across it (fem.static.road). With l =
    -e_xi . cos gamma n_0 the force conjugate to the road's height is v = p - l t_xi, p being the z
    component of the normal force f = s p, s the stretch. At slipping nodes v and t_xi give p.
    """

    def __init__(self, body: Body, friction: float, sliding: Sliding) -> None:
        super().__init__(body, sliding.shape)
        self.friction, self.sliding = friction, sliding
        self.pull = np.zeros((len(body.tread), 2))
        self.sticks = np.zeros(len(body.tread), dtype=bool)
        self._along = 3 * body.tread[:, None] + np.arange(2)
        self._softly = np.ones(len(body.tread))
        self._slips = np.zeros(0, np.intp)
        self._came = np.zeros(len(body.tread), dtype=bool)
        self._way, self._across, self._led = np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)

    def search(self) -> None:
        """Begin the search for another equilibrium."""
        self._came[:] = False

    def set_stiffness(self, diagonal: Array) -> None:
        super().set_stiffness(diagonal)
        self._softly = diagonal[self._along].mean(axis=1)

    @property
    def held(self) -> Array:
        """Owned unknowns held by the road: the vertical ones, then x and y of sticking nodes."""
        return np.concatenate([super().held, self._along[self.sticks].ravel()])

    def steps(self) -> tuple[Array, Array]:
        down, rise = super().steps()
        members, _, lag = self.sliding.led(self.sticks)
        back = -self.sliding.slid()
        back[members] = -lag
        back = back[self.sticks].ravel()
        return np.append(down, back), np.append(rise, np.zeros(len(back)))

    def _lie(self) -> tuple[Array, Array]:
        """s and l (n,) at the nodes' positions."""
        shape = self.shape
        if shape.flat:
            return np.ones(len(self.dofs)), np.zeros(len(self.dofs))
        x, y, _ = self.places().T
        return shape.stretch(x, y), -shape.upright * shape.frames(x, y)[:, 0] @ shape.up

    def pressing(self) -> Array:
        """p (n,) N."""
        return self.force + self._lie()[1] * self.pull[:, 0]

    def forward(self) -> float:
        """Sum of all road forces, normal ones included, along the wheel's x, N. Not collective."""
        if self.shape.flat:
            return float(self.pull[:, 0].sum())
        x, y, _ = self.places().T
        pushed = -self.shape.slopes(x, y)[0] @ self.pressing()
        return float(pushed + (self.pull * self.shape.frames(x, y)[:, :2, 0]).sum())

    def _trial(self) -> tuple[Array, Array]:
        """t - c g (n, 2) N and mu f (n,) N, with f as in the active-set condition. Collective."""
        pressing = np.maximum(self.pressing() - self.stiffness * self.gap(), 0.0)
        bound = self.friction * self._lie()[0] * pressing
        return self.pull - self._softly[:, None] * self.sliding.slid(), bound

    def choose(self) -> bool:
        """Update the active set and the sticking nodes; True if either changed. Collective.

        A node sticks until its force exceeds the bound; it slips until it would slip backwards, and
        never reverses at once. A new contact sticks, but slips the second time in one search, which
        would not end otherwise. (By t - c g alone, nodes slipped to and fro forever.)
        """
        touched, changed = self.active, super().choose()
        self.pull[~self.active] = 0.0
        trial, bound = self._trial()
        within = np.linalg.norm(self.pull, axis=1) <= bound * (1 + _ROUNDING)
        back = (trial[self._slips] * self._way).sum(axis=1) <= bound[self._slips]
        within[self._slips] = back
        fresh = self.active & ~touched
        within[fresh] = ~self._came[fresh]
        self._came |= fresh
        sticks = self.active & within
        turned = bool((sticks != self.sticks).any())
        self.sticks = sticks
        return self._body.comm.allreduce(changed or turned, op=MPI.LOR)

    def distance(self) -> Array:
        trial, bound = self._trial()
        length = np.linalg.norm(trial, axis=1)
        share = np.where(self.sticks, 1.0, bound / np.where(length > 0, length, 1.0))
        off = (self.pull - share[:, None] * trial)[self.active]
        return np.concatenate([super().distance(), off.ravel()])

    def subtract_forces(self, out: Array) -> None:
        super().subtract_forces(out)
        out[self._along] -= self.pull

    def linearise(self) -> None:
        """Set n, m and k at the slipping nodes. Collective."""
        trial, bound = self._trial()
        self._slips = np.flatnonzero(self.active & ~self.sticks)
        length = np.linalg.norm(trial[self._slips], axis=1)
        safe = np.where(length > 0, length, 1.0)
        self._way = trial[self._slips] / safe[:, None]
        self._across = self._way[:, ::-1] * [-1.0, 1.0]
        share = np.where(length > 0, bound[self._slips] / safe, 0.0)
        self._led = self._softly[self._slips] * np.minimum(
            share / np.maximum(1.0 - share, 1e-300), _STIFFEST
        )

    def _sources(self) -> tuple[Array, Array]:
        """At slipping nodes: unknowns (k, m) whose forces give mu f, and factors (k, m)."""
        stretch, lean = (part[self._slips] for part in self._lie())
        upright = self.dofs[self._slips, None]
        if self.shape.flat:
            return upright, self.friction * stretch[:, None]
        where = np.concatenate([upright, self._along[self._slips, :1]], axis=1)
        return where, self.friction * stretch[:, None] * np.stack(
            [np.ones(len(lean)), lean], axis=1
        )

    def rows(self, out: Array) -> Array:
        """At slipping nodes, the balance along the road with friction eliminated. Collective."""
        where = self._along[self._slips]
        sources, shares = self._sources()
        bound = (shares * out[sources]).sum(axis=1)
        out[where] -= self._way * bound[:, None]
        out[where] += self._led_by(self.sliding.slid())
        return out

    def _led_by(self, slid: Array) -> Array:
        """k m (m . g) (k, 2) N."""
        off = (self._across * slid[self._slips]).sum(axis=1)
        return (self._led * off)[:, None] * self._across

    def couplings(self) -> Couplings:
        """The change of the tangent's rows that corresponds to `rows`. Not collective."""
        sources, shares = self._sources()
        springs = self._led[:, None, None] * self._across[:, :, None] * self._across[:, None, :]
        own = springs.copy()
        if not self.shape.flat:  # along a drum the normal changes with position
            own[:, :, 0] += self._way * self._leaning()[:, None]
        return Couplings(
            unknowns=self._along[self._slips],
            sources=sources,
            shares=-self._way[:, :, None] * shares[:, None, :],
            own=own,
            springs=springs,
            ahead=self.sliding.ahead(self._slips),
        )

    def _leaning(self) -> Array:
        """At slipping nodes mu b (f l s + t_xi), N/m, b the bending: loss of mu f per metre."""
        stretch, lean = (part[self._slips] for part in self._lie())
        normal = stretch * self.pressing()[self._slips]
        bending = self.shape.bending(self.places()[self._slips, 0])
        return self.friction * bending * (normal * stretch * lean + self.pull[self._slips, 0])

    def resume(self, pressing: Array, pull: Array, height: float) -> None:
        """Start from normal forces (nodes,) N, given by their component along the wheel's z, and
        forces (nodes, 2) N along and across the road at `height` (m). Collective."""
        self.take(pressing, height)
        self.pull = pull[self._body.tread]
        stretch, lean = self._lie()
        bound = self.friction * stretch * self.force
        self.force = self.force - lean * self.pull[:, 0]
        size = np.linalg.norm(self.pull, axis=1)
        self.sticks = self.active & (size < (1 - _BRINK) * bound)
        self._slips = np.flatnonzero(self.active & ~self.sticks)
        self._way = self.pull[self._slips] / size[self._slips, None]

    def vertical_force(self, reaction: Array) -> float:
        return float(reaction[: int(self.active.sum())].sum())

    def set_reactions(self, reaction: Array) -> None:
        count = int(self.active.sum())
        super().set_reactions(reaction[:count])
        self.pull[self.sticks] = reaction[count:].reshape(-1, 2)
        led, (stretch, lean) = self._led_by(self.sliding.slid()), self._lie()
        stretch, lean = self.friction * stretch[self._slips], lean[self._slips]
        pressing = self.force[self._slips] - lean * led[:, 0]
        pressing /= 1.0 - lean * stretch * self._way[:, 0]
        self.pull[self._slips] = (stretch * pressing)[:, None] * self._way - led

    def snapshot(self) -> tuple[Any, ...]:
        return *super().snapshot(), self.sticks.copy(), self.pull.copy(), self._slips, self._way

    def restore(self, state: tuple[Any, ...]) -> None:
        super().restore(state[:3])
        self.sticks, self.pull, self._slips, self._way = state[3:]

    @property
    def travel(self) -> float | None:
        return getattr(self.sliding, "radius", None)

    def pulled(self) -> Array:
        pull = np.zeros((self._body.nodes, 2))
        pull[self._body.tread] = self.pull
        return pull
