"""Interpolation on the deformed outer face: weights and positions at any point."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.interpolate import LinearNDInterpolator

from tireroad.fem.matrices.probe import line_shape
from tireroad.fem.tire.mesh import Lattice

_WINDOW = np.radians(75)  # around the lowest point, where the face of a round section points down
_STEP = 1e-6  # rad, of the difference quotients; affects Newton's rate only, not the result
_NEWTON = 30
_CLOSE = 1e-11  # m
_CLOSE_ANGLE = 1e-9  # rad; at a lowest point the height error is its square times the radius


class TreadSurface:
    """The outer face of a lattice with its nodes at `positions` (s, 3) m. Not collective."""

    def __init__(self, lattice: Lattice, positions: np.ndarray) -> None:
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
            corners, found = self._closed_in(*corners)
        return float(found.min())

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
        ring, arc, found = self._located[key]
        return ring.copy(), arc.copy(), found.copy()

    def _found(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        target = np.stack([x, y], axis=-1)
        place = self._guess(target)
        found = np.isfinite(place).all(axis=1)
        place[~found] = 0.0
        for _ in range(_NEWTON):
            defect = self.at(*place.T)[:, :2] - target
            open_ = found & (np.abs(defect).max(axis=1) > _CLOSE)
            if not open_.any():
                break
            place[open_] -= self._newton_step(place[open_], defect[open_])
            place[:, 1] = np.clip(place[:, 1], *self._across)
        found &= np.abs(self.at(*place.T)[:, :2] - target).max(axis=1) <= 1e3 * _CLOSE
        return place[:, 0], place[:, 1], found

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
