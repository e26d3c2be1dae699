"""Membranes in a section: on element sides, or inside elements, which are split along them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from tireroad.fem.decks.shape.cut import Origins, cut, oriented
from tireroad.fem.decks.shape.places import inverse, locate, rates
from tireroad.fem.decks.shape.quad_split import Quads, shape

SNAP = 0.01  # of a cell: tolerance within which a point lies on a node or side
# A line that ends nearer than this to a side ends on it: a cell of a hundredth of its neighbours'
# length left no correct digits in the modes (relative residual 0.6), one of a twentieth does not.
_SNAP_END = 0.05
_LEAST_ANGLE = 0.1  # sine between a line and a side; below it the line runs along the side


@dataclass(frozen=True)
class Line:
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


def lay(quads: Quads, line: Line, origins: Origins) -> tuple[Quads, list[int]]:
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


def _inside(quads: Quads, line: Line) -> None:
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


def _cut_at_end(quads: Quads, line: Line, end: float) -> tuple[Quads, float]:
    """Split the cell in which a line ends across it, unless it ends near a side or node.

    Also returns how far (in s) beyond the end the line must then be followed.
    """
    (cell,), where, _ = locate(quads, line.at(np.array([end])))
    matrix, slope = rates(quads.points[quads.cells[[cell]]], where)[0], line.slope(end)
    along = int(np.argmax(np.abs(np.linalg.solve(matrix, slope))))
    t = float(where[0, along])
    cell_length = float(np.linalg.norm(matrix[:, along]) / np.linalg.norm(slope))
    if not _SNAP_END < t < 1 - _SNAP_END:
        return quads, 1.1 * _SNAP_END * cell_length
    sides = quads.sides()[cell, [2, 3] if along == 0 else [0, 1]]
    marks = {int(s[1]): oriented(s, t) for s in sides}
    return cut(quads, marks, -1, {}, line.fail), SNAP * min(t, 1 - t) * cell_length


def _stations(quads: Quads, line: Line, reach: tuple[float, float]) -> list[_Station]:
    """All points where the line meets sides or nodes, for s within `reach`, in order along it."""
    sides = np.unique(quads.sides().reshape(-1, 3), axis=0)
    _, first = np.unique(sides[:, 1], return_index=True)
    sides = sides[first]
    low = np.where((sides[:, 0] < sides[:, 2])[:, None], sides, sides[:, ::-1])
    found: dict[tuple, _Station] = {}
    for number, s in _candidates(quads.points[low], line):
        hit = _meet(quads.points[low[number]], line, s)
        if hit is None or not reach[0] <= hit[1] <= reach[1]:
            continue
        t, s = hit
        node = low[number, 0] if t < SNAP else low[number, 2] if t > 1 - SNAP else -1
        station = _Station(s, int(node), int(low[number, 1]), t)
        found.setdefault(("node", node) if node >= 0 else ("side", station.side), station)
    return sorted(found.values(), key=lambda one: one.s)


def _candidates(sides: np.ndarray, line: Line) -> Iterator[tuple[int, float]]:
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
        for one in np.flatnonzero(near):
            yield one // 2, s[k] + u[one] * (s[k + 1] - s[k])


def _meet(side: np.ndarray, line: Line, s: float) -> tuple[float, float] | None:
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
    quads: Quads, line: Line, stations: list[_Station]
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
        names = [one.node if one.node >= 0 else one.side for one in (a, b)]
        shared = at[names[0]] & at[names[1]]
        if not shared:
            raise line.fail(_slant(line, a, b))
        if a.node >= 0 and b.node >= 0:
            whole.append(_between(quads, shared, a.node, b.node, line, a, b))
        else:
            cell = _opposite(quads, shared, names, a, b, line)
            marks |= {one.side: one.t for one in (a, b)}
            path[cell] = (a, b)
    return marks, _half_way(quads, path, line), whole


def _slant(line: Line, a: _Station, b: _Station) -> str:
    r, z = line.at(np.array([(a.s + b.s) / 2]))[0]
    return (
        f"it crosses the elements at r = {r:.5g}, z = {z:.5g} slantwise, not from one side to the opposite "
        "one: put element sides on it"
    )


def _between(
    quads: Quads, cells: set[int], first: int, last: int, line: Line, a: _Station, b: _Station
) -> int:
    """The middle node of the side between two nodes."""
    for cell in cells:
        for side in quads.sides_of(cell):
            if {int(side[0]), int(side[2])} == {first, last}:
                return int(side[1])
    raise line.fail(_slant(line, a, b))


def _opposite(
    quads: Quads, cells: set[int], names: list[int], a: _Station, b: _Station, line: Line
) -> int:
    """The cell in which two sides are opposite each other."""
    if a.node < 0 and b.node < 0:
        for cell in cells:
            middles = quads.sides_of(cell)[:, 1].tolist()
            if middles.index(names[0]) ^ 1 == middles.index(names[1]):
                return cell
    raise line.fail(_slant(line, a, b))


def _half_way(quads: Quads, path: dict, line: Line) -> dict[int, float]:
    """Position of the line halfway across each cell: parabola through three of its points."""
    cells = np.array(list(path), np.int64)
    middle = line.at(np.array([(a.s + b.s) / 2 for a, b in path.values()]))
    places = inverse(quads.points[quads.cells[cells]], middle)[0] if len(cells) else cells
    found = {}
    for cell, (a, b), where in zip(path, path.values(), places, strict=True):
        sides = quads.sides_of(cell)
        at = {sides[:, 1].tolist().index(one.side): one for one in (a, b)}
        first, last = (oriented(sides[k], at[k].t) for k in sorted(at))
        along, across = where if min(at) == 0 else where[::-1]
        bulge = 0.0
        if 0.2 < along < 0.8:
            bulge = (across - first - (last - first) * along) / (4 * along * (1 - along))
        found[cell] = (first + last) / 2 + bulge
    return found
