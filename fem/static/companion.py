"""A tire in equilibrium on the road, and near that state on another mesh, for mesh errors.

Half of the ring is used where a half turn leaves the state unchanged
(fem.static.symmetry.half_turn).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.sections.ring import Ring
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.footprint import Footprint, footprint, nodal_area
from tireroad.fem.static.path.carried_over import sampled
from tireroad.fem.static.path.loading import Loader
from tireroad.fem.static.path.near import balance_near
from tireroad.fem.static.symmetry.half_turn import HalfTurnEquilibrium, looks_the_same
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import Lattice, field_lattice

_ROUNDING = 1e-9  # rad
_SAME = 1e-6  # of the wall: the change that a half turn may cause


@dataclass(frozen=True, kw_only=True)
class Balance:
    """A tire with the elements of `ring`, in static equilibrium on the road at `height` (m) under
    `load` (N).

    `displacement` (n, 3) m and `force` (n,) N of the road at all nodes of the whole `lattice`;
    `solved`: the problem that found the state."""

    ring: Ring
    lattice: Lattice
    rolling: Rolling
    height: float
    load: float
    displacement: np.ndarray
    force: np.ndarray
    solved: Equilibrium

    @classmethod
    def of(cls, loader: Loader, rolling: Rolling) -> Balance:
        """The present state of a loader. Collective."""
        body, whole = loader.body, loader.equilibrium
        assert whole.road_height is not None, "there is no road"
        return cls(
            ring=body.ring,
            lattice=body.lattice,
            rolling=rolling,
            height=whole.road_height,
            load=loader.load(),
            displacement=body.displacement(),
            force=body.everywhere(whole.contact_force()),
            solved=whole,
        )._by(loader.halved)

    def _by(self, half: HalfTurnEquilibrium | None) -> Balance:
        """The same state, with the half-ring problem as `solved` if that has it. Collective."""
        if half is None or not _has_all_of(half, self.lattice, self.displacement):
            return self
        return replace(self, solved=half)

    def near(self, ring: Ring) -> Equilibrium:
        """The same tire's problem on another `ring` of elements, at this state. Collective."""
        if ring is self.ring and isinstance(self.solved, HalfTurnEquilibrium):
            return self.solved
        return self._problem(ring, self._sampled(ring))

    def balanced_on(self, ring: Ring, allowed: float) -> Balance:
        """Equilibrium on the same road with other elements, up to `allowed` N. Collective.

        Raises ConvergenceError if none is found.
        """
        lattice, displacement = field_lattice(ring), self._sampled(ring)
        other = self._problem(ring, displacement)
        other.road.take(self._touching(lattice)[other.body.ids], self.height)
        step = balance_near(other, self.height, self.load, allowed)
        if not step.converged:
            raise ConvergenceError(f"static: elements half as long do not converge ({step.reason})")
        found = _nodes(other, lattice)
        return Balance(
            ring=ring,
            lattice=lattice,
            rolling=self.rolling,
            height=self.height,
            load=other.load(),
            displacement=found[0],
            force=found[1],
            solved=other,
        )

    @property
    def face_force(self) -> np.ndarray:
        """Force of the road (around, along) N on the nodes of the outer face."""
        return self.force[self.lattice.face].reshape(self.lattice.face_shape)

    @cached_property
    def extent(self) -> Footprint:
        """Extent of the contact."""
        face, shape = self.lattice.face, self.solved.shape
        places = self.lattice.points(face) + self.displacement[face]
        force, area = self.force[face], nodal_area(self.lattice, places)
        gap = places[:, 2] - shape.height(*places[:, :2].T) - self.height
        pressure = np.divide(force, area, out=np.zeros_like(force), where=force > 0)
        return footprint(self.lattice.face_shape, places, pressure, np.where(force > 0, 0.0, gap))

    def _sampled(self, ring: Ring) -> np.ndarray:
        if ring is self.ring:
            return self.displacement
        return sampled(self.lattice, self.displacement, field_lattice(ring))

    def _problem(self, ring: Ring, displacement: np.ndarray) -> Equilibrium:
        """The problem at the displacement (n, 3) m of the whole ring's nodes. Collective."""
        body, shape = self.solved.body, self.solved.shape
        other: Equilibrium | None = self._half(ring, displacement)
        if other is None:
            own = Body(body.comm, ring, body.materials, cords=body.plies.cords)
            other = Equilibrium(own, self.rolling, shape)
            own.set_displacement(displacement)
        other.pressure.value = float(self.solved.pressure.value)
        return other

    def _half(self, ring: Ring, displacement: np.ndarray) -> HalfTurnEquilibrium | None:
        """The half-ring problem, if half of the ring has the whole state; else None. Collective."""
        if not (self.solved.shape.flat and looks_the_same(ring, self.rolling)):
            return None
        half = HalfTurnEquilibrium(self.solved.body, self.rolling, ring)
        half.body.set_displacement(displacement)
        return half if _has_all_of(half, field_lattice(ring), displacement) else None

    def _touching(self, lattice: Lattice) -> np.ndarray:
        """A positive force (n,) N on those nodes of another lattice that lie between loaded nodes
        of this one."""
        pressed = self.face_force > 0
        around = _between(np.append(self.lattice.ring, 2 * np.pi), lattice.ring) % len(pressed)
        along = _between(self.lattice.arc, lattice.arc)
        inside = pressed[np.ix_(around.ravel(), along.ravel())]
        inside = inside.reshape(len(lattice.ring), 2, len(lattice.arc), 2).all(axis=(1, 3))
        force = np.zeros(lattice.size)
        force[lattice.face] = self.load / max(inside.sum(), 1) * inside.ravel()
        return force


def _between(line: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Indices (n, 2) of each value's neighbours on an ascending line, equal if it is on it."""
    above = np.clip(np.searchsorted(line, values - _ROUNDING), 0, len(line) - 1)
    below = np.clip(np.searchsorted(line, values + _ROUNDING, side="right") - 1, 0, len(line) - 1)
    return np.stack([below, above], axis=-1)


def _has_all_of(half: HalfTurnEquilibrium, lattice: Lattice, displacement: np.ndarray) -> bool:
    """Whether half of a ring reproduces the displacement (n, 3) m of the whole. Collective."""
    off = np.abs(half.on(lattice)[0] - displacement).max()
    return bool(off < _SAME * lattice.tire.thickness)


def _nodes(solved: Equilibrium, lattice: Lattice) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (n, 3) m and road force (n,) N at the nodes of the whole ring. Collective."""
    if isinstance(solved, HalfTurnEquilibrium):
        return solved.on(lattice)
    return solved.body.displacement(), solved.body.everywhere(solved.contact_force())
