"""The thesis's torus with selectable elements: tire of most benchmarks, validations and tests."""

from __future__ import annotations

import math
from typing import Any

from tireroad.fem.sections.torus import Torus


def thesis_torus(
    *, segments: int, elements_arc: int, elements_thickness: int = 1, order: int = 2, **more: Any
) -> Torus:
    """Outer radius 0.32 m, section radius 0.1 m, wall 12 mm, 120 deg from the crown to each bead.

    `more`: grading and footprint_size of the Torus.
    """
    return Torus(
        outer_radius=0.32,
        minor_radius=0.10,
        thickness=0.012,
        half_angle=math.radians(120),
        segments=segments,
        elements_arc=elements_arc,
        elements_thickness=elements_thickness,
        order=order,
        **more,
    )
