"""Mobility of the rolling tire: its modes against complex moduli by Fourier series.

Force and reader rest in space while the tire turns through them, so that a wave of n reaches the rubber at the frequency of the
force plus n turns a second, and what runs with the tire is heard higher than what runs against it.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from tireroad.fem.sections.inflated import InflatedRing
from tireroad.fem.sections.radial import radial
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.mobility import ALONG, HALF, PRESSURE, SIZE, Bench, Chain, level

ABOUT = "drive-point and transfer mobility of the built-in tire at 80 km/h, against complex moduli"
SPEED = 72.0  # rad/s, towards smaller angles
UP_TO = 710.0  # Hz, of the modes, as accuracy.up_to = 500 chooses
FREQUENCY = np.array([31.5, 40, 50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500])  # Hz
ANGLES = np.radians(
    [0.0, 90.0, -90.0, 180.0]
)  # positive: ahead of the axle, if the patch is under it


def run() -> list[Table]:
    """Levels of both."""
    ring = InflatedRing(radial(SIZE), ALONG, 2, PRESSURE)
    weights = ring.patch(0.0, HALF[0])
    exact = ring.receptance(weights, HALF[1], FREQUENCY, ANGLES, speed=-SPEED)
    found = of_modes(Chain.whole(UP_TO, SPEED, Bench(ring)))
    wanted, off = level(exact, FREQUENCY), level(found, FREQUENCY) - level(exact, FREQUENCY)
    rows = [
        [float(f), *(round(float(value), 1) for value in (*one, *less))]
        for f, one, less in zip(FREQUENCY, wanted, off, strict=True)
    ]
    degrees = [f"{np.degrees(angle):.0f}\u00b0" for angle in ANGLES]
    return [
        Table(
            f"Mobility of the crown at {SPEED:g} rad/s, {SIZE}, {PRESSURE / 1e3:.0f} kPa, rim held, no road",
            [
                ("frequency", "Hz"),
                *((f"at {d}", "dB") for d in degrees),
                *((f"modes, {d}", "dB more") for d in degrees),
            ],
            rows,
            [
                f"dB re 1 m/(N s), radial, of a patch {2e3 * HALF[0]:.0f} mm wide and {np.degrees(2 * HALF[1]):.0f}\u00b0 long at "
                "rest in space: complex moduli at the frequency at which each wave reaches the rubber, by Fourier series around",
                f"Rotating modes to {UP_TO:.0f} Hz with attachment modes, three-dimensional elements: at the driven patch "
                f"{np.abs(off[:, 0]).max():.1f} dB off at most, elsewhere {np.abs(off[:, 1:]).max():.1f} dB",
            ],
        )
    ]


def of_modes(chain: Chain) -> np.ndarray:
    """H (f, a) m/N of the rotating modes of a `chain`, from the patch at 0 to those at the angles."""
    probes = sparse.csr_matrix([chain.patch(0.0, angle, HALF) for angle in ANGLES])
    response = chain.rolling(SPEED).respond(probes, probes[:1], "attachment")
    return response.receptance(FREQUENCY)[:, :, 0]
