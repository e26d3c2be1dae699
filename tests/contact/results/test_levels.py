"""Levels and densities: Parseval, units, the standards' tables, and what a record is too short for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import trapezoid

from tireroad.contact.results import chance, spectra
from tireroad.contact.results.spectra import VELOCITY, density, third_octaves

STEP = 1e-4
TIME = STEP * np.arange(20000)
NAMES = [25, 31.5, 40, 50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630, 800, 1000, 1250]
# IEC 61672-1, table 3, at the exact centres of NAMES.
WEIGHTS = [-44.7, -39.4, -34.6, -30.2, -26.2, -22.5, -19.1, -16.1, -13.4, -10.9, -8.6, -6.6, -4.8]
WEIGHTS += [-3.2, -1.9, -0.8, 0.0, 0.6]
CENTRES = 1000.0 * 10.0 ** (np.arange(-16, 2) / 10)


def test_bands_are_named_as_in_the_standard() -> None:
    assert spectra.nominal(CENTRES) == pytest.approx(NAMES)
    assert spectra.nominal(np.array([87.0])) == 87.0, "no band, no other name"


def test_a_weighting_of_every_band_is_the_standards() -> None:
    np.testing.assert_allclose(spectra.a_weighting(CENTRES), WEIGHTS, atol=0.05)


def test_a_sine_has_its_level_weighted_and_not() -> None:
    """2 N at 100 Hz: rms sqrt(2) N, 3.01 dB re 1 N, and 19.1 less by A."""
    values = 2.0 * np.sin(2 * np.pi * 100 * TIME)[:, None]
    centre, level = third_octaves(values, STEP)
    band = np.argmin(np.abs(centre - 100))
    assert level[band, 0] == pytest.approx(3.01, abs=0.02)
    weighted = third_octaves(values, STEP, weighted=True)[1]
    assert weighted[band, 0] - level[band, 0] == pytest.approx(-19.1, abs=0.06)


def test_the_rate_of_a_displacement_is_a_velocity() -> None:
    """1 um at 200 Hz moves with 1.257 mm/s, rms 888.6 um/s: 119.0 dB re 1 nm/s."""
    values = 1e-6 * np.sin(2 * np.pi * 200 * TIME)[:, None]
    centre, level = third_octaves(values, STEP, reference=VELOCITY, rate=True)
    exact = 20 * np.log10(2 * np.pi * 200 * 1e-6 / np.sqrt(2) / 1e-9)
    assert level[np.argmin(np.abs(centre - 200)), 0] == pytest.approx(exact, abs=0.02)


@pytest.mark.parametrize("rate", [False, True])
def test_the_density_holds_the_variance(rate) -> None:
    """Parseval: the integral over frequency is the variance, of a velocity too."""
    rng = np.random.default_rng(2)
    smooth = np.convolve(rng.standard_normal(60_000), np.hanning(61), mode="valid")[:, None]
    found = density([smooth], STEP, rate=rate)
    exact = np.gradient(smooth[:, 0], STEP).var() if rate else smooth.var()
    assert trapezoid(found.density[:, 0], found.frequency) == pytest.approx(exact, rel=0.03)


def test_bands_and_density_of_white_noise_agree() -> None:
    """A band of a density G holds G times its width."""
    noise = np.random.default_rng(3).standard_normal((len(TIME), 1))
    centre, level = third_octaves(noise, STEP, 2000.0)
    band = np.argmin(np.abs(centre - 1000))
    width = centre[band] * (10**0.05 - 10**-0.05)
    found = density([noise], STEP)
    inside = np.abs(np.log10(found.frequency[1:] / centre[band])) < 0.05
    held = found.density[1:, 0][inside].mean() * width
    assert level[band, 0] == pytest.approx(10 * np.log10(held), abs=0.3)


def test_nothing_is_beyond_the_band_and_the_settings_are_told() -> None:
    found = density([np.random.default_rng(4).standard_normal((4500, 3))], STEP, 300.0)
    assert found.frequency[-1] <= 300.0
    assert (found.segment, found.averages) == (pytest.approx(0.1), 8)
    assert found.density.shape == (len(found.frequency), 3)
    longer = density([np.zeros((60_000, 1))], STEP)
    assert longer.segment == pytest.approx(0.5)
    assert longer.averages == 23


def test_a_record_of_one_value_has_a_density_of_one_line() -> None:
    assert density([np.ones((1, 3))], STEP).density.shape == (1, 3)


def test_confidence_covers_the_level_of_the_process() -> None:
    """Of 400 records of white noise, 95 % have the true level within the interval; of few lines and of many."""
    rng = np.random.default_rng(5)
    for band, spacing in ((100.0, 5.0), (500.0, 5.0)):
        low, high = spectra.confidence(chance.freedom(np.array([band]), spacing))[0]
        width = band * (10**0.05 - 10**-0.05)
        exact = 10 * np.log10(width / 2500.0)
        inside = 0
        for noise in rng.standard_normal((400, 1000, 1)):
            centre, level = third_octaves(noise, 2e-4)
            own = level[np.argmin(np.abs(centre - band)), 0]
            inside += own + low <= exact <= own + high
        assert 0.92 <= inside / 400 <= 0.98


def test_bands_of_fewer_than_three_lines_are_told() -> None:
    """Lines 13 Hz apart: 3 lines are 39 Hz, what a band has from 169 Hz on."""
    left_out = spectra.nominal(spectra.too_narrow(13.0, 258.0))
    assert left_out == pytest.approx([20, 25, 31.5, 40, 50, 63, 80, 100, 125, 160])
    centre, _ = spectra.band_sums(13.0 * np.arange(40), np.ones(40), 258.0)
    assert spectra.nominal(centre) == pytest.approx([200])
