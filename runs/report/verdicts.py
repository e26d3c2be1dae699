"""Rates error indicators: limits, and a word for the reader."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

# (part of the indicator's name, largest good value, largest usable value); the first match counts.
# At these limits a figure of the report would begin to change: 1e-6 of an eigenvector is 1e-12 of
# its frequency; 1 % of the load is 1 % of the forces.
LIMITS: tuple[tuple[str, float, float], ...] = (
    ("least contact force", 0.0, 0.0),  # no point may pull; see `verdict`
    ("largest penetration", 1e-9, 1e-6),
    ("estimated error of the load", 1.0, 3.0),
    ("residual in the static flexibility", 0.5, 1.0),
    ("worst complementarity residual", 1e-9, 1e-6),
    ("energy", inf, inf),  # in joules: rated by the other energy figures
    ("residual states", inf, inf),  # a count
    ("residual", 1e-8, 1e-5),
    ("orthonormality", 1e-9, 1e-6),
    ("identity", 1e-9, 1e-6),
    ("biorthogonality", 1e-9, 1e-6),
    ("basis condition", 1e4, 1e6),
    ("near-defective", 0.0, 10.0),
    ("truncation error", 0.05, 0.2),
)
GOOD, FAIR, POOR = "good", "fair", "poor"


def verdict(name: str, value: Any) -> str:
    """ "good", "fair", "poor", or "" for a figure without a rating."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return ""
    if name == "least contact force":
        return GOOD if value >= 0 else POOR
    for part, good, fair in LIMITS:
        if part in name:
            if good == inf:
                return ""
            return GOOD if value <= good else FAIR if value <= fair else POOR
    return ""


def verdicts(stages: Mapping[str, Mapping[str, Any]]) -> list[tuple[str, str, Any, str, str]]:
    """(stage, indicator, value, unit, verdict) of every indicator in a summary; poor ones first."""
    rows = [
        (stage, name, entry["value"], entry.get("unit", ""), verdict(name, entry["value"]))
        for stage, found in stages.items()
        for name, entry in (found.get("indicators") or {}).items()
    ]
    order = {POOR: 0, FAIR: 1, GOOD: 2, "": 3}
    return sorted(rows, key=lambda row: order[row[4]])
