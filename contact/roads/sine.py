"""A sine road, waves across the rolling direction."""

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError

Array = NDArray[np.float64]


class Sine:
    """z = a sin(2 pi x/L + phase): amplitude a and wavelength L in m, phase in radians; endless."""

    extent = ((-np.inf, np.inf), (-np.inf, np.inf))

    def __init__(self, amplitude: float, wavelength: float, phase: float = 0.0) -> None:
        if not (np.isfinite(wavelength) and wavelength > 0.0):
            raise InputError(f"road: wavelength {wavelength:g} m must be positive")
        if not (np.isfinite(amplitude) and amplitude >= 0.0):
            raise InputError(f"road: amplitude {amplitude:g} m must not be negative")
        self._amplitude, self._phase = amplitude, phase
        self._wavenumber = 2.0 * np.pi / wavelength
        self.spacing = wavelength / 2  # two points a wave: the shortest length resolved

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x, m; y does not matter."""
        return self._amplitude * np.sin(self._wavenumber * np.asarray(x) + self._phase)

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """The amplitude, m: the bound of any strip."""
        return self._amplitude

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Minus the amplitude, m."""
        return -self._amplitude

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "Sine":
        """Nothing to prepare."""
        return self
