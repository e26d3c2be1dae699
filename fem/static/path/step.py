"""Outcome of one equilibrium solve."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Step:
    """Outcome of one solve: `iterations` tangents, `residual` relative to the force scale."""

    converged: bool
    iterations: int
    residual: float
    reason: str
