"""How stiff slow motions find a tire: static moduli, those of modes, and those of a wave that rests on a rolling tire.

A slow rise of the road is answered by the static flexibility of all modes. Each has the modulus of its own frequency,
and static shapes that of half the highest mode's: above that of a load that comes in seconds. In a rolling tire a
deformation of n waves that stands on the road passes the rubber n Omega / 2 pi times a second, which is what its
modulus is for. The loop has states that make up for it (greens.slow).
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from tireroad.fem.matrices.compliance import add_part, compliance
from tireroad.fem.sections.inflated import InflatedRing, patch_share
from tireroad.fem.sections.radial import radial
from tireroad.fem.tire.material import own_moduli
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.mobility import ALONG, PRESSURE, SIZE, Chain

ABOUT = "flexibility under slow loads: static moduli, those of the modes, those of a standing wave of a rolling tire, and the loop's"
UP_TO, WAVES = 1000.0, 60  # Hz, of the modes
KEPT = 400.0  # Hz, of those of three-dimensional elements
WIDE = 0.05  # m, half of the patch across: a footprint's
LONG = np.radians([2.0, 12.0])  # half of it around: a point of a footprint, and a footprint
SPEEDS = (20.0, 72.0)  # rad/s


def run() -> list[Table]:
    """Flexibility of two patches over that with static moduli, by Fourier series and in the loop."""
    ring = InflatedRing(radial(SIZE), ALONG, 2, PRESSURE)
    lowest = min(float(ring.frequencies(wave, 1)[0]) for wave in (0, 1))
    answers = np.array([_of_wave(ring, wave, lowest) for wave in range(WAVES + 1)])
    rows, resting = [], []
    for half in LONG:
        share = np.array([patch_share(wave, half) for wave in range(WAVES + 1)])
        static, *others = share @ answers
        ratios = [float(other / static) for other in others]
        rows.append(
            [round(float(np.degrees(2 * half))), round(1e9 * float(static), 1), *_rounded(ratios)]
        )
        resting.append([1.0, *ratios[1:]])
    title = f"Flexibility of a patch of the crown, {SIZE}, {PRESSURE / 1e3:.0f} kPa, rim held"
    waves = Table(
        title,
        [
            ("length", "deg"),
            ("static moduli", "nm/N"),
            ("modes", "of it"),
            *((f"waves at {speed:g} rad/s", "of it") for speed in SPEEDS),
        ],
        rows,
        [
            f"Patch {2e3 * WIDE:.0f} mm wide, Fourier series around; modes to {UP_TO:g} Hz, each with the modulus of its own "
            "frequency, and the static response of all others with that of half the highest; waves: moduli at n times the "
            "wheel's frequency, not below the static ones, which n = 0 has, with inertia"
        ],
    )
    return [waves, _in_loop(title, np.array(resting).T)]


def _rounded(values: list[float]) -> list[float]:
    return [round(value, 3) for value in values]


def _of_wave(ring: InflatedRing, wave: int, lowest: float) -> list[float]:
    """Flexibilities, m rad/N, of one wave: static moduli, modes, and moduli at the wave's frequency at each speed."""
    weights = ring.patch(0.0, WIDE)
    standing = ring.modes(wave, weights)
    stored = np.array([np.diag(part).real for part in standing.parts])
    own = standing.squares + own_moduli(standing.squares, stored, ring.kinds)[0]
    slow = standing.squares + own_moduli(standing.squares, stored, ring.kinds, UP_TO / 2)[0]
    squares = np.where(own <= (2 * np.pi * UP_TO) ** 2, own, slow)
    push = np.abs(standing.push) ** 2
    rest = standing.flexibility - (push / standing.squares).sum()
    modes = (push / squares).sum() + rest * (standing.squares[-1] / slow[-1])
    waves = (ring.resting(wave, weights, speed, lowest).real for speed in SPEEDS)
    return [ring.flexibility(wave, weights), float(modes), *waves]


def _in_loop(title: str, resting: np.ndarray) -> Table:
    """The same of three-dimensional elements as a loop has them; `resting` (speeds, patches) of the Fourier series."""
    chain, rows = Chain.whole(KEPT, max(SPEEDS)), []
    probes = sparse.csr_matrix([chain.patch(0.0, 0.0, (WIDE, half)) for half in LONG])
    static = _static(chain, probes)
    for speed, wanted in zip((0.0, *SPEEDS), resting, strict=True):
        response = chain.rolling(speed).respond(probes, probes)
        loop = np.diag(response.static() + response.residual) / static
        modes = np.diag(response.without_slow().static() + response.residual) / static
        for k, half in enumerate(LONG):
            ratios = [float(level) for level in (modes[k], loop[k], wanted[k])]
            off = 100 * (ratios[1] / ratios[2] - 1)
            rows.append(
                [speed, round(float(np.degrees(2 * half))), *_rounded(ratios), round(off, 2)]
            )
    return Table(
        f"{title}, in the loop",
        [
            ("speed", "rad/s"),
            ("length", "deg"),
            ("modes", "of static"),
            ("with slow rubber", "of static"),
            ("wanted", "of static"),
            ("off", "%"),
        ],
        rows,
        [
            f"Three-dimensional elements, modes to {KEPT:g} Hz with the static flexibility of all others, over their own "
            "flexibility with static moduli; wanted: 1 standing, the waves above rolling"
        ],
    )


def _static(chain: Chain, probes: sparse.csr_matrix) -> np.ndarray:
    """Flexibility (k,) m/N of each probe of the standing tire with static moduli: K of the static state."""
    operators = chain.standing.motions.operators
    stiffness = operators.stiffness.copy()
    for compound in operators.compounds():
        add_part(stiffness, compound.kind.static - 1, compound.stiffness)
    return np.diag(compliance(operators, stiffness, probes, probes))
