"""Closed forms of contact with an elastic half-space and of rolling, for tests.

E* is the contact modulus, 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2, in Pa; a rigid body has no term.
Source: Johnson, Contact Mechanics (1985), unless another is given.
"""

import math
from typing import NamedTuple

import numpy as np

# pi times the capacity of the square plate of half side 1 (0.3667892 per side, Read 1997): F/(E* a
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
    """Load (N) on a sphere at an approach delta (m): F = 4/3 E* sqrt(R) delta^(3/2)."""
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


def westergaard_pressure(
    x: np.ndarray, fraction: float, amplitude: float, wavelength: float, modulus: float
) -> np.ndarray:
    """Pressure (Pa) at x (m) from a crest of rigid waves, `fraction` of which is in contact.

    p = 2 p_m cos(pi x/L) sqrt(s^2 - sin^2(pi x/L))/s^2 in the contact, s = sin(pi fraction/2); p_m
    as in `westergaard_mean`. Source: Westergaard, J. Appl. Mech. 6 (1939) 49; Johnson 13.2.
    """
    s = math.sin(math.pi * fraction / 2)
    mean = westergaard_mean(fraction, amplitude, wavelength, modulus)
    turned = np.pi * np.asarray(x) / wavelength
    inside = np.maximum(s**2 - np.sin(turned) ** 2, 0.0)
    return 2 * mean * np.abs(np.cos(turned)) * np.sqrt(inside) / s**2


def westergaard_mean(fraction: float, amplitude: float, wavelength: float, modulus: float) -> float:
    """Mean pressure (Pa) for `fraction` of a wavy surface: pi E* A/L sin^2(pi fraction/2)."""
    full = math.pi * modulus * amplitude / wavelength
    return full * math.sin(math.pi * fraction / 2) ** 2


def carter_force(creepage: float, friction: float, half_width: float, radius: float) -> float:
    """Tangential force over mu P of a rolling elastic cylinder, one body rigid or both alike.

    Q/(mu P) = 1 - (1 - R xi/(mu a))^2, and 1 from xi = mu a/R on: `creepage` xi, `friction` mu,
    half width a (m), relative radius R (m). Source: Carter, Proc. R. Soc. A 112 (1926) 151; Johnson
    (8.20).
    """
    share = min(radius * creepage / (friction * half_width), 1.0)
    return 1.0 - (1.0 - share) ** 2


def carter_traction(
    x: np.ndarray, creepage: float, friction: float, half_width: float, radius: float
) -> np.ndarray:
    """Tangential traction over peak pressure at x (m) from the middle, leading edge at x = a.

    mu [sqrt(1 - x^2/a^2) - c/a sqrt(1 - (x - a + c)^2/c^2)]; the stick zone is 2c = 2a - 2 R xi/mu
    wide and adjoins the leading edge.
    """
    a, x = half_width, np.asarray(x)
    stick = a * math.sqrt(1.0 - carter_force(creepage, friction, half_width, radius))
    whole = np.sqrt(np.maximum(1.0 - (x / a) ** 2, 0.0))
    if stick == 0.0:
        return friction * whole
    inner = np.sqrt(np.maximum(1.0 - ((x - a + stick) / stick) ** 2, 0.0))
    return friction * (whole - stick / a * inner)


def brush_force(
    slip: float, friction: float, load: float, half_length: float, tread: float
) -> float:
    """Force (N) of a sliding brush under parabolic pressure: mu F [1 - (1 - theta sigma)^3].

    `slip` sigma, load F (N), half length a (m), bristle stiffness `tread` c (N/m2) per length,
    theta = 2 c a^2/(3 mu F). Source: Pacejka, Tire and Vehicle Dynamics (2012), 3.2.
    """
    theta = 2 * tread * half_length**2 / (3 * friction * load)
    return friction * load * (1 - (1 - min(theta * slip, 1.0)) ** 3)
