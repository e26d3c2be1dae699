"""The gas law of an inflated tire: its pressure at another temperature."""

from __future__ import annotations

ATMOSPHERE = 101325.0  # Pa; inflation is measured above it
KELVIN = 273.15  # K at 0 degrees C


def warmed(inflation: float, before: float, temperature: float) -> float:
    """Inflation (Pa above the atmosphere) at a `temperature` of a tire inflated at another, degrees C, of the same volume.

        p + p_0 = (p_before + p_0) T / T_before

    A tire without inflation is open and stays without; none gets emptier than that.
    """
    if not inflation:
        return inflation
    ratio = (temperature + KELVIN) / (before + KELVIN)
    return max(ratio * (inflation + ATMOSPHERE) - ATMOSPHERE, 0.0)
