"""The discretisation error of the load, from a companion state on another mesh.

Half of the ring is used where a half turn leaves the state unchanged
(fem.static.symmetric).

Where contact ends, the surface opens as d^(3/2), d being the distance from the edge, which lies
anywhere in an element. This error fluctuates from mesh to mesh, and no coarser mesh reveals it.
Therefore the elements at the footprint are split in two, and equilibrium is solved again from the
present state. The excess stiffness of all other elements is estimated with elements of another
order on the same mesh: how far the footprint sinks under the same traction in one Newton step from
the present state.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices import probe
from tireroad.fem.sections.ring import Ring
from tireroad.fem.sections.split import interpolation, locate, split_ring
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.footprint import Footprint, footprint, nodal_area
from tireroad.fem.static.load_steps import LoadStepper, balance_near, cords_strained
from tireroad.fem.static.state import StaticState, static_state
from tireroad.fem.static.symmetric import HalfModelEquilibrium, looks_the_same
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import NodeGrid, field_lattice

if TYPE_CHECKING:
    from tireroad.fem.model import TireModel


def carried_over(
    state: StaticState, tire: TireModel, other: TireModel, load: float | None
) -> StaticState | None:
    """Static state of the `other` mesh, by Newton's method from the `state` of this one.

    Inflation, rolling and road height are kept; with a `load` (N) the road carries that instead.
    The height of first touch is taken from the state. None if no equilibrium is found.
    Collective.
    """
    body = other.body
    body.set_displacement(sampled(tire.lattice, state.displacement, body.lattice))
    equilibrium = Equilibrium(body, state.rolling, state.road)
    equilibrium.pressure.value = state.inflation
    carried = None if load is None else load * state.road.upright
    step = equilibrium.solve(state.road_height, load=carried)
    return static_state(equilibrium, state.touch_height) if step.converged else None


def sampled(lattice: NodeGrid, values: np.ndarray, target: NodeGrid) -> np.ndarray:
    """Values (n, 3) of a lattice interpolated to another lattice of the same tire."""
    section = lattice.tire.section
    place = locate(section.nodes, section.cells, section.order, target.section)
    across = interpolation(lattice.cells_2d, lattice.edge, lattice.shape[1], place)
    first, shape = probe.line_shape(lattice.ring_corners, lattice.edge, target.ring)
    index = (first[:, None] + np.arange(len(lattice.edge))) % lattice.shape[0]
    around = np.einsum("ka,kanx->knx", shape, values.reshape(*lattice.shape, 3)[index])
    return np.stack([across @ ring for ring in around]).reshape(-1, 3)


_ROUNDING = 1e-9  # rad
_SAME = 1e-6  # of the wall: the change that a half turn may cause


@dataclass(frozen=True, kw_only=True)
class Balance:
    """A tire with the elements of `ring`, in static equilibrium on the road at `height` (m) under
    `load` (N).

    `displacement` (n, 3) m and `force` (n,) N of the road at all nodes of the whole `lattice`;
    `solved`: the problem that found the state."""

    ring: Ring
    lattice: NodeGrid
    rolling: Rolling
    height: float
    load: float
    displacement: np.ndarray
    force: np.ndarray
    solved: Equilibrium

    @classmethod
    def of(cls, loader: LoadStepper, rolling: Rolling) -> Balance:
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

    def _by(self, half: HalfModelEquilibrium | None) -> Balance:
        """The same state, with the half-ring problem as `solved` if that has it. Collective."""
        if half is None or not _has_all_of(half, self.lattice, self.displacement):
            return self
        return replace(self, solved=half)

    def near(self, ring: Ring) -> Equilibrium:
        """The same tire's problem on another `ring` of elements, at this state. Collective."""
        if ring is self.ring and isinstance(self.solved, HalfModelEquilibrium):
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

    def _half(self, ring: Ring, displacement: np.ndarray) -> HalfModelEquilibrium | None:
        """The half-ring problem, if half of the ring has the whole state; else None. Collective."""
        if not (self.solved.shape.flat and looks_the_same(ring, self.rolling)):
            return None
        half = HalfModelEquilibrium(self.solved.body, self.rolling, ring)
        half.body.set_displacement(displacement)
        return half if _has_all_of(half, field_lattice(ring), displacement) else None

    def _touching(self, lattice: NodeGrid) -> np.ndarray:
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


def _has_all_of(half: HalfModelEquilibrium, lattice: NodeGrid, displacement: np.ndarray) -> bool:
    """Whether half of a ring reproduces the displacement (n, 3) m of the whole. Collective."""
    off = np.abs(half.on(lattice)[0] - displacement).max()
    return bool(off < _SAME * lattice.tire.thickness)


def _nodes(solved: Equilibrium, lattice: NodeGrid) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (n, 3) m and road force (n,) N at the nodes of the whole ring. Collective."""
    if isinstance(solved, HalfModelEquilibrium):
        return solved.on(lattice)
    return solved.body.displacement(), solved.body.everywhere(solved.contact_force())


HIGHEST = 3  # highest element order available
CUBIC = 0.1  # ratio of the errors of order 3 and order 2 on the same mesh
# Fraction of the bulk error that remains: the rest comes from the elements at the footprint, which
# the first companion refines. Estimated over true error of the soft torus at 4 and 12 mm
# deflection, order 2 on 16 x 8, 20 x 8 and 24 x 10 elements and order 3 on 16 x 6 and 30 x 14 (4
# mm): 0.6 to 1.3 (bench discretisation). Compared with order 3 split once or twice at the footprint
# (known to 0.2 %), order 2 on 16 x 8, 20 x 8 and 24 x 10 at 2, 4 and 12 mm: 0.7 to 2.0 in
# magnitude, with the wrong sign in two of the nine cases, where the two parts nearly cancel.
REMAINS = 0.7
ENOUGH = 1e-4  # of the load: residual allowed in a companion
UNKNOWN = "these elements strain the cords too much between their integration points; take smaller elements"
CANCELS = 0.5  # of the larger part: sums below this have an unknown sign


@dataclass(frozen=True)
class LoadError:
    """Estimated discretisation error of the load.

    `load` N extrapolated to infinitely small elements; `relative`: relative deviation from it, in
    magnitude; its parts `footprint` (elements at the footprint) and `bulk` (all elements),
    relative, positive if the load is too large. `bulk` None: unknown, the estimate then has the
    footprint's part only. `extent`: footprint on the finer companion, which has `unknowns`.
    """

    load: float
    relative: float
    footprint: float
    bulk: float | None
    extent: Footprint
    unknowns: int

    @property
    def signed(self) -> bool:
        """Whether the error's sign is known: both parts are, and do not nearly cancel."""
        if self.bulk is None:
            return False
        return self.relative > CANCELS * max(abs(self.footprint), abs(self.bulk))


def load_error(loader: LoadStepper, rolling: Rolling) -> LoadError | str:
    """Estimated error of the load at the present road height, or the reason why it is unknown.

    The body is left unchanged. Collective.
    """
    if not loader.load():
        return "nothing touches the road"
    given = Balance.of(loader, rolling)
    try:
        finer = at_finer_footprint(given)
        bulk = _bulk(given)
    except ConvergenceError as error:
        return f"on the companion, {error}"
    edge = 1 - finer.load / given.load
    both = edge if bulk is None else edge + bulk
    return LoadError(
        load=given.load * (1 - both),
        relative=abs(both),
        footprint=edge,
        bulk=bulk,
        extent=finer.extent,
        unknowns=3 * finer.lattice.size,
    )


def at_finer_footprint(given: Balance) -> Balance:
    """The same tire and road with the elements at the footprint split in two. Collective."""
    lattice, force = given.lattice, given.face_force
    around = _touched(np.asarray(force.any(axis=1)), lattice.ring_corners, lattice, closed=True)
    along = _touched(np.asarray(force.any(axis=0)), lattice.arc_corners, lattice, closed=False)
    return given.balanced_on(split_ring(given.ring, around, along), ENOUGH * given.load)


def _bulk(given: Balance) -> float | None:
    """Relative excess of the load because the elements are too stiff. Collective.

    None if the state strains the cords of the other-order elements too much for a single step to be
    meaningful."""
    ring, load = given.ring, given.load
    order = ring.order + 1 if ring.order < HIGHEST else ring.order - 1
    section, corners = ring.section.of_order(order), ring.ring_corners
    half = ring.coarser() if order > ring.order else None
    if half is not None:
        # For the higher order half as many elements around give the same result at half the cost
        # (50 x 16, order 2: 0.741 % of the load with all elements, 0.747 % with half).
        corners = half.ring_corners
    other = replace(ring, ring_corners=corners, section=section)
    place, spread = _spot(given)
    weights, others = (probe.spot(field_lattice(one), *place, spread) for one in (ring, other))
    near = given.near(other)
    if cords_strained(near, load):
        return None
    sinks, compliance = given.near(ring).sinking(weights, load)
    further = near.sinking(others, load)[0]
    share = REMAINS * (further - sinks) / compliance / load
    return share if order > ring.order else -CUBIC * share


def _spot(given: Balance) -> tuple[tuple[float, float], tuple[float, float]]:
    """Centre and half widths of the contact (rad, around and along), at least one element each."""
    lattice, force = given.lattice, given.face_force
    around = (lattice.ring + np.pi) % (2 * np.pi) - np.pi
    places, spreads = [], []
    for angle, share, corners in (
        (around, force.sum(axis=1), lattice.ring_corners),
        (lattice.arc, force.sum(axis=0), lattice.arc_corners),
    ):
        middle = float(angle @ share / share.sum())
        least = np.diff(corners)[np.abs(corners[:-1] - middle).argmin()]
        places.append(middle)
        spreads.append(max(float(np.ptp(angle[share > 0])) / 2, float(least)))
    return (places[0], places[1]), (spreads[0], spreads[1])


def _touched(nodes: np.ndarray, corners: np.ndarray, lattice: NodeGrid, closed: bool) -> np.ndarray:
    """Flags of intervals between corners with a marked node, and of their neighbours."""
    order, count = len(lattice.edge) - 1, len(corners) - 1
    index = order * np.arange(count)[:, None] + np.arange(order + 1)
    held = nodes[index % len(nodes)].any(axis=1)
    wide = np.pad(held, 1, mode="wrap" if closed else "constant")
    return wide[2:] | held | wide[:-2]
