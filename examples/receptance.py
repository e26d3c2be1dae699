"""The receptance of the tread: displacement of the crown per newton, standing and rolling.

Run it with `./tireroad python examples/receptance.py`.
"""

from __future__ import annotations

import numpy as np
from small_tire import small_tire

import tireroad as tr

FREQUENCIES = np.arange(20.0, 201.0, 20.0)  # Hz


def main() -> dict[float, np.ndarray]:
    """|H_zz| (f,) in m/N at the lowest point of the crown, by speed in rad/s."""
    tire = small_tire()
    static = tr.press(tire, inflation=2e5, load=300.0)
    modes = tr.modes(tire, static, count=60)
    found = {}
    for speed in (0.0, 50.0):
        rolling = tr.roll(modes, tr.Turning(speed=speed, damping=(50.0, 0.0)))
        response = rolling.at([(0.0, 0.0)], residual="static")  # x, y, z of the lowest point
        found[speed] = np.abs(response.receptance(FREQUENCIES)[:, 2, 2])
    return found


if __name__ == "__main__":
    standing, rolling = main().values()
    for frequency, a, b in zip(FREQUENCIES, standing, rolling, strict=True):
        print(f"{frequency:5.0f} Hz  standing {1e6 * a:7.3f} µm/N  rolling {1e6 * b:7.3f} µm/N")
