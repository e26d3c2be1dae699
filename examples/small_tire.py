"""The tire of these examples: a soft torus on a coarse mesh, a few seconds a step. Not for results."""

from __future__ import annotations

import tireroad as tr


def small_tire(**changes):
    """A torus of 48 MPa rubber with 16 x 8 elements."""
    return tr.torus(
        **{
            "youngs_modulus": 48e6,
            "segments": 16,
            "elements_arc": 8,
            "order": 2,
            "footprint_size": 0.3,
        }
        | changes
    )
