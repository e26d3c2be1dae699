"""Receptances between the driven points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.parameters import integer, number
from tireroad.runs.scene.outputs import (
    MOST_FREQUENCIES,
    OUTPUTS,
    Curves,
    Output,
    Where,
    check_steps,
)

if TYPE_CHECKING:
    from tireroad.runs.scene.tables.scene import Scene
    from tireroad.runs.stages.response import Driven
    from tireroad.runs.stages.stage import Record


# Share of what modes lack in a receptance between half the highest frequency and the highest, above
# which a point's dent is told. On the tread of a radial tire (0.78 to 400 Hz) the receptance of a
# point is 12 % above that of a patch of 2 degrees.
_DENT = 0.5


@OUTPUTS.register("receptance", "receptances between the driven points")
class Receptance(Output):
    to: float = number(500.0, "Hz", "highest frequency", least=1e-3, most=1e6)
    step: float = number(2.0, "Hz", "step between two frequencies", least=1e-4, most=1e6)
    direct: int = integer(
        0, "number of frequencies also solved on the full matrices, as a check", least=0, most=1000
    )

    def check(self, scene: Scene, path: tuple[str, ...], error: Where) -> None:
        """Check the steps, and that the direct solution is possible where it is requested."""
        check_steps(
            (*path, "step"), "frequencies", self.to, self.step, "Hz", error, most=MOST_FREQUENCIES
        )
        rolls = scene.rotation is not None and scene.rotation.speed != 0
        if self.direct and rolls:
            self._check_rolling(scene, (*path, "direct"), error)
        if self.direct and scene.axle.kind != "fixed":
            raise error((*path, "direct"), "needs an [axle] that is fixed: take 0")

    def _check_rolling(self, scene: Scene, path: tuple[str, ...], error: Where) -> None:
        """Full matrices of a rolling tire need damping and stiffness that are the same everywhere."""
        if scene.damping is None:
            raise error(
                path,
                f"= {self.direct} needs full matrices of damping, and loss factors make none for a rolling tire: add "
                "[damping]",
            )
        if scene.tire.shape.varies(scene.tire):
            raise error(
                path,
                f"= {self.direct} needs moduli that do not depend on frequency in a rolling tire: set exponent = 0 in "
                "[[tire.region]]",
            )

    def frequencies(self) -> int:
        """Number of frequencies above 0."""
        return round(self.to / self.step)

    def curves(self, seen: Driven, record: Record) -> Curves:
        """Receptances H (f, k, k) m/N, each point along its own force. Collective."""
        frequency = np.arange(0.0, self.to + self.step / 2, self.step)
        if seen.drifts:
            frequency = frequency[1:]
        with record.timing("receptance"):
            along = seen.along(seen.response.receptance(frequency))
        peak = int(np.abs(along[:, 0, 0]).argmax())
        record.headline["largest receptance"] = (float(np.abs(along[peak, 0, 0])), "m/N")
        record.headline["frequency of the largest receptance"] = (float(frequency[peak]), "Hz")
        self._dents(seen, record, along)
        out = {"frequency": (frequency, "Hz"), "receptance": (along, "m/N")}
        return out | (self._by_full_matrices(seen, record) if self.direct else {})

    def _dents(self, seen: Driven, record: Record, along: np.ndarray) -> None:
        """Warn of point forces whose dent in the surface is much of their receptance (f, k, k)."""
        local = np.abs(seen.along(seen.response.residual[None])[0].diagonal())
        high = np.abs(along[len(along) // 2 :].diagonal(axis1=1, axis2=2))
        share = local / np.maximum(np.median(high, axis=0), np.finfo(float).tiny)
        for which, force in enumerate(seen.job.scene.force, 1):
            if not any(force.spread) and share[which - 1] > _DENT:
                record.warnings.append(
                    f"force {which} acts at a point, and above {self.to / 2:.4g} Hz {100 * share[which - 1]:.0f} % of "
                    "its receptance is local flexibility beyond the modes: the dent under a point depends on the "
                    "elements and has no limit. Give spread, the half widths of what presses there"
                )

    def _by_full_matrices(self, seen: Driven, record: Record) -> Curves:
        """The receptances from full matrices at a few frequencies; records the modal error."""
        frequency = self.to * np.arange(1, self.direct + 1) / self.direct
        loads, readings = seen.points()
        with record.timing("receptance of the full matrices"):
            full = seen.wheel.product.receptance(readings, loads, frequency)
        off = seen.response.receptance(frequency) - full
        share = np.linalg.norm(off, axis=(1, 2)) / np.linalg.norm(full, axis=(1, 2))
        name = f"receptance off the full matrices' up to {self.to:.4g} Hz"
        record.indicators[name] = (float(share.max()), "-")
        return {
            "direct/frequency": (frequency, "Hz"),
            "direct/receptance": (seen.along(full), "m/N"),
        }
