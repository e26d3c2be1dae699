"""What the modes of a tire become as it turns faster: a Campbell diagram, from one set of modes.

Run it with `./tireroad python examples/campbell.py`.
"""

from __future__ import annotations

import numpy as np
from small_tire import small_tire

import tireroad as tr

SPEEDS = np.arange(0.0, 101.0, 25.0)  # rad/s


def main() -> dict[str, np.ndarray]:
    """Frequencies (speeds,) of the lowest branches by name, Hz, in the frame that does not turn."""
    tire = small_tire()
    static = tr.press(tire, inflation=2e5)
    modes = tr.modes(tire, static, count=30)
    turning = tr.Turning(speed=100.0, damping=(10.0, 0.0))
    lines = tr.campbell(modes, turning, speeds=SPEEDS, branches=6)
    return dict(zip(lines.name, lines.frequency.T, strict=True))


if __name__ == "__main__":
    print("rad/s  " + "".join(f"{speed:8.0f}" for speed in SPEEDS))
    for name, line in main().items():
        print(f"{name:6s} " + "".join(f"{f:8.2f}" for f in line) + " Hz")
