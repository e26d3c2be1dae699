"""Report section about speeds: at which speed which part of the calculation, and which tire, ends."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

from tireroad.fem.errors import InputError
from tireroad.fem.sections.radial import size
from tireroad.runs.report.read import Absent, Results, Section, digits

_SHAPE = (
    "The rolling shape (stage static) has the moduli at rest and no losses. Where the wheel turns as fast as shear waves "
    "run in its rubber it has no steady shape any more, and the run says so; of the built-in 205/60 R15 between 145 and "
    "150 rad/s."
)
_WAVE = (
    "The critical speed is that of the undamped tire: from there a wave stands on the road. In the built-in tire it is a "
    "short shear wave of the sidewall's rubber, which losses damp within one or two lengths: a tire passes it, and its "
    "rolling resistance takes off later, at about its speed symbol (docs/radial-tire.md)."
)


def speeds(results: Results, stages: Mapping) -> Section | None:
    """Speeds at which model, tire or symbol end, of a run with a rolling tire; None for others. `stages` as in summary.json."""
    headline = stages.get("rotating", {}).get("headline") or {}
    critical = headline.get("critical speed", {}).get("value")
    radius = None
    with suppress(Absent, InputError):  # that file's own section reports the problem
        radius = results.attribute("static.h5", "rolling_radius")
    if not isinstance(critical, int | float) or not isinstance(radius, float):
        return None

    def told(speed: float) -> str:
        return f"{digits(speed)} rad/s, {digits(3.6 * speed * radius)} km/h"

    section = Section("What ends at which speed")
    own = headline.get("speed", {}).get("value")
    if isinstance(own, int | float):
        section.facts.append(("this run", told(own)))
    if critical < float("inf"):
        section.facts.append(("critical speed of the undamped tire", told(critical)))
        for key in ("standing wave at the critical speed", "bound on the critical speed"):
            if key in headline:
                section.facts.append((key, str(headline[key]["value"])))
    else:
        section.facts.append(("critical speed of the undamped tire", "none by these modes"))
    rated = _rated(results)
    if rated:
        section.facts.append((f"speed symbol {rated[0]}", told(rated[1] / radius)))
    section.notes = [_SHAPE, _WAVE]
    return section


def _rated(results: Results) -> tuple[str, float] | None:
    """Speed symbol and its speed (m/s), where the size of the tire gives it."""
    written = results.scene.get("tire", {}).get("size")
    try:
        own = size(written) if isinstance(written, str) else None
    except InputError:
        return None
    return (
        None if own is None or own.symbol is None or own.speed is None else (own.symbol, own.speed)
    )
