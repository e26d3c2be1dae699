"""Impulse responses between the driven points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tireroad.runs.scene.outputs import OUTPUTS, Curves, Output

if TYPE_CHECKING:
    from tireroad.runs.stages.base.record import Record
    from tireroad.runs.stages.build.driven import Driven


@OUTPUTS.register(
    "impulse", "impulse responses (Green's functions) between the driven points, over [time]"
)
class Impulse(Output):
    def numbers(self, points: int) -> int:
        """One per pair of points."""
        return points**2

    def curves(self, seen: Driven, record: Record) -> Curves:
        """g (nt, k, k) along the forces, without the residual's delta function at t = 0."""
        if seen.time is None:
            return {}
        with record.timing("impulse responses"):
            return {"impulse": (seen.along(seen.response.impulse(seen.time)), "m/(N s)")}
