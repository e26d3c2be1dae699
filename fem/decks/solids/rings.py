"""The axis about which the nodes of a three-dimensional deck form rings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.fem.decks.deck import Deck
from tireroad.fem.errors import InputError

_SAME = 1e-6  # of the body's size (positions) or of a radian (angles): tolerance for equality


@dataclass(frozen=True)
class Rings:
    """The nodes of a body about an axis.

    For each row of the deck's points the numbers of its ring (its position in the section) and of
    its angle; `places` (r, along) of the rings; `angles` ascending in rad.
    """

    axis: int
    ring: np.ndarray
    angle: np.ndarray
    places: np.ndarray
    angles: np.ndarray


def find_rings(deck: Deck, corners: np.ndarray) -> Rings:
    """The axis about which corner nodes form rings of equal angles. InputError if none."""
    best: tuple[int, int, int] = (len(corners) + 1, 0, 0)  # more positions than possible
    for axis in (1, 2, 0):
        rings = _rings(deck.points, axis, corners)
        pairs = np.unique(rings.ring[corners] * len(rings.angles) + rings.angle[corners])
        places, angles = (len(np.unique(part[corners])) for part in (rings.ring, rings.angle))
        if len(pairs) == len(corners) == places * angles and angles >= 3:
            return rings
        if places < best[0]:
            best = (places, angles, axis)
    raise InputError(
        f"{deck.file}: not a body of revolution about x, y or z through the origin: its {len(corners)} corner "
        f"nodes lie at {best[0]} places of the section and {best[1]} angles about {'xyz'[best[2]]}. Rolling is "
        "formulated about a body that is undeformed the same at every angle: bring its section"
    )


def _rings(points: np.ndarray, axis: int, corners: np.ndarray) -> Rings:
    """Rings and angles of all nodes about a coordinate axis."""
    first, second = points[:, (axis + 1) % 3], points[:, (axis + 2) % 3]
    r, along = np.hypot(first, second), points[:, axis]
    small = _SAME * max(np.ptp(points[corners], axis=0).max(), 1e-300)
    pair = _clusters(r, small) * (len(points) + 1) + _clusters(along, small)
    _, start, ring = np.unique(pair, return_index=True, return_inverse=True)
    theta = np.arctan2(second, first) % (2 * np.pi)
    theta[theta > 2 * np.pi - _SAME] = 0.0
    number = _clusters(theta, _SAME)
    used = np.unique(number[corners])
    _, begin = np.unique(number, return_index=True)
    angle = np.searchsorted(used, number)
    angle[~np.isin(number, used)] = -1
    return Rings(axis, ring.ravel(), angle, np.column_stack([r, along])[start], theta[begin][used])


def _clusters(values: np.ndarray, small: float) -> np.ndarray:
    """Group numbers of values, ascending; groups have no gap above `small`."""
    order = np.argsort(values)
    group = np.cumsum(np.diff(values[order], prepend=values[order[0]]) > small)
    out = np.empty(len(values), np.int64)
    out[order] = group
    return out
