"""Contact pressure and extent of the footprint from nodal forces and gaps on the outer face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.fem.tire.mesh import Lattice


@dataclass(frozen=True)
class Footprint:
    """Length (x) and width (y) in m, and area in m2, of the region of positive pressure."""

    length: float
    width: float
    area: float


def nodal_area(lattice: Lattice, positions: np.ndarray) -> np.ndarray:
    """Horizontal area (s,) m2 associated with each node of the deformed outer face (s, 3).

    Row sums of the surface mass matrix by the Lobatto rule of the nodes. They are positive for
    every order, so that pressure = force/area has the sign of the force. On a plane they are
    proportional to the nodal forces of a uniform pressure; areas from node spacings are not (a
    factor 2 between corner and mid-side nodes of quadratic elements).
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

    At the edge of contact of a smooth body with a plane the gap opens as d^(3/2) (1 + c d), d being
    the distance from the edge (Johnson, Contact Mechanics, 1985, 5.3). The edge is therefore
    extrapolated from gap^(2/3) at the next three nodes of a line. It may lie up to half a node
    spacing inside the last loaded node, which represents that length. The area is the mean of the
    areas covered by the lines around and by the lines across.
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
    """Index of the line across the face in the middle of the longest arc without contact."""
    lines = np.flatnonzero(inside.any(axis=1))
    free = np.diff(np.append(lines, lines[0] + len(inside)))
    longest = int(free.argmax())
    return int(lines[longest] + free[longest] // 2)


@dataclass(frozen=True)
class _Lines:
    """Contact along the k lines in one direction that touch the road.

    `ends` m: limits in that direction; `chord` (k,) m: contact length of each line; `place` (k,) m:
    its position in the other direction."""

    ends: tuple[float, float]
    chord: np.ndarray
    place: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, gap: np.ndarray, inside: np.ndarray, axis: int) -> _Lines:
        """Lines along the first index of points (n, m, 3) m with gap (n, m) m and contact flags
        `inside` (n, m); `axis` is their direction, 0: x, 1: y."""
        share = (inside[:-1] & inside[1:]).astype(float)
        edge = []
        for forward in (True, False):
            turn = slice(None, None, 1 if forward else -1)
            for last, line in zip(*np.nonzero(inside[turn][:-1] & ~inside[turn][1:]), strict=True):
                here = points[turn][:, line], gap[turn][:, line], inside[turn][:, line]
                place, part = _edge(*here, last)
                edge.append(place[axis])
                # The edge may lie before the last loaded node, which then shortens the preceding
                # segment.
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
        """Area (m2) of a contact limited across the lines by `between` m, with elliptic ends."""
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
    """Edge of contact on a line of nodes (n, 3) whose node `last` is loaded and the next is not.

    Returns its position (3,) m, and its distance from that node as a fraction of the next segment,
    or, if negative, of the one before."""
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


_NODES = 3  # beyond the contact, used to extrapolate its edge


def _begins(away: np.ndarray, rise: np.ndarray) -> float:
    """Zero of the parabola through three points (away, rise), or of the line through two.

    It is at most away[0]; 0 if the points do not rise, half of away[0] for a single point."""
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
