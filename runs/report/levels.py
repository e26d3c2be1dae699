"""Third-octave levels of a run, under the one name and unit that every page and table has for each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.results.spectra import SILENT, confidence, nominal
from tireroad.runs.results.reader import RunResults

Array = NDArray[np.float64]
AXES = ("x", "y", "z")
SOUND = "A-weighted sound pressure level at "  # a microphone
INTENSITY = "A-weighted sound intensity level at "  # an intensity probe
POWER = "sound power level"
# Of spectra.h5, by component: quantity, dataset, unit.
_FORCES = (
    ("axle force", "level", "dB re 1 N"),
    ("contact force", "contact_level", "dB re 1 N"),
    ("moment on the hub", "hub_moment_level", "dB re 1 N m"),
)


@dataclass(frozen=True)
class BandLevels:
    """Levels of one quantity: `name` and `unit`; `band` (b,) Hz, nominal; `level` (b,) dB, its estimated numerical
    `error` (b,) dB, and the `freedom` (b,), degrees of freedom of its lines, by which it is off by chance; NaN where there is
    none or it is unknown.
    """

    name: str
    unit: str
    band: Array
    level: Array
    error: Array
    freedom: Array

    @property
    def chance(self) -> Array:
        """Bounds (b, 2) dB of the level of the road's process, 95 %, to be added to `level`."""
        return confidence(self.freedom)


def is_drawn(name: str) -> bool:
    """Whether the pages chart the third octaves of a quantity: vertical forces, and sound, of probes their intensity."""
    if name.startswith(SOUND):
        return not name.endswith((" inner", " outer"))
    return name in ("axle force z", "contact force z", POWER) or name.startswith(INTENSITY)


def rank(name: str) -> tuple[int, str]:
    """Sorts quantities as `band_levels` yields them: forces, moments, sound at microphones, intensity at probes, power."""
    for place, (quantity, *_) in enumerate(_FORCES):
        if name.startswith(f"{quantity} "):
            return place, name
    return len(_FORCES) + name.startswith(INTENSITY) + 2 * (name == POWER), name


def band_levels(run: RunResults) -> Iterator[BandLevels]:
    """All third octaves of a run: forces and moments by component, sound at each microphone, its power."""
    if "spectra/third_octave/centre" in run:
        band = nominal(run["spectra/third_octave/centre"])
        freedom = _known(run, "spectra/third_octave/freedom", band)
        for quantity, key, unit in _FORCES:
            path = f"spectra/third_octave/{key}"
            if path in run:
                level, error = run[path], _known(run, f"{path}_error", run[path])
                for axis, name in enumerate(AXES):
                    both = level[:, axis], error[:, axis]
                    yield _heard(f"{quantity} {name}", unit, band, *both, freedom)
    if "sound/third_octave/level_a" in run:
        band = nominal(run["sound/third_octave/centre"])
        level = run["sound/third_octave/level_a"]
        error = _known(run, "sound/third_octave/level_error", level)
        for k, name in enumerate(run.attributes("sound")["microphone_names"]):
            yield _heard(f"{SOUND}{name}", "dB(A) re 20 uPa", band, level[k], error[k])
        if "sound/third_octave/intensity_level_a" in run:
            probes = run.attributes("sound")["probe_names"]
            for name, column in zip(
                probes, run["sound/third_octave/intensity_level_a"], strict=True
            ):
                unknown = np.full_like(column, np.nan)
                yield _heard(f"{INTENSITY}{name}", "dB(A) re 1 pW/m2", band, column, unknown)
        power = run["sound/power"]
        yield _heard(POWER, "dB re 1 pW", band, power, np.full_like(power, np.nan))


def _known(run: RunResults, path: str, level: Array) -> Array:
    return run[path] if path in run else np.full_like(level, np.nan)


def _heard(
    name: str, unit: str, band: Array, level: Array, error: Array, freedom: Array | None = None
) -> BandLevels:
    level = np.where(level > SILENT, level, np.nan)
    known = np.full_like(level, np.nan) if freedom is None else freedom
    error, known = (np.where(np.isfinite(level), one, np.nan) for one in (error, known))
    return BandLevels(name, unit, band, level, error, known)
