"""The tire's wall as a shallow shell under tension: how dense its modes are."""

import math
from dataclasses import dataclass

import numpy as np

from tireroad.runs.scene.tables.scene import Scene

DIRECTIONS = 16  # of waves, over a quarter turn


@dataclass(frozen=True)
class Wall:
    """N = A/4π (k² + s² ω²) modes up to ω, k² averaged over the directions of waves.

    k is the wave number of bending waves in a shallow shell (Donnell), ρh (ω² - ω_c²) = B k⁴ + T k²,
    and s² the sum of the squared slownesses of the two in-plane waves, which cords make too fast to
    count. A wave across which the wall is curved stretches it, and there is none below its
    ω_c = c (cos²θ / r + sin²θ / R), where c is the speed of sound in a rod, r and R the radii of the
    section and of the crown, θ the direction from the circumference (318 Hz at θ = 0 in a torus of
    48 MPa and r = 0.1 m, whose 60th mode is at 313 Hz: 294 Hz by this, 210 Hz in a flat plate).

    `area` A m², `mass` ρh kg/m², `bending` B N m, `tension` T N/m, `slowness2` s² (s/m)²,
    `curved2` ω_c² (1/s²) by direction.
    """

    area: float
    mass: float
    bending: float
    tension: float
    slowness2: float
    curved2: np.ndarray

    def modes_below(self, frequency: float) -> float:
        """Number of modes below a frequency (Hz)."""
        omega2 = (2 * math.pi * frequency) ** 2
        driving = self.mass * np.maximum(omega2 - self.curved2, 0.0)
        root = np.sqrt(self.tension**2 + 4 * self.bending * driving)
        k2 = float(np.mean((root - self.tension) / (2 * self.bending)))
        return self.area * (k2 + self.slowness2 * omega2) / (4 * math.pi)

    def frequency_of(self, modes: float) -> float:
        """Frequency (Hz) below which there are that many modes, by bisection in its logarithm."""
        low, high = 1e-3, 1e9
        while high > 1.001 * low:
            middle = math.sqrt(low * high)
            low, high = (middle, high) if self.modes_below(middle) < modes else (low, middle)
        return low


def wall_of(scene: Scene) -> Wall:
    """The wall, from the section's height and thickness; tension as in a circle of that radius.

    With cords its waves are those of a flat plate: cords hinder the stretching of rubber, and give
    way to waves that do not stretch them.
    """
    tire, shape = scene.tire.proportions(), scene.tire.shape
    youngs, poisson, density = shape.rubber(scene.tire)
    plane = density * (1 - poisson**2 + 2 * (1 + poisson)) / youngs
    middle = tire.outer_radius - 0.5 * tire.height
    cords = bool(shape.angles(scene.tire))
    theta = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS * math.pi / 2
    curved = np.cos(theta) ** 2 / tire.height + np.sin(theta) ** 2 / tire.outer_radius
    return Wall(
        area=2 * math.pi * middle * 2 * math.radians(tire.half_angle) * tire.height,
        mass=density * tire.thickness,
        bending=youngs * tire.thickness**3 / (12 * (1 - poisson**2)),
        tension=scene.static.inflation * tire.height,
        slowness2=0.0 if cords else plane,
        curved2=np.zeros(DIRECTIONS) if cords else youngs / density * curved**2,
    )
