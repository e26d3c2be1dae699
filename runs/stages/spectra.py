"""Stage spectra: levels and densities of contact force, axle force and motions over frequency."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import h5py
import numpy as np

from tireroad.contact.results import chance, spectra
from tireroad.contact.results.spectra import (
    FORCE,
    MOMENT,
    SILENT,
    VELOCITY,
    Limit,
    amplitudes,
    density,
    in_band,
    least_duration,
    lowest,
    lowest_wanted,
    nominal,
    off_middle,
    third_octaves,
    total_level,
)
from tireroad.contact.setup import ContactSetup
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.store import attribute, dataset, put, read_fields, write_fields
from tireroad.runs.process import console
from tireroad.runs.stages import corner
from tireroad.runs.stages.accuracy import Accuracy, all_limits
from tireroad.runs.stages.contact_file import ContactHistory
from tireroad.runs.stages.rolling import first_step, run_in
from tireroad.runs.stages.stage import UNKNOWN, Computed, Record, Result
from tireroad.runs.stages.stretches import Stretches

# name in `third_octave/`: name in `density/`, reference of the level, its unit, unit of the
# density, whether the rate is taken
_KINDS = {
    "level": ("axle_force", FORCE, "1 N", "N2/Hz", False),
    "contact_level": ("contact_force", FORCE, "1 N", "N2/Hz", False),
    "hub_moment_level": ("hub_moment", MOMENT, "1 N m", "N2 m2/Hz", False),
    "point_velocity_level": ("point_velocity", VELOCITY, "1 nm/s", "m2/s2/Hz", True),
}
WEIGHTED, SPREAD = "_a_weighted", "_spread"
_STRETCHED = {  # the same of further stretches, by their field in runs.stages.stretches.Stretches
    "level": "axle_force",
    "contact_level": "contact_force",
    "hub_moment_level": "hub_moment",
    "point_velocity_level": "driven",
}
# dB by which the window may change the mean square of a force without a warning: an impact in the
# middle adds 4.26, a short rough record loses up to 5. A force that varies by less than this share
# needs none.
_LOWER, _HIGHER, _SLIGHT = -6.0, 4.0, 1e-6
_CONSTANT = "none: it does not vary", "-"
_ONE = {  # common to all
    "third_octave/centre": "Hz",
    "third_octave/nominal": "Hz",
    "third_octave/lines": "-",
    "third_octave/freedom": "-",
    "third_octave/confidence": "dB",
    "third_octave/windows": "-",
    "third_octave/too_narrow": "Hz",
    "density/frequency": "Hz",
    "density/confidence": "dB",
    "density/segment": "s",
    "density/averages": "-",
}
UNITS = _ONE | {
    key: unit
    for name, (what, _, reference, per_hertz, _) in _KINDS.items()
    for key, unit in (
        (f"third_octave/{name}", f"dB re {reference}"),
        (f"third_octave/{name}{WEIGHTED}", f"dB(A) re {reference}"),
        (f"third_octave/{name}{SPREAD}", "dB"),
        (f"density/{what}", per_hertz),
    )
}
_FEWEST = 32  # fewest steps for a meaningful spectrum
ROUNDING = 1e-12  # relative to the largest line: anything below is rounding


def series(history: ContactHistory, start: int) -> dict[str, np.ndarray]:
    """The histories by level name from step `start` on: (n, d) in N, N m, and m for points."""
    histories = {"contact_level": history.total_force, "level": history.axle_force}
    histories |= {"hub_moment_level": history.wheel.get("hub_moment")}
    histories |= {"point_velocity_level": history.driven}
    return {name: values[start:] for name, values in histories.items() if values is not None}


def records_of(name: str, values: np.ndarray, further: Stretches | None) -> list[np.ndarray]:
    """The records (n, d) of a level: the run's own `values`, and those of further stretches."""
    more = [] if further is None else getattr(further, _STRETCHED[name])
    return [record.reshape(len(record), -1) for record in (values, *more)]


def levels_of(
    history: ContactHistory, start: int, up_to: float, further: Stretches | None = None
) -> dict[str, np.ndarray]:
    """All entries of `UNITS` that the history provides, after the run-in and below `up_to` Hz.

    By their names in spectra.h5: levels (b, 3), for points (b, k, 3), dB of the rms; `…_a_weighted`
    with each line weighted; `…_spread` (b, 3, 2); densities (f, 3) or (f, k, 3). Of the mean power of the run's own record and
    of the windows of `further` stretches.
    """
    levels: dict[str, np.ndarray] = {}
    held = further.held if further else (1,)
    for name, values in series(history, start).items():
        what, reference, _, _, rate = _KINDS[name]
        records, shape = records_of(name, values, further), values.shape[1:]
        for weighted, suffix in ((False, ""), (True, WEIGHTED)):
            every = [
                third_octaves(
                    window, history.step, up_to, reference=reference, rate=rate, weighted=weighted
                )
                for record in records
                for window in chance.windows(record, len(values))
            ]
            centre, level = every[0][0], np.array([one for _, one in every])
            levels[f"third_octave/{name}{suffix}"] = chance.pooled(level).reshape(-1, *shape)
            spacing = 1 / (len(values) * history.step)
            if not weighted:
                each, degrees = (chance.freedom(centre, spacing, h) for h in ((1,), held))
                if len(every) >= chance.LEAST_WINDOWS:
                    wide = chance.spread(level, each, degrees)
                    levels[f"third_octave/{name}{SPREAD}"] = wide.reshape(-1, *shape, 2)
        welch = density(records, history.step, up_to, rate)
        levels[f"density/{what}"] = welch.density.reshape(-1, *shape)
    return levels | {
        "third_octave/centre": centre,
        "third_octave/nominal": spectra.nominal(centre),
        "third_octave/lines": spectra.lines(centre, spacing),
        "third_octave/freedom": degrees,
        "third_octave/confidence": spectra.confidence(degrees),
        "third_octave/windows": np.array(held),
        "third_octave/too_narrow": spectra.too_narrow(spacing, up_to),
        "density/frequency": welch.frequency,
        "density/confidence": welch.confidence,
        "density/segment": np.array(welch.segment),
        "density/averages": np.array(welch.averages),
    }


def describe(
    record: Record,
    levels: dict[str, np.ndarray],
    history: ContactHistory,
    start: int,
    up_to: float,
    further: Stretches | None = None,
) -> None:
    """Record the bands of `levels_of`, the vertical totals, and what the window hides.

    Totals are over all lines below `up_to` Hz and do not depend on which bands have a level.
    """
    names = levels["third_octave/nominal"]
    if len(names):
        record.headline["bands"] = (_named(names), "-")
    forces = series(history, start)
    for name, what in (("contact_level", "contact force"), ("level", "force on the axle")):
        if name not in forces or len(forces[name]) < 2:
            continue
        vertical = forces[name][:, 2:]
        windows = [
            window[:, 2:]
            for record in records_of(name, forces[name], further)
            for window in chance.windows(record, len(vertical))
        ]
        for kind, letter in (("level", ""), ("A-weighted level", "(A)")):
            every = [
                total_level(window, history.step, up_to, weighted=bool(letter))
                for window in windows
            ]
            total = float(chance.pooled(np.array(every))[0])
            record.headline[f"{kind} of the vertical {what}"] = (
                (total, f"dB{letter} re 1 N") if total > SILENT else _CONSTANT
            )
        _warn_of_window(record, vertical, what)
    _describe_chance(record, levels)
    narrow = spectra.nominal(levels["third_octave/too_narrow"])
    if len(narrow):
        record.headline["bands left out, narrower than three lines"] = (_named(narrow), "-")


def _describe_chance(record: Record, levels: dict[str, np.ndarray]) -> None:
    """Record how far the lowest band of pooled stretches may be off by chance, by its lines and by the spread of the windows."""
    wide = levels.get(
        f"third_octave/level{SPREAD}", levels.get(f"third_octave/contact_level{SPREAD}")
    )
    names = levels["third_octave/nominal"]
    if wide is None or not len(names):
        return
    worst = int(np.abs(levels["third_octave/confidence"]).max(axis=1).argmax())
    name = f"third octave {names[worst]:g} Hz by chance, 95 %"
    by_lines, by_spread = levels["third_octave/confidence"][worst], wide[worst, 2]
    record.headline[f"{name}, at most"] = (float(np.abs(by_lines).max()), "dB")
    if np.isfinite(by_spread).all():
        record.headline[f"{name}, by the spread of {int(levels['third_octave/windows'].sum())} windows"] = (
            float(np.abs(by_spread).max()),
            "dB",
        )  # fmt: skip


def extremes(record: Record, history: ContactHistory, start: int, up_to: float) -> None:
    """Record the least and largest forces after the run-in, of what lies below `up_to` Hz."""
    forces = {"contact": history.total_force, "axle": history.axle_force}
    along = "longitudinal" if history.friction else "longitudinal (without friction)"
    for what, values in forces.items():
        if values is None or start == len(values):
            continue
        low = in_band(values, history.step, up_to)[start:]
        for axis, name in ((2, "vertical"), (0, along)):
            for how, found in (("least", low.min(axis=0)), ("largest", low.max(axis=0))):
                record.headline[f"{how} {name} {what} force"] = (float(found[axis]), "N")
                record.headline["error of the least and largest forces"] = (UNKNOWN, "-")


def _warn_of_window(record: Record, force: np.ndarray, what: str) -> None:
    """Warn where an impact near an end of the record, or in its middle, sets its level."""
    off = float(off_middle(force)[0])
    if not _LOWER < off < _HIGHER and force.std() > _SLIGHT * np.abs(force).max():
        where, change = ("near an end", "lower") if off < 0 else ("in the middle", "higher")
        record.warnings.append(
            f"most of the variance of the {what} is {where} of the record, where the Hann window of spectra and "
            f"levels makes them {abs(off):.2g} dB {change} than its mean square: such levels depend on when an "
            "impact happens (road.position, time.duration); compare runs with equal ones only"
        )


def _named(bands: np.ndarray) -> str:
    """The first and the last band in words."""
    return f"{bands[0]:g} to {bands[-1]:g} Hz" if len(bands) > 1 else f"{bands[0]:g} Hz"


def write(file: h5py.File, levels: dict[str, np.ndarray]) -> None:
    """Write all datasets of `levels`."""
    for name in UNITS:
        if name in levels:
            put(file, name, levels[name], UNITS[name])


def read(file: h5py.File) -> dict[str, np.ndarray]:
    """The same, read back."""
    return {name: file[name][()] for name in UNITS if name in file}


@dataclass(frozen=True, kw_only=True)
class Spectra:
    """Spectra of a run after its run-in, up to the model's frequency limit.

    `frequency` (f,) Hz; `contact_force` and, if stored, `axle_force` (f, 3) N: complex amplitudes;
    `left_out` s: the run-in; `limit`: where the model ends; `levels`: third octaves and densities
    by the names of `levels_of`; `too_short`: what the reader is told of a run without
    its low bands, empty if it has them; `level_error` and `contact_level_error` (b, 3) dB:
    estimated numerical errors of the third octaves of axle and contact force, NaN where unknown; `unknown_error`: which of them
    is, and why, empty if none; `wheel`: hub moments and motions of a moving wheel, (f, 3) or (f, 1), by the names of
    runs.stages.corner.
    """

    frequency: np.ndarray = dataset("Hz")
    contact_force: np.ndarray = dataset("N")
    left_out: float = attribute()
    limit: Limit
    levels: dict[str, np.ndarray]
    too_short: str = attribute(default="")
    unknown_error: str = attribute(default="")
    wheel: dict[str, np.ndarray] = field(default_factory=dict)
    axle_force: np.ndarray | None = dataset("N", default=None)
    level_error: np.ndarray | None = dataset("dB", "third_octave/level_error", default=None)
    contact_level_error: np.ndarray | None = dataset(
        "dB", "third_octave/contact_level_error", default=None
    )


@dataclass(frozen=True, kw_only=True)
class SpectraStage(Computed[Spectra]):
    """Spectra of the contact history after the run-in."""

    name: ClassVar[str] = "spectra"
    contact: Result[ContactHistory]
    setup: Result[ContactSetup]
    rotating: Result[RollingModes]
    accuracy: Result[Accuracy] | None = None
    stretches: Result[Stretches] | None = None

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
        further = self.stretches.product if self.stretches else None
        levels = levels_of(history, start, limit.frequency, further)
        describe(record, levels, history, start, limit.frequency, further)
        if not self.job.scene.road.surface.sampled:  # the levels of a shape are not by chance
            for name in ("freedom", "confidence"):
                del levels[f"third_octave/{name}"]
        extremes(record, history, start, limit.frequency)
        grows = run_in(self.setup.product, self.job.scene.road)
        short = too_short(levels["third_octave/centre"], limit.frequency, grows)
        record.warnings += [short] if short else []
        axle = {}
        if history.axle_force is not None:
            force = history.axle_force[start:]
            amplitude = amplitudes(force, step)[1][below]
            axle["axle_force"] = amplitude
            _largest(record, frequency[below], amplitude)
        unknown = self._unknown_error(levels["third_octave/centre"])
        if unknown:
            record.headline["numerical error of the third octaves"] = (unknown, "-")
        errors = {
            f"{key}_error": self._errors(force, levels[f"third_octave/{key}"], levels)
            for key, force in (("level", "axle_force"), ("contact_level", "contact_force"))
            if f"third_octave/{key}" in levels
        }
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
            levels=levels,
            too_short=short,
            unknown_error=unknown,
            **axle,
            **errors,
        )

    def _errors(self, force: str, level: np.ndarray, levels: dict[str, np.ndarray]) -> np.ndarray:
        """Estimated numerical errors (b, 3) dB of the third octaves of a force, NaN where unknown."""
        bars = self.accuracy.product if self.accuracy else None
        found = bars.levels(force, levels["third_octave/centre"]) if bars else None
        return np.full_like(level, np.nan) if found is None else found

    def _unknown_error(self, centre: np.ndarray) -> str:
        """Part of the numerical error of the third octaves that is unknown, and why; empty if none is."""
        if self.accuracy is None:
            return "unknown: accuracy.estimate is false"
        bars = self.accuracy.product
        if not bars.by_cause.get("contact_force"):
            return f"unknown: {', '.join(dict.fromkeys(bars.absent.values()))}"
        errors = bars.levels("contact_force", centre)
        if errors is None or not np.isfinite(errors).any():
            return f"unknown: its companions end after {bars.window:.3g} s, too short for third octaves"
        left_out = (f"by the {cause} ({reason})" for cause, reason in bars.absent.items())
        return ", ".join(("without the part", *left_out)) if bars.absent else ""

    def _limit(self, record: Record, step: float) -> Limit:
        """The lowest frequency limit of the model, with its cause."""
        limits = all_limits(self.setup.product, self.rotating.product, step)
        limit = lowest(limits)
        record.headline["valid up to"] = (limit.frequency, "Hz")
        record.headline["limited by"] = (limit.cause, "-")
        others = ", ".join(
            f"{other.cause} would allow {other.frequency:.4g} Hz"
            for other in limits
            if other != limit
        )
        console.say(f"  spectra end at {limit.frequency:.4g} Hz, {limit.cause}; {others}")
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
        write_fields(file, product)
        for name, values in product.wheel.items():
            put(file, name, values, corner.UNITS[name])
        write(file, product.levels)
        file.attrs["axle_force_is"] = (
            "force on the hub of a wheel that moves"
            if self.job.axle
            else "blocked force, wheel held"
        )
        file.attrs["limit"] = product.limit.frequency
        file.attrs["limit_cause"] = product.limit.cause

    def read(self, file) -> Spectra:
        """The same, read back."""
        limit = Limit(float(file.attrs["limit"]), str(file.attrs["limit_cause"]))
        wheel = {name: file[name][:] for name in corner.UNITS if name in file}
        fields = read_fields(file, Spectra)
        return Spectra(limit=limit, levels=read(file), wheel=wheel, **fields)


def too_short(centre: np.ndarray, up_to: float, grows: float) -> str:
    """The remark on a run without its low third octaves; empty if it has them.

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
        record.headline["largest line of the vertical axle force"] = (
            float(np.abs(axle[peak, 2])),
            "N",
        )
        record.headline["frequency of the largest line"] = (float(frequency[peak]), "Hz")
