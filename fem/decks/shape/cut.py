"""Splitting of rows of cells along a line, so that element sides lie on it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from tireroad.fem.decks.shape.quad_split import SIDE_NODES, Quads, place, shape

Marks = dict[int, float]  # by a side's middle node: position of its cut from its lower end node


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
    for cell, along in axis.items():
        new, sides = _halves(quads, cell, along, marks, side_points, points, path.get(cell))
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
    found = {}
    sides = {int(side[1]): side for side in quads.sides().reshape(-1, 3)}
    for middle, t in marks.items():
        side = sides[middle]
        low_first = side if side[0] < side[2] else side[::-1]
        new = shape(np.array([t / 2, t, (1 + t) / 2])) @ quads.points[low_first]
        found[middle] = tuple(range(len(points), len(points) + 3))
        points.extend(new)
    return found


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
