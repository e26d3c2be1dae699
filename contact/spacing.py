"""Spacing of the contact points where the scene leaves it to the program.

The forces of a footprint a few points wide depend on where its edge falls between them; a fifth of
its width and length is fine enough (soft torus, 14 mm wide; docs/verification/contact-points.md).
A wave needs twelve points: with ten the deviation of the radial tire, 130 mm wide, is 0.7 to
2.2 % off (docs/verification/default-settings.md), with twelve 0.6 % at most. Points much closer than
the nodes that carry them resolve no more of the tire.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the tables read ON_A_NODE, and need no finite elements
    from tireroad.contact.patch import Patch
    from tireroad.fem.static.footprint import Footprint

ACROSS = 5.0  # points on the footprint's width or length
ON_A_WAVE = 12.0  # points on the shortest wave of interest
ON_A_NODE = 2.0  # points from node to node, at most


def spacing(footprint: Footprint, nodes: Patch, speed: float, highest: float) -> float | None:
    """Spacing (m) of the points, two digits of it; None if nothing touches.

    From the `footprint` as solved, the `nodes` in it, and the shortest wave: the road's `speed`
    (m/s) over the `highest` frequency (Hz) of interest.
    """
    between = math.sqrt(float(nodes.spacing.prod()))
    if not between or not min(footprint.length, footprint.width) > 0:
        return None
    wanted = min(footprint.length, footprint.width) / ACROSS
    if speed > 0:
        wanted = min(wanted, speed / highest / ON_A_WAVE)
    wanted = max(wanted, between / ON_A_NODE)
    digit = 10.0 ** (math.floor(math.log10(wanted)) - 1)
    return round(math.floor(wanted / digit * (1 + 1e-9)) * digit, 9)
