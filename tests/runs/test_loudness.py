"""Loudness and sharpness: their definitions by mosqito where it is installed, what is handed to it in any case."""

from __future__ import annotations

import sys
from types import ModuleType

import numpy as np
import pytest

import tireroad

RATE = 8000.0
TIME = np.arange(4 * int(RATE)) / RATE


def tone(frequency: float, level: float, time: np.ndarray = TIME) -> np.ndarray:
    return 2e-5 * 10 ** (level / 20) * np.sqrt(2) * np.sin(2 * np.pi * frequency * time)


def narrow(level: float) -> np.ndarray:
    """Noise one critical band wide at 1 kHz."""
    lines = np.fft.rfft(np.random.default_rng(1).normal(size=len(TIME)))
    frequency = np.fft.rfftfreq(len(TIME), 1 / RATE)
    noise = np.fft.irfft(np.where(np.abs(frequency - 1000) < 80, lines, 0))
    return noise * 2e-5 * 10 ** (level / 20) / noise.std()


def test_loudness_is_that_of_its_definition() -> None:
    """1 kHz at 40 dB is 1 sone, 10 dB more are twice as loud; ISO 532-1 allows 5 % or 0.1 sone."""
    pytest.importorskip("mosqito")
    tones = np.stack([tone(1000.0, level) for level in (40.0, 50.0, 60.0)])
    found = tireroad.loudness(tones, RATE)
    assert found.total == pytest.approx([1.0, 2.0, 4.0], rel=0.05, abs=0.1)
    assert found.specific.shape == (3, len(found.bark))
    assert found.specific.sum(axis=1) * 0.1 == pytest.approx(found.total, rel=0.02)


def test_sharpness_is_that_of_its_definition() -> None:
    """Noise one critical band wide at 1 kHz and 60 dB is 1 acum (DIN 45692); lower bands are duller."""
    pytest.importorskip("mosqito")
    found = tireroad.loudness(np.stack([narrow(60.0), tone(250.0, 60.0)]), RATE)
    assert found.sharpness[0] == pytest.approx(1.0, abs=0.05)
    assert found.sharpness[1] < 0.6


def stand_in(monkeypatch: pytest.MonkeyPatch) -> list[tuple]:
    """A package in the place of mosqito, which notes what it is given and answers with mean squares."""
    given: list[tuple] = []

    def loudness_zwst(heard: np.ndarray, rate: float, field_type: str) -> tuple:
        given.append((heard, rate, field_type))
        total = (heard**2).mean(axis=0)
        alone = heard.shape[1] == 1
        specific = np.outer(np.arange(240.0), total)
        return (
            (total[0] if alone else total),
            (specific[:, 0] if alone else specific),
            np.arange(240.0),
        )

    metrics = ModuleType("mosqito.sq_metrics")
    metrics.loudness_zwst = loudness_zwst
    metrics.sharpness_din_from_loudness = lambda total, specific: [specific[1] / total]
    monkeypatch.setitem(sys.modules, "mosqito", ModuleType("mosqito"))
    monkeypatch.setitem(sys.modules, "mosqito.sq_metrics", metrics)
    return given


@pytest.mark.parametrize("rate", [8000.0, 16000.0, 48000.0, 96000.0])
def test_what_is_handed_on_has_the_rate_of_the_standard(
    monkeypatch: pytest.MonkeyPatch, rate: float
) -> None:
    given = stand_in(monkeypatch)
    time = np.arange(round(0.5 * rate)) / rate
    heard = np.stack([tone(500.0, 70.0, time), tone(500.0, 76.0, time)])
    found = tireroad.loudness(heard, rate, field="diffuse")
    signals, at, field = given[0]
    assert (at, field) == (48000, "diffuse")
    assert signals.shape == (3 * 48000, 2)  # joined to 3 s
    spectrum = np.abs(np.fft.rfft(signals[:, 0]))
    assert np.fft.rfftfreq(len(signals), 1 / 48000)[spectrum.argmax()] == pytest.approx(500, abs=1)
    assert found.total[1] / found.total[0] == pytest.approx(10**0.6, rel=1e-6)
    assert found.total[0] == pytest.approx(4e-10 * 10**7, rel=0.1)
    assert found.specific.shape == (2, 240) and found.sharpness == pytest.approx([1.0, 1.0])
    alone = tireroad.loudness(heard[0], rate, field="diffuse")
    assert alone.total == pytest.approx(found.total[:1])
    assert alone.specific.shape == (1, 240)


def test_it_says_what_to_install_and_refuses_what_is_no_sound(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "mosqito.sq_metrics", None)
    with pytest.raises(tireroad.InputError, match=r"pip install mosqito"):
        tireroad.loudness(TIME, RATE)
    stand_in(monkeypatch)
    with pytest.raises(tireroad.InputError, match=r"\(k, n\)"):
        tireroad.loudness(np.zeros((2, 2, 2)), RATE)
    with pytest.raises(tireroad.InputError, match=r"\(k, n\)"):
        tireroad.loudness(np.array([np.nan]), RATE)
    with pytest.raises(tireroad.InputError, match="rate"):
        tireroad.loudness(TIME, 0.0)
    with pytest.raises(tireroad.InputError, match="diffuse"):
        tireroad.loudness(TIME, RATE, field="near")
