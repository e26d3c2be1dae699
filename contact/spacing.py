"""How far apart the points of a contact are where the scene leaves that to the program.

A footprint some points wide has forces that depend on where its edge falls between them: a fifth of its width and length
tells them (soft torus, 16 mm wide; docs/verification.md, Contact points). Waves that are told need twelve points: with ten
the deviation of the radial tire, 130 mm wide, is 0.7 to 2.2 % off (Default settings there), with twelve 0.6 % at most. And points
much closer than the nodes that carry them tell no more of the tire.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # `check` asks for ON_A_NODE, and needs no finite elements
    from tireroad.contact.patch import Patch
    from tireroad.fem.static.footprint import Footprint

ACROSS = 5.0  # points on the footprint's width or length
ON_A_WAVE = 12.0  # points on the shortest wave told
ON_A_NODE = 2.0  # points from node to node at most


def spacing(footprint: Footprint, nodes: Patch, speed: float, highest: float) -> float | None:
    """Distance (m) of the points from the `footprint` as solved, the `nodes` in it, and the road's `speed` (m/s) over the
    `highest` frequency (Hz) that is told, two digits of it; None where nothing touches.
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
