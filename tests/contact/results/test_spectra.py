"""Amplitudes and third-octave levels of signals whose spectra are known."""

import numpy as np
import pytest

from tireroad.contact.results.spectra import amplitudes, third_octaves

STEP = 1e-4
TIME = STEP * np.arange(20000)


def test_a_sine_on_a_line_shows_its_amplitude() -> None:
    values = np.stack([3.0 * np.cos(2 * np.pi * 50 * TIME) + 7.0, np.zeros(len(TIME))], axis=-1)
    frequency, amplitude = amplitudes(values, STEP)
    at = np.argmin(np.abs(frequency - 50.0))
    assert frequency[at] == pytest.approx(50.0)
    assert abs(amplitude[at, 0]) == pytest.approx(3.0, rel=1e-3)
    assert abs(amplitude[0, 0]) < 1e-6
    assert not amplitude[:, 1].any()


def test_a_sine_fills_its_band_alone() -> None:
    values = 2.0 * np.sin(2 * np.pi * 125.9 * TIME)[:, None]
    centre, level = third_octaves(values, STEP)
    band = np.argmin(np.abs(centre - 125.9))
    assert level[band, 0] == pytest.approx(10 * np.log10(2.0), abs=0.05)
    assert np.delete(level[:, 0], band).max() < level[band, 0] - 30


def test_bands_of_noise_sum_to_its_variance() -> None:
    noise = np.random.default_rng(1).standard_normal((len(TIME), 1))
    centre, level = third_octaves(noise, STEP)
    low, high = centre[0] * 10**-0.05, centre[-1] * 10**0.05
    total = (10 ** (level[:, 0] / 10)).sum()
    assert total == pytest.approx((high - low) / 5000.0, rel=0.03)
