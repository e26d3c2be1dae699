"""Ratings of error indicators: good, fair or poor by two limits each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

GOOD, FAIR, POOR = "good", "fair", "poor"
PULL = "least contact force"  # of the static state: no point may pull


class Limits(NamedTuple):
    """The largest value that changes no figure of a report, and the largest usable one."""

    good: float
    fair: float


# By stage and by how an indicator's name begins; what follows says where, or up to which frequency.
# 1e-6 of an eigenvector is 1e-12 of its frequency; 1 % of the load is 1 % of the forces.
LIMITS: Mapping[str, Mapping[str, Limits]] = {
    "static": {
        "largest penetration": Limits(1e-9, 1e-6),
        "estimated error of the load": Limits(1.0, 3.0),
    },
    "modes": {
        "worst residual": Limits(1e-8, 1e-5),
        "orthonormality": Limits(1e-9, 1e-6),
    },
    "rotating": {
        "projected: worst residual": Limits(1e-8, 1e-5),
        "projected: worst left residual": Limits(1e-8, 1e-5),
        "projected: sum identity": Limits(1e-9, 1e-6),
        "projected: biorthogonality": Limits(1e-9, 1e-6),
        "worst residual": Limits(1e-8, 1e-5),
        "worst left residual": Limits(1e-8, 1e-5),
        "basis condition": Limits(1e4, 1e6),
        "states in the near-defective block": Limits(0.0, 10.0),
        "truncation error of the projected eigenvalues": Limits(0.05, 0.2),
    },
    "greens": {
        "estimated truncation error": Limits(0.05, 0.2),
        "share of the residual in the static flexibility": Limits(0.5, 1.0),
    },
    "contact": {
        "worst complementarity residual": Limits(1e-9, 1e-6),
        "largest penetration": Limits(1e-9, 1e-6),
    },
}


def verdict(stage: str, name: str, value: Any) -> str:
    """ "good", "fair" or "poor"; "" for a figure without a rating."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return ""
    if name == PULL:
        return GOOD if value >= 0 else POOR
    for begins, limits in LIMITS.get(stage, {}).items():
        if name.startswith(begins):
            return GOOD if value <= limits.good else FAIR if value <= limits.fair else POOR
    return ""
