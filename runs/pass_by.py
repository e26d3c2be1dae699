"""`tireroad.pass_by`: a vehicle's tires that pass a microphone at the roadside, of a finished run.

Each of four tires at its place moves along the road at the speed of the run and sends what a microphone
hears there through the air that the boundary elements give: the signals at microphones along the road, in
the frame of the tire, whose distances have been taken out, are blended as the tire passes, and delayed by
its distance at the moment they leave it. The Doppler shift follows from that delay. The tires have the record
of the same run, from moments that have nothing in common.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, signal

from tireroad.contact.results.spectra import a_weighting
from tireroad.fem.errors import InputError
from tireroad.greens.absorbing_road import PorousLayer
from tireroad.runs.files.disk import replacing
from tireroad.runs.listen import finished
from tireroad.runs.results.wave import joined, wave_file
from tireroad.runs.stages.sound import PRESSURE

Array = NDArray[np.float64]

FAST = 0.125  # s: time weighting F, IEC 61672-1
REACH = 25.0  # m along the road before and behind the microphone
WIDEST = 80.0  # deg from abreast: the last microphone
APART = 5.0  # deg between them: the sound of a tire varies over 30 deg and more
QUIET = 1e-30  # Pa2


@dataclass(frozen=True, kw_only=True)
class PassBy:
    """Sound of a vehicle's tires at the roadside.

    `time` (n,) s, 0 where the vehicle's middle is abreast; `pressure` (n,) Pa at `rate` Hz; `level` (n,)
    dB(A) re 20 uPa with time weighting F, and its `maximum`; `speed` m/s; `up_to` Hz: the end of the band.
    """

    time: Array
    pressure: Array
    level: Array
    maximum: float
    speed: float
    rate: float
    up_to: float

    def write(self, path: str | Path) -> float:
        """Write the pressure as a WAV file of 16 bits; returns the pressure (Pa) of its full scale."""
        data, full = wave_file(self.pressure, self.rate)
        with replacing(Path(path)) as part:
            part.write_bytes(data)
        return full


def pass_by(
    run: str | Path | Mapping[str, Any],
    *,
    side: float = 7.5,
    height: float = 1.2,
    wheelbase: float = 2.7,
    track: float = 1.5,
    temperature: float = 293.15,
    up_to: float | None = None,
    road: PorousLayer | Mapping[str, float] | None = None,
) -> PassBy:
    """Four tires of a finished run that pass a microphone, as in UN Regulation 117. Not collective.

    `side` m from the middle of the vehicle's path to the microphone, `height` m over the road; `wheelbase`
    and `track` m between the tires; the rest as in `listen`. The record of the run is joined to itself in
    overlap where the passage is longer. Left out: the car itself, what one tire hides of another, and the
    change of amplitude by motion, at most 0.6 dB ahead and behind. InputError for a tire that does not
    roll, and for a microphone nearer than 2 m to a tire.
    """
    near = side - track / 2
    if not (np.isfinite([side, height, wheelbase, track]).all() and near >= 2.0 and height >= 0):
        raise InputError(
            f"pass_by: side = {side:g} m leaves {near:g} m to the nearest tires, height = {height:g} m: at least 2 and 0 m"
        )
    if wheelbase < 0 or track < 0:
        raise InputError("pass_by: wheelbase and track are at least 0 m")
    beside = np.radians(np.arange(-WIDEST, WIDEST + APART / 2, APART))
    lines = sorted({near, side + track / 2})
    places = [(y * np.tan(angle), y, height) for y in lines for angle in beside]
    job, done = finished(run, places, temperature, up_to, road)
    rotation, state = job.scene.rotation, done["static"].product
    speed = job.speed * state.rolling_radius()
    if rotation is None or speed <= 0:
        raise InputError("pass_by: the tire of this run does not roll: give [rotation] a speed")
    heard, air = done["sound"].product, done["radiation"].product.near.air
    still = _undelayed(heard.signal, heard.rate, np.linalg.norm(places, axis=1) / air.speed)
    sent = dict(zip(lines, np.split(still, len(lines)), strict=True))
    time = np.arange(-REACH / speed, REACH / speed, 1 / heard.rate)
    tires = [(x, y) for x in (wheelbase / 2, -wheelbase / 2) for y in (near, side + track / 2)]
    period = heard.signal.shape[1]
    pressure = np.zeros(len(time))
    for number, (ahead, y) in enumerate(tires):
        moved = _Tire(sent[y], beside, y, height, round(number * period / len(tires)))
        pressure += moved.heard(time, ahead, speed, air.speed)
    level = _fast(pressure, heard.rate)
    abreast = np.abs(time) * speed <= REACH / 2
    return PassBy(
        time=time,
        pressure=pressure,
        level=level,
        maximum=float(level[abreast].max()),
        speed=float(speed),
        rate=heard.rate,
        up_to=float(heard.frequency[-1]),
    )


def _undelayed(given: Array, rate: float, delay: Array) -> Array:
    """Signals (k, n) without their `delay` (k,) s, of records that repeat."""
    lines = np.fft.rfft(given, axis=1)
    frequency = np.fft.rfftfreq(given.shape[1], 1 / rate)
    return np.fft.irfft(lines * np.exp(2j * np.pi * frequency * delay[:, None]), given.shape[1])


@dataclass(frozen=True)
class _Tire:
    """A tire's `signals` (k, n) at angles (k,) rad from abreast, `side` m away, from a sample `start` on."""

    signals: Array
    angles: Array
    side: float
    height: float
    start: int

    def heard(self, time: Array, ahead: float, speed: float, sound: float) -> Array:
        """Pressure (n,) Pa at the microphone: the tire is at `ahead` + `speed` t when it sends."""
        place = ahead + speed * time
        far = np.sqrt(place**2 + self.side**2 + self.height**2)
        # Where the microphone is for the tire, and between which of the signals; these times their distance.
        turn = np.clip(np.arctan2(-place, self.side), self.angles[0], self.angles[-1])
        away = np.hypot(self.side / np.cos(self.angles), self.height)
        share = interpolate.CubicSpline(self.angles, np.eye(len(self.angles)))(turn)
        long = joined(self.signals * away[:, None], len(time), self.start)
        sent = np.einsum("nk,kn->n", share, long) / far
        there = interpolate.CubicSpline(time + far / sound, sent, extrapolate=False)(time)
        return np.nan_to_num(there)  # nothing has arrived before the first


def _fast(pressure: Array, rate: float) -> Array:
    """A-weighted level (n,) dB(A) re 20 uPa with time weighting F of a pressure (n,) Pa at `rate` Hz."""
    lines, count = np.fft.rfft(pressure), len(pressure)
    frequency = np.fft.rfftfreq(count, 1 / rate)
    ears = np.zeros(len(frequency))
    ears[1:] = 10 ** (a_weighting(frequency[1:]) / 20)
    square = np.fft.irfft(lines * ears, count) ** 2
    keep = np.exp(-1 / (rate * FAST))
    mean = signal.lfilter([1 - keep], [1, -keep], square)
    return 10 * np.log10(np.maximum(mean, QUIET) / PRESSURE**2)
