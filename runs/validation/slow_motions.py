"""How stiff slow motions find a tire: static moduli, those of modes, and those of a wave that rests on a rolling tire.

A slow rise of the road is answered by the static flexibility of all modes. Each has the modulus of its own frequency,
and static shapes that of half the highest mode's: above that of a load that comes in seconds. In a rolling tire a
deformation of n waves that stands on the road passes the rubber n Omega / 2 pi times a second, which is what its
modulus is for.
"""

from __future__ import annotations

import numpy as np

from tireroad.fem.sections.inflated import InflatedRing, patch_share
from tireroad.fem.sections.radial import radial
from tireroad.fem.tire.material import own_moduli
from tireroad.runs.validation.mobility import ALONG, PRESSURE, SIZE
from tireroad.runs.validation.tables import Table

ABOUT = "flexibility under slow loads: static moduli, those of the modes, those of a standing wave of a rolling tire"
UP_TO, WAVES = 1000.0, 60  # Hz, of the modes
WIDE = 0.05  # m, half of the patch across: a footprint's
LONG = np.radians([2.0, 12.0])  # half of it around: a point of a footprint, and a footprint
SPEEDS = (20.0, 72.0)  # rad/s


def run() -> list[Table]:
    """Flexibility of two patches over that with static moduli."""
    ring = InflatedRing(radial(SIZE), ALONG, 2, PRESSURE)
    answers = np.array([_of_wave(ring, wave) for wave in range(WAVES + 1)])
    rows = []
    for half in LONG:
        share = np.array([patch_share(wave, half) for wave in range(WAVES + 1)])
        static, *others = share @ answers
        ratios = [round(float(one / static), 3) for one in others]
        rows.append([round(float(np.degrees(2 * half))), round(1e9 * float(static), 1), *ratios])
    return [
        Table(
            f"Flexibility of a patch of the crown, {SIZE}, {PRESSURE / 1e3:.0f} kPa, rim held",
            [
                ("length", "deg"),
                ("static moduli", "nm/N"),
                ("modes", "of it"),
                *((f"waves at {speed:g} rad/s", "of it") for speed in SPEEDS),
            ],
            rows,
            [
                f"Patch {2e3 * WIDE:.0f} mm wide; modes to {UP_TO:g} Hz, each with the modulus of its own frequency, and the "
                "static response of all others with that of half the highest; waves: moduli at n times the wheel's "
                "frequency, without inertia"
            ],
        )
    ]


def _of_wave(ring: InflatedRing, wave: int) -> list[float]:
    """Flexibilities, m rad/N, of one wave: static moduli, modes, and moduli at the wave's frequency at each speed."""
    weights = ring.patch(0.0, WIDE)
    found = ring.modes(wave, weights)
    stored = np.array([np.diag(part).real for part in found.parts])
    own = found.squares + own_moduli(found.squares, stored, ring.kinds)[0]
    slow = found.squares + own_moduli(found.squares, stored, ring.kinds, UP_TO / 2)[0]
    squares = np.where(own <= (2 * np.pi * UP_TO) ** 2, own, slow)
    push = np.abs(found.push) ** 2
    rest = found.flexibility - (push / found.squares).sum()
    modes = (push / squares).sum() + rest * (found.squares[-1] / slow[-1])
    static = ring.flexibility(wave, weights, None).real
    passing = (wave * speed / (2 * np.pi) for speed in SPEEDS)
    return [static, float(modes), *(ring.flexibility(wave, weights, f).real for f in passing)]
