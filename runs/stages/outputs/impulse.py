"""Impulse responses (Green's functions) between the driven points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tireroad.runs.scene.outputs import OUTPUTS, Curves, Output

if TYPE_CHECKING:
    from tireroad.runs.stages.response import Driven
    from tireroad.runs.stages.stage import Record


@OUTPUTS.register(
    "impulse",
    "impulse responses (Green's functions) between the driven points, over [time]; flexibility that responds at once is written beside them",
)
class Impulse(Output):
    def numbers(self, points: int) -> int:
        """One per pair of points."""
        return points**2

    def curves(self, seen: Driven, record: Record) -> Curves:
        """g (nt, k, k) along the forces, and the weight (k, k) of delta(t), where there is one.

        The receptance is the Fourier transform of both, as residual flexibility without states
        responds at the instant of the impulse.
        """
        if seen.time is None:
            return {}
        response = seen.response
        with record.timing("impulse responses"):
            curves: Curves = {"impulse": (seen.along(response.impulse(seen.time)), "m/(N s)")}
        if response.residual.any():
            curves["impulse_at_once"] = seen.along(response.residual[None])[0], "m/N"
        return curves
