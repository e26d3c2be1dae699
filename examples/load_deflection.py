"""Press a tire on the road: load over deflection, and the footprint.

Run it with `./tireroad python examples/load_deflection.py`.
"""

from __future__ import annotations

from small_tire import small_tire

import tireroad as tr


def main() -> list[tuple[float, float, float]]:
    """(deflection in mm, load in N, footprint length in mm) of a few deflections."""
    tire = small_tire()
    rows = []
    for deflection in (0.002, 0.004, 0.006):
        state = tr.press(tire, inflation=2e5, deflection=deflection)
        rows.append((1e3 * deflection, state.load, 1e3 * state.footprint().length))
    return rows


if __name__ == "__main__":
    for deflection, load, length in main():
        print(f"{deflection:5.1f} mm  {load:7.1f} N  footprint {length:5.1f} mm long")
