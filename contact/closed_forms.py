"""Closed forms of frictionless contact with an elastic half-space, for tests and users alike.

E* is the contact modulus, 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2, in Pa; a rigid body has no term.
Source: Johnson, Contact Mechanics (1985), unless said otherwise.
"""

import math
from typing import NamedTuple

# pi times the capacity of the unit-half-side square plate (0.3667892 per side, Read 1997): F/(E* a
# delta).
SQUARE_PUNCH = 2.3046
# pi E* u / p at the centre of a uniformly loaded square of half side 1; half of it at the corner
# (Love 1929).
LOVE_SQUARE_CENTRE = 8.0 * math.log(1.0 + math.sqrt(2.0))


class SphereContact(NamedTuple):
    """Contact radius (m), approach of distant points (m), pressure at the centre (Pa)."""

    radius: float
    approach: float
    peak_pressure: float


class CylinderContact(NamedTuple):
    """Half width of the contact strip (m), pressure on its middle line (Pa)."""

    half_width: float
    peak_pressure: float


def contact_modulus(youngs_modulus: float, poisson_ratio: float) -> float:
    """E* (Pa) of one elastic body against a rigid one: E/(1 - nu^2)."""
    return youngs_modulus / (1.0 - poisson_ratio**2)


def hertz_sphere(load: float, radius: float, modulus: float) -> SphereContact:
    """Sphere of relative radius R (m) under a load F (N).

    a^3 = 3FR/4E*, approach a^2/R, peak pressure 3F/(2 pi a^2).
    """
    a = (0.75 * load * radius / modulus) ** (1.0 / 3.0)
    return SphereContact(a, a**2 / radius, 1.5 * load / (math.pi * a**2))


def hertz_sphere_load(approach: float, radius: float, modulus: float) -> float:
    """Load (N) on a sphere pressed in by an approach delta (m): F = 4/3 E* sqrt(R) delta^(3/2)."""
    return 4.0 / 3.0 * modulus * math.sqrt(radius) * approach**1.5


def hertz_cylinder(load: float, radius: float, modulus: float) -> CylinderContact:
    """Cylinder of relative radius R (m) under a load P per length (N/m).

    a^2 = 4PR/(pi E*), peak pressure 2P/(pi a).
    """
    a = math.sqrt(4.0 * load * radius / (math.pi * modulus))
    return CylinderContact(a, 2.0 * load / (math.pi * a))


def square_punch_load(approach: float, half_side: float, modulus: float) -> float:
    """Load (N) on a rigid flat square punch: F = 2.3046 E* a delta, lengths in m."""
    return SQUARE_PUNCH * modulus * half_side * approach


def love_square_centre(pressure: float, half_side: float, modulus: float) -> float:
    """Displacement (m) at the centre of a uniformly loaded square: 8 ln(1 + sqrt 2) p a/(pi E*)."""
    return LOVE_SQUARE_CENTRE * pressure * half_side / (math.pi * modulus)
