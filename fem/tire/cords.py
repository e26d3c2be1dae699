"""Cords of a ply or belt: their properties, and the strain energy of the membrane they form.

    W_c = k/2 (lambda - 1)^2 per undeformed area,  k = E A_c / s,  lambda = |F a|,

a being the cord's unit direction in the surface of the ply, a = cos(alpha) e_circ + sin(alpha)
e_arc: e_circ around the axle towards growing ring angle, e_arc along the section from -y to +y.
Below lambda = 1 the modulus is multiplied by `compression`; W_c and its slope stay continuous. A
cord without strain, as in a tire without inflation, has its full modulus.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from ufl.core.expr import Expr

from tireroad.fem.errors import InputError

TAUT = 1 - 1e-10  # stretch below which a cord is compressed: strain of 1e-10 is rounding


@dataclass(frozen=True, kw_only=True)
class Cords:
    """The cords of one ply or belt, by the `name` of its line in the section.

    `angle` rad from the circumference (90 degrees: radial); `youngs_modulus` Pa; `area` m2 of one
    cord; `spacing` m between cords; `density` kg/m3 of the cord; `compression`: ratio of the moduli
    in compression and tension. `drum_radius` m: angle and spacing are those on the building drum,
    from which the ply is lifted; None: they hold everywhere in the tire.
    """

    name: str
    angle: float
    youngs_modulus: float
    area: float
    spacing: float
    density: float = 0.0
    compression: float = 1.0
    drum_radius: float | None = None

    def __post_init__(self) -> None:
        for key in ("youngs_modulus", "area", "spacing"):
            if not getattr(self, key) > 0:
                raise InputError(f"cords {self.name!r}: {key} must be above 0")
        if self.density < 0 or self.compression < 0:
            raise InputError(f"cords {self.name!r}: density and compression must not be negative")

    @property
    def stiffness(self) -> float:
        """k = E A_c / s at the given spacing, N/m."""
        return self.youngs_modulus * self.area / self.spacing

    def at(self, radius: np.ndarray) -> Woven:
        """Properties of the ply at radii (n,) m from the axle.

        After lifting from the drum cos alpha = (r / r_0) cos alpha_0 and s = s_0 (r / r_0) sin
        alpha / sin alpha_0: cords keep their length and their share of the circumference. Raises
        InputError where the cords cannot reach the radius.
        """
        exact = np.array([np.cos(self.angle), np.sin(self.angle)])
        exact[np.abs(exact) < np.finfo(float).eps] = 0.0  # at 90 and 0 degrees
        cosine, sine = (np.full(len(radius), value) for value in exact)
        spacing = np.full(len(radius), self.spacing)
        if self.drum_radius is not None:
            cosine = radius / self.drum_radius * exact[0]
            if (np.abs(cosine) >= 1).any() or not exact[1]:
                raise InputError(
                    f"cords {self.name!r}: cords of {np.degrees(self.angle):g} deg on a drum of "
                    f"{self.drum_radius:g} m cannot be lifted to {radius.max():.4g} m"
                )
            sine = np.sign(exact[1]) * np.sqrt(1 - cosine**2)
            spacing = self.spacing * radius / self.drum_radius * sine / exact[1]
        section = self.area / spacing
        return Woven(self.youngs_modulus * section, self.density * section, cosine, sine)


@dataclass(frozen=True)
class Woven:
    """A ply at n places: `stiffness` k = E A_c / s (n,) N/m, `mass` rho_c A_c / s (n,) kg/m2, and
    the components `cosine` and `sine` (n,) of the cord along e_circ and e_arc, exactly 0 at 90 and
    0 degrees.
    """

    stiffness: np.ndarray
    mass: np.ndarray
    cosine: np.ndarray
    sine: np.ndarray


def _modulus(stretch: Expr, stiffness: Expr, slack: Expr) -> Expr:
    return stiffness * ufl.conditional(ufl.lt(stretch, TAUT), slack, 1.0)


def tension(stretch: Expr, stiffness: Expr, slack: Expr) -> Expr:
    """dW_c/dlambda, N/m, in UFL."""
    return _modulus(stretch, stiffness, slack) * (stretch - 1)


def energy(stretch: Expr, stiffness: Expr, slack: Expr) -> Expr:
    """W_c, J/m2, in UFL."""
    return tension(stretch, stiffness, slack) * (stretch - 1) / 2


def tension_over_stretch(square: Expr, stiffness: Expr, slack: Expr) -> Expr:
    """(1/lambda) dW_c/dlambda as a function of lambda^2: second Piola-Kirchhoff stress, N/m."""
    stretch = ufl.sqrt(square)
    return tension(stretch, stiffness, slack) / stretch


def tension_over_stretch_rate(square: Expr, stiffness: Expr, slack: Expr) -> Expr:
    """Derivative of `tension_over_stretch` with respect to lambda^2, N/m."""
    stretch = ufl.sqrt(square)
    return _modulus(stretch, stiffness, slack) / (2 * stretch**3)
