"""The flat road under the tread nodes of one body, with Coulomb friction.

At a node that touches, with f its normal force, t the road's horizontal force on it, g how far it slides and c its stiffness,

    t = P(t - c g),   P the projection on |t| <= mu f:

it sticks, g = 0, or it slips, |t| = mu f against g. (Alart and Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353.)
Newton's method on that, node by node: with n the direction of t - c g, m at a right angle, b = mu f / |t - c g| < 1,

    t+ = mu f+ n - k m (m . g+),   k = b c / (1 - b),

f+ and g+ of the linearised problem: no step of its own for t. k is |t| over |g| once it slips: a node that
slides is led by its friction as by a spring across its way, and along it only by mu times its normal force.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI

from tireroad.fem.static.friction.sliding import Sliding
from tireroad.fem.static.road import Road
from tireroad.fem.tire.body import Body

Array = np.ndarray
_ROUNDING = 1e-9  # of a node's bound
_STIFFEST = 1e6  # k over c: a node on the brink of sticking


class RubbingRoad(Road):
    """As `Road`; `pull` (n, 2) N horizontal forces on the tire, `sticks` (n,) which nodes do; `friction` mu."""

    def __init__(self, body: Body, friction: float, sliding: Sliding) -> None:
        super().__init__(body)
        self.friction, self.sliding = friction, sliding
        self.pull = np.zeros((len(body.tread), 2))
        self.sticks = np.zeros(len(body.tread), dtype=bool)
        self._along = 3 * body.tread[:, None] + np.arange(2)
        self._softly = np.ones(len(body.tread))
        self._slips = np.zeros(0, np.intp)
        self._way, self._across, self._led = np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)

    def weigh(self, diagonal: Array) -> None:
        super().weigh(diagonal)
        self._softly = diagonal[self._along].mean(axis=1)

    @property
    def held(self) -> Array:
        """Owned unknowns that the road holds: the vertical ones, then x and y of each node that sticks."""
        return np.concatenate([super().held, self._along[self.sticks].ravel()])

    def steps(self) -> tuple[Array, Array]:
        down, rise = super().steps()
        members, _, lag = self.sliding.led(self.sticks)
        back = -self.sliding.slid()
        back[members] = -lag
        back = back[self.sticks].ravel()
        return np.append(down, back), np.append(rise, np.zeros(len(back)))

    def _trial(self) -> tuple[Array, Array]:
        """t - c g (n, 2) N and mu f (n,) N, f as Newton's method sees it. Collective."""
        normal = np.maximum(self.force - self.stiffness * self.gap(), 0.0)
        return self.pull - self._softly[:, None] * self.sliding.slid(), self.friction * normal

    def choose(self) -> bool:
        """As of a road without friction; and which nodes stick. A node that does goes on to until its force is too large;
        one that slips, until it would slip the other way: it never turns round at once. What touches
        anew sticks first. (All by t - c g alone, nodes slipped to and fro together, for ever.) Collective.
        """
        touched, changed = self.active, super().choose()
        self.pull[~self.active] = 0.0
        trial, bound = self._trial()
        within = np.linalg.norm(self.pull, axis=1) <= bound * (1 + _ROUNDING)
        back = (trial[self._slips] * self._way).sum(axis=1) <= bound[self._slips]
        within[self._slips] = back
        sticks = self.active & (within | ~touched)
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
        """Take n, m and k at the nodes that slip. Collective."""
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

    def rows(self, out: Array) -> Array:
        """At nodes that slip, the balance along the road with its friction eliminated. Collective."""
        where = self._along[self._slips]
        out[where] -= self.friction * self._way * out[self.dofs[self._slips], None]
        out[where] += self._led_by(self.sliding.slid())
        return out

    def _led_by(self, slid: Array) -> Array:
        """k m (m . g) (k, 2) N."""
        off = (self._across * slid[self._slips]).sum(axis=1)
        return (self._led * off)[:, None] * self._across

    def couplings(self) -> tuple[Array, Array, Array, Array]:
        """What `rows` does to the tangent's rows: of the unknowns (k, 2) the shares (k, 2) of the vertical one's row, and the
        springs (k, 2, 2) N/m to the nodes ahead, numbers of blocks (k,). Not collective."""
        springs = self._led[:, None, None] * self._across[:, :, None] * self._across[:, None, :]
        ahead = self.sliding.ahead(self._slips)
        return self._along[self._slips], -self.friction * self._way, springs, ahead

    def upward(self, reaction: Array) -> float:
        return float(reaction[: int(self.active.sum())].sum())

    def react(self, reaction: Array) -> None:
        count = int(self.active.sum())
        super().react(reaction[:count])
        self.pull[self.sticks] = reaction[count:].reshape(-1, 2)
        normal = self.friction * self.force[self._slips]
        self.pull[self._slips] = normal[:, None] * self._way - self._led_by(self.sliding.slid())

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
