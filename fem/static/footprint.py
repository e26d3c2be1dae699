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
    shape: tuple[int, int],
    positions: np.ndarray,
    pressure: np.ndarray,
    gap: np.ndarray,
    area: np.ndarray,
) -> Footprint:
    """Extent of the contact on a face of `shape` (around, along); arrays (s,), positions (s, 3).

    Where a smooth body lets go of a plane, the gap opens as d^(3/2) (1 + c d) of the distance d to the edge (Johnson,
    Contact Mechanics, 1985, 5.3), so gap^(2/3) through the next three nodes of a line tells where it begins. That is the
    edge, up to half a node's spacing inside the last node that presses, which stands for that much.
    """
    inside = (pressure > 0).reshape(shape)
    if not inside.any():
        return Footprint(0.0, 0.0, 0.0)
    start = _opposite(inside)
    grid, opening, shadow, inside = (
        np.roll(
            values.reshape(*shape, -1).squeeze(-1) if k else values.reshape(*shape, 3), -start, 0
        )
        for k, values in enumerate((positions, np.maximum(gap, 0.0), area, inside))
    )
    ring, arc = (
        _Lines.of(grid, opening, inside),
        _Lines.of(grid.swapaxes(0, 1), opening.T, inside.T),
    )
    # Lines across an end of the contact have a node of it at most, whose place says nothing of that end.
    length, width = np.ptp(ring.edge[:, 0]), np.ptp(arc.edge[:, 1])
    return Footprint(float(length), float(width), float((shadow * ring.cover * arc.cover.T).sum()))


def _opposite(inside: np.ndarray) -> int:
    """The line across the face in the middle of the longest part of the ring without contact."""
    lines = np.flatnonzero(inside.any(axis=1))
    free = np.diff(np.append(lines, lines[0] + len(inside)))
    longest = int(free.argmax())
    return int(lines[longest] + free[longest] // 2)


@dataclass(frozen=True)
class _Lines:
    """Contact along the lines of an axis of the face: `edge` (k, 3) m its ends, `cover` (n, m) the covered share of
    what each node stands for."""

    edge: np.ndarray
    cover: np.ndarray

    @classmethod
    def of(cls, points: np.ndarray, gap: np.ndarray, inside: np.ndarray) -> _Lines:
        """Along the first axis of points (n, m, 3) m with a gap (n, m) m, `inside` (n, m) where they press."""
        share, kept = (inside[:-1] & inside[1:]).astype(float), inside.copy()
        edge = []
        for forward in (True, False):
            turn = slice(None, None, 1 if forward else -1)
            for last, line in zip(*np.nonzero(inside[turn][:-1] & ~inside[turn][1:]), strict=True):
                at = _Edge.of(
                    points[turn][:, line], gap[turn][:, line], inside[turn][:, line], last
                )
                edge.append(at.place)
                segment, node = (last, last) if forward else (-1 - last, -1 - last)
                if at.part >= 0:
                    share[segment, line] = at.part
                else:  # the last node that presses is itself beyond the edge
                    share[segment - 1 if forward else segment + 1, line] += at.part
                    kept[node, line] = False
        return cls(np.array(edge), _cover(share, kept))


@dataclass(frozen=True)
class _Edge:
    """The `place` (3,) m of a contact's end on a line, as a `part` of the segment beyond the last node that presses;
    below 0 of the one before it."""

    place: np.ndarray
    part: float

    @classmethod
    def of(cls, points: np.ndarray, gap: np.ndarray, inside: np.ndarray, last: int) -> _Edge:
        """From the nodes (n, 3) of a line of which `last` presses and the next does not."""
        free = last + 1 + np.arange(_NODES)
        free = free[free < len(points)]
        free = free[~np.logical_or.accumulate(inside[free])]
        step = np.linalg.norm(np.diff(points[max(last - 1, 0) : free[-1] + 1, :2], axis=0), axis=1)
        before = float(step[0]) if last > 0 else 0.0
        away = np.cumsum(step[1 if last > 0 else 0 :])
        least = -before / 2 if last > 0 and inside[last - 1] else 0.0
        at = float(np.clip(_begins(away, gap[free] ** (2 / 3)), least, away[0]))
        other, part = (last + 1, at / float(away[0])) if at >= 0 else (last - 1, at / before)
        place = points[last] + abs(part) * (points[other] - points[last])
        return cls(place, part)


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


def _cover(share: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Covered share (n, m) of each node's two half segments, of those of the segments (n - 1, m)."""
    both = np.pad(share, ((1, 1), (0, 0)))
    covered = (
        np.where(inside, np.minimum(1, 2 * side), np.maximum(0, 2 * side - 1))
        for side in (both[:-1], both[1:])
    )
    return np.add(*covered) / 2
