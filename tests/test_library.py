"""The library refuses what does not fit together in one message; its example shows a result."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tireroad as tr
from tireroad.fem.model import SmallMotions
from tireroad.runs.library import RollingTire

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parent.parent
TIRE = {"youngs_modulus": 48e6, "segments": 16, "elements_arc": 6, "order": 1}


@pytest.fixture(scope="module")
def tire():
    return tr.torus(**TIRE)


@pytest.fixture(scope="module")
def static(tire):
    return tr.press(tire, inflation=2e5, load=300.0)


@pytest.fixture(scope="module")
def rolling(tire, static) -> RollingTire:
    return tr.roll(tr.modes(tire, static, count=12), tr.Turning(speed=50.0, damping=(500.0, 0.0)))


@pytest.mark.parametrize(
    "wrong",
    [
        {"segments": 7},
        {"segments": 7.5},
        {"elements_arc": 1},
        {"elements_thickness": 21},
        {"footprint_size": 0.01},
        {"outer_radius": 320},
        {"half_angle": 0.1},
    ],
)
def test_a_torus_has_the_ranges_of_a_scene(wrong: dict) -> None:
    tr.torus(**TIRE | {"segments": np.int64(16), "half_angle": np.radians(175), "outer_radius": 1})
    with pytest.raises(tr.InputError, match=f"{next(iter(wrong))} must be"):
        tr.torus(**TIRE | wrong)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"segments": 18}, "it has .* nodes, and the tire"),
        ({"outer_radius": 0.33}, "its nodes lie elsewhere"),
        ({"youngs_modulus": 47e6}, "its tire is of other materials"),
    ],
)
def test_modes_refuse_the_state_of_another_tire(static, change: dict, why: str) -> None:
    with pytest.raises(tr.InputError, match=f"another tire .{why}"):
        tr.modes(tr.torus(**TIRE | change), static, count=4)


def test_modes_take_the_state_of_an_equal_tire(rolling, static) -> None:
    again = tr.modes(tr.torus(**TIRE), static, count=12)
    assert again.frequency == pytest.approx(rolling.standing.frequency, rel=1e-9)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"tread": "rubber"}, "tread = 'rubber' is no tread law.*HalfSpace"),
        ({"duration": float("nan")}, "duration = nan s must be positive and finite"),
        ({"duration": -1.0}, "duration = -1 s must be"),
        ({"step": 0.0}, "step = 0 s must be"),
        ({"step": float("inf")}, "step = inf s must be"),
        ({"spacing": 0.0}, "spacing = 0.0 must be"),
        ({"spacing": (0.01, 0.01, 0.01)}, "spacing = .* must be one length or two"),
        ({"spacing": "fine"}, "spacing = 'fine' must be"),
        ({"spacing": 5}, "spacing = 5 m .* less than two points in a footprint of 0.036"),
        ({"spacing": (0.01, 0.1)}, "across leaves less than two points.*take 0.005 m"),
        ({"residual": "statics"}, 'residual = "statics" is unknown: take none, .*static'),
    ],
)
def test_drive_says_what_it_does_not_take(rolling, given: dict, message: str) -> None:
    with pytest.raises(tr.InputError, match=message):
        tr.drive(rolling, tr.make_road(kind="flat"), **{"duration": 0.01} | given)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"road": "held"}, 'road = "held" fixes the nodes'),
        ({"rim": "free"}, 'rim = "free" leaves nothing'),
    ],
)
def test_drive_refuses_modes_that_cannot_carry_the_contact(
    rolling, tire, static, change: dict, why: str
) -> None:
    standing = replace(rolling.standing, motions=SmallMotions(tire, static, **change))
    with pytest.raises(tr.InputError, match=why):
        tr.drive(replace(rolling, standing=standing), tr.make_road(kind="flat"), duration=0.01)


def test_a_response_has_one_of_the_known_residuals(rolling) -> None:
    with pytest.raises(tr.InputError, match='residual = "x" is unknown: take none'):
        rolling.at([(0.0, 0.0)], residual="x")


def test_a_response_has_a_point(rolling) -> None:
    with pytest.raises(tr.InputError, match="at: no point given"):
        rolling.at([])


def test_a_torus_is_of_a_material() -> None:
    with pytest.raises(tr.InputError, match="material = 'rubber' is no material: take"):
        tr.torus(**TIRE, material="rubber")


def test_a_run_of_one_step_has_no_band(rolling) -> None:
    run = tr.drive(rolling, tr.make_road(kind="flat"), duration=1e-3, step=1e-3)
    assert run.time.tolist() == [1e-3] and run.step == 1e-3
    frequency, amplitude = run.spectrum()
    assert frequency.tolist() == [0.0] and not amplitude.any()
    centre, level = run.third_octaves()
    assert centre.shape == (0,) and level.shape == (0, 3)


def test_one_spacing_is_that_of_both_ways(rolling) -> None:
    road = tr.make_road(kind="sine", amplitude=2e-4)
    one, two = (
        tr.drive(rolling, road, duration=0.005, step=5e-4, spacing=spacing)
        for spacing in (0.01, (0.01, 0.01))
    )
    assert np.array_equal(one.force, two.force) and one.force.any()


def _example(page: str) -> str:
    text = (ROOT / page).read_text(encoding="utf-8")
    return re.findall(r"```python\n(import tireroad as tr\n.*?)```", text, re.DOTALL)[0]


def test_the_example_is_the_same_on_both_pages() -> None:
    assert _example("README.md") == _example("docs/how-to/library.md")


@pytest.mark.long
def test_the_example_shows_levels_of_what_the_road_does(capfd) -> None:
    """Of the road's passing frequency, 80 Hz, which lies in a band of its own."""
    exec(_example("README.md"), {})
    printed = capfd.readouterr().out
    assert printed.startswith("500 N, deviation ")
    levels = {int(hz): float(db) for hz, db in re.findall(r"(\d+) Hz: (-?[\d.]+) dB", printed)}
    assert len(levels) >= 2 and max(levels, key=levels.__getitem__) == 79
