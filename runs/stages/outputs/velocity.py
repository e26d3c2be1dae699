"""Velocities of the driven points."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from tireroad.runs.scene.outputs import OUTPUTS, Curves, Output

if TYPE_CHECKING:
    from tireroad.runs.stages.driven import Driven
    from tireroad.runs.stages.record import Record


@OUTPUTS.register("velocity", "velocity of the driven points, in scenes without [contact]")
class Velocity(Output):
    in_contact: ClassVar[bool] = False

    def numbers(self, points: int) -> int:
        """Three components per point."""
        return 3 * points

    def curves(self, seen: Driven, record: Record) -> Curves:
        """v = C s q + C B f + R df/dt, (nt, k, 3) m/s: states q, poles s, shapes C, residual R.

        C B, with the inputs B, is zero for a complete set of states.
        """
        if seen.integration is None:
            return {}
        response = seen.response.resolved(seen.integration.step)
        moved = seen.march(response.rate()) + seen.force(1) @ response.residual.T
        return {"velocity": (moved.reshape(len(moved), -1, 3), "m/s")}
