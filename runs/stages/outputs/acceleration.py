"""Accelerations of the driven points."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from tireroad.runs.scene.outputs import OUTPUTS, Curves, Output

if TYPE_CHECKING:
    from tireroad.runs.stages.driven import Driven
    from tireroad.runs.stages.record import Record


@OUTPUTS.register("acceleration", "acceleration of the driven points, in scenes without [contact]")
class Acceleration(Output):
    in_contact: ClassVar[bool] = False

    def numbers(self, points: int) -> int:
        """Three components per point."""
        return 3 * points

    def curves(self, seen: Driven, record: Record) -> Curves:
        """a = C s^2 q + C s B f + C B df/dt + R d2f/dt2, (nt, k, 3) m/s2, of states q and forces f.

        The middle terms are the residuals of the rates; C B is zero for a complete set of states.
        """
        if seen.integration is None:
            return {}
        response = seen.response.resolved(seen.integration.step)
        velocity = response.rate()
        moved = seen.march(velocity.rate())
        moved += seen.force(1) @ velocity.residual.T + seen.force(2) @ response.residual.T
        return {"acceleration": (moved.reshape(len(moved), -1, 3), "m/s2")}
