"""Lines of cords in the wall: what they are made of, and the strain energy of the membrane they form.

    W_c = k/2 (lambda - 1)^2 per undeformed area,  k = E A_c / s,  lambda = |F a|,

a the unit direction of the cord in the ply's surface, a = cos(alpha) e_circ + sin(alpha) e_arc: e_circ around
the axle towards growing ring angle, e_arc along the section from -y to +y. Below lambda = 1 the modulus
is `compression` times as large: W_c and its slope stay continuous.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl

from tireroad.fem.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Cords:
    """The cords of one ply or belt, by the `name` of its line in the section.

    `angle` rad from the circumference (90 degrees: radial); `youngs_modulus` Pa, `area` m2 of one cord,
    `spacing` m between cords, `density` kg/m3 of the cord, `compression` modulus in compression over that
    in tension.
    """

    name: str
    angle: float
    youngs_modulus: float
    area: float
    spacing: float
    density: float = 0.0
    compression: float = 1.0

    def __post_init__(self):
        for key in ("youngs_modulus", "area", "spacing"):
            if not getattr(self, key) > 0:
                raise InputError(f"cords {self.name!r}: {key} must be above 0")
        if self.density < 0 or self.compression < 0:
            raise InputError(f"cords {self.name!r}: density and compression must not be negative")

    @property
    def stiffness(self) -> float:
        """k = E A_c / s, N/m."""
        return self.youngs_modulus * self.area / self.spacing

    @property
    def mass(self) -> float:
        """rho_c A_c / s, kg/m2."""
        return self.density * self.area / self.spacing

    @property
    def direction(self) -> tuple[float, float]:
        """Components of the cord along e_circ and e_arc; exactly 0 where the angle is 0 or 90 degrees."""
        exact = np.array([np.cos(self.angle), np.sin(self.angle)])
        exact[np.abs(exact) < np.finfo(float).eps] = 0.0
        return float(exact[0]), float(exact[1])


def tension(stretch, stiffness, slack):
    """dW_c/dlambda, N/m, in UFL."""
    modulus = stiffness * ufl.conditional(ufl.lt(stretch, 1.0), slack, 1.0)
    return modulus * (stretch - 1)


def energy(stretch, stiffness, slack):
    """W_c, J/m2, in UFL."""
    return tension(stretch, stiffness, slack) * (stretch - 1) / 2


def tension_over_stretch(square, stiffness, slack):
    """(1/lambda) dW_c/dlambda as a function of lambda^2: the second Piola-Kirchhoff stress, N/m."""
    stretch = ufl.sqrt(square)
    return tension(stretch, stiffness, slack) / stretch


def tension_over_stretch_rate(square, stiffness, slack):
    """The derivative of `tension_over_stretch` by lambda^2, N/m."""
    stretch = ufl.sqrt(square)
    modulus = stiffness * ufl.conditional(ufl.lt(stretch, 1.0), slack, 1.0)
    return modulus / (2 * stretch**3)
