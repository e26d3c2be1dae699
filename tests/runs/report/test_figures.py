"""What the report draws and prints is what the numbers say."""

from base64 import b64decode
from io import BytesIO

import numpy as np
import pytest
from matplotlib import image
from synthetic_results import lattice

from tireroad.runs.report import figures, surface_figures
from tireroad.runs.report.ratings import LIMITS, verdict
from tireroad.runs.report.read import bounded, quantity


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
        ("230.6 / 461.2", "Hz", "230.6 / 461.2 Hz"),
        ("not estimated: too short", "-", "not estimated: too short"),
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
    x, drawn = figures.envelope(np.arange(y.size), y)
    assert drawn.size < 3 * figures.DRAWN
    assert (x[drawn.argmax()], x[drawn.argmin()]) == (12_345, 100_002)
    assert (np.diff(x) >= 0).all()


def test_a_spectrum_keeps_its_highest_line() -> None:
    frequency = np.arange(1.0, 50_001.0)
    level = np.full(frequency.size, -40.0)
    level[33_333] = 12.0
    drawn, kept = figures.peak_hold(frequency, level)
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
    middle = pixels[:, pixels.shape[1] // 3].sum(axis=1)
    dark = np.flatnonzero(middle < 1.0)
    assert dark.size and dark.max() < 0.3 * len(middle), "the foremost points are drawn on top"


@pytest.mark.parametrize("count", [1, 3, 12])
def test_bands_have_their_bars_at_their_names(count: int) -> None:
    """One band too: its bars stand over its name, as high as the level, and few lines are pale."""
    drawn = []
    centre = 200.0 * 10 ** (np.arange(count) / 10)
    level = np.column_stack([np.full(count, -3.0), np.arange(count) - 12.0, np.full(count, -3.4)])
    few = np.arange(count) == 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "encode", lambda figure, *_: drawn.append(figure) or "")
        figures.third_octaves(centre, level, np.full((count, 3), 0.5), "dB", few)
    axes = drawn[0].axes[0]
    names = [200, 250, 315, 400, 500, 630, 800, 1000, 1250, 1600, 2000, 2500]
    ticks = [
        (place, text.get_text())
        for place, text in zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
    ]
    assert ticks == [(place, str(name)) for place, name in enumerate(names[:count])]
    floor, _ = figures.level_range(level)
    for column, bars in enumerate(axes.containers[:: len(axes.containers) // 3][:3]):
        patches = bars.patches
        middles = [bar.get_x() + bar.get_width() / 2 for bar in patches]
        assert middles == pytest.approx(np.arange(count) + 0.28 * (column - 1))
        tops = [bar.get_y() + bar.get_height() for bar in patches]
        assert tops == pytest.approx(level[:, column]) and floor < min(tops)
        assert [bar.get_alpha() for bar in patches] == [0.45] + [None] * (count - 1)
    low, high = axes.get_xlim()
    assert low < -0.5 and count - 0.5 < high < count, "the axis spans the bands alone"


@pytest.mark.parametrize("levels", [[20.36], [20.1, 20.4, 23.0], [-3.0, -12.0]])
def test_bars_that_differ_little_do_not_look_as_if_they_differed_much(levels: list) -> None:
    floor, top = figures.level_range(np.array(levels))
    assert floor % 10 == 0 and floor <= top - 20 and floor <= min(levels) and top >= max(levels)


def test_an_indicator_is_rated_by_its_stage_and_name() -> None:
    assert verdict("modes", "worst residual", 1e-3) == "poor"
    assert verdict("modes", "worst residual", 1e-9) == "good"
    assert verdict("greens", "estimated truncation error up to 284.6 Hz, contact", 0.1) == "fair"
    assert verdict("static", "least contact force", -1e-9) == "poor"
    made_static = "residual states faster than 3 times the highest mode, made static"
    assert verdict("greens", made_static, 115) == ""
    assert verdict("contact", "energy left in the residual flexibility", 1.0) == ""


def test_no_two_ratings_apply_to_one_indicator() -> None:
    for limits in LIMITS.values():
        assert not [(a, b) for a in limits for b in limits if a != b and a.startswith(b)]


def test_an_error_has_the_unit_of_its_value() -> None:
    assert bounded(60.37, 0.6665, "N") == "60.37 ± 0.67 N"
    assert bounded(0.003752, 2.04e-5, "m") == "3.752 ± 0.02 mm"
    assert bounded(598.0, None, "N") == "598 N"
