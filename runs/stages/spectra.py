"""Stage spectra: contact and axle force over frequency."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from tireroad.contact.results.limits import Limit, lowest
from tireroad.contact.results.spectra import amplitudes, least_duration, lowest_wanted, nominal
from tireroad.contact.setup import ContactSetup
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.store import put
from tireroad.runs.process import observe
from tireroad.runs.stages.accuracy import Accuracy
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.base.stage import Computed, Done
from tireroad.runs.stages.build import corner
from tireroad.runs.stages.build.model_limit import all_limits
from tireroad.runs.stages.build.rolling.run_in import first_step, run_in
from tireroad.runs.stages.stored import levels
from tireroad.runs.stages.stored.contact_file import ContactHistory

_FEWEST = 32  # fewest steps for a meaningful spectrum

ROUNDING = 1e-12  # relative to the largest line: anything below is rounding


@dataclass(frozen=True, kw_only=True)
class Spectra:
    """Spectra of a run after its run-in, up to the model's frequency limit.

    `frequency` (f,) Hz; `contact_force` and, if stored, `axle_force` (f, 3) N: complex amplitudes;
    `left_out` s: the run-in; `limit`: where the model ends; `levels`: third octaves and densities
    by the names of runs.stages.stored.levels; `too_short`: what the reader is told of a run without
    its low bands, empty if it has them; `level_error` and `contact_level_error` (b, 3) dB:
    estimated errors of the third octaves of axle and contact force, NaN where unknown, None if not
    requested; `wheel`: hub moments and motions of a moving wheel, (f, 3) or (f, 1), by the names of
    runs.stages.build.corner.
    """

    frequency: np.ndarray
    contact_force: np.ndarray
    left_out: float
    limit: Limit
    levels: dict[str, np.ndarray]
    too_short: str = ""
    wheel: dict[str, np.ndarray] = field(default_factory=dict)
    axle_force: np.ndarray | None = None
    level_error: np.ndarray | None = None
    contact_level_error: np.ndarray | None = None


_UNITS = {
    "frequency": ("frequency", "Hz"),
    "contact_force": ("contact_force", "N"),
    "axle_force": ("axle_force", "N"),
    "level_error": ("third_octave/level_error", "dB"),
    "contact_level_error": ("third_octave/contact_level_error", "dB"),
}


@dataclass(frozen=True, kw_only=True)
class SpectraStage(Computed[Spectra]):
    """Spectra of the contact history after the run-in."""

    name: ClassVar[str] = "spectra"
    contact: Done[ContactHistory]
    setup: Done[ContactSetup]
    rotating: Done[RollingModes]
    accuracy: Done[Accuracy] | None = None

    def inputs(self) -> dict:
        """The contact forces, whose key covers modes and run-in length, and the error bars."""
        return {"contact": self.contact.key, "bars": self.accuracy.key if self.accuracy else None}

    def compute(self, record: Record) -> Spectra:
        """The spectra. Not collective."""
        history = self.contact.product
        start, step = self._after_run_in(record, history.time), history.step
        total = history.total_force[start:]
        if len(total) < _FEWEST:
            record.warnings.append(
                f"the spectra are of {len(total)} steps: lengthen time.duration to have any use of them"
            )
        record.headline["resolution"] = (1 / (len(total) * step), "Hz")
        if start:
            record.headline["left out as run-in"] = (start * step, "s")
        limit = self._limit(record, step)
        frequency, contact = amplitudes(total, step)
        below = frequency <= limit.frequency
        found = levels.levels_of(history, start, limit.frequency)
        levels.describe(record, found, history, start, limit.frequency)
        grows = run_in(self.setup.product, self.job.scene.road)
        short = too_short(found["third_octave/centre"], limit.frequency, grows)
        record.warnings += [short] if short else []
        axle = {}
        if history.axle_force is not None:
            force = history.axle_force[start:]
            amplitude = amplitudes(force, step)[1][below]
            axle["axle_force"] = amplitude
            _largest(record, frequency[below], amplitude)
        if self.accuracy is not None:
            bars, centre = self.accuracy.product, found["third_octave/centre"]
            axle["level_error"] = bars.levels("axle_force", centre)
            axle["contact_level_error"] = bars.levels("contact_force", centre)
        wheel = {
            name: amplitudes(values[start:].reshape(len(total), -1), step)[1][below]
            for name, values in history.wheel.items()
        }
        return Spectra(
            frequency=frequency[below],
            contact_force=contact[below],
            left_out=start * step,
            limit=limit,
            wheel=wheel,
            levels=found,
            too_short=short,
            **axle,
        )

    def _limit(self, record: Record, step: float) -> Limit:
        """The lowest frequency limit of the model, with its cause."""
        found = all_limits(self.setup.product, self.rotating.product, step)
        limit = lowest(found)
        record.headline["an answer up to"] = (limit.frequency, "Hz")
        record.headline["which is"] = (limit.cause, "-")
        others = ", ".join(
            f"{other.cause} would allow {other.frequency:.4g} Hz"
            for other in found
            if other != limit
        )
        observe.say(f"  spectra end at {limit.frequency:.4g} Hz, {limit.cause}; {others}")
        return limit

    def _after_run_in(self, record: Record, time: np.ndarray) -> int:
        """First step with the whole patch beyond the run-in.

        0, with a warning, if that would drop half the run or more: too little would be left to
        resolve.
        """
        setup, road = self.setup.product, self.job.scene.road
        start, needed = first_step(setup, road, time), run_in(setup, road)
        if start or not needed:
            return start
        record.warnings.append(
            f"the spectra hold the run-in: with the patch it takes {needed:.3g} s of the run's "
            f"{time[-1]:.3g} s, and half or more cannot be left out; take time.duration above "
            f"{2 * needed:.2g} s, or a shorter road.run_in"
        )
        return 0

    def write(self, file, product: Spectra) -> None:
        """All fields of the product."""
        for name, (stored, unit) in _UNITS.items():
            if getattr(product, name) is not None:
                put(file, stored, getattr(product, name), unit)
        for name, values in product.wheel.items():
            put(file, name, values, corner.UNITS[name])
        levels.write(file, product.levels)
        file.attrs["axle_force_is"] = (
            "force on the hub of a wheel that moves"
            if self.job.axle
            else "blocked force, wheel held"
        )
        file.attrs["left_out"] = product.left_out
        file.attrs["limit"] = product.limit.frequency
        file.attrs["limit_cause"] = product.limit.cause
        file.attrs["too_short"] = product.too_short

    def read(self, file) -> Spectra:
        """The same, read back."""
        kept = {name: file[stored][:] for name, (stored, _) in _UNITS.items() if stored in file}
        limit = Limit(float(file.attrs["limit"]), str(file.attrs["limit_cause"]))
        wheel = {name: file[name][:] for name in corner.UNITS if name in file}
        return Spectra(
            left_out=float(file.attrs["left_out"]),
            limit=limit,
            levels=levels.read(file),
            too_short=str(file.attrs["too_short"]),
            wheel=wheel,
            **kept,
        )


def too_short(centre: np.ndarray, up_to: float, grows: float) -> str:
    """What a run without its low third octaves is told; empty if it has them.

    `centre` (b,) Hz: the bands it has; `up_to` Hz: where the model ends; `grows` s: the run-in,
    which is left out of a run of more than twice its length only.
    """
    wanted = lowest_wanted(up_to)
    if not wanted or centre.min(initial=np.inf) < 1.05 * wanted:
        return ""
    needed = 1.01 * max(grows + least_duration(wanted), 2 * grows)
    has = f"none below {nominal(centre.min()):g} Hz" if len(centre) else "none"
    return (
        f"the run is too short for third octaves from {nominal(np.array(wanted)):g} Hz on, and has {has}: "
        f"take time.duration = {math.ceil(100 * needed) / 100:g} s"
    )


def _largest(record: Record, frequency: np.ndarray, axle: np.ndarray) -> None:
    """Record the largest line of the vertical axle force away from the mean, if there is any."""
    band = np.arange(min(3, len(frequency)), len(frequency))
    if np.abs(axle[band, 2]).max(initial=0.0) > ROUNDING * np.abs(axle[:, 2]).max(initial=0.0):
        peak = band[np.abs(axle[band, 2]).argmax()]
        record.headline["largest vertical axle force"] = (float(np.abs(axle[peak, 2])), "N")
        record.headline["at"] = (float(frequency[peak]), "Hz")
