"""Contact within a linearised step: a linear complementarity problem on the tread nodes.

K du = right is solved with the nodes held that were held when K was factorised. Each node held
since then adds a force, each node released since then a motion, both times a column of K's inverse:

    gap = gap_0 + C z + gap_l rise,    force = force_0 + D z + force_l rise,

with z such that gap = 0 at held nodes and force = 0 at free ones, and rise such that the road
carries the load. As in `Equilibrium.solve` a node is held if force > c gap; the sets are updated
until they stay the same. Columns are solved for together, at a seventh of the cost of a solve
each.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
from mpi4py import MPI

from tireroad.fem.static.held_system import Columns, Moved, System
from tireroad.fem.static.road import Road

_ROUNDS = 10  # updates of the sets in one step
_MOST = 400  # columns per factorisation
_OFF = 1e-12  # m from the road: rounding leaves less

Array = np.ndarray


def held_step(
    comm: MPI.Comm, system: System, road: Road, given: tuple[Array, Moved | None, float | None]
) -> tuple[Array, Array] | None:
    """One linearised step: motion (m) of owned dofs, reactions (N) at held ones. Collective.

    `given`: residual forces (N), the prescribed motion of the held dofs, and a load (N) or None;
    with a load the road is raised to carry it. Returns None if nothing resists the road. The road's
    force is the reaction of the linearised problem: a residual is no force of the road (otherwise
    held dofs were seen to be released and held again forever).
    """
    out, closing, load = given
    change, force = system.solve(-out, closing)
    force += out[road.held]
    if load is None:
        return change, force
    further, more = system.solve(np.zeros_like(out), system.raising)
    sums = np.array([road.upward(part) for part in (force, more)])
    total, rate = comm.allreduce(sums)
    if not rate > 0:
        return None
    rise = (load - total) / rate
    road.height += rise
    return change + rise * further, force + rise * more


@dataclass(frozen=True)
class _Found:
    """z at the `nodes` and rise; the nodes that should be held, and the road's force (N) on all."""

    nodes: Array
    parts: tuple[Array, float]
    wanted: Array
    force: Array


@dataclass
class _Answer:
    """Motion (m) of the owned dofs; gap (m) and force (N) of the tread nodes of all processes."""

    motion: Array
    gap: Array
    force: Array

    def plus(self, times: float, other: _Answer) -> _Answer:
        """This answer plus `times` the other."""
        return _Answer(
            self.motion + times * other.motion,
            self.gap + times * other.gap,
            self.force + times * other.force,
        )


class LinearContact:
    """The contact problem for the current factorisation of a system. All methods are collective."""

    def __init__(self, comm: MPI.Comm, system: System, road: Road) -> None:
        self._comm, self._system, self._road = comm, cast(Columns, system), road
        counts = comm.allgather(len(road.dofs))
        first = sum(counts[: comm.rank])
        self._own = slice(first, first + len(road.dofs))
        self._stiffness = self._gathered(road.stiffness)
        self._base = self._gathered(road.active)  # held in the factorisation
        self._number = np.full(len(self._base), -1)  # column number of each node
        none = np.empty((len(self._base), 0))
        self._columns = _Answer(np.empty((system.closing.change.size, 0)), none, none)
        self._lift: _Answer | None = None
        self.changed = False  # whether the held nodes differ from those of the factorisation

    def step(
        self, out: Array, closing: Moved | None, load: float | None, given: float | None = None
    ) -> tuple[Array, Array] | None:
        """`held_step` that first settles the active set; the road may rise by a `given` m."""
        road = self._road
        free = self._answer(*self._system.solve(-out, closing), out)
        free.gap += self._gathered(road.gap())
        if given:
            free = free.plus(given, self._lifted())
        lift = self._lifted() if load is not None else None
        if lift is not None and not lift.force.sum() > 0:
            return None
        held = self._gathered(road.active)
        found = self._solved(free, lift, held, load)
        if (
            closing is not None or given is not None
        ):  # near equilibrium the sets of a reused tangent are unreliable
            held, found = self._settled(
                held, found, lambda held: self._solved(free, lift, held, load)
            )
        z, rise = found.parts
        self.changed = bool((held != self._base).any())
        motion = free.motion + self._columns.motion[:, self._number[found.nodes]] @ z
        road.height += rise + (given or 0.0)
        road.active, road.force = held[self._own].copy(), np.zeros(len(road.dofs))
        motion = motion if lift is None else motion + rise * lift.motion
        return self._system.spread(motion), found.force[self._own][road.active]

    def _settled(
        self, held: Array, found: _Found, solved: Callable[[Array], _Found]
    ) -> tuple[Array, _Found]:
        """The first held set that no longer changes, with its solution; else the given ones."""
        first = held, found
        for _ in range(_ROUNDS):
            if (found.wanted == held).all():
                return held, found
            if np.count_nonzero(found.wanted ^ self._base) > _MOST:
                break
            held = found.wanted
            found = solved(held)
        return first

    def _solved(
        self, free: _Answer, lift: _Answer | None, held: Array, load: float | None
    ) -> _Found:
        """z, rise, gaps and forces of the tread nodes for the set `held`."""
        off = (
            held & self._base & (np.abs(free.gap) > _OFF)
        )  # released since the factorisation, and held again
        changed = np.flatnonzero((held ^ self._base) | off)
        self._add_columns(changed)
        use = self._number[changed]
        gap, force = self._columns.gap[:, use], self._columns.force[:, use]
        rest = free.gap, free.force
        if lift is not None:
            gap, force = (np.column_stack(p) for p in ((gap, lift.gap), (force, lift.force)))
        on, own = held[changed], self._stiffness[changed]
        rows = np.where(on[:, None], own[:, None] * gap[changed], force[changed])
        right = -np.where(on, own * rest[0][changed], rest[1][changed])
        unit = np.where(self._base[changed], 1 / own, 1.0)  # scales all to N
        if lift is not None:
            rows, right = (
                np.vstack([rows, force.sum(axis=0)]),
                np.append(right, load - rest[1].sum()),
            )
            unit = np.append(unit, 1 / self._stiffness.max())
        z = unit * np.linalg.lstsq(rows * unit, right, rcond=None)[0] if len(right) else right
        parts = z[: len(changed)], float(z[-1]) if lift is not None else 0.0
        gaps = np.where(held, 0.0, rest[0] + gap @ z)
        return _Found(
            changed,
            parts,
            np.where(held, rest[1] + force @ z, 0.0) > self._stiffness * gaps,
            np.where(held, rest[1] + force @ z, 0.0),
        )

    def _add_columns(self, nodes: Array) -> None:
        """Compute the columns of nodes that have none yet."""
        new = nodes[self._number[nodes] < 0]
        if not len(new):
            return
        mine = new[(new >= self._own.start) & (new < self._own.stop)] - self._own.start
        dofs = self._road.dofs[mine]
        order = np.flatnonzero((new >= self._own.start) & (new < self._own.stop))
        motion, reaction = self._system.columns(order, dofs, len(new))
        force = np.zeros((len(self._road.dofs), len(new)))
        force[self._base[self._own]] = reaction
        pressed = ~self._base[self._own][mine]
        force[mine[pressed], order[pressed]] = 1.0
        added = motion, self._gathered(motion[self._road.dofs]), self._gathered(force)
        kept = self._columns
        parts = zip((kept.motion, kept.gap, kept.force), added, strict=True)
        self._columns = _Answer(*(np.hstack(pair) for pair in parts))
        self._number[new] = np.arange(len(new)) + (self._number.max() + 1)

    def _lifted(self) -> _Answer:
        """Response to a unit rise of the road with its nodes held."""
        if self._lift is None:
            nothing = np.zeros_like(self._system.closing.force)
            self._lift = self._answer(*self._system.solve(nothing, self._system.raising), nothing)
            self._lift.gap -= 1.0
        return self._lift

    def _answer(self, motion: Array, reaction: Array, out: Array) -> _Answer:
        held = self._road.dofs[self._base[self._own]]
        force = np.zeros(len(self._road.dofs))
        force[self._base[self._own]] = reaction + out[held]
        return _Answer(motion, self._gathered(motion[self._road.dofs]), self._gathered(force))

    def _gathered(self, values: Array) -> Array:
        return np.concatenate(self._comm.allgather(values))
