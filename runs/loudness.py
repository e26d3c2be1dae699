"""`tireroad.loudness`: how loud and how sharp a sound is to the ear, by the package mosqito."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from tireroad.fem.errors import InputError
from tireroad.runs.results.wave import LISTEN, joined

Array = NDArray[np.float64]

RATE = 48000  # Hz, of which ISO 532-1 has its filters
FIELDS = ("free", "diffuse")


@dataclass(frozen=True, kw_only=True)
class Loudness:
    """Loudness of k sounds.

    `total` (k,) sone, `specific` (k, b) sone/Bark at the critical-band rates `bark` (b,); `sharpness` (k,) acum.
    """

    total: Array
    specific: Array
    bark: Array
    sharpness: Array


def loudness(pressure: Array, rate: float, *, field: str = "free") -> Loudness:
    """Loudness of stationary sounds by Zwicker (ISO 532-1:2017, method 1) and sharpness (DIN 45692). Not collective.

    `pressure` (k, n) or (n,) Pa at `rate` Hz, as `signal` and `rate` of tireroad.listen; records shorter than 3 s are joined to
    themselves in overlap. `field`: sound from ahead ("free") or from everywhere ("diffuse"). The sound of a run
    ends where its band does, and so does its loudness; sharpness, which weights what is above 3 kHz, ranks tires in the same band only.
    InputError for what is no sound, and without mosqito (pip install "tireroad[loudness]").
    """
    try:
        from mosqito.sq_metrics import loudness_zwst, sharpness_din_from_loudness
    except ImportError as missing:
        raise InputError(
            f'loudness: the package mosqito is needed ({missing}): pip install mosqito, or "tireroad[loudness]"'
        ) from None
    heard = np.atleast_2d(np.asarray(pressure, float))
    if heard.ndim != 2 or not heard.size or not np.isfinite(heard).all():
        raise InputError(f"loudness: pressure has shape {np.shape(pressure)}: (k, n) Pa are needed")
    if not rate > 0 or field not in FIELDS:
        raise InputError(
            f"loudness: rate = {rate!r} Hz is above 0, field one of {', '.join(FIELDS)}"
        )
    least = round(LISTEN * rate)
    long = heard if heard.shape[1] >= least else joined(heard, least)
    ratio = Fraction(RATE / rate).limit_denominator(1000)
    fine = signal.resample_poly(long, ratio.numerator, ratio.denominator, axis=1)
    total, specific, bark = loudness_zwst(fine.T, RATE, field_type=field)
    found = np.reshape(total, -1), np.reshape(specific, (len(bark), -1))
    sharp = [
        float(np.squeeze(sharpness_din_from_loudness(one, each)))
        for one, each in zip(found[0], found[1].T, strict=True)
    ]
    return Loudness(total=found[0], specific=found[1].T, bark=bark, sharpness=np.array(sharp))
