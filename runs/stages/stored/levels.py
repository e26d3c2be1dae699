"""Levels and densities of all histories of a run: forces, moments, motion of chosen points."""

from __future__ import annotations

import h5py
import numpy as np

from tireroad.contact.results import spectra
from tireroad.contact.results.spectra import (
    FORCE,
    MOMENT,
    SILENT,
    VELOCITY,
    density,
    off_middle,
    third_octaves,
    total_level,
)
from tireroad.runs.files.store import put
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.stored.contact_file import ContactHistory

# name in `third_octave/`: name in `density/`, reference of the level, its unit, unit of the
# density, whether the rate is taken
_KINDS = {
    "level": ("axle_force", FORCE, "1 N", "N2/Hz", False),
    "contact_level": ("contact_force", FORCE, "1 N", "N2/Hz", False),
    "hub_moment_level": ("hub_moment", MOMENT, "1 N m", "N2 m2/Hz", False),
    "point_velocity_level": ("point_velocity", VELOCITY, "1 nm/s", "m2/s2/Hz", True),
}
WEIGHTED = "_a_weighted"
# dB by which the window may change the mean square of a force without a warning: an impact in the
# middle adds 4.26, a short rough record loses up to 5. A force that varies by less than this share
# needs none.
_LOWER, _HIGHER, _SLIGHT = -6.0, 4.0, 1e-6
_CONSTANT = "none: it does not vary", "-"
_ONE = {  # common to all
    "third_octave/centre": "Hz",
    "third_octave/nominal": "Hz",
    "third_octave/lines": "-",
    "third_octave/confidence": "dB",
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
        (f"density/{what}", per_hertz),
    )
}


def series(history: ContactHistory, start: int) -> dict[str, np.ndarray]:
    """The histories by level name from step `start` on: (n, d) in N, N m, and m for points."""
    found = {"contact_level": history.total_force, "level": history.axle_force}
    found |= {"hub_moment_level": history.wheel.get("hub_moment")}
    found |= {"point_velocity_level": history.driven}
    return {name: values[start:] for name, values in found.items() if values is not None}


def levels_of(history: ContactHistory, start: int, up_to: float) -> dict[str, np.ndarray]:
    """All entries of `UNITS` that the history provides, after the run-in and below `up_to` Hz.

    By their names in spectra.h5: levels (b, 3), for points (b, k, 3), dB of the rms; `…_a_weighted`
    with each line weighted; densities (f, 3) or (f, k, 3).
    """
    found: dict[str, np.ndarray] = {}
    for name, values in series(history, start).items():
        what, reference, _, _, rate = _KINDS[name]
        flat, shape = values.reshape(len(values), -1), values.shape[1:]
        for weighted, suffix in ((False, ""), (True, WEIGHTED)):
            centre, level = third_octaves(
                flat, history.step, up_to, reference=reference, rate=rate, weighted=weighted
            )
            found[f"third_octave/{name}{suffix}"] = level.reshape(-1, *shape)
        welch = density(flat, history.step, up_to, rate)
        found[f"density/{what}"] = welch.density.reshape(-1, *shape)
    spacing = 1 / (len(flat) * history.step)
    count = spectra.lines(centre, spacing)
    return found | {
        "third_octave/centre": centre,
        "third_octave/nominal": spectra.nominal(centre),
        "third_octave/lines": count,
        "third_octave/confidence": spectra.confidence(spectra.freedom(count)),
        "third_octave/too_narrow": spectra.too_narrow(spacing, up_to),
        "density/frequency": welch.frequency,
        "density/confidence": welch.confidence,
        "density/segment": np.array(welch.segment),
        "density/averages": np.array(welch.averages),
    }


def describe(
    record: Record,
    found: dict[str, np.ndarray],
    history: ContactHistory,
    start: int,
    up_to: float,
) -> None:
    """Record the bands of `levels_of`, the vertical totals, and what the window hides.

    Totals are over all lines below `up_to` Hz and do not depend on which bands have a level.
    """
    names = found["third_octave/nominal"]
    if len(names):
        record.headline["bands"] = (_named(names), "-")
    forces = series(history, start)
    for name, what in (("contact_level", "contact force"), ("level", "force on the axle")):
        if name not in forces or len(forces[name]) < 2:
            continue
        vertical = forces[name][:, 2:]
        for kind, letter in (("level", ""), ("A-weighted level", "(A)")):
            total = float(total_level(vertical, history.step, up_to, weighted=bool(letter))[0])
            record.headline[f"{kind} of the vertical {what}"] = (
                (total, f"dB{letter} re 1 N") if total > SILENT else _CONSTANT
            )
        _warn_of_window(record, vertical, what)
    narrow = spectra.nominal(found["third_octave/too_narrow"])
    if len(narrow):
        record.headline["bands left out, narrower than three lines"] = (_named(narrow), "-")


def _warn_of_window(record: Record, force: np.ndarray, what: str) -> None:
    """Warn where an impact near an end of the record, or in its middle, sets its level."""
    off = float(off_middle(force)[0])
    if not _LOWER < off < _HIGHER and force.std() > _SLIGHT * np.abs(force).max():
        where, change = ("near an end", "lower") if off < 0 else ("in the middle", "higher")
        record.warnings.append(
            f"most of what the {what} varies lies {where} of the record, where the Hann window of spectra and "
            f"levels makes them {abs(off):.2g} dB {change} than its mean square: such levels depend on when an "
            "impact happens (road.position, time.duration); compare runs with equal ones only"
        )


def _named(bands: np.ndarray) -> str:
    """The first and the last band in words."""
    return f"{bands[0]:g} to {bands[-1]:g} Hz" if len(bands) > 1 else f"{bands[0]:g} Hz"


def write(file: h5py.File, found: dict[str, np.ndarray]) -> None:
    """Write all datasets of `found`."""
    for name in UNITS:
        if name in found:
            put(file, name, found[name], UNITS[name])


def read(file: h5py.File) -> dict[str, np.ndarray]:
    """The same, read back."""
    return {name: file[name][()] for name in UNITS if name in file}
