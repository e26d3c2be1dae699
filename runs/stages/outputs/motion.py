"""Outputs of the driven points' motion: velocities, accelerations, impulse responses."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from tireroad.runs.scene.outputs import OUTPUTS, Curves, Output

if TYPE_CHECKING:
    from tireroad.runs.stages.response import Driven
    from tireroad.runs.stages.stage import Record


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
            found: Curves = {"impulse": (seen.along(response.impulse(seen.time)), "m/(N s)")}
        if response.residual.any():
            found["impulse_at_once"] = seen.along(response.residual[None])[0], "m/N"
        return found
