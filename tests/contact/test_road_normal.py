"""Forces along the road's normal: their parts, the slopes of smoothed roads, and a tire on waves."""

import numpy as np
import pytest

import tireroad as tr
from tireroad.contact.roads.cell_mean import CellMean

Y = np.array([-0.02, 0.0, 0.01])
HALF = np.tile([0.005, 0.004], (3, 1))


class Given:
    """A road of any height, finely resolved, without an end."""

    spacing, end = 1e-3, np.inf

    def __init__(self, height) -> None:
        self.height = height


def test_slopes_of_a_plane_are_exact() -> None:
    mean = CellMean(Given(lambda x, y: 0.03 * x - 0.05 * y), Y, HALF)
    x = np.array([[0.1, 0.2, 0.3], [0.1033, 0.2033, 0.3033]])
    assert np.allclose(mean.slope(x, Y), [0.03, -0.05], rtol=1e-9)


def test_the_slope_along_is_the_derivative_of_the_smoothed_height() -> None:
    """Of that very function: what the road does to the tire must be what its slope pays for."""
    rough = np.random.default_rng(1)
    waves, phases = rough.uniform(20, 800, (40, 2)), rough.uniform(0, 2 * np.pi, 40)

    def height(x, y):
        return 1e-4 * sum(
            np.cos(k * x + q * y + p) for (k, q), p in zip(waves, phases, strict=True)
        )

    mean = CellMean(Given(height), Y, HALF)
    x, apart = 0.10013 + np.array([[0.0, 0.011, 0.0207]]), 1e-7
    found = mean.slope(x, Y)[..., 0]
    between = (mean.height(x + apart, Y) - mean.height(x - apart, Y)) / (2 * apart)
    assert np.abs(found - between).max() < 1e-6 * np.abs(found).max()


def test_the_slope_across_of_a_long_wave() -> None:
    """Smoothed as the height is: a wave of twenty widths is a derivative to 1 %."""
    k = 2 * np.pi / 0.16
    mean = CellMean(Given(lambda x, y: 1e-3 * np.sin(k * y + 0 * x)), Y, HALF)
    found = mean.slope(np.zeros((1, 3)), Y)[0, :, 1]
    assert np.allclose(found, 1e-3 * k * np.cos(k * Y), rtol=0.01)


@pytest.fixture(scope="module")
def rolling():
    tire = tr.torus(youngs_modulus=48e6, segments=16, elements_arc=6, order=1)
    static = tr.press(tire, inflation=2e5, load=300.0)
    return tr.roll(tr.modes(tire, static, count=12), tr.Turning(speed=50.0, damping=(500.0, 0.0)))


@pytest.mark.slow
@pytest.mark.parametrize("wavelength", [0.2, 1.0, 5.0])
def test_a_wave_pushes_the_tire_back_by_the_load_times_its_slope(rolling, wavelength) -> None:
    """The resultant of a low wave is -a k |P(k)| in amplitude, with P the Fourier transform of the
    static pressure: 4000 N on a wave of 2 mm and 1 m gives 50 N, less what the footprint smooths."""
    low = 1e-6
    road = tr.make_road(kind="sine", wavelength=wavelength, amplitude=low)
    run = tr.drive(rolling, road, duration=0.022, step=1e-4, spacing=0.008, friction=0.0)
    speed = 50.0 * rolling.standing.motions.static.rolling_radius()
    k = 2 * np.pi / wavelength
    patch = run.patch
    along = patch.points[:, 0] + speed * run.time[:, None]
    push = -(patch.force * low * k * np.cos(k * along)).sum(axis=1)
    found = run.horizontal.sum(axis=1)
    late = run.time > run.run_in
    assert late.sum() > 50
    assert np.abs(found[late, 0] - push[late]).max() < 0.01 * np.abs(push).max()
    assert np.abs(found[:, 1]).max() < 1e-6 * np.abs(push).max()
