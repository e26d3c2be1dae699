"""How one equilibrium solve ended."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Step:
    """How one equilibrium solve ended: `iterations` tangents, `residual` relative to the force scale."""

    converged: bool
    iterations: int
    residual: float
    reason: str
