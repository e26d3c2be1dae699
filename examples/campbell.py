"""What the modes of a tire become as it turns faster: frequencies over speed, from one set of modes.

Run it with `./tireroad python examples/campbell.py`.
"""

from __future__ import annotations

import numpy as np
from small_tire import small_tire

import tireroad as tr

SPEEDS = np.arange(0.0, 101.0, 25.0)  # rad/s


def main() -> np.ndarray:
    """Frequencies (speeds, 6) of the lowest states, Hz, in the frame that does not turn."""
    tire = small_tire()
    static = tr.press(tire, inflation=2e5)
    modes = tr.modes(tire, static, count=30)
    rows = []
    for speed in SPEEDS:
        rolling = tr.roll(modes, tr.Turning(speed=speed, damping=(10.0, 0.0)))
        rows.append(np.sort(rolling.eigenvalue.imag[rolling.eigenvalue.imag > 0])[:6] / (2 * np.pi))
    return np.array(rows)


if __name__ == "__main__":
    for speed, row in zip(SPEEDS, main(), strict=True):
        print(f"{speed:5.0f} rad/s  " + "  ".join(f"{f:7.2f}" for f in row) + " Hz")
