"""A sine road with crests across the rolling direction."""

import math

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.kind import EndlessRoad, road_kind
from tireroad.fem.parameters import number

Array = NDArray[np.float64]


@road_kind("sine", "sine waves, their crests across the rolling direction")
class Sine(EndlessRoad):
    """z = a sin(2 pi x/L + phase): amplitude a and wavelength L in m, phase in degrees; endless."""

    amplitude: float = number(1.0e-3, "m", "amplitude of the waves", least=0, most=1)
    wavelength: float = number(0.1, "m", "wavelength", least=1e-3, most=1e4)
    phase: float = number(0.0, "deg", "phase of the waves at x = 0", least=-360, most=360)

    @property
    def spacing(self) -> float:
        """Half the wavelength, m: two points per wave."""
        return 0.5 * self.wavelength

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x, m, for any y."""
        wavenumber = 2.0 * np.pi / self.wavelength
        return self.amplitude * np.sin(wavenumber * np.asarray(x) + math.radians(self.phase))

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """The amplitude, m, the upper bound of any strip."""
        return self.amplitude

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Minus the amplitude, m."""
        return -self.amplitude
