"""The air inside the tire as an ideal gas, and its acoustic losses at the walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

GAS_CONSTANT = 287.0  # J/(kg K), of dry air
RATIO = 1.4  # of specific heats
ATMOSPHERE = 101325.0  # Pa; inflation is measured above it
_PRANDTL = 0.71


@dataclass(frozen=True)
class Gas:
    """Air at rest: absolute `pressure` Pa and `temperature` K."""

    pressure: float
    temperature: float

    @property
    def density(self) -> float:
        """rho0 = p / (R T), kg/m3."""
        return self.pressure / (GAS_CONSTANT * self.temperature)

    @property
    def sound_speed(self) -> float:
        """c = sqrt(gamma R T), m/s."""
        return float(np.sqrt(RATIO * GAS_CONSTANT * self.temperature))

    @property
    def viscosity(self) -> float:
        """Dynamic viscosity, Pa s, by Sutherland's law for air."""
        return 1.458e-6 * self.temperature**1.5 / (self.temperature + 110.4)

    def wall_loss(self, radius: float, circular: np.ndarray) -> np.ndarray:
        """Damping rate (1/s) of waves at `circular` rad/s in a tube of `radius` m.

        Twice the decay rate of the amplitude, by viscosity and heat conduction in the boundary
        layers (Kirchhoff 1868; Pierce, Acoustics (1981), 10-5):  (2 / a) sqrt(mu w / 2 rho0) (1 +
        (gamma - 1) / sqrt(Pr)).
        """
        layer = np.sqrt(self.viscosity * circular / (2 * self.density))
        return 2 / radius * layer * (1 + (RATIO - 1) / np.sqrt(_PRANDTL))


def inflated(inflation: float, temperature: float) -> Gas:
    """The air of a tire at `inflation` Pa above atmospheric pressure and `temperature` K."""
    return Gas(inflation + ATMOSPHERE, temperature)
