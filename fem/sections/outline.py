"""A smooth, symmetric outer face through a few points, parametrised by length from the crown."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from tireroad.fem.errors import InputError

RADII = 0.1, 2.5  # m, range of the outer radius of a tire
_SAMPLES = 4001
_ARC = 24  # points on each arc


class Outline:
    """The outer face, r and y in m, from the crown (y = 0) to the bead, with its mirror image.

    `points` (k, 2) of (r, y), k >= 4, starting at y = 0: a cubic spline through them over chord
    length, with zero slope at the crown. `length` m from crown to bead.
    """

    def __init__(self, points: np.ndarray) -> None:
        points = np.asarray(points, float)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 4:
            raise InputError("section: an outline needs four points (r, y) or more")
        if points[0, 1] != 0:
            raise InputError(
                f"section: the outline starts at y = {points[0, 1]:g}, not at the crown, y = 0"
            )
        chord = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        if (np.diff(chord) <= 0).any():
            raise InputError("section: two points of the outline are at one place")
        both = np.concatenate([points[:0:-1] * [1, -1], points])
        spline = CubicSpline(np.concatenate([-chord[:0:-1], chord]), both)
        t = np.linspace(0.0, chord[-1], _SAMPLES)
        dense = spline(t)
        steps = np.linalg.norm(np.diff(dense, axis=0), axis=1)
        by_length = CubicSpline(np.append(0.0, np.cumsum(steps)), t)
        self.length = float(steps.sum())
        self._place = lambda s: spline(by_length(s))
        self._slope = lambda s: spline(by_length(s), 1)

    def at(self, s: np.ndarray) -> np.ndarray:
        """(r, y) (k, 2) m at signed lengths (k,) m from the crown."""
        found = self._place(np.abs(s))
        found[:, 1] *= np.sign(s)
        return found

    def inwards(self, s: np.ndarray) -> np.ndarray:
        """Unit normals (k, 2) towards the air inside."""
        r, y = self._slope(np.abs(s)).T
        size = np.hypot(r, y)
        return np.stack([-y / size, np.sign(s) * r / size], axis=-1)


def arcs(through: npt.ArrayLike) -> np.ndarray:
    """Points on consecutive arcs: `through` is the start, then a middle and an end for each."""
    points = np.asarray(through, float)
    if points.ndim != 2 or len(points) < 3 or len(points) % 2 == 0:
        raise InputError("section: arcs are a start and two points (on the way, end) for each arc")
    found = [points[:1]]
    for start, middle, end in zip(points[:-2:2], points[1:-1:2], points[2::2], strict=True):
        found.append(_arc(start, middle, end)[1:])
    return np.concatenate(found)


def _arc(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    matrix = 2 * np.array([b - a, c - a])
    if abs(np.linalg.det(matrix)) < 1e-12 * np.linalg.norm(c - a) ** 2:
        return a + np.linspace(0, 1, _ARC)[:, None] * (c - a)
    centre = np.linalg.solve(matrix, [b @ b - a @ a, c @ c - a @ a])
    angle = np.unwrap([np.arctan2(*(p - centre)) for p in (a, b, c)])
    turn = np.linspace(angle[0], angle[2], _ARC)
    return centre + np.linalg.norm(a - centre) * np.stack([np.sin(turn), np.cos(turn)], axis=-1)
