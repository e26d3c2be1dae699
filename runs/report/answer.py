"""Summary of a run: load, footprint, forces and levels with errors, first modes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from tireroad.contact.results.spectra import SILENT, deviation, nominal
from tireroad.fem.errors import InputError
from tireroad.runs.files.read import Absent, Results
from tireroad.runs.report.quantities import bounded, digits, quantity

Fact = tuple[str, str]
_MODES = 4
_SPREAD = "error of the deviation of the"


def answer(results: Results, stages: Mapping[str, Any]) -> list[Fact]:
    """Facts (what, value) from the result files and the summary's `stages`, as far as available."""
    found: list[Fact] = []
    for part in (_standing, _rolling, _levels, _power, _modes):
        try:
            found += part(results, _Headlines(stages))
        except (Absent, InputError, LookupError, ValueError):
            continue  # the file's own section reports the problem
    return found


class _Headlines:
    """Headline figures and indicators of the summary, by stage and name."""

    def __init__(self, stages: Mapping[str, Any]) -> None:
        self._stages = stages

    def __call__(self, stage: str, name: str) -> float | None:
        groups = [
            self._stages.get(stage, {}).get(kind) or {} for kind in ("headline", "indicators")
        ]
        value = (groups[0].get(name) or groups[1].get(name) or {}).get("value")
        return float(value) if isinstance(value, int | float) else None


Given = Callable[[str, str], float | None]


def _standing(results: Results, given: Given) -> list[Fact]:
    """Load, deflection and footprint."""
    load, sunk, length, width = (
        float(results.attribute("static.h5", name) or 0.0)
        for name in ("load", "deflection", "footprint_length", "footprint_width")
    )
    found: list[Fact] = []
    if load and results.optional("static.h5", "contact/force") is not None:
        error = given("static", "estimated error of the load")
        about = f" ± {quantity(float(f'{error:.2g}'), '%')}" if error else ""
        found.append(("load at rest", quantity(load, "N") + about))
        found.append(("deflection", quantity(sunk, "m")))
    if length and width:
        found.append(("footprint at rest", f"{digits(1e3 * length)} × {digits(1e3 * width)} mm"))
    return found


def _rolling(results: Results, given: Given) -> list[Fact]:
    """The vertical contact force while rolling, after the run-in as in the spectra.

    Errors are estimated on part of that time: that of the deviation as a share of it there.
    """
    step = float(results.attribute("contact.h5", "step") or 1.0)
    start = round((_of_spectra(results, "left_out") or 0.0) / step)
    force = results.array("contact.h5", "total_force")[start:, 2]
    if not len(force):
        return []
    end = _of_spectra(results, "limit")
    varies = float(deviation(force[:, None], step, float(end or np.inf))[0])
    error, spread = (
        given("accuracy", f"{what} contact force") for what in ("error of the mean", _SPREAD)
    )
    there = given("accuracy", "deviation of the contact force")
    off = spread / there * varies if spread and there else spread
    after = f" from {quantity(start * step, 's')} on" if start else ""
    what = "its standard deviation" + (f" up to {quantity(end, 'Hz')}" if end else "")
    return [
        (f"vertical force, rolling (mean{after})", bounded(float(force.mean()), error, "N")),
        (what, bounded(varies, off, "N")),
    ]


def _of_spectra(results: Results, name: str) -> Any:
    """`limit` of the model (Hz) or `left_out` (s) as run-in; None in a run without spectra."""
    try:
        return results.attribute("spectra.h5", name)
    except Absent:
        return None


def _levels(results: Results, _: Given) -> list[Fact]:
    """Levels summed over the bands, the upper bound of their errors, and their frequency limit."""
    end = results.attribute("spectra.h5", "limit")
    found = [("valid up to", quantity(end, "Hz"))] if end else []
    centre = results.array("spectra.h5", "third_octave/centre")
    if not len(centre):
        return found
    first, last = nominal(centre[[0, -1]])
    band = f"{first:g} to {last:g} Hz" if last > first else f"{first:g} Hz band"
    held = str(results.attribute("spectra.h5", "axle_force_is") or "")
    axle = "hub force" if held.startswith("force on the hub") else "blocked axle force"
    for key, what in (("level", axle), ("contact_level", "contact force")):
        level = results.optional("spectra.h5", f"third_octave/{key}")
        if level is None:
            continue
        fact = f"{what} z", "constant: no level"
        if level[:, 2].max() > SILENT:
            error = results.optional("spectra.h5", f"third_octave/{key}_error")
            text = f"{_summed(level, error)} dB re 1 N"
            weighted = results.optional("spectra.h5", f"third_octave/{key}_a_weighted")
            if weighted is not None:
                text += f", {_summed(weighted, None)} dB(A)"
            fact = f"{what} z, {band}", text
        found.insert(-1 if end else len(found), fact)
    return found


def _summed(level: np.ndarray, error: np.ndarray | None) -> str:
    power = 10 ** (level[:, 2] / 10)
    text = f"{10 * np.log10(max(power.sum(), 1e-300)):.1f}".replace("-", "−")
    if error is not None and np.isfinite(error[:, 2]).all():
        text += f" ± {(power * error[:, 2]).sum() / max(power.sum(), 1e-300):.1f}"
    return text


def _power(results: Results, _: Given) -> list[Fact]:
    """The equivalent radiated power: an upper bound of what the outer face radiates."""
    total = results.attribute("vibration.h5", "radiated_power_level_a_weighted")
    if total is None:
        return []
    return [("equivalent radiated power", f"{total:.1f} dB(A) re 1 pW")]


def _modes(results: Results, _: Given) -> list[Fact]:
    """The lowest undamped modes of the non-rotating tire."""
    lowest = results.array("modes.h5", "frequency")[:_MODES]
    named = ", ".join(f"{value:.4g}" for value in lowest)
    return [("lowest modes, undamped", f"{named} Hz")] if len(lowest) else []
