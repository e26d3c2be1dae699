"""Air of the footprint on its way out: over the edge, or through grooves that are pipes (greens.air_network).

What the tread squeezes out of the texture's pits (contact.results.squeezed_air) leaves by the nearest of three ways: over
the footprint's edge, into a circumferential groove, which carries it to its ends ahead and behind, or into a lateral groove, which
carries it to the shoulder and to the circumferential grooves that it meets. The texture between cells and their groove is a slit of the
mean gap. Lateral grooves pass through the footprint with the tread. The air's wave is long against their pitch P, so that it meets
their mean, d/P of a groove on each of the rows of cells d apart; what their passing itself modulates is left out.

Mouths radiate against the resistance that the tire over the road gives them, their own and with each other (`radiation_resistance`): on a
plane that is the flanged pipe's, (rho c / A) (ka)^2/2; between tread and road, at 1 kHz, ten times as much and more. The air outside is that
of the tire over the road: each outlet is a source at the nearest place of the tire's face.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, sparse

from tireroad.greens.air_network import Lengths, Mouth, Network, Pipe, reaching
from tireroad.greens.tire_sound import FAR, SoundAir, SoundingTire, Transfer, directions

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

_SHORT = 1e-4  # m: least length between a cell and the groove beside it, whose side may lie beyond the cell's middle
UNDER = 0.03  # m over the road: places of the tire's face near the contact


@dataclass(frozen=True)
class Groove:
    """A circumferential groove: its middle `y`, `width` and `depth`, all in m."""

    y: float
    width: float
    depth: float


@dataclass(frozen=True)
class LateralGroove:
    """Lateral grooves, one in each `pitch` (m, in the mean): their `width` and `depth` in m, the `span` (2,) m of y that they cover and
    the `slope` with which they go ahead along x per y, 0 along the axle."""

    width: float
    depth: float
    pitch: float
    span: tuple[float, float]
    slope: float = 0.0

    @property
    def stretch(self) -> float:
        """Length along the groove per y."""
        return float(np.hypot(1.0, self.slope))

    @property
    def apart(self) -> float:
        """Width of the tread between two of them, m, across the grooves."""
        return max(self.pitch / self.stretch - self.width, 0.0)


def radiation_resistance(
    far: Transfer, met: sparse.csr_matrix, sources: sparse.csr_matrix, lines: Array
) -> Array:
    """Resistance (m, o, l) Pa s/m3 that sources `met` (shares (e, m) of the elements) radiate against beside `sources` (e, o).

    R_ij = (w rho)^2 / (rho c) int Re(g_i g_j*) r^2 dOmega, from the Green's functions `far` to `directions`, of which quotients by
    w^2 are interpolated at lines (l,) Hz. Of a source on a plane rho w^2 / (2 pi c), which is a flanged pipe's.
    """
    weight = directions()[1] * FAR**2
    own, every = (
        np.stack([np.asarray(shares.T @ one.T) for one in far.ahead]) for shares in (met, sources)
    )
    resistance = ((own * weight) @ np.swapaxes(every.conj(), 1, 2)).real
    at_lines = interpolate.CubicSpline(far.frequency, resistance)(lines)
    scale = (2 * np.pi * lines * far.air.density) ** 2 / far.air.impedance
    return np.asarray(np.moveaxis(at_lines * scale[:, None, None], 0, -1))


@dataclass(frozen=True)
class Outlets:
    """Ways out of the footprint's air.

    `sums` (o, k): cells of the footprint to ways: places of the edge first, then nodes of the `network` of grooves; `edge` (e, 2) m: of the
    edge; `grooves`: the circumferential ones under the footprint; `mouths` (m, 2) m: places of the network's mouths, of each of these
    the rear and the front end, then those of lateral grooves; `reach` m: twice the mean distance of a cell from its way out over the
    edge, `reaches` (n,) m the same of the slits beside each node.
    """

    sums: sparse.csr_matrix
    edge: Array
    grooves: tuple[Groove, ...]
    network: Network
    mouths: Array
    reach: float
    reaches: Array

    @staticmethod
    def of(
        inside: Mask,
        cell: Index,
        x: Array,
        y: Array,
        grooves: Sequence[Groove] = (),
        lateral: Sequence[LateralGroove] = (),
    ) -> Outlets:
        """The nearest way out of each cell (k, 2) of a footprint `inside` (nx, ny) on the grid `x`, `y` (m).

        Grooves beside the footprint are left out. From a `lateral` groove, whose place changes, the distance is that in the mean.
        """
        under = [g for g in grooves if inside[:, np.abs(y - g.y).argmin()].any()]
        ways, places = _over_the_edge(inside, cell, x, y)
        ends = _groove_ends(inside, x, y, under)
        distance = np.stack([*ways, *_into_grooves(cell, x, y, under, ends, lateral)])
        way = distance.argmin(axis=0)
        own = distance[way, np.arange(len(cell))]
        over = way < len(ways)
        chosen = places[np.minimum(way, len(ways) - 1), np.arange(len(cell))]
        edge, number = np.unique(chosen[over], axis=0, return_inverse=True)
        laid = _Laid(inside, x, y)
        for k, groove in enumerate(under):
            # Of cells that lie evenly from 0 to the farthest, twice the mean distance.
            reach = 2 * _mean(own[way == len(ways) + k])
            laid.around(groove, Pipe(groove.width, groove.depth, reach), ends[k])
        for one in lateral:
            laid.across(one, under)
        outlet = np.zeros(len(cell), dtype=int)
        outlet[over] = number
        into = way[~over] - len(ways)
        outlet[~over] = len(edge) + laid.node_at[(into, *cell[~over].T)]
        network = laid.network()
        ones = np.ones(len(cell)), (outlet, np.arange(len(cell)))
        return Outlets(
            sums=sparse.csr_matrix(ones, shape=(len(edge) + network.nodes, len(cell))),
            edge=edge,
            grooves=tuple(under),
            network=network,
            mouths=np.array(laid.places).reshape(-1, 2),
            reach=2 * _mean(own[over]),
            reaches=np.array(laid.reaches),
        )

    @property
    def places(self) -> Array:
        """Where air comes out (e + m, 2) m: at the edge, then at the mouths of grooves."""
        return np.vstack([self.edge, self.mouths])

    def leaving(
        self, rate: Complex, frequency: Array, height: float, air: SoundAir, resistance: Array
    ) -> Complex:
        """Volume velocities (s, e + m, f) m3/s at the `places`, of those squeezed (s, o, f) m3/s in s states, with a mean gap of `height` m.

        `resistance` (m, e + m, f): `radiation_resistance` that the mouths meet beside all places.
        """
        first = len(self.edge)
        over = rate[:, :first] * reaching(self.reach, height, frequency, air)
        if not len(self.mouths):
            return over
        part = {b: reaching(b, height, frequency, air) for b in set(self.reaches.tolist())}
        flow = rate[:, first:] * np.array([part[b] for b in self.reaches.tolist()])
        outside = np.einsum("ijf,sjf->sif", resistance[:, :first], over)
        given = flow, frequency, height, air, resistance[:, first:], outside
        return np.concatenate([over, self.network.leaving(*given)], axis=1)


def _over_the_edge(inside: Mask, cell: Index, x: Array, y: Array) -> tuple[list[Array], Array]:
    """Distances (4) (k,) m of cells from the edge behind, ahead, to the right and to the left, and its places (4, k, 2) m there."""
    low, high = _ends(inside, x)
    right, left = _ends(inside.T, y)
    row, column = cell.T
    at, across = x[row], y[column]
    ways = [at - low[column], high[column] - at, across - right[row], left[row] - across]
    places = [(low[column], across), (high[column], across), (at, right[row]), (at, left[row])]
    return ways, np.stack([np.stack(place, axis=1) for place in places])


def _groove_ends(inside: Mask, x: Array, y: Array, grooves: Sequence[Groove]) -> Array:
    """Rear and front end (g, 2) m of each circumferential groove, which is as long as its cells."""
    low, high = _ends(inside, x)
    half = (x[1] - x[0]) / 2
    nearest = [int(np.abs(y - g.y).argmin()) for g in grooves]
    return np.array([[low[j] - half, high[j] + half] for j in nearest]).reshape(-1, 2)


def _into_grooves(
    cell: Index,
    x: Array,
    y: Array,
    grooves: Sequence[Groove],
    ends: Array,
    lateral: Sequence[LateralGroove],
) -> Iterator[Array]:
    """Distances (k,) m of cells from each circumferential groove, then from lateral ones in the mean; infinite where it is not beside."""
    at, across = x[cell[:, 0]], y[cell[:, 1]]
    for groove, (rear, front) in zip(grooves, ends, strict=True):
        beyond = np.maximum(np.abs(across - groove.y) - groove.width / 2, 0.0)
        yield np.where((at >= rear) & (at <= front), beyond, np.inf)
    taken = _columns_of(grooves, y) >= 0
    for one in lateral:
        met = (across >= one.span[0]) & (across <= one.span[1]) & ~taken[cell[:, 1]]
        yield np.where(met, one.apart / 4, np.inf)


def _columns_of(grooves: Sequence[Groove], y: Array) -> Index:
    """The number (ny,) of the circumferential groove in each column of cells, -1 where there is none."""
    found = np.full(len(y), -1)
    for k, groove in enumerate(grooves):
        away = np.abs(y - groove.y)
        found[(away <= groove.width / 2) | (away == away.min())] = k
    return found


class _Stop(NamedTuple):
    """Where lateral grooves pass: from `low` to `high` y in m, at a cell; its `node`, -1 outside; `own`: a node of theirs."""

    low: float
    high: float
    row: int
    column: int
    node: int = -1
    own: bool = False


@dataclass
class _Laid:
    """Network under construction in a footprint `inside` (nx, ny) on the grid `x`, `y` (m).

    `node_at` (g, nx, ny): the node at each cell of each groove, circumferential ones first, -1 where it has none.
    """

    inside: Mask
    x: Array
    y: Array
    node_at: Index = field(init=False)
    places: list[tuple[float, float]] = field(default_factory=list)
    reaches: list[float] = field(default_factory=list)
    _mouths: list[Mouth] = field(default_factory=list)
    _lengths: dict[Pipe, list[tuple]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.node_at = np.zeros((0, *self.inside.shape), dtype=int)

    def network(self) -> Network:
        """The network that has been laid so far."""
        lengths = []
        for pipe, some in self._lengths.items():
            one, two, length, count = zip(*some, strict=True)
            both = np.array([one, two], dtype=int).T
            lengths.append(Lengths(pipe, both, np.array(length), np.array(count)))
        return Network(len(self.reaches), tuple(lengths), tuple(self._mouths))

    def _node(self, pipe: Pipe) -> int:
        self.reaches.append(pipe.reach)
        return len(self.reaches) - 1

    def _join(self, pipe: Pipe, one: int, two: int, length: float, count: float = 1.0) -> None:
        self._lengths.setdefault(pipe, []).append((one, two, length, count))

    def _mouth(self, pipe: Pipe, place: tuple[float, float], count: float = 1.0) -> int:
        node = self._node(pipe)
        self._mouths.append(Mouth(node, pipe, count))
        self.places.append(place)
        return node

    def _known(self) -> Index:
        """Places for the nodes of one more groove, (nx, ny)."""
        more = np.full((1, *self.inside.shape), -1)
        self.node_at = np.concatenate([self.node_at, more])
        known: Index = self.node_at[-1]
        return known

    def around(self, groove: Groove, pipe: Pipe, ends: Array) -> None:
        """A circumferential groove: a node on each of its rows, which the cells beside it share, and a mouth at both ends."""
        rows = np.flatnonzero((self.x > ends[0]) & (self.x < ends[1]))
        stops = [self._mouth(pipe, (float(ends[0]), groove.y))]
        stops += [self._node(pipe) for _ in rows]
        self._known()[rows] = np.array(stops[1:])[:, None]
        stops.append(self._mouth(pipe, (float(ends[1]), groove.y)))
        at = np.concatenate([ends[:1], self.x[rows], ends[1:]])
        for one, two, length in zip(stops, stops[1:], np.diff(at).tolist(), strict=False):
            self._join(pipe, one, two, length)

    def across(self, groove: LateralGroove, around: Sequence[Groove]) -> None:
        """Lateral grooves: from each row on, a string of nodes to where they leave the footprint, meet grooves `around` or end."""
        pipe = Pipe(groove.width, groove.depth, groove.apart / 2)
        apart = float(self.x[1] - self.x[0])
        columns = np.flatnonzero((self.y >= groove.span[0]) & (self.y <= groove.span[1]))
        ahead = np.rint(self.y[columns] * groove.slope / apart).astype(int)
        known, met = self._known(), _columns_of(around, self.y)
        for first in range(-int(ahead.max(initial=0)), len(self.x) - int(ahead.min(initial=0))):
            rows = first + ahead
            stops = list(self._stops(pipe, rows, columns, known, met, around))
            self._strung(groove, pipe, stops, apart / groove.pitch)

    def _stops(
        self,
        pipe: Pipe,
        rows: Index,
        columns: Index,
        known: Index,
        met: Index,
        around: Sequence[Groove],
    ) -> Iterator[_Stop]:
        """Places that lateral grooves pass from right to left: cells, to which nodes are given, grooves, and what is outside."""
        for row, j in zip(rows.tolist(), columns.tolist(), strict=True):
            y, k = float(self.y[j]), int(met[j])
            if not (0 <= row < len(self.x) and self.inside[row, j]):
                yield _Stop(y, y, row, j)
            elif k < 0:
                known[row, j] = node = self._node(pipe)
                yield _Stop(y, y, row, j, node, own=True)
            else:
                groove, node = around[k], int(self.node_at[k, row, j])
                low, high = groove.y - groove.width / 2, groove.y + groove.width / 2
                yield _Stop(low, high, row, j, node)

    def _strung(self, groove: LateralGroove, pipe: Pipe, stops: list[_Stop], count: float) -> None:
        """Join the stops of lateral grooves, `count` of them side by side; they are open where they leave the footprint."""
        half, long = float(self.y[1] - self.y[0]) / 2, groove.stretch
        for one, two in zip(stops, stops[1:], strict=False):
            within = not (one.own or two.own) and one.low == two.low  # one groove's two columns
            if min(one.node, two.node) >= 0 and not within:
                self._join(pipe, one.node, two.node, long * max(two.low - one.high, _SHORT), count)
            for stop, other, side in ((one, two, half), (two, one, -half)):
                if stop.own and other.node < 0:
                    self._opened(pipe, stop, side, long, count)
        for stop, end, side in ((stops[0], 0, -half), (stops[-1], 1, half)) if stops else ():
            left = abs(groove.span[end] - stop.low)
            beside = stop.column + (1 if side > 0 else -1)
            within = 0 <= beside < len(self.y) and self.inside[stop.row, beside]
            if stop.own and not within and left >= half:
                self._opened(pipe, stop, side, long, count)
            elif stop.own and left > 0:
                self._join(pipe, stop.node, -1, long * min(left, 2 * half), count)

    def _opened(self, pipe: Pipe, stop: _Stop, side: float, long: float, count: float) -> None:
        """A mouth at `side` (m) of a cell."""
        mouth = self._mouth(pipe, (float(self.x[stop.row]), stop.low + side), count)
        self._join(pipe, stop.node, mouth, long * abs(side), count)


def _ends(inside: Mask, place: Array) -> tuple[Array, Array]:
    """First and last place of each column of a footprint; NaN where it has none."""
    some = inside.any(axis=0)
    low = np.where(some, place[inside.argmax(axis=0)], np.nan)
    high = np.where(some, place[len(place) - 1 - inside[::-1].argmax(axis=0)], np.nan)
    return low, high


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else 0.0


def on_elements(tire: SoundingTire, face: Array, places: Array) -> sparse.csr_matrix:
    """Shares (e, o) of the elements in sources at `places` (o, 2) m beside the contact, x forward and y left on the road.

    g of a source is that at the nearest node of the outer face that is in the air; `face` (s, 3) m: the nodes in the road's axes,
    over the road.
    """
    free = np.flatnonzero((np.linalg.norm(tire.area, axis=1) > 0) & (face[:, 2] < UNDER))
    apart = np.linalg.norm(face[free, None, :2] - places[None], axis=2)
    return tire.nodes[free[apart.argmin(axis=0)]].T.tocsr()
