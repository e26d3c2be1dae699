"""The smooth road under the tread nodes of one body, with Coulomb friction.

For a node in contact with normal force f, horizontal road force t, slip distance g and stiffness c,

    t = P(t - c g),   P the projection on |t| <= mu f:

it sticks, g = 0, or it slips, |t| = mu f against g (Alart and Curnier, Comput. Methods Appl. Mech.
Eng. 92 (1991) 353). Newton's method node by node, with n along t - c g, m normal to n and
b = mu f / |t - c g| < 1:

    t+ = mu f+ n - k m (m . g+),   k = b c / (1 - b),

f+ and g+ being those of the linearised problem: t has no step of its own. Once a node slips, k is
|t| / |g|: friction is a spring across its path, and along it only mu times the normal force.

Unless the road is a level plane, t and g are along and across it (fem.static.curved). With
l = -e_xi . cos gamma n_0 the force conjugate to the road's height is v = p - l t_xi, p being the z
component of the normal force f = s p, s the stretch. At slipping nodes v and t_xi give p.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from tireroad.fem.static.friction.sliding import Sliding
from tireroad.fem.static.road import Road
from tireroad.fem.tire.body import Body

Array = np.ndarray


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


_ROUNDING, _BRINK = 1e-9, 1e-7  # of a node's friction bound
# k over c of a node about to stick: with 1e6 the rounding of g prevented convergence
_STIFFEST = 1e3


class RubbingRoad(Road):
    """`Road` with friction: `pull` (n, 2) N along and across the road; `sticks` (n,) bool."""

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

    def weigh(self, diagonal: Array) -> None:
        super().weigh(diagonal)
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

    def take_off(self, out: Array) -> None:
        super().take_off(out)
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

    def upward(self, reaction: Array) -> float:
        return float(reaction[: int(self.active.sum())].sum())

    def react(self, reaction: Array) -> None:
        count = int(self.active.sum())
        super().react(reaction[:count])
        self.pull[self.sticks] = reaction[count:].reshape(-1, 2)
        led, (stretch, lean) = self._led_by(self.sliding.slid()), self._lie()
        stretch, lean = self.friction * stretch[self._slips], lean[self._slips]
        pressing = self.force[self._slips] - lean * led[:, 0]
        pressing /= 1.0 - lean * stretch * self._way[:, 0]
        self.pull[self._slips] = (stretch * pressing)[:, None] * self._way - led

    def kept(self) -> tuple[Any, ...]:
        return *super().kept(), self.sticks.copy(), self.pull.copy(), self._slips, self._way

    def put_back(self, kept: tuple[Any, ...]) -> None:
        super().put_back(kept[:3])
        self.sticks, self.pull, self._slips, self._way = kept[3:]

    @property
    def travel(self) -> float | None:
        return getattr(self.sliding, "radius", None)

    def pulled(self) -> Array:
        pull = np.zeros((self._body.nodes, 2))
        pull[self._body.tread] = self.pull
        return pull
