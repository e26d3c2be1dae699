"""A half section completed by its mirror image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tireroad.fem.decks.shape.quad_split import Quads
from tireroad.fem.errors import InputError

_CLOSE = 1e-4  # of the section's size: tolerance for nodes on the centre plane


def on_centre(quads: Quads) -> np.ndarray:
    """Which points lie on the plane z = 0."""
    return np.abs(quads.points[:, 1]) < _CLOSE * np.ptp(quads.points, axis=0).max()


def is_half(quads: Quads) -> bool:
    """Whether the section lies on one side of z = 0 and has sides of its outline on it."""
    centre = on_centre(quads)
    y = quads.points[~centre, 1]
    sides = quads.sides()[tuple(quads.boundary().T)]
    return bool(len(y) and (y.min() > 0 or y.max() < 0) and centre[sides].all(axis=1).any())


def mirrored(quads: Quads) -> Quads:
    """Both halves, sharing nodes on the centre plane. InputError if it is not a half section."""
    if not is_half(quads):
        low, high = quads.points[:, 1].min(), quads.points[:, 1].max()
        raise InputError(
            f"mirror = true is for a half section that ends on z = 0; this one goes from z = {low:.5g} to "
            f"{high:.5g}"
        )
    centre = on_centre(quads)
    points = quads.points.copy()
    points[centre, 1] = 0.0
    image = np.arange(len(points))
    image[~centre] = len(points) + np.arange((~centre).sum())
    turned = np.arange(9).reshape(3, 3)[::-1].ravel()  # xi is reversed
    return replace(
        quads,
        points=np.concatenate([points, points[~centre] * [1, -1]]),
        cells=np.concatenate([quads.cells, image[quads.cells[:, turned]]]),
        region=np.tile(quads.region, 2),
        element=np.tile(quads.element, 2),
        origin=np.concatenate([quads.origin, quads.origin[:, [1, 0, 2, 3]]]),
    )
