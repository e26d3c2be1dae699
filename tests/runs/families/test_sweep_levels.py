"""Levels of a sweep: averaged over seeds, in dB of the first, with how sure that is."""

import numpy as np
import pytest
from scipy import stats

from tireroad.contact.results import chance
from tireroad.contact.results.spectra import confidence
from tireroad.runs.report.levels import POWER, SOUND
from tireroad.runs.sweep.page import (
    TOTAL,
    Gathered,
    SweepColumn,
    _chosen,
    _lines,
    _page_figures,
    levels,
    write_page,
)

FORCE = "axle force z"
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


def captions(table: Gathered) -> list[str]:
    return [figure.caption for figure in _page_figures(table)]


def test_seeds_are_samples_of_one_road() -> None:
    """Mean power and its confidence, against scipy's interval of the mean; 3 dB more is 3 dB more."""
    level = np.vstack([LOUD, LOUD + 3.0])
    given = {"rotation.speed": (30.0,) * 4 + (60.0,) * 4, "road.seed": (1, 2, 3, 4) * 2}
    found = levels(table(given, level, None), FORCE)
    assert found.names == ("rotation.speed = 30.0", "rotation.speed = 60.0")
    assert found.seeds == (4, 4)
    power = 10 ** (LOUD / 10)
    np.testing.assert_allclose(found.level[0], 10 * np.log10(power.mean(axis=0)))
    # As of Gaussian noise whose power varies so, and by Student's t for four members.
    degrees = 2 * 4 * (power.mean(axis=0) / power.std(axis=0, ddof=1)) ** 2
    degrees *= (stats.norm.ppf(0.975) / stats.t.ppf(0.975, 3)) ** 2
    ends = [10 * np.log10(degrees / stats.chi2.ppf(q, degrees)) for q in (0.975, 0.025)]
    np.testing.assert_allclose(found.spread[0].T, ends)
    apart, sure, across = found.differences()
    np.testing.assert_allclose(apart[1], 3.0)
    assert np.isnan(sure).all() and np.isnan(found.chance).all()
    np.testing.assert_allclose(across[1, :, 1], np.hypot(*ends))


def test_bands_of_seeds_are_pooled_as_stretches_of_one_run_are() -> None:
    """Four members of 8 degrees of freedom each have 32, in level and bounds."""
    given = table({"road.seed": (1, 2, 3, 4)}, LOUD, None)
    degrees = [
        SweepColumn(f"degrees of freedom of the {column.name}", "-", np.full(4, 8.0))
        for column in given.columns
    ]
    full = Gathered(given.names, given.settings, (*given.columns, *degrees), ())
    found = levels(full, FORCE)
    np.testing.assert_allclose(found.chance[0], [confidence(np.array(32.0))] * 2)
    np.testing.assert_allclose(found.level[0], chance.pooled(LOUD))
    np.testing.assert_allclose(found.spread[0], chance.spread(LOUD, np.ones(2), 4 * np.ones(2)))
    assert any("mean power over all seeds" in text for text in captions(full))


def test_what_runs_tell_of_their_errors_adds_up() -> None:
    error = np.array([[0.3, np.nan], [0.4, np.nan]])
    found = levels(table({"static.load": (1.0, 2.0)}, LOUD[:2], error), FORCE)
    apart, sure, _ = found.differences()
    np.testing.assert_allclose(apart[1], LOUD[1] - LOUD[0])
    assert sure[1, 0] == pytest.approx(0.5) and np.isnan(sure[1, 1])


def test_a_member_without_results_is_left_out_of_the_mean() -> None:
    level = LOUD.copy()
    level[1] = np.nan
    found = levels(table({"road.seed": (1, 2, 3, 4)}, level, None), FORCE)
    kept = 10 ** (LOUD[[0, 2, 3]] / 10)
    np.testing.assert_allclose(found.level[0], 10 * np.log10(kept.mean(axis=0)))
    assert found.seeds == (3,)
    assert levels(Gathered(("a",), {}, (), ()), FORCE) is None


def test_the_caption_counts_the_seeds_that_have_levels() -> None:
    """It counted failed seeds too: "3 to 3 seeds" of a mean over two."""
    level = np.vstack([LOUD[:3], LOUD[:3] + 3.0, np.full((3, 2), np.nan)])
    given = {"damping.mass": (1,) * 3 + (2,) * 3 + (3,) * 3, "road.seed": (1, 2, 3) * 3}
    assert any("over 3 seeds" in text for text in captions(table(given, level, None)))
    level[1] = np.nan
    assert any("over 2 to 3 seeds" in text for text in captions(table(given, level, None)))


def test_the_page_draws_the_differences() -> None:
    shown = captions(table({"static.load": (1.0, 2.0, 3.0, 4.0)}, LOUD, None))
    assert any("difference from the first" in text for text in shown)


def test_sound_has_third_octaves_as_forces_have() -> None:
    """At every microphone and of the power; a band in the middle of a headline's name is none."""
    forces = table({"static.load": (1.0, 2.0, 3.0, 4.0)}, LOUD, None)
    names = f"{SOUND}cpx front", f"{SOUND}pass-by", POWER
    sound = [
        SweepColumn(f"{name}, {band} Hz", "dB re 1 pW", LOUD[:, k] + 60)
        for name in names
        for k, band in enumerate((100, 125))
    ]
    other = SweepColumn("contact: error of the history up to, 400 Hz", "%", LOUD[:, 0])
    full = Gathered(forces.names, forces.settings, (other, *forces.columns, *sound), ())
    shown = captions(full)
    for name in (FORCE, *names):
        assert f"Third octaves: {name}." in shown
        assert any(f"Third octaves: {name}, difference from the first" in text for text in shown)
        assert levels(full, name).bands == ("100 Hz", "125 Hz")
    assert len(shown) == 8


def test_lines_join_members_that_are_equal_in_all_other_keys() -> None:
    """A list of members that differ in two keys looked like the effect of one of them."""
    given = {
        "static.inflation": (2.2e5, 2.4e5, 2.0e5, 2.2e5, None),
        "road.kind": ("sine", "sine", "sine", "flat", "flat"),
        "contact.points": ("auto", "auto", "auto", {"dx": 0.01, "dy": 0.01}, "auto"),
    }
    level = np.vstack([LOUD, LOUD[:1]])
    members = table(given, level, None)
    values = np.array([2.2e5, 2.4e5, 2.0e5, 2.2e5, np.nan])
    assert _lines(members, "static.inflation", values) == [[2, 0, 1], [3]]


def test_what_was_given_is_no_result() -> None:
    """The load was drawn over the inflation, a flat line but for rounding."""
    rounded = SweepColumn("static: load", "N", np.array([4000.0, 4000.0 + 1e-9]))
    assert _chosen(Gathered(("a", "b"), {}, (rounded,), ())) == []


def test_members_without_bands_are_drawn_as_far_as_they_go(recwarn) -> None:
    """A short run has a level over all lines and no bands; the next is what others differ from."""
    level = LOUD.copy()
    level[0], level[2, 1] = np.nan, np.nan
    given = {"modal.count": (40, 40, 100, 100), "time.duration": (0.1, 0.5, 0.1, 0.5)}
    bands = table(given, level, None)
    total = SweepColumn(TOTAL, "dB re 1 N", np.array([35.3, 35.2, 35.4, np.nan]))
    full = Gathered(bands.names, given, (total, *bands.columns), ())
    apart, *_ = levels(full, FORCE).differences()
    np.testing.assert_allclose(apart[:, 0], [np.nan, 0.0, -2.0, -0.5])
    assert _chosen(full) == [total]
    shown = captions(full)
    assert any("first that has bands, m1, in dB" in text for text in shown)
    assert sum(TOTAL in text for text in shown) == 1 and not recwarn.list


def test_settings_are_shown_as_in_a_scene(tmp_path) -> None:
    """Tables and flags were Python's."""
    points = ({"dx": 0.005, "dy": 0.004}, "auto", True, None)
    page = write_page(table({"contact.points": points}, LOUD, None), tmp_path, "points", [])
    cells = page.read_text()
    for text in ("{ &#34;dx&#34; = 0.005, &#34;dy&#34; = 0.004 }", "auto", "true", "–"):
        assert f"<td>{text}</td>" in cells, text
