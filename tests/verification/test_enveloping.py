"""A bar rolled over slowly, against the tandem of elliptical cams of the enveloping models.

Two cams, front and rear, |x/a|^c + |z/b|^c = 1, a share of the footprint's length apart, roll over the road; their mean
height and the slope between them are the effective plane (Schmeitz, A semi-empirical three-dimensional model of the
pneumatic tyre rolling over arbitrarily uneven road surfaces, Delft 2004; Pacejka, Tyre and Vehicle Dynamics). A held
axle then feels the load by the vertical stiffness at the effective height, along the normal of the effective plane.
The parameters are those of public tire files: 0.8, 1, 1, 1.8 and 0.83, 1.3, 1, 1.5.
"""

from pathlib import Path

import h5py
import numpy as np
import pytest
from started import ROOT

# N, N/m, m, m: 205/60 R15, its stiffness as published with its parameter set (MF-Swift)
LOAD, STIFFNESS, FOOTPRINT, RADIUS = 4000.0, 209.65e3, 0.119, 0.3135
SETS = {"passenger": (0.8, 1.0, 1.0, 1.8), "wide": (0.83, 1.3, 1.0, 1.5)}
SPEED = 3e-3  # m/s
WINDOW = 0.01  # m, over which forces are averaged: two points


def tandem(height: float, length: float, given: tuple[float, ...]) -> tuple[float, float]:
    """Largest vertical force beyond the load, and largest longitudinal force, N."""
    apart, along, up, order = given
    a, b, distance = along * RADIUS, up * RADIUS, apart * FOOTPRINT
    place, bar = np.linspace(-0.2, 0.2, 4001), np.linspace(0.0, length, 101)

    def cam(x: np.ndarray) -> np.ndarray:
        away = np.minimum(np.abs(x[:, None] - bar) / a, 1.0)
        rise = b * (1 - (1 - away**order) ** (1 / order))
        return np.maximum(height - rise, 0.0).max(axis=1)

    front, rear = cam(place + distance / 2), cam(place - distance / 2)
    vertical = STIFFNESS * (front + rear) / 2
    along_road = (LOAD + vertical) * (front - rear) / distance
    mean = np.ones(round(WINDOW / (place[1] - place[0])))
    vertical, along_road = (
        np.convolve(f, mean / len(mean), "same") for f in (vertical, along_road)
    )
    return float(vertical.max()), float(along_road.max())


@pytest.mark.long
@pytest.mark.parametrize(("height", "length"), [(0.01, 0.02), (0.015, 0.05)])
def test_a_bar_lifts_and_pushes_as_the_tandem_of_cams_does(
    height: float, length: float, tmp_path: Path, ran
) -> None:
    """Within the two sets' spread and 12 % vertically; the longitudinal force is up to 28 % below theirs."""
    road = f'{{kind="cleat",height={height},length={length},position=0.35}}'
    ran(
        ROOT / "runs/scenes/passenger.toml",
        tmp_path / "slow",
        *("--until", "contact", "--set", "accuracy.estimate=false"),
        *("--set", f"road={road}", "--set", "rotation.speed=0.00978"),
        *("--set", "time.duration=185.0", "--set", "time.step=0.1"),
        *("--set", "contact.points.dx=0.0025", "--set", "contact.points.dy=0.01"),
        # The cams belong to a wheel that turns as it likes; one that turns at a constant rate is held back by a
        # sticking road whose way over the bar is longer.
        *("--set", "contact.friction=0"),
    )
    with h5py.File(tmp_path / "slow" / "contact.h5") as file:
        force = file["axle_force"][:] - file["axle_force"][0]
        step = SPEED * float(file["time"][1] - file["time"][0])
    mean = np.ones(round(WINDOW / step))
    along, vertical = (np.convolve(force[:, k], mean / len(mean), "same") for k in (0, 2))
    known = np.array([tandem(height, length, given) for given in SETS.values()])
    assert 0.88 * known[:, 0].min() < vertical.max() < 1.12 * known[:, 0].max()
    for largest in (along.max(), -along.min()):
        assert 0.72 * known[:, 1].min() < largest < 1.12 * known[:, 1].max()
    assert along[vertical > 10.0][0] < 0.0 < along[vertical > 10.0][-1]  # back on the way up
