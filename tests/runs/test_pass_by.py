"""Pass-by: a moving source's Doppler shift and distance, records joined, time weighting F, refusals."""

from __future__ import annotations

import wave
from pathlib import Path

import numpy as np
import pytest

from tireroad.runs.pass_by import FAST, PassBy, _fast, _Tire, _undelayed
from tireroad.runs.results.wave import FADE, joined

RATE, SOUND, SPEED = 8000.0, 343.0, 22.0


def test_a_moving_tone_is_shifted_and_fades_with_distance() -> None:
    """p = s(t') / R(t') at t = t' + R(t') / c: f / (1 - M cos) as it comes, and as it goes."""
    angles = np.radians(np.arange(-80, 81, 5.0))
    side, height, tone = 6.75, 1.2, 200.0
    count = round(6.0 * RATE)
    still = np.sin(2 * np.pi * tone * np.arange(count) / RATE)
    away = np.hypot(side / np.cos(angles), height)
    time = np.arange(-0.9, 0.9, 1 / RATE)
    begin = count // 2  # far from its ends, which are joined
    tire = _Tire(still / away[:, None], angles, side, height, begin)
    found = tire.heard(time, 0.0, SPEED, SOUND)
    left = time[:, None] + np.linspace(-0.12, 0.0, 1201)  # when it was sent, by search
    arrival = left + np.hypot(np.hypot(SPEED * left, side), height) / SOUND
    sent = np.array([np.interp(t, a, e) for t, a, e in zip(time, arrival, left, strict=True)])
    some = sent > time[0] + 0.01
    far = np.sqrt((SPEED * sent) ** 2 + side**2 + height**2)
    exact = np.sin(2 * np.pi * tone * (sent - time[0] + begin / RATE)) / far
    assert np.abs(found - exact)[some].max() < 0.01 * np.abs(exact[some]).max()
    approach = found[(time > -0.6) & (time < -0.4)]
    crossings = np.flatnonzero(np.diff(np.signbit(approach)))
    frequency = (len(crossings) - 1) / 2 / ((crossings[-1] - crossings[0]) / RATE)
    cosine = SPEED * 0.5 / np.hypot(SPEED * 0.5, np.hypot(side, height))
    assert frequency == pytest.approx(tone / (1 - SPEED / SOUND * cosine), rel=0.005)


def test_a_record_goes_on_at_its_level() -> None:
    """Faded noise joined to seconds: its mean square to 0.1 dB, from any start, without a gap."""
    random = np.random.default_rng(1)
    count = 4000
    fade = np.ones(count)
    ends = round(FADE * count)
    rise = 0.5 * (1 - np.cos(np.pi * (np.arange(ends) + 0.5) / ends))
    fade[:ends], fade[-ends:] = rise, rise[::-1]
    noise = random.standard_normal(count)
    for start in (0, 1234, 3999, 12345):
        long = joined(noise * fade, 40000, start)
        assert 10 * np.log10((long**2).mean() / (noise**2).mean()) == pytest.approx(-0.054, abs=0.1)
        chunks = (long.reshape(-1, 100) ** 2).mean(axis=1)
        assert chunks.min() > 0.2
    one = joined(fade, 20000)[ends:]
    np.testing.assert_allclose(one, 1.0, atol=1e-9)


def test_level_with_time_weighting_f() -> None:
    """A tone of 1 kHz and 1 Pa: 91 dB(A) after 1 s, 1/e of the way after 125 ms, 34.7 dB a second down."""
    time = np.arange(0, 4, 1 / RATE)
    tone = np.where(time < 2, np.sin(2 * np.pi * 1000 * time), 0.0)
    level = _fast(tone, RATE)
    at = lambda t: level[round(t * RATE)]  # noqa: E731
    assert at(1.9) == pytest.approx(90.97, abs=0.05)
    assert at(FAST) - at(1.9) == pytest.approx(10 * np.log10(1 - np.exp(-1)), abs=0.1)
    assert at(2.2) - at(2.7) == pytest.approx(0.5 * 34.74, abs=0.1)


def test_delays_are_taken_out() -> None:
    random = np.random.default_rng(2)
    lines = np.fft.rfft(random.standard_normal(800))
    lines[250:] = 0
    sent = np.fft.irfft(lines, 800)
    wait = 0.0217
    late = np.fft.irfft(lines * np.exp(-2j * np.pi * np.fft.rfftfreq(800, 1 / RATE) * wait), 800)
    np.testing.assert_allclose(_undelayed(late[None], RATE, np.array([wait]))[0], sent, atol=1e-12)


def test_it_writes_what_is_heard(tmp_path: Path) -> None:
    time = np.arange(-0.1, 0.1, 1 / RATE)
    pressure = 0.03 * np.sin(2 * np.pi * 440 * time)
    given = PassBy(
        time=time,
        pressure=pressure,
        level=_fast(pressure, RATE),
        maximum=60.0,
        speed=SPEED,
        rate=RATE,
        up_to=1000.0,
    )
    full = given.write(tmp_path / "pass-by.wav")
    with wave.open(str(tmp_path / "pass-by.wav")) as file:
        samples = np.frombuffer(file.readframes(file.getnframes()), "<i2") * full / 32767
    np.testing.assert_allclose(samples, pressure, atol=full / 30000)
