"""Membranes with cords are embedded in a section: its cells are split along them, and each becomes a ply.

A ply has a course along sides of cells, the angle of its cords, and their data. In an axisymmetric membrane Abaqus measures the cord angle a from the meridian, the direction t from
the element's first node to its second, positive about the normal, which is t rotated by 90 degrees
in the (r, z) plane: the cord lies along cos a t + sin a e_theta, e_theta right-handed about z. At
the lowest point e_theta is -x, so relative to a chain that runs along s t (s = 1 or -1) the cord
lies along -sin a e_x + s cos a e_chain: the angle from the circumference is atan2(s cos a, -sin a).
A line has no sense of direction, so the angle is reduced to between -90 and 90 degrees.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tireroad.fem.decks.compounds import CordMaterial
from tireroad.fem.decks.deck import SCOPE, CordLayer, Deck
from tireroad.fem.decks.quads import (
    SIDE_NODES,
    DeckEdges,
    Quads,
    along,
    ends,
    forward,
    place,
    shape,
    strings,
    with_origin,
)
from tireroad.fem.errors import InputError

_NEWTON = 12
Marks = dict[int, float]  # by a side's middle node: position of its cut from its lower end node
SNAP = 0.01  # of a cell: tolerance within which a point lies on a node or side
# A line that ends nearer than this to a side ends on it: a cell of a hundredth of its neighbours'
# length left no correct digits in the modes (relative residual 0.6), one of a twentieth does not.
_SNAP_END = 0.05
_WITHIN = 1e-3  # of an element of the line: from its end to where its last cell is looked for
_LEAST_ANGLE = 0.1  # sine between a line and a side; below it the line runs along the side


def rate(t: np.ndarray) -> np.ndarray:
    """Derivatives (k, 3) of the quadratic functions of the nodes 0, 1/2 and 1."""
    t = np.asarray(t, float)
    return np.stack([4 * t - 3, 4 - 8 * t, 4 * t - 1], axis=-1)


def rates(nine: np.ndarray, where: np.ndarray) -> np.ndarray:
    """d(r, z)/d(xi, eta) (k, 2, 2) of cells (k, 9, 2) at one position (k, 2) each."""
    grid = nine.reshape(-1, 3, 3, 2)
    xi, eta = where.T
    along = [(rate(xi), shape(eta)), (shape(xi), rate(eta))]
    return np.stack([np.einsum("ka,kb,kabx->kx", a, b, grid) for a, b in along], axis=-1)


def inverse(
    nine: np.ndarray, points: np.ndarray, limit: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates (k, 2) of points (k, 2) in cells (k, 9, 2), and residual distances: Newton.

    Coordinates are kept within `limit` of the cell.
    """
    where = np.full(points.shape, 0.5)
    grid = nine.reshape(-1, 3, 3, 2)
    for _ in range(_NEWTON + 1):
        here = np.einsum("ka,kb,kabx->kx", shape(where[:, 0]), shape(where[:, 1]), grid)
        matrix = rates(nine, where)
        size = np.linalg.norm(matrix, axis=1).prod(axis=1)
        matrix[np.abs(np.linalg.det(matrix)) <= 1e-9 * size] = np.eye(2) * 1e300
        step = np.linalg.solve(matrix, (here - points)[..., None])[..., 0]
        where = np.clip(where - np.clip(step, -0.5, 0.5), -limit, 1 + limit)
    return where, np.linalg.norm(here - points, axis=1)


def locate(quads: Quads, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cells (k,) containing points (k, 2), coordinates (k, 2), distance outside (k,) in cells.

    A point near no cell has cell -1 and an infinite distance.
    """
    nine = quads.points[quads.cells]
    low, high = nine.min(axis=1), nine.max(axis=1)
    margin = 0.2 * (high - low).max(axis=1, keepdims=True)
    near = [
        np.flatnonzero(((point >= low - margin) & (point <= high + margin)).all(axis=1))
        for point in points
    ]
    owner = np.repeat(np.arange(len(points)), [len(cells) for cells in near])
    cells = np.concatenate([np.empty(0, np.int64), *near])
    where, miss = inverse(nine[cells], points[owner])
    size = np.linalg.norm(high - low, axis=1)[cells]
    beyond = np.maximum(np.maximum(-where, where - 1).max(axis=1, initial=0), 0) + miss / size
    order = np.lexsort((beyond, owner))
    there, first = np.unique(owner[order], return_index=True)
    best = order[first]
    places = np.full(len(points), -1), np.zeros((len(points), 2)), np.full(len(points), np.inf)
    for into, value in zip(places, (cells, where, beyond), strict=True):
        into[there] = value[best]
    return places


class Origins:
    """Edge numbers: the deck's and new ones; a part of an edge knows its parent."""

    def __init__(self, count: int) -> None:
        self._first = count
        self._parent: list[int] = []

    def new(self, parent: int) -> int:
        """A number for a part of edge `parent` (-1: of none)."""
        self._parent.append(parent)
        return self._first + len(self._parent) - 1

    def with_parts(self, numbers: np.ndarray) -> np.ndarray:
        """The given numbers and those of all their parts."""
        known = set(numbers.tolist())
        for offset, parent in enumerate(self._parent):
            if parent in known:
                known.add(self._first + offset)
        return np.array(sorted(known), np.int64)


def oriented(side: np.ndarray, t: float) -> float:
    """A position on a side from its first node, given that from its lower node, or vice versa."""
    return t if side[0] < side[2] else 1 - t


def cut(
    quads: Quads,
    marks: Mapping[int, float],
    number: int,
    path: Mapping[int, float],
    fail: Callable[[str], Exception],
) -> Quads:
    """Split the cells at the marked sides and onwards, to the boundary or round the section.

    `path`: the cells in which the cut is part of the line, with its position halfway through; sides
    created there get `number`. `fail` creates the error for a cut that would cross itself.
    """
    marks, axis = _closed(quads, dict(marks), fail)
    points = list(quads.points)
    side_points = _cut_sides(quads, marks, points)
    keep = np.setdiff1d(np.arange(len(quads.cells)), list(axis))
    cells, origin = [quads.cells[keep]], [quads.origin[keep]]
    parent = [keep]
    for cell, across in axis.items():
        new, sides = _halves(quads, cell, across, marks, side_points, points, path.get(cell))
        tag = number if cell in path else -1
        cells.append(new)
        origin.append(np.where(sides == -2, tag, sides))
        parent.append(np.full(2, cell))
    parent = np.concatenate(parent)
    return _tidy(
        Quads(
            points=np.array(points),
            cells=np.concatenate(cells),
            region=quads.region[parent],
            element=quads.element[parent],
            origin=np.concatenate(origin),
        )
    )


def _closed(
    quads: Quads, marks: Marks, fail: Callable[[str], Exception]
) -> tuple[Marks, dict[int, int]]:
    """All sides to be cut, and for each cell the direction (0 xi, 1 eta) in which it is divided."""
    sides = quads.sides()
    cells = defaultdict(list)
    for cell, row in enumerate(sides[:, :, 1].tolist()):
        for side, middle in enumerate(row):
            cells[middle].append((cell, side))
    axis: dict[int, int] = {}
    queue = list(marks)
    while queue:
        middle = queue.pop()
        for cell, side in cells[middle]:
            divided = 1 - side // 2
            if axis.setdefault(cell, divided) != divided:
                r, z = quads.points[quads.cells[cell, 4]]
                raise fail(
                    f"the row of elements it lies in crosses itself at r = {r:.5g}, z = {z:.5g}"
                )
            opposite = sides[cell, side ^ 1]
            if opposite[1] not in marks:
                t = oriented(sides[cell, side], marks[middle])
                marks[int(opposite[1])] = oriented(opposite, t)
                queue.append(int(opposite[1]))
    return marks, axis


def _cut_sides(quads: Quads, marks: Marks, points: list) -> dict[int, tuple]:
    """New points of each cut side from its lower end: first middle, cut, second middle."""
    cut_sides = {}
    sides = {int(side[1]): side for side in quads.sides().reshape(-1, 3)}
    for middle, t in marks.items():
        side = sides[middle]
        low_first = side if side[0] < side[2] else side[::-1]
        new = shape(np.array([t / 2, t, (1 + t) / 2])) @ quads.points[low_first]
        cut_sides[middle] = tuple(range(len(points), len(points) + 3))
        points.extend(new)
    return cut_sides


def _halves(
    quads: Quads,
    cell: int,
    along: int,
    marks: Marks,
    side_points: dict[int, tuple],
    points: list,
    middle: float | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Two cells (2, 9) in place of one, and the origin of their sides (2, 4); -2 on the cut."""
    grid = quads.cells[cell].reshape(3, 3)
    origin = quads.origin[cell]
    if along == 0:  # treated as a division of eta, and transposed back at the end
        grid = grid.T
    first, last = (0, 1) if along == 1 else (2, 3)
    sides = quads.cells[cell][SIDE_NODES[[first, last]]]
    at = [oriented(side, marks[int(side[1])]) for side in sides]
    half = middle if middle is not None else (at[0] + at[1]) / 2
    rows = np.empty((3, 5), np.int64)  # across the cut: five nodes instead of three
    rows[:, 0], rows[:, 4] = grid[:, 0], grid[:, 2]
    for row, side in zip((0, 2), sides, strict=True):
        new = side_points[int(side[1])]
        rows[row, 1:4] = new if side[0] < side[2] else new[::-1]
    nine = quads.points[quads.cells[cell]]
    xi, eta = np.full(3, 0.5), np.array([half / 2, half, (1 + half) / 2])
    rows[1, 1:4] = range(len(points), len(points) + 3)
    points.extend(place(nine, *((xi, eta) if along == 1 else (eta, xi))))
    lower, upper = rows[:, :3], rows[:, 2:]
    a, b, c, d = origin if along == 1 else origin[[2, 3, 0, 1]]
    parts = np.array([[a, b, c, -2], [a, b, -2, d]])
    if along == 0:
        lower, upper, parts = lower.T, upper.T, parts[:, [2, 3, 0, 1]]
    return np.array([lower.ravel(), upper.ravel()]), parts


def _tidy(quads: Quads) -> Quads:
    """Remove nodes that no cell uses any more."""
    used, cells = np.unique(quads.cells, return_inverse=True)
    return replace(quads, points=quads.points[used], cells=cells.reshape(quads.cells.shape))


@dataclass(frozen=True)
class HostedLine:
    """One chain of line elements: points (k, 3, 2) at start, middle and end of each; `name` and
    `fail`, which creates an error from a text, for messages; `hosts`: elements it must lie in,
    None: any.
    """

    name: str
    points: np.ndarray
    fail: Callable[[str], Exception]
    hosts: frozenset | None = None

    def at(self, s: np.ndarray) -> np.ndarray:
        """Positions (k, 2) at s, in elements from the start; extrapolated beyond the ends."""
        number = np.clip(np.floor(s).astype(int), 0, len(self.points) - 1)
        return np.einsum("ka,kax->kx", shape(s - number), self.points[number])

    def slope(self, s: float) -> np.ndarray:
        """d at / ds at one position."""
        step = 1e-6
        return (self.at(np.array([s + step])) - self.at(np.array([s - step])))[0] / (2 * step)


@dataclass(frozen=True)
class _Station:
    """Where a line meets the mesh: at a node, or on a side (named by its middle) at t from its
    lower end."""

    s: float
    node: int = -1
    side: int = -1
    t: float = 0.0


def lay(quads: Quads, line: HostedLine, origins: Origins) -> tuple[Quads, list[int]]:
    """The cells with sides all along a line, and the numbers of those sides.

    Raises the line's error if it leaves the body or its hosts, or crosses cells obliquely.
    """
    _inside(quads, line)
    length = float(len(line.points))
    quads, before = _cut_at_end(quads, line, 0.0)
    quads, after = _cut_at_end(quads, line, length)
    stations = _stations(quads, line, (-before, length + after))
    marks, path, sides = _follow(quads, line, stations)
    numbers = []
    origin = quads.origin.copy()
    for middle in sides:
        where = np.argwhere(quads.sides()[:, :, 1] == middle)
        number = origins.new(int(origin[tuple(where[0])]))
        origin[where[:, 0], where[:, 1]] = number
        numbers.append(number)
    quads = replace(quads, origin=origin)
    if marks:
        numbers.append(origins.new(-1))
        quads = cut(quads, marks, numbers[-1], path, line.fail)
    return quads, numbers


def _inside(quads: Quads, line: HostedLine) -> None:
    """Check that ends and middles of the line's elements lie in the body and in the hosts."""
    points = line.points.reshape(-1, 2)
    cells, where, beyond = locate(quads, points)
    clear = ((where > 0.1) & (where < 0.9)).all(axis=1)
    astray = np.zeros(len(points), bool)
    if line.hosts is not None:
        astray = clear & ~np.isin(quads.element[cells], list(line.hosts))
    for k in np.flatnonzero((beyond > SNAP) | astray)[:1]:
        what = "outside the wall" if beyond[k] > SNAP else "outside its hosts, in another region"
        r, z = points[k]
        raise line.fail(f"element {k // 3 + 1} of it lies {what}, at r = {r:.5g}, z = {z:.5g}")


def _cut_at_end(quads: Quads, line: HostedLine, end: float) -> tuple[Quads, float]:
    """Split the cell in which a line ends across it, unless it ends near a side or node.

    Also returns how far (in s) beyond the end the line must then be followed.
    """
    # An end on a side is in two cells, and to the one beyond it a line may run slantwise.
    within = end + _WITHIN if end == 0.0 else end - _WITHIN
    (cell,), _, _ = locate(quads, line.at(np.array([within])))
    nine = quads.points[quads.cells[[cell]]]
    where, _ = inverse(nine, line.at(np.array([end])))
    matrix, slope = rates(nine, where)[0], line.slope(end)
    along = int(np.argmax(np.abs(np.linalg.solve(matrix, slope))))
    t = float(where[0, along])
    cell_length = float(np.linalg.norm(matrix[:, along]) / np.linalg.norm(slope))
    if not _SNAP_END < t < 1 - _SNAP_END:
        return quads, 1.1 * _SNAP_END * cell_length
    sides = quads.sides()[cell, [2, 3] if along == 0 else [0, 1]]
    marks = {int(s[1]): oriented(s, t) for s in sides}
    return cut(quads, marks, -1, {}, line.fail), SNAP * min(t, 1 - t) * cell_length


def _stations(quads: Quads, line: HostedLine, reach: tuple[float, float]) -> list[_Station]:
    """All points where the line meets sides or nodes, for s within `reach`, in order along it."""
    sides = np.unique(quads.sides().reshape(-1, 3), axis=0)
    _, first = np.unique(sides[:, 1], return_index=True)
    sides = sides[first]
    low = np.where((sides[:, 0] < sides[:, 2])[:, None], sides, sides[:, ::-1])
    stations: dict[tuple, _Station] = {}
    for number, s in _candidates(quads.points[low], line):
        hit = _meet(quads.points[low[number]], line, s)
        if hit is None or not reach[0] <= hit[1] <= reach[1]:
            continue
        t, s = hit
        node = low[number, 0] if t < SNAP else low[number, 2] if t > 1 - SNAP else -1
        station = _Station(s, int(node), int(low[number, 1]), t)
        stations.setdefault(("node", node) if node >= 0 else ("side", station.side), station)
    return sorted(stations.values(), key=lambda station: station.s)


def _candidates(sides: np.ndarray, line: HostedLine) -> Iterator[tuple[int, float]]:
    """(side, s) near which a side (n, 3, 2) and the line may meet, from straight pieces of both."""
    pieces = 4
    s = np.linspace(0, len(line.points), pieces * len(line.points) + 1)
    points = line.at(s)
    a, d = sides[:, :2].reshape(-1, 2), (sides[:, 1:] - sides[:, :2]).reshape(-1, 2)
    for k in range(len(s) - 1):
        b, e = points[k], points[k + 1] - points[k]
        cross = d[:, 0] * e[1] - d[:, 1] * e[0]
        ok = np.abs(cross) > 1e-3 * np.linalg.norm(d, axis=1) * np.linalg.norm(e)
        safe = np.where(ok, cross, 1.0)
        off = b - a
        t = (off[:, 0] * e[1] - off[:, 1] * e[0]) / safe
        u = (off[:, 0] * d[:, 1] - off[:, 1] * d[:, 0]) / safe
        over = 0.1 if 0 < k < len(s) - 2 else 3.0  # the ends may extend a little
        near = ok & (t > -0.1) & (t < 1.1) & (u > -over) & (u < 1 + over)
        for candidate in np.flatnonzero(near):
            yield candidate // 2, s[k] + u[candidate] * (s[k + 1] - s[k])


def _meet(side: np.ndarray, line: HostedLine, s: float) -> tuple[float, float] | None:
    """(t, s) where a side (3, 2) meets the line; None if it does not or runs along it."""
    t, step = 0.5, 1e-6
    for _ in range(20):
        off = shape(np.array([t]))[0] @ side - line.at(np.array([s]))[0]
        rate = (shape(np.array([t + step])) - shape(np.array([t - step])))[0] @ side / (2 * step)
        matrix = np.stack([rate, -line.slope(s)], axis=1)
        lengths = np.linalg.norm(matrix, axis=0)
        sine = np.linalg.det(matrix) / max(lengths.prod(), 1e-300)
        if abs(sine) < _LEAST_ANGLE:
            return None
        move = np.linalg.solve(matrix, off)
        t, s = float(np.clip(t - move[0], -1, 2)), s - move[1]
        if np.abs(move).max() < 1e-12:
            break
    return (t, s) if -SNAP <= t <= 1 + SNAP else None


def _follow(
    quads: Quads, line: HostedLine, stations: list[_Station]
) -> tuple[dict[int, float], dict[int, float], list[int]]:
    """Sides to cut, the cells concerned (position halfway), and whole sides on the line."""
    if len(stations) < 2:
        raise line.fail("it crosses no element")
    at = defaultdict(set)
    for cell, (corners, middles) in enumerate(
        zip(quads.corners.tolist(), quads.sides()[:, :, 1].tolist(), strict=True)
    ):
        for node in corners + middles:
            at[node].add(cell)
    marks: dict[int, float] = {}
    path: dict[int, tuple[_Station, _Station]] = {}
    whole: list[int] = []
    for a, b in zip(stations[:-1], stations[1:], strict=True):
        names = [end.node if end.node >= 0 else end.side for end in (a, b)]
        shared = at[names[0]] & at[names[1]]
        if not shared:
            raise line.fail(_slant(line, a, b))
        if a.node >= 0 and b.node >= 0:
            whole.append(_between(quads, shared, a.node, b.node, line, a, b))
        else:
            cell = _opposite(quads, shared, names, a, b, line)
            marks |= {end.side: end.t for end in (a, b)}
            path[cell] = (a, b)
    return marks, _half_way(quads, path, line), whole


def _slant(line: HostedLine, a: _Station, b: _Station) -> str:
    r, z = line.at(np.array([(a.s + b.s) / 2]))[0]
    return (
        f"it crosses the elements at r = {r:.5g}, z = {z:.5g} slantwise, not from one side to the opposite "
        "one: put element sides on it"
    )


def _between(
    quads: Quads, cells: set[int], first: int, last: int, line: HostedLine, a: _Station, b: _Station
) -> int:
    """The middle node of the side between two nodes."""
    for cell in cells:
        for side in quads.sides_of(cell):
            if {int(side[0]), int(side[2])} == {first, last}:
                return int(side[1])
    raise line.fail(_slant(line, a, b))


def _opposite(
    quads: Quads, cells: set[int], names: list[int], a: _Station, b: _Station, line: HostedLine
) -> int:
    """The cell in which two sides are opposite each other."""
    if a.node < 0 and b.node < 0:
        for cell in cells:
            middles = quads.sides_of(cell)[:, 1].tolist()
            if middles.index(names[0]) ^ 1 == middles.index(names[1]):
                return cell
    raise line.fail(_slant(line, a, b))


def _half_way(quads: Quads, path: dict, line: HostedLine) -> dict[int, float]:
    """Position of the line halfway across each cell: parabola through three of its points."""
    cells = np.array(list(path), np.int64)
    middle = line.at(np.array([(a.s + b.s) / 2 for a, b in path.values()]))
    places = inverse(quads.points[quads.cells[cells]], middle)[0] if len(cells) else cells
    halves = {}
    for cell, (a, b), where in zip(path, path.values(), places, strict=True):
        sides = quads.sides_of(cell)
        at = {sides[:, 1].tolist().index(end.side): end for end in (a, b)}
        first, last = (oriented(sides[k], at[k].t) for k in sorted(at))
        along, across = where if min(at) == 0 else where[::-1]
        bulge = 0.0
        if 0.2 < along < 0.8:
            bulge = (across - first - (last - first) * along) / (4 * along * (1 - along))
        halves[cell] = (first + last) / 2 + bulge
    return halves


@dataclass(frozen=True, kw_only=True)
class Ply:
    """Cords on one chain of sides, in SI: `angle` in rad from +x at the lowest point towards the
    chain's end; the others as in `Cords`.
    """

    name: str
    sides: np.ndarray
    angle: float
    youngs_modulus: float
    area: float
    spacing: float
    density: float
    compression: float


@dataclass(frozen=True)
class LaidMembranes:
    """The membranes of a line: numbers of the deck's edges they lie on, and middles (k, 2) and
    directions (k, 2) of their elements from first to last node; `corded` (k,): those that have the
    layer's cords.
    """

    numbers: np.ndarray
    middles: np.ndarray
    directions: np.ndarray
    corded: np.ndarray

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """The element (k,) nearest to each point (k, 2)."""
        return np.linalg.norm(points[:, None] - self.middles, axis=2).argmin(axis=1)

    def mirrored(self) -> LaidMembranes:
        """With the other half, turned by 180 deg about the vertical so that cords continue."""
        return LaidMembranes(
            self.numbers,
            np.concatenate([self.middles, self.middles * [1, -1]]),
            np.concatenate([self.directions, self.directions * [-1, 1]]),
            np.tile(self.corded, 2),
        )


def plies(
    quads: Quads, laid: LaidMembranes, layer: CordLayer, material: CordMaterial, length: float
) -> list[Ply]:
    """The plies of one cord layer: one per unbroken line, more if the angle varies along it."""
    sides = with_origin(quads, laid.numbers)
    sides = sides[laid.corded[laid.nearest(quads.points[ends(quads, sides)].mean(axis=1))]]
    runs, branches = strings(ends(quads, sides))
    if branches:
        r, y = quads.points[branches[0]]
        raise layer.place.error(
            f"the membranes of {layer.elements} branch at r = {r:.5g}, z = {y:.5g}: make a set of each line"
        )
    plies = []
    for line in runs:
        chain = forward(quads, sides[line])
        sense = _sense(quads, chain, laid, layer)
        for part in [chain] if layer.geometry == "CONSTANT" else np.split(chain, len(chain)):
            plies.append(_ply(quads, part, layer, material, length, sense))
    if len(plies) > 1:
        plies = [replace(ply, name=f"{ply.name} ({n + 1})") for n, ply in enumerate(plies)]
    return plies


def _ply(
    quads: Quads,
    sides: np.ndarray,
    layer: CordLayer,
    material: CordMaterial,
    length: float,
    sense: int,
) -> Ply:
    r = quads.points[ends(quads, sides).ravel(), 0].mean()
    angle, spacing = _geometry(layer, r)
    return Ply(
        name=layer.name,
        sides=sides,
        angle=from_circumference(angle, sense),
        youngs_modulus=material.youngs_modulus,
        area=layer.area * length**2,
        spacing=spacing * length,
        density=material.density,
        compression=material.compression,
    )


def _geometry(layer: CordLayer, r: float) -> tuple[float, float]:
    """(angle from the meridian in rad, spacing in the deck's length unit) at radius r.

    Lifting keeps the number of cords around: with the angle b from the circumference and the
    extension e, cos b = r / (r0 (1 + e)) cos b0 and s = s0 (r / r0) sin b / sin b0.
    """
    angle = np.radians(layer.angle)
    if layer.geometry == "ANGULAR":
        return angle, r * np.radians(layer.spacing)
    if layer.geometry == "CONSTANT":
        return angle, layer.spacing
    if layer.radius <= 0 or layer.extension <= -1:
        raise layer.place.error(
            f"cords {layer.name}: a lifted layer needs a radius > 0 as last number"
        )
    cosine = r / (layer.radius * (1 + layer.extension)) * np.sin(angle)
    if abs(cosine) >= 1 or abs(np.cos(angle)) < 1e-9:
        raise layer.place.error(
            f"cords {layer.name}: cannot be lifted from r = {layer.radius:g} to r = {r:g}"
        )
    lifted = np.arcsin(cosine)
    return float(lifted), layer.spacing * r / layer.radius * np.cos(lifted) / np.cos(angle)


def from_circumference(angle: float, sense: int) -> float:
    """Angle from the meridian (rad) converted to one from the circumference, (-pi/2, pi/2]."""
    turned = float(np.arctan2(sense * np.cos(angle), -np.sin(angle)))
    turned -= np.pi * np.ceil(turned / np.pi - 0.5)
    return 0.0 if abs(turned) < 1e-12 else turned


def _sense(quads: Quads, chain: np.ndarray, laid: LaidMembranes, layer: CordLayer) -> int:
    """1 if the membranes run with the chain, -1 if against it."""
    points = quads.points[along(ends(quads, chain))]
    middles, steps = (points[1:] + points[:-1]) / 2, np.diff(points, axis=0)
    with_it = (steps * laid.directions[laid.nearest(middles)]).sum(axis=1) > 0
    slanted = abs(np.sin(2 * np.radians(layer.angle))) > 1e-9
    if slanted and with_it.any() != with_it.all():
        raise InputError(
            f"{layer.place}: the membranes of {layer.elements} do not all run in one direction, so the angle "
            f"of {layer.name} is not clear: number their nodes from one end to the other"
        )
    return 1 if with_it.mean() > 0.5 else -1


def lay_all(
    deck: Deck, quads: Quads, edges: DeckEdges, origins: Origins
) -> tuple[Quads, dict[str, LaidMembranes]]:
    """The cells with sides along all membranes that carry cords, and the position of each set.

    Membranes that share the solids' nodes already lie on sides; others are located
    geometrically.
    """
    done: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
    for layer in deck.layers:
        whole = layer.line or layer.elements
        if whole in done:
            continue
        ends, points, labels = _elements(deck, layer, whole)
        numbers = edges.numbers(ends)
        if (numbers < 0).any():
            quads, numbers = _embed(deck, quads, layer, ends, points, labels, origins)
        done[whole] = numbers, points, labels
    laid = {}
    for layer in deck.layers:
        numbers, points, labels = done[layer.line or layer.elements]
        laid[layer.elements] = LaidMembranes(
            origins.with_parts(numbers),
            points[:, 1],
            points[:, 2] - points[:, 0],
            np.isin(labels, deck.element_sets.labels(layer.elements, layer.place)),
        )
    return quads, laid


def _elements(deck: Deck, layer: CordLayer, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """End nodes (k, 2), points (k, 3, 2) and labels (k,) of the membranes of a layer's set."""
    wanted = deck.element_sets.labels(name, layer.place)
    ends, points, labels = [], [], []
    for block in deck.blocks:
        mine = np.isin(block.labels, wanted)
        if block.kind.role != "membrane" or not mine.any():
            continue
        rows = deck.rows(block.nodes[mine], block.place)
        at = deck.points[rows][:, :, :2]
        middle = at[:, 2] if block.kind.nodes == 3 else at.mean(axis=1)
        ends.append(rows[:, :2])
        points.append(np.stack([at[:, 0], middle, at[:, 1]], axis=1))
        labels.append(block.labels[mine])
    if not ends:
        raise layer.place.error(
            f"the set {layer.elements} of cords {layer.name} holds no membranes (SFMGAX, MGAX, SFM3D, M3D) and "
            "no shells (SAX, S4, S8)"
        )
    ends, points, labels = (np.concatenate(part) for part in (ends, points, labels))
    flat = np.flatnonzero(ends[:, 0] == ends[:, 1])
    if len(flat):
        raise layer.place.error(f"membrane {labels[flat[0]] % SCOPE} begins and ends at one node")
    return ends, points, labels


def _embed(
    deck: Deck,
    quads: Quads,
    layer: CordLayer,
    ends: np.ndarray,
    points: np.ndarray,
    labels: np.ndarray,
    origins: Origins,
) -> tuple[Quads, np.ndarray]:
    """The cells split along membranes inside them, and the numbers of the sides created."""
    hosts = _hosts(deck, layer, labels)
    numbers: list[int] = []
    for line in strings(ends)[0]:
        turned = _turned(ends[line])
        three = np.where(turned[:, None, None], points[line][:, ::-1], points[line])
        first = labels[line[0]] % SCOPE

        def fail(text: str, first: int = first) -> Exception:
            return layer.place.error(
                f"cords {layer.name}: the line of membranes from element {first}: {text}"
            )

        quads, new = lay(quads, HostedLine(layer.elements, three, fail, hosts), origins)
        numbers += new
    return quads, np.array(numbers, np.int64)


def _turned(ends: np.ndarray) -> np.ndarray:
    """Mask of the elements of an ordered chain that run against it."""
    if len(ends) == 1:
        return np.zeros(1, bool)
    turned = np.empty(len(ends), bool)
    turned[0] = ends[0, 1] not in ends[1]
    at = ends[0, 0] if turned[0] else ends[0, 1]
    for k in range(1, len(ends)):
        turned[k] = ends[k, 0] != at
        at = ends[k, 0] if turned[k] else ends[k, 1]
    return turned


def _hosts(deck: Deck, layer: CordLayer, labels: np.ndarray) -> frozenset | None:
    """Elements in which the membranes must lie; None if the deck names no host for them."""
    for embedded in deck.embedded:
        if embedded.host is None:
            continue
        for name in embedded.elements:
            if np.isin(labels, deck.element_sets.labels(name, embedded.place)).any():
                return frozenset(deck.element_sets.labels(embedded.host, embedded.place).tolist())
    return None
