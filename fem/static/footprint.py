"""The footprint: contact pressure and extent on the deformed outer face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.interpolate import LinearNDInterpolator

from tireroad.fem.matrices.probe import line_shape
from tireroad.fem.tire.mesh import NodeGrid

_LINE, _MIDDLE, _SHOULDER = 0.8, 0.2, 0.6  # of the half width
_NODES = 3  # beyond the contact, used to extrapolate its edge
_WINDOW = np.radians(75)  # around the lowest point, where the face of a round section points down
_STEP = 1e-6  # rad, of the difference quotients; affects Newton's rate only, not the result
_NEWTON = 30
_CLOSE = 1e-11  # m
_CLOSE_ANGLE = 1e-9  # rad; at a lowest point the height error is its square times the radius


@dataclass(frozen=True)
class Footprint:
    """Length (x) and width (y) in m, and area in m2, of the region of positive pressure."""

    length: float
    width: float
    area: float

    def pressure(self, load: float) -> float:
        """Mean pressure (Pa) under a load (N); 0 without contact."""
        return load / self.area if self.area else 0.0


def nodal_area(lattice: NodeGrid, positions: np.ndarray) -> np.ndarray:
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


@dataclass(frozen=True)
class Evenness:
    """How a footprint is loaded across its width.

    `shape_factor`: length in the middle over the mean of those at 0.8 of the half width, above 1 for a
    round footprint; `shoulder`: mean pressure from 0.6 of the half width outwards over that of the
    middle fifth of the width. Both are read from lines around the tire, interpolated between them.
    """

    shape_factor: float
    shoulder: float


def evenness(
    shape: tuple[int, int],
    positions: np.ndarray,
    force: np.ndarray,
    area: np.ndarray,
    gap: np.ndarray,
) -> Evenness | None:
    """Evenness of the contact on a face of `shape`; `force` N and `area` m2 (s,) of each node.

    None where fewer than five lines around touch.
    """
    inside = (force > 0).reshape(shape)
    if np.count_nonzero(inside.any(axis=0)) < 5:
        return None
    start = _opposite(inside)
    grid, opening = positions.reshape(*shape, 3), np.maximum(gap, 0.0).reshape(shape)
    there, apart, on = (np.roll(values, -start, 0) for values in (grid, opening, inside))
    around = _Lines.of(there, apart, on, axis=0)
    low, high = _Lines.of(there.swapaxes(0, 1), apart.T, on.T, axis=1).ends
    middle, half = (low + high) / 2, (high - low) / 2
    length = np.interp(middle + half * np.array([-_LINE, 0.0, _LINE]), around.place, around.chord)
    # Forces and areas of the lines in the order of their places, as the chords.
    some = inside.any(axis=0)
    touching = np.where(inside, 1.0, 0.0)
    whole = [(values.reshape(shape) * touching).sum(axis=0)[some] for values in (force, area)]
    place = (grid[..., 1] * touching).sum(axis=0)[some] / touching.sum(axis=0)[some]
    order = np.argsort(place)
    pressure = (whole[0] / whole[1])[order]
    inner = middle + half * np.linspace(-_MIDDLE, _MIDDLE, 21)
    outer = half * np.linspace(_SHOULDER, 1.0, 21)
    outer = np.concatenate([middle - outer, middle + outer])
    means = [float(np.interp(y, place[order], pressure).mean()) for y in (inner, outer)]
    return Evenness(float(2 * length[1] / (length[0] + length[2])), means[1] / means[0])


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


class TreadSurface:
    """The outer face of a lattice with its nodes at `positions` (s, 3) m. Not collective."""

    def __init__(self, lattice: NodeGrid, positions: np.ndarray) -> None:
        self._lattice, self._positions = lattice, positions
        self._shape = lattice.face_shape
        self._located: dict[bytes, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        self._across = self._seen_from_below()

    def _seen_from_below(self) -> tuple[float, float]:
        """Section angles (rad) between which points are sought.

        At least `_WINDOW` to either side. A tread that is wide for its height has larger angles,
        though it is flat: all as far as y rises with the angle on the lowest meridian.
        """
        places, arc = self._positions.reshape(*self._shape, 3), self._lattice.arc
        i, j = np.unravel_index(places[:, :, 2].argmin(), self._shape)
        turns = np.flatnonzero(np.diff(places[i, :, 1]) <= 0)
        last = turns[turns >= j].min(initial=len(arc) - 1)
        first = turns[turns < j].max(initial=-1) + 1
        return min(-_WINDOW, arc[first]), max(_WINDOW, arc[last])

    def weights(self, ring: np.ndarray, arc: np.ndarray) -> sparse.csr_matrix:
        """Shape functions (k, s) of the face at angles around the axle and the section, rad."""
        lattice, edge = self._lattice, self._lattice.edge
        around, ring_shape = line_shape(lattice.ring_corners, edge, ring % (2 * np.pi))
        along, arc_shape = line_shape(lattice.arc_corners, edge, arc)
        nodes = np.arange(len(edge))
        i = (around[:, None] + nodes) % self._shape[0]
        j = along[:, None] + nodes
        columns = i[:, :, None] * self._shape[1] + j[:, None, :]
        values = ring_shape[:, :, None] * arc_shape[:, None, :]
        rows = np.repeat(np.arange(len(ring)), len(edge) ** 2)
        size = (len(ring), self._shape[0] * self._shape[1])
        return sparse.csr_matrix((values.ravel(), (rows, columns.ravel())), shape=size)

    def at(self, ring: np.ndarray, arc: np.ndarray) -> np.ndarray:
        """Deformed positions (k, 3), m."""
        return self.weights(ring, arc) @ self._positions

    def lowest(self) -> float:
        """Height of the lowest point of the face, m: where a rising road touches first.

        An element dips below its lowest node by less than the range of its nodes. All elements that
        could reach below every node are searched, each with a grid that closes in on its lowest
        point.
        """
        lattice, edge = self._lattice, self._lattice.edge
        order = len(edge) - 1
        i = (
            order * np.arange(len(lattice.ring_corners) - 1)[:, None] + np.arange(order + 1)
        ) % self._shape[0]
        j = order * np.arange(len(lattice.arc_corners) - 1)[:, None] + np.arange(order + 1)
        height = self._positions[:, 2].reshape(self._shape)[i[:, None, :, None], j[None, :, None]]
        low, high = height.min(axis=(2, 3)), height.max(axis=(2, 3))
        around, along = np.nonzero(2 * low - high <= low.min())
        corners = [
            np.stack([line[index], line[index + 1]], axis=1)
            for line, index in ((lattice.ring_corners, around), (lattice.arc_corners, along))
        ]
        while max((box[:, 1] - box[:, 0]).max() for box in corners) > _CLOSE_ANGLE:
            corners, inside = self._closed_in(*corners)
        return float(inside.min())

    def _closed_in(self, ring: np.ndarray, arc: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
        """Boxes (k, 2) a third as wide around the lowest of 7 x 7 points, and heights (k,)."""
        t = np.linspace(0, 1, 7)
        place = [box[:, :1] + (box[:, 1:] - box[:, :1]) * t for box in (ring, arc)]
        grid = np.repeat(place[0], 7, axis=1), np.tile(place[1], (1, 7))
        height = self.at(grid[0].ravel(), grid[1].ravel())[:, 2].reshape(-1, 49)
        best = height.argmin(axis=1)
        boxes = [
            np.take_along_axis(line, np.clip(at[:, None] + np.array([-1, 1]), 0, 6), axis=1)
            for line, at in zip(place, np.divmod(best, 7), strict=True)
        ]
        return boxes, height.min(axis=1)

    def locate(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles (rad) of the points seen from below at x, y (k,) m; found or not (k,) bool.

        Newton's method on the deformed surface, starting from linear interpolation between the
        nodes; results are cached by x, y.
        """
        key = x.tobytes() + y.tobytes()
        if key not in self._located:
            self._located[key] = self._found(x, y)
        ring, arc, inside = self._located[key]
        return ring.copy(), arc.copy(), inside.copy()

    def _found(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        target = np.stack([x, y], axis=-1)
        place = self._guess(target)
        inside = np.isfinite(place).all(axis=1)
        place[~inside] = 0.0
        left = np.flatnonzero(inside)
        for _ in range(_NEWTON):
            defect = self.at(*place[left].T)[:, :2] - target[left]
            far = np.abs(defect).max(axis=1) > _CLOSE
            if not far.any():
                break
            left, before = left[far], place[left[far]]
            place[left] -= self._newton_step(before, defect[far])
            place[left, 1] = np.clip(place[left, 1], *self._across)
            left = left[(place[left] != before).any(axis=1)]  # others are held by the border
        inside &= np.abs(self.at(*place.T)[:, :2] - target).max(axis=1) <= 1e3 * _CLOSE
        return place[:, 0], place[:, 1], inside

    def _newton_step(self, place: np.ndarray, defect: np.ndarray) -> np.ndarray:
        ring, arc = place.T
        rates = [
            (self.at(ring + di, arc + dj) - self.at(ring - di, arc - dj))[:, :2] / (2 * _STEP)
            for di, dj in ((_STEP, 0.0), (0.0, _STEP))
        ]
        step = np.linalg.solve(np.stack(rates, axis=-1), defect[:, :, None])[:, :, 0]
        return np.clip(step, -0.1, 0.1)

    def _guess(self, target: np.ndarray) -> np.ndarray:
        ring, arc = np.meshgrid(self._lattice.ring, self._lattice.arc, indexing="ij")
        ring = (ring.ravel() + np.pi) % (2 * np.pi) - np.pi
        arc = arc.ravel()
        low = (np.abs(ring) < _WINDOW) & (arc >= self._across[0]) & (arc <= self._across[1])
        inverse = LinearNDInterpolator(
            self._positions[low, :2], np.stack([ring[low], arc[low]], axis=-1)
        )
        return inverse(target)
