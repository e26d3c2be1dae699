"""A tread law of your own: springs that share their load with their neighbours.

A law is a dataclass with the influence of a force on one point upon another; the contact solver needs no
more. Registered by a decorator it is also known by name.

Run it with `./tireroad python examples/own_tread.py`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from small_tire import small_tire

import tireroad as tr
from tireroad.contact.tread.law import TreadLaw


@dataclass(frozen=True, kw_only=True)
class Pasternak(TreadLaw):
    """Springs of `stiffness` N/m3 under a membrane that spreads a force over `length` m."""

    stiffness: float = 2e8
    length: float = 4e-3

    def influence(self, farthest: float):
        """exp(-r / length) / (2 pi length^2 stiffness): what a force of 1 N does at a distance, m/N."""
        scale = 2 * np.pi * self.length**2 * self.stiffness

        def of(x, y, a, b):
            return np.exp(-np.hypot(x, y) / self.length) / scale

        return of


def main(tread: TreadLaw | None = None) -> tuple[float, float]:
    """Mean and deviation of the contact force over a wavy road, N."""
    tire = small_tire()
    turning = tr.Turning(speed=50.0, damping=(500.0, 0.0))
    static = tr.press(tire, inflation=2e5, load=300.0, turning=turning)
    rolling = tr.roll(tr.modes(tire, static, count=40), turning)
    road = tr.make_road(kind="sine", amplitude=0.3e-3, wavelength=0.1)
    run = tr.drive(rolling, road, duration=0.05, tread=tread or Pasternak(), spacing=(0.01, 0.01))
    return float(run.total_force.mean()), float(run.total_force.std())


if __name__ == "__main__":
    print("mean {:.1f} N, deviation {:.2f} N".format(*main()))
