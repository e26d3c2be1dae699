"""Signals as WAV files to listen to, with a known full scale."""

from __future__ import annotations

from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from scipy.io import wavfile

_FULL = 32767  # of 16 bits


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
