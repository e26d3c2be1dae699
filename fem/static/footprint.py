"""Contact pressure and the extent of the footprint, from nodal forces and gaps on the outer face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.fem.tire.mesh import Lattice


@dataclass(frozen=True)
class Footprint:
    """Length (x), width (y) in m and area in m2 of where the pressure is positive."""

    length: float
    width: float
    area: float


def nodal_area(lattice: Lattice, positions: np.ndarray) -> np.ndarray:
    """Horizontal area (s,) m2 that each node of the deformed outer face (s, 3) stands for.

    The row sums of the surface's mass matrix by the Lobatto rule of the nodes: positive in every
    order, so that pressure = force/area has the force's sign. On a plane they are what a uniform
    pressure puts on the nodes; a node's share of distances is not (a factor 2 between corners and
    middles of quadratic elements).
    """
    around, along = lattice.face_shape
    order = len(lattice.edge) - 1
    weight, slope = _edge_rule(lattice.edge)
    grid = positions.reshape(around, along, 3)
    i = (order * np.arange(around // order)[:, None] + np.arange(order + 1)) % around
    j = order * np.arange((along - 1) // order)[:, None] + np.arange(order + 1)
    element = grid[i[:, None, :, None], j[None, :, None, :]]
    ring = np.einsum("ab,ijbcx->ijacx", slope, element)
    arc = np.einsum("cb,ijabx->ijacx", slope, element)
    shadow = abs(ring[..., 0] * arc[..., 1] - ring[..., 1] * arc[..., 0])
    area = np.zeros((around, along))
    share = shadow * np.outer(weight, weight)
    np.add.at(area, (i[:, None, :, None], j[None, :, None, :]), share)
    return area.ravel()


def _edge_rule(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights of the nodes on [0, 1], and slopes (at node, of shape function)."""
    powers = np.arange(len(nodes))
    coefficients = np.linalg.inv(nodes[:, None] ** powers)  # of the shape functions, by column
    derivative = powers * nodes[:, None] ** np.maximum(powers - 1, 0)
    return (1 / (powers + 1)) @ coefficients, derivative @ coefficients


def footprint(
    shape: tuple[int, int], positions: np.ndarray, pressure: np.ndarray, gap: np.ndarray
) -> Footprint:
    """Extent of the contact on a face of `shape` (around, along); arrays (s,), positions (s, 3).

    Where a smooth body lets go of a plane, the gap opens as d^(3/2) (1 + c d) of the distance d to the edge (Johnson,
    Contact Mechanics, 1985, 5.3), so gap^(2/3) through the next three nodes of a line tells where it begins. That is the
    edge, up to half a node's spacing inside the last node that presses, which stands for that much. The area is the
    mean of those that the lines around and the lines across cover.
    """
    inside = (pressure > 0).reshape(shape)
    if not inside.any():
        return Footprint(0.0, 0.0, 0.0)
    start = _opposite(inside)
    grid, opening = positions.reshape(*shape, 3), np.maximum(gap, 0.0).reshape(shape)
    grid, opening, inside = (np.roll(values, -start, 0) for values in (grid, opening, inside))
    ring = _Lines.of(grid, opening, inside, axis=0)
    arc = _Lines.of(grid.swapaxes(0, 1), opening.T, inside.T, axis=1)
    (x0, x1), (y0, y1) = ring.ends, arc.ends
    area = (ring.area(arc.ends) + arc.area(ring.ends)) / 2
    return Footprint(x1 - x0, y1 - y0, area)


def _opposite(inside: np.ndarray) -> int:
    """The line across the face in the middle of the longest part of the ring without contact."""
    lines = np.flatnonzero(inside.any(axis=1))
    free = np.diff(np.append(lines, lines[0] + len(inside)))
    longest = int(free.argmax())
    return int(lines[longest] + free[longest] // 2)


@dataclass(frozen=True)
class _Lines:
    """Contact along the k lines of the face in one direction that have some: `ends` m in that direction, of each line
    the length `chord` (k,) m and its `place` (k,) m in the other direction."""

    ends: tuple[float, float]
    chord: np.ndarray
    place: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, gap: np.ndarray, inside: np.ndarray, axis: int) -> _Lines:
        """Along the first index of points (n, m, 3) m with a gap (n, m) m, `inside` (n, m) where they press; `axis` 0
        where that is along x."""
        share = (inside[:-1] & inside[1:]).astype(float)
        edge = []
        for forward in (True, False):
            turn = slice(None, None, 1 if forward else -1)
            for last, line in zip(*np.nonzero(inside[turn][:-1] & ~inside[turn][1:]), strict=True):
                here = points[turn][:, line], gap[turn][:, line], inside[turn][:, line]
                place, part = _edge(*here, last)
                edge.append(place[axis])
                # The last node that presses may itself be beyond the edge: then the segment before it is shorter.
                share[turn][last if part >= 0 else last - 1, line] += part
        length = np.linalg.norm(np.diff(points[..., :2], axis=0), axis=2)
        some = inside.any(axis=0)
        across = (
            np.where(inside, points[..., 1 - axis], 0.0).sum(axis=0)[some]
            / inside.sum(axis=0)[some]
        )
        order = np.argsort(across)
        chord = np.maximum((share * length).sum(axis=0), 0.0)[some]
        return cls((float(min(edge)), float(max(edge))), chord[order], across[order])

    def area(self, between: tuple[float, float]) -> float:
        """Area (m2) of a contact that ends, across the lines, at the two places `between` m, round as an ellipse beyond
        the outermost lines."""
        low, high = between
        held = (self.place >= low) & (self.place <= high)
        chord, place = self.chord[held], self.place[held]
        if not len(place):
            return float(np.pi / 4 * self.chord.max() * (high - low))
        round_ = np.pi / 4 if len(place) == 1 else 2 / 3
        ends = chord[0] * (place[0] - low) + chord[-1] * (high - place[-1])
        return float((chord[1:] + chord[:-1]) / 2 @ np.diff(place) + round_ * ends)


def _edge(
    points: np.ndarray, gap: np.ndarray, inside: np.ndarray, last: int
) -> tuple[np.ndarray, float]:
    """The place (3,) m where a contact ends on a line of nodes (n, 3), of which `last` presses and the next does not, and
    the part of the segment beyond that node; below 0 of the one before it."""
    free = last + 1 + np.arange(_NODES)
    free = free[free < len(points)]
    free = free[~np.logical_or.accumulate(inside[free])]
    step = np.linalg.norm(np.diff(points[max(last - 1, 0) : free[-1] + 1, :2], axis=0), axis=1)
    before = float(step[0]) if last > 0 else 0.0
    away = np.cumsum(step[1 if last > 0 else 0 :])
    least = -before / 2 if last > 0 and inside[last - 1] else 0.0
    at = float(np.clip(_begins(away, gap[free] ** (2 / 3)), least, away[0]))
    other, part = (last + 1, at / float(away[0])) if at >= 0 else (last - 1, at / before)
    return points[last] + abs(part) * (points[other] - points[last]), part


_NODES = 3  # beyond the contact, that tell where it ends


def _begins(away: np.ndarray, rise: np.ndarray) -> float:
    """Where a parabola through up to three points (away, rise), or the line through two, leaves zero, at most the first."""
    if len(away) == 1:
        return float(away[0]) / 2
    slopes = np.diff(rise) / np.diff(away)
    bend = float(np.diff(slopes)[0] / (away[2] - away[0])) if len(away) > 2 else 0.0
    slope = float(slopes[0]) - bend * float(away[1] - away[0])
    square = slope**2 - 4 * bend * float(rise[0])
    if slope <= 0 or square < 0:
        bend, slope = 0.0, float(slopes[0])
        square = slope**2
    if slope <= 0:
        return 0.0
    return float(away[0] - 2 * rise[0] / (slope + np.sqrt(square)))
