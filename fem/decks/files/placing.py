"""Positions of generated nodes: on lines and arcs, shifted, rotated, reflected."""

from __future__ import annotations

import numpy as np

from tireroad.fem.decks.files.lines import Card, Place

_SAME = 1e-6  # of a radius: tolerance for the two ends of an arc


def along_line(first: np.ndarray, last: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Points (..., k, 3) at fractions (k,) of the way from `first` to `last`."""
    return first + share[:, None] * (last - first)


def along_arc(
    ends: np.ndarray, centre: np.ndarray, normal: np.ndarray, share: np.ndarray, place: Place
) -> np.ndarray:
    """Points (k, 3) at fractions of the arc between two ends (2, 3) about a centre.

    Right-handed about `normal`; without one (0) the smaller arc. Raises InputError for invalid
    arcs.
    """
    start, end = ends - centre
    radius = np.linalg.norm(start)
    if not radius or abs(np.linalg.norm(end) - radius) > _SAME * radius:
        raise place.error("*NGEN, LINE=C: the two ends are not equally far from the centre")
    given = bool(normal.any())
    axis = normal if given else np.cross(start, end)
    if np.linalg.norm(axis) < _SAME * (1 if given else radius**2):
        raise place.error("*NGEN, LINE=C: an arc of 180 degrees or more needs its normal")
    axis = axis / np.linalg.norm(axis)
    angle = np.arctan2(axis @ np.cross(start, end), start @ end)
    angle = angle if angle > _SAME else angle + 2 * np.pi
    return centre + turned(np.tile(start, (len(share), 1)), axis, share * angle)


def turned(points: np.ndarray, axis: np.ndarray, angle: np.ndarray | float) -> np.ndarray:
    """Points (k, 3) rotated about a unit axis through the origin by angles (rad): Rodrigues."""
    cosine, sine = (np.asarray(f(angle))[..., None] for f in (np.cos, np.sin))
    along = (points @ axis)[:, None] * axis
    return along + cosine * (points - along) + sine * np.cross(axis, points)


def copied(points: np.ndarray, card: Card, table: list[list[float]]) -> np.ndarray:
    """The points of an *NCOPY: shifted and rotated, or reflected. Raises InputError for POLE."""
    rows = [np.array((row + [0.0] * 7)[:7]) for row in table] + [np.zeros(7)] * 2
    mirror = card.options.get("REFLECT", "").upper()
    if "SHIFT" in card.options:
        return _shifted(points + rows[0][:3], card, rows[1])
    if "POLE" in card.options:
        raise card.place.error("*NCOPY, POLE is not read: SHIFT and REFLECT are")
    a, b = rows[0][:3], rows[0][3:6]
    if mirror == "POINT":
        return 2 * a - points
    if mirror == "LINE":
        along = _unit(b - a, card)
        return 2 * (a + ((points - a) @ along)[:, None] * along) - points
    if mirror == "MIRROR":
        normal = _unit(np.cross(b - a, rows[1][:3] - a), card)
        return points - 2 * ((points - a) @ normal)[:, None] * normal
    raise card.place.error("*NCOPY needs SHIFT or REFLECT=LINE, MIRROR or POINT")


def _shifted(points: np.ndarray, card: Card, turn: np.ndarray) -> np.ndarray:
    """Rotated about the line through two points by an angle in degrees, MULTIPLE times."""
    angle = np.radians(turn[6]) * float(card.options.get("MULTIPLE") or 1)
    if not angle:
        return points
    return turn[:3] + turned(points - turn[:3], _unit(turn[3:6] - turn[:3], card), angle)


def _unit(direction: np.ndarray, card: Card) -> np.ndarray:
    length = np.linalg.norm(direction)
    if not length > 0:
        raise card.place.error("*NCOPY: its points give no line or plane")
    return direction / length
