"""Chance of pooled third octaves, against the distribution of levels of synthetic Gaussian records."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal, stats

from tireroad.contact.results import chance
from tireroad.contact.results.spectra import confidence, third_octaves

STEP, LENGTH, TRIALS = 1e-3, 400, 4000
SPACING = 1 / (STEP * LENGTH)
BANDS = [63.0957, 100.0, 199.526]  # Hz, of 5.8, 9.2 and 18.4 lines


def linear_contact(rng: np.random.Generator, count: int) -> np.ndarray:
    """Forces (count, TRIALS) of a damped oscillator at 150 Hz driven by white noise: a linear contact on a rough road."""
    damped, ring = 2 * np.pi * 60.0, 2 * np.pi * 150.0
    pole = np.exp((-damped + 1j * ring) * STEP)
    noise = rng.standard_normal((count + 200, TRIALS))
    return signal.lfilter([1.0], np.poly([pole, pole.conj()]).real, noise, axis=0)[200:]


def powers(records: list[np.ndarray]) -> np.ndarray:
    """Mean power (b, TRIALS) of all half-overlapping windows of the records in `BANDS`."""
    every = [w for record in records for w in chance.windows(record, LENGTH)]
    levels = []
    for window in every:
        centre, level = third_octaves(window, STEP)
        levels.append(level[[int(np.abs(centre - band).argmin()) for band in BANDS]])
    return 10 ** (chance.pooled(np.array(levels)) / 10)


@pytest.mark.parametrize("held", [(1,), (1, 1, 1), (6,), (1, 5, 5)])
def test_levels_of_a_linear_contact_spread_as_chi_square(held: tuple[int, ...]) -> None:
    """Power of 4000 roads over its mean has the variance, and 95 % of them the bounds, of nu / chi-square(nu)."""
    rng = np.random.default_rng(sum(held))
    power = powers([linear_contact(rng, chance.steps(count, LENGTH)) for count in held])
    degrees = chance.freedom(np.array(BANDS), SPACING, held)
    mean = power.mean(axis=1)
    # The variance of 4000 samples is known to 2.4 %, of a few degrees of freedom to 4 %.
    np.testing.assert_allclose(2 * mean**2 / power.var(axis=1), degrees, rtol=0.12)
    low, high = (10 ** (bound / 10) for bound in confidence(degrees).T)
    inside = (power.T * low <= mean) & (mean <= power.T * high)
    np.testing.assert_allclose(inside.mean(axis=0), 0.95, atol=0.012)
    for own, middle, nu in zip(power, mean, degrees, strict=True):
        assert stats.kstest(nu * own / middle, stats.chi2(nu).cdf).statistic < 0.025


def test_windows_that_overlap_know_more_than_those_side_by_side() -> None:
    """Of the same length of road: 11 windows in 6 lengths have 1.6 to 1.9 times the degrees of freedom of 6."""
    bands = np.array(BANDS)
    ratio = chance.freedom(bands, SPACING, (11,)) / chance.freedom(bands, SPACING, (1,) * 6)
    assert (ratio > 1.6).all() and (ratio < 1.9).all()
    assert chance.steps(11, LENGTH) == 6 * LENGTH
    assert len(chance.windows(np.zeros(chance.steps(11, LENGTH)), LENGTH)) == 11


@pytest.mark.parametrize("length", [1, 2, 7, 400])
@pytest.mark.parametrize("count", [1, 2, 9])
def test_a_record_has_as_many_windows_as_it_was_made_for(length: int, count: int) -> None:
    whole = chance.windows(np.arange(chance.steps(count, length)), length)
    assert len(whole) == count and {len(one) for one in whole} == {length}
    assert whole[-1][-1] == chance.steps(count, length) - 1


@pytest.mark.parametrize("wanted", [6.0, 3.0, 1.5, 1.0, 0.5])
def test_as_few_stretches_as_meet_what_is_asked(wanted: float) -> None:
    bands = np.array(BANDS)
    plan = chance.planned(bands, SPACING, wanted)
    left = chance.largest(chance.freedom(bands, SPACING, plan.all_windows))
    assert left <= wanted
    if plan.stretches:
        fewer = chance.StretchPlan(plan.stretches, plan.windows - 1).all_windows
        assert chance.largest(chance.freedom(bands, SPACING, fewer)) > wanted
    assert chance.planned(bands[:0], SPACING, wanted).stretches == 0


@pytest.mark.parametrize("bumps", [False, True])
def test_the_spread_covers_the_process_whatever_it_is(bumps: bool) -> None:
    """Of 4000 roads of three stretches 95 % lie within the bounds by their own spread, and 90 % with bumps on a tenth of the
    road, of which the bounds by lines hold for less than 80 %.
    """
    rng, held = np.random.default_rng(2), (1, 15, 15)
    bands = np.array(BANDS)
    degrees, level = chance.freedom(bands, SPACING, held), []
    for count in held:
        record = linear_contact(rng, chance.steps(count, LENGTH))
        if bumps:
            rough = rng.random((-(-len(record) // 100), TRIALS)) < 0.1
            record *= np.repeat(1.0 + 4.0 * rough, 100, axis=0)[: len(record)]
        for window in chance.windows(record, LENGTH):
            centre, found = third_octaves(window, STEP)
            level.append(found[[int(np.abs(centre - band).argmin()) for band in BANDS]])
    every, pooled = np.array(level), chance.pooled(np.array(level))
    true = 10 * np.log10(np.mean(10 ** (pooled / 10), axis=1))[:, None]

    def inside(bounds: np.ndarray) -> np.ndarray:
        within = (pooled + bounds[..., 0] <= true) & (true <= pooled + bounds[..., 1])
        return within.mean(axis=1)

    by_spread = inside(chance.spread(every, chance.freedom(bands, SPACING), degrees))
    by_lines = inside(confidence(degrees)[:, None, :])
    if bumps:
        assert (by_spread > 0.88).all() and (by_lines < 0.8).all()
    else:
        np.testing.assert_allclose(by_spread, 0.95, atol=0.03)
        np.testing.assert_allclose(by_lines, 0.95, atol=0.012)


def test_few_windows_and_silence_have_no_spread() -> None:
    degrees, level = np.full(3, 4.0), np.zeros((5, 3, 2))
    assert np.isnan(chance.spread(level[:1], degrees, degrees)).all()
    assert np.isnan(chance.spread(level, degrees, 5 * degrees)).all()
