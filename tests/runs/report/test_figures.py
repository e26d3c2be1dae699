"""What the report draws and prints is what the numbers say."""

from base64 import b64decode
from io import BytesIO

import numpy as np
import pytest
from matplotlib import image
from synthetic_results import lattice

from tireroad.runs.report import surface_figures, thinned
from tireroad.runs.report.quantities import quantity


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0123, "m", "12.3 mm"),
        (-0.309, "m", "−309 mm"),
        (2.0e5, "Pa", "200 kPa"),
        (12345.678, "N", "12.35 kN"),
        (9999.0, "N", "9\u202f999 N"),
        (2.5e-5, "s", "25 µs"),
        (14200.0, "Hz", "14.2 kHz"),
        (3.1e-12, "-", "3.1·10⁻¹²"),
        (0, "N", "0 N"),
        (True, "", "yes"),
        (None, "m", "–"),
        ([0.5, 2], "deg", "0.5 °, 2 °"),
        (float("nan"), "N", "nan N"),
        (float("inf"), "m", "inf m"),
    ],
)
def test_quantities(value: object, unit: str, text: str) -> None:
    assert quantity(value, unit) == text


def test_the_envelope_keeps_a_peak_of_one_sample() -> None:
    y = np.zeros(100_003)
    y[[12_345, 100_002]] = 5.0, -3.0
    x, drawn = thinned.envelope(np.arange(y.size), y)
    assert drawn.size < 3 * thinned.DRAWN
    assert (x[drawn.argmax()], x[drawn.argmin()]) == (12_345, 100_002)
    assert (np.diff(x) >= 0).all()


def test_a_spectrum_keeps_its_highest_line() -> None:
    frequency = np.arange(1.0, 50_001.0)
    level = np.full(frequency.size, -40.0)
    level[33_333] = 12.0
    drawn, kept = thinned.peak_hold(frequency, level)
    assert kept.max() == 12.0
    assert drawn[kept.argmax()] == pytest.approx(33_334.0, rel=0.03)


def test_a_cut_lies_in_its_plane_and_on_the_surface() -> None:
    points, quads = lattice(60, 21)
    ends, weight = surface_figures.cut(
        points, quads, points[:, 1] - 0.02, np.ones(len(quads), dtype=bool)
    )
    line = surface_figures.carry(points, ends, weight)
    assert len(line) == 60, "one ring: the arc ends above y = 0.087 m on the side of the beads"
    assert line[..., 1] == pytest.approx(0.02)
    section = np.hypot(np.hypot(line[..., 0], line[..., 2]) - 0.22, 0.02)
    assert section == pytest.approx(0.1, rel=0.02)


def test_normals_point_out_of_the_section() -> None:
    points, quads = lattice(60, 21)
    ring = points * (0.22 / np.hypot(points[:, 0], points[:, 2]))[:, None] * (1, 0, 1)
    exact = (points - ring) / 0.1
    assert np.einsum("si,si->s", surface_figures.outward(points, quads), exact).min() > 0.97
    turned = surface_figures.outward(points, quads[:, ::-1])
    assert np.einsum("si,si->s", turned, exact).min() > 0.97


def test_the_space_time_map_shows_where_the_force_is() -> None:
    points = np.zeros((40, 3))
    points[:, 0] = np.repeat(np.linspace(-0.05, 0.05, 10), 4)
    force = np.zeros((20, 40))
    force[:, points[:, 0] > 0.045] = 10.0
    picture = surface_figures.space_time(np.arange(20.0), points, force)
    pixels = image.imread(BytesIO(b64decode(picture.split(",")[1])))[..., :3]
    middle = pixels[:, pixels.shape[1] // 2].sum(axis=1)
    dark = np.flatnonzero(middle < 1.0)
    assert dark.size and dark.max() < 0.3 * len(middle), "the foremost points are drawn on top"
