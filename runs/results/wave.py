"""Signals as WAV files to listen to, with a known full scale."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from scipy.io import wavfile

FADE = 0.05  # of a record at each end
LISTEN = 3.0  # s: shorter records are joined to themselves
_FULL = 32767  # of 16 bits


def joined(signal: NDArray, count: int, start: int = 0) -> NDArray:
    """A signal (..., n) whose ends fade over `FADE` of it, joined to itself in overlap to `count` samples.

    From sample `start` on. The fades of one end and the other add up to 1, so that levels stay: two that
    have nothing in common lose 0.05 dB.
    """
    length = signal.shape[-1]
    step = max(length - round(FADE * length), 1)
    whole = np.zeros((*signal.shape[:-1], count))
    for first in range(-(start % step) - step, count, step):
        some = slice(max(first, 0), max(min(first + length, count), 0))
        whole[..., some] += signal[..., some.start - first :][..., : some.stop - some.start]
    return whole


def wave_file(signal: NDArray, rate: float) -> tuple[bytes, float]:
    """A WAV file of 16 bits of a signal (n,) Pa at `rate` Hz, and the pressure (Pa) of its full scale.

    The full scale is 1, 2 or 5 times a power of ten, so that levels can be calibrated by hand.
    """
    peak = float(np.abs(signal).max(initial=0.0)) or 1.0
    power = 10.0 ** np.floor(np.log10(peak))
    full = next(
        step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= peak * (1 - 1e-12)
    )
    stream = BytesIO()
    wavfile.write(stream, round(rate), np.rint(_FULL * signal / full).astype("<i2"))
    return stream.getvalue(), float(full)
