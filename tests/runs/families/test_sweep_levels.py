"""Levels of a sweep: averaged over seeds, in dB of the first, with how sure that is."""

import numpy as np
import pytest
from scipy import stats

from tireroad.runs.sweep.page import (
    TOTAL,
    Gathered,
    SweepColumn,
    _chosen,
    _page_figures,
    levels,
    write_page,
)

LOUD = np.array([[0.0, 10.0], [1.0, 12.0], [-1.0, 11.0], [0.5, 10.5]])


def table(settings: dict, level: np.ndarray, error: np.ndarray | None) -> Gathered:
    """Of members with two bands."""
    bands = "100 Hz", "125 Hz"
    columns = [
        SweepColumn(f"axle force z, {band}", "dB re 1 N", level[:, k])
        for k, band in enumerate(bands)
    ]
    if error is not None:
        columns += [
            SweepColumn(f"error of the axle force z, {band}", "dB", error[:, k])
            for k, band in enumerate(bands)
        ]
    names = tuple(f"m{k}" for k in range(len(level)))
    return Gathered(names, settings, tuple(columns), ())


def test_seeds_are_samples_of_one_road() -> None:
    """Mean power and its confidence, against scipy's interval of the mean; 3 dB more is 3 dB more."""
    level = np.vstack([LOUD, LOUD + 3.0])
    given = {"rotation.speed": (30.0,) * 4 + (60.0,) * 4, "road.seed": (1, 2, 3, 4) * 2}
    found = levels(table(given, level, None))
    assert found.names == ("rotation.speed = 30.0", "rotation.speed = 60.0")
    assert found.seeds == (4, 4)
    power = 10 ** (LOUD / 10)
    np.testing.assert_allclose(found.level[0], 10 * np.log10(power.mean(axis=0)))
    top = stats.t.interval(0.95, 3, power.mean(axis=0), stats.sem(power, axis=0))[1]
    np.testing.assert_allclose(found.level[0] + found.error[0], 10 * np.log10(top))
    apart, sure = found.differences()
    np.testing.assert_allclose(apart[1], 3.0)
    np.testing.assert_allclose(sure[1], np.sqrt(2) * found.error[0])


def test_what_runs_tell_of_their_errors_adds_up() -> None:
    error = np.array([[0.3, np.nan], [0.4, np.nan]])
    found = levels(table({"static.load": (1.0, 2.0)}, LOUD[:2], error))
    apart, sure = found.differences()
    np.testing.assert_allclose(apart[1], LOUD[1] - LOUD[0])
    assert sure[1, 0] == pytest.approx(0.5) and np.isnan(sure[1, 1])


def test_a_member_without_results_is_left_out_of_the_mean() -> None:
    level = LOUD.copy()
    level[1] = np.nan
    found = levels(table({"road.seed": (1, 2, 3, 4)}, level, None))
    kept = 10 ** (LOUD[[0, 2, 3]] / 10)
    np.testing.assert_allclose(found.level[0], 10 * np.log10(kept.mean(axis=0)))
    assert found.seeds == (3,)
    assert levels(Gathered(("a",), {}, (), ())) is None


def test_the_caption_counts_the_seeds_that_have_levels() -> None:
    """It counted failed seeds too: "3 to 3 seeds" of a mean over two."""
    level = np.vstack([LOUD[:3], LOUD[:3] + 3.0, np.full((3, 2), np.nan)])
    given = {"damping.mass": (1,) * 3 + (2,) * 3 + (3,) * 3, "road.seed": (1, 2, 3) * 3}
    assert any("over 3 seeds" in text for _, text in _page_figures(table(given, level, None)))
    level[1] = np.nan
    assert any("over 2 to 3 seeds" in text for _, text in _page_figures(table(given, level, None)))


def test_the_page_draws_the_differences() -> None:
    shown = _page_figures(table({"static.load": (1.0, 2.0, 3.0, 4.0)}, LOUD, None))
    assert any("difference from the first" in text for _, text in shown)


def test_members_without_bands_are_drawn_as_far_as_they_go(recwarn) -> None:
    """A short run has a level over all lines and no bands; the next is what others differ from."""
    level = LOUD.copy()
    level[0], level[2, 1] = np.nan, np.nan
    given = {"modal.count": (40, 40, 100, 100), "time.duration": (0.1, 0.5, 0.1, 0.5)}
    bands = table(given, level, None)
    total = SweepColumn(TOTAL, "dB re 1 N", np.array([35.3, 35.2, 35.4, np.nan]))
    full = Gathered(bands.names, given, (total, *bands.columns), ())
    apart, _ = levels(full).differences()
    np.testing.assert_allclose(apart[:, 0], [np.nan, 0.0, -2.0, -0.5])
    assert _chosen(full) == [total]
    shown = [text for _, text in _page_figures(full)]
    assert any("first that has bands, m1, in dB" in text for text in shown)
    assert sum(TOTAL in text for text in shown) == 1 and not recwarn.list


def test_settings_are_shown_as_in_a_scene(tmp_path) -> None:
    """Tables and flags were Python's."""
    points = ({"dx": 0.005, "dy": 0.004}, "auto", True, None)
    page = write_page(table({"contact.points": points}, LOUD, None), tmp_path, "points", [])
    cells = page.read_text()
    for text in ("{ &#34;dx&#34; = 0.005, &#34;dy&#34; = 0.004 }", "auto", "true", "–"):
        assert f"<td>{text}</td>" in cells, text
