"""Roll over a wavy road: contact force, axle force, third octaves.

Run it with `./tireroad python examples/rolling.py`.
"""

from __future__ import annotations

from small_tire import small_tire

import tireroad as tr


def main():
    """The history of 50 ms at 50 rad/s over waves of 0.1 m."""
    tire = small_tire()
    turning = tr.Turning(speed=50.0, damping=(500.0, 0.0))
    static = tr.press(tire, inflation=2e5, load=300.0, turning=turning)
    rolling = tr.roll(tr.modes(tire, static, count=40), turning)
    road = tr.make_road(kind="sine", amplitude=0.5e-3, wavelength=0.1)
    return tr.drive(rolling, road, duration=0.05)


if __name__ == "__main__":
    run = main()
    print(f"mean {run.total_force.mean():.1f} N, deviation {run.total_force.std():.1f} N")
    for centre, level in zip(*run.third_octaves(), strict=True):
        print(f"{centre:7.0f} Hz  {level[2]:6.1f} dB re 1 N")
