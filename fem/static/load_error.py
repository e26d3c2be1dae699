"""The discretisation error of the load, from a companion state on another mesh.

Where contact ends, the surface opens as d^(3/2), d being the distance from the edge, which lies
anywhere in an element. This error fluctuates from mesh to mesh, and no coarser mesh reveals it.
Therefore the elements at the footprint are split in two, and equilibrium is solved again from the
present state. The excess stiffness of all other elements is estimated with elements of another
order on the same mesh: how far the footprint sinks under the same traction in one Newton step from
the present state. Half of the ring is used where a half turn leaves the state unchanged
(fem.static.symmetric).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices import probe
from tireroad.fem.sections import mesh2d
from tireroad.fem.sections.mesh2d import Ring, SectionMesh
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.footprint import Footprint, footprint, nodal_area
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.restart import balance_near, cords_strained
from tireroad.fem.static.state import StaticState, static_state
from tireroad.fem.static.symmetric import HalfModelEquilibrium, looks_the_same
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import NodeGrid, field_lattice

if TYPE_CHECKING:
    from tireroad.fem.model import TireModel

_CANDIDATES = 9  # cells whose centres are nearest to a point: one of them contains it
_NEWTON = 12
_OUTSIDE = 0.2  # of an element: limit of the reference coordinates for points off the mesh
_MERGED = 1e-7  # of the section's size: nodes of two cells closer than this are merged
_ROUNDING = 1e-9  # rad
_SAME = 1e-6  # of the wall: the change that a half turn may cause
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


def locate(
    nodes: np.ndarray, cells: np.ndarray, order: int, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cell, xi and eta, (k,) each, of points (k, 2) m in cells (c, n) of equispaced nodes.

    Newton's method in the nearest cells; a point outside all of them gets the best fit.
    """
    near = min(_CANDIDATES, len(cells))
    _, candidates = cKDTree(nodes[cells].mean(axis=1)).query(points, k=near)
    candidates = candidates.reshape(len(points), near)
    best = np.full(len(points), np.inf)
    places = np.zeros((len(points), 3))
    for cell in candidates.T:
        place = _inverse(nodes[cells[cell]], order, points)
        # Any cell that contains the point will do; otherwise the nearest.
        excess = np.abs(place - 0.5).max(axis=1)
        better = excess < best - 1e-9
        best[better] = excess[better]
        places[better] = np.column_stack([cell, place])[better]
    return places[:, 0].astype(int), places[:, 1], places[:, 2]


def _inverse(corners: np.ndarray, order: int, points: np.ndarray) -> np.ndarray:
    """Reference coordinates (k, 2) of points (k, 2) in cells with nodes (k, n, 2)."""
    edge = mesh2d.equispaced(order)
    place = np.full(points.shape, 0.5)
    for _ in range(_NEWTON):
        xi, eta = place.T
        value = mesh2d.lagrange(edge, xi), mesh2d.lagrange(edge, eta)
        slope = mesh2d.lagrange_slope(edge, xi), mesh2d.lagrange_slope(edge, eta)
        defect = np.einsum("ka,kax->kx", mesh2d.tensor(*value), corners) - points
        rates = [
            np.einsum("ka,kax->kx", mesh2d.tensor(*pair), corners)
            for pair in ((slope[0], value[1]), (value[0], slope[1]))
        ]
        step = np.linalg.solve(np.stack(rates, axis=-1), defect[:, :, None])[:, :, 0]
        place = np.clip(place - np.clip(step, -0.5, 0.5), -_OUTSIDE, 1 + _OUTSIDE)
    return place


def interpolation(
    cells: np.ndarray,
    edge: np.ndarray,
    count: int,
    place: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> sparse.csr_matrix:
    """Shape functions (k, count) at (cell, xi, eta) on cells (c, n) with nodes at `edge`."""
    cell, xi, eta = place
    shape = mesh2d.tensor(mesh2d.lagrange(edge, xi), mesh2d.lagrange(edge, eta))
    rows = np.repeat(np.arange(len(cell)), shape.shape[1])
    entries = shape.ravel(), (rows, cells[cell].ravel())
    return sparse.csr_matrix(entries, shape=(len(cell), count))


def split_ring(ring: Ring, around: np.ndarray, along: np.ndarray) -> Ring:
    """The ring with segments `around` (segments,) bool and the strips of cells under outer edges
    `along` (k,) bool split in two. The shape and all existing nodes are kept.
    """
    return replace(
        ring,
        section=split_section(ring.section, along),
        ring_corners=_cut(ring.ring_corners, around),
        arc_corners=_cut(ring.arc_corners, along),
        coarser=lambda: None,
    )


def _cut(corners: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Ascending corners with a midpoint inserted in each wanted interval."""
    return np.sort(np.append(corners, ((corners[1:] + corners[:-1]) / 2)[wanted]))


def split_section(section: SectionMesh, along: np.ndarray) -> SectionMesh:
    """The section with strips of cells under outer edges `along` (k,) bool split in two.

    A strip runs from an edge to the opposite one of the same cell and on through the next, so that
    cells still share whole edges. The shape is that of the original cells.
    """
    children = _Children(_strips(section, section.outer[along]))
    order = section.order
    xi, eta = mesh2d.grid_points(mesh2d.equispaced(order))

    def position(cells: np.ndarray, xi: np.ndarray, eta: np.ndarray) -> np.ndarray:
        return section.at(*children.in_parent(cells, xi, eta))

    count = len(children.owner)
    every = np.repeat(np.arange(count), len(xi))
    nodes, number = _merged(position(every, np.tile(xi, count), np.tile(eta, count)))
    return replace(
        section,
        nodes=nodes,
        cells=number.reshape(count, -1),
        region=section.region[children.owner],
        outer=children.chain(section, section.outer),
        tread=children.edges(section.tread),
        inner=children.edges(section.inner),
        rim=children.edges(section.rim),
        plies={name: children.chain(section, edges) for name, edges in section.plies.items()},
        position=position,
    )


def _strips(section: SectionMesh, starts: np.ndarray) -> np.ndarray:
    """Reference coordinates along which each cell is split, (cells, 2) bool."""
    sides = section.cells[:, mesh2d.side_nodes(section.order)][..., [0, -1]]
    across: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for cell, side in np.ndindex(sides.shape[:2]):
        across.setdefault(tuple(sorted(sides[cell, side])), []).append((cell, side))
    cut = np.zeros((len(section.cells), 2), bool)
    for cell, side in starts:
        while not cut[cell, _along(side)]:
            cut[cell, _along(side)] = True
            opposite = cell, side ^ 1
            both = across[tuple(sorted(sides[opposite]))]
            cell, side = next((strip for strip in both if strip != opposite), opposite)
    return cut


def _along(side: int) -> int:
    """The reference coordinate that runs along a side."""
    return 1 - side // 2


class _Children:
    """The cells into which `cut` (cells, 2) bool splits each cell, consecutive for each parent."""

    def __init__(self, cut: np.ndarray) -> None:
        self.parts = 1 + cut
        self.first = np.concatenate([[0], np.cumsum(self.parts.prod(axis=1))])
        self.owner = np.repeat(np.arange(len(cut)), self.parts.prod(axis=1))
        local = np.arange(len(self.owner)) - self.first[self.owner]
        self.size = 1 / self.parts[self.owner]
        self.start = np.stack(np.divmod(local, self.parts[self.owner, 1]), axis=-1) * self.size

    def in_parent(
        self, cells: np.ndarray, xi: np.ndarray, eta: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cell and reference coordinates in the parent section."""
        place = self.start[cells] + self.size[cells] * np.stack([xi, eta], axis=-1)
        return self.owner[cells], place[:, 0], place[:, 1]

    def edges(self, edges: np.ndarray, turned: np.ndarray | None = None) -> np.ndarray:
        """The children's edges (k', 2) of edges (k, 2), reversed for sides that are `turned`."""
        pairs = []
        for number, (cell, side) in enumerate(edges):
            across, step = self.parts[cell], _along(side)
            place = np.zeros((across[step], 2), int)
            place[:, step] = np.arange(across[step])
            place[:, 1 - step] = (across[1 - step] - 1) * (side % 2)
            if turned is not None and turned[number]:
                place = place[::-1]
            child = self.first[cell] + place[:, 0] * across[1] + place[:, 1]
            pairs.append(np.stack([child, np.full(len(child), side)], axis=1))
        return np.concatenate(pairs) if pairs else edges

    def chain(self, section: SectionMesh, edges: np.ndarray) -> np.ndarray:
        """The children's edges of an ordered chain, in its order."""
        start = section.chain(edges)[:: section.order][:-1]
        return self.edges(edges, section.side(edges)[:, 0] != start)


def _merged(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unique points (n, 2), and the index of each given point (k,) among them."""
    size = np.ptp(points, axis=0).max()
    a, b = cKDTree(points).query_pairs(_MERGED * size, output_type="ndarray").T
    same = coo_matrix((np.ones(len(a)), (a, b)), shape=(len(points),) * 2)
    _, number = connected_components(same, directed=False)
    _, first = np.unique(number, return_index=True)
    return points[first], number


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
        index = _nodes(other, lattice)
        return Balance(
            ring=ring,
            lattice=lattice,
            rolling=self.rolling,
            height=self.height,
            load=other.load(),
            displacement=index[0],
            force=index[1],
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
        """Initial contact forces (n,) N on a finer mesh: positive at nodes between loaded nodes of the coarse one."""
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
    balance = Balance.of(loader, rolling)
    try:
        finer = at_finer_footprint(balance)
        bulk = _bulk(balance)
    except ConvergenceError as error:
        return f"on the companion, {error}"
    edge = 1 - finer.load / balance.load
    both = edge if bulk is None else edge + bulk
    return LoadError(
        load=balance.load * (1 - both),
        relative=abs(both),
        footprint=edge,
        bulk=bulk,
        extent=finer.extent,
        unknowns=3 * finer.lattice.size,
    )


def at_finer_footprint(balance: Balance) -> Balance:
    """The same tire and road with the elements at the footprint split in two. Collective."""
    lattice, force = balance.lattice, balance.face_force
    around = _touched(np.asarray(force.any(axis=1)), lattice.ring_corners, lattice, closed=True)
    along = _touched(np.asarray(force.any(axis=0)), lattice.arc_corners, lattice, closed=False)
    return balance.balanced_on(split_ring(balance.ring, around, along), ENOUGH * balance.load)


def _bulk(balance: Balance) -> float | None:
    """Relative excess of the load because the elements are too stiff. Collective.

    None if the state strains the cords of the other-order elements too much for a single step to be
    meaningful."""
    ring, load = balance.ring, balance.load
    order = ring.order + 1 if ring.order < HIGHEST else ring.order - 1
    section, corners = ring.section.of_order(order), ring.ring_corners
    half = ring.coarser() if order > ring.order else None
    if half is not None:
        # For the higher order half as many elements around give the same result at half the cost
        # (50 x 16, order 2: 0.741 % of the load with all elements, 0.747 % with half).
        corners = half.ring_corners
    other = replace(ring, ring_corners=corners, section=section)
    place, spread = _spot(balance)
    weights, others = (probe.spot(field_lattice(mesh), *place, spread) for mesh in (ring, other))
    near = balance.near(other)
    if cords_strained(near, load):
        return None
    sinks, compliance = balance.near(ring).uniform_traction_step(weights, load)
    further = near.uniform_traction_step(others, load)[0]
    share = REMAINS * (further - sinks) / compliance / load
    return share if order > ring.order else -CUBIC * share


def _spot(balance: Balance) -> tuple[tuple[float, float], tuple[float, float]]:
    """Centre and half widths of the contact (rad, around and along), at least one element each."""
    lattice, force = balance.lattice, balance.face_force
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
