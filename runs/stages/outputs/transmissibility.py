"""Force and moment on the held axle per force at driven points, by momentum and by a free rim."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.parameters import integer, number
from tireroad.greens.residuals import names
from tireroad.runs.scene.outputs import (
    MOST_FREQUENCIES,
    OUTPUTS,
    Curves,
    Output,
    Where,
    check_steps,
)
from tireroad.runs.scene.tables.scene import has_air

if TYPE_CHECKING:
    from tireroad.runs.scene.tables.scene import Scene
    from tireroad.runs.stages.response import Driven
    from tireroad.runs.stages.stage import Record

# Of the highest mode. For a tire of 48 MPa with 60, 120 and 250 modes (311, 448, 687 Hz) the two
# methods differ by 0.5, 0.25 and 0.2 % up to half of it, and by 40, 3 and 0.2 % up to 300 Hz.
LIMIT = 0.5
APART = 0.05  # largest distance of the two ways without a warning
FREQUENCY, MOMENTUM, FREE_RIM, MOMENT, FREE_RIM_MOMENT = (
    f"transmissibility/{name}"
    for name in ("frequency", "momentum", "free_rim", "moment", "free_rim_moment")
)


@OUTPUTS.register(
    "transmissibility",
    "force and moment on the held axle per force at each driven point, over frequency",
)
class Transmissibility(Output):
    to: float = number(300.0, "Hz", "highest frequency", least=1e-3, most=1e6)
    step: float = number(2.0, "Hz", "step between two frequencies", least=1e-4, most=1e6)
    free_rim: int = integer(
        0,
        "number of modes of the tire with a free rim, by which it is computed a second time; only without a road: under its load a free rim topples and has no modes; and only with viscous [damping]. 0: by momentum alone",
        least=0,
        most=100000,
    )

    def check(self, scene: Scene, path: tuple[str, ...], error: Where) -> None:
        """Check that an axle alone holds the tire, that a free rim has no air and no road, and the steps."""
        if scene.modes.rim == "free" or scene.axle.kind != "fixed":
            raise error(
                path, 'is the force on a held axle: take modal.rim = "fixed", axle.kind = "fixed"'
            )
        if not scene.modes.on_axle_alone:
            raise error(
                path,
                'is the force on an axle that carries all of it, and with modal.road = "held" the road carries part: take '
                '"forces"',
            )
        if self.free_rim:
            self._check_free_rim(scene, (*path, "free_rim"), error)
        check_steps(
            (*path, "step"), "frequencies", self.to, self.step, "Hz", error, most=MOST_FREQUENCIES
        )

    def _check_free_rim(self, scene: Scene, path: tuple[str, ...], error: Where) -> None:
        """Check what a tire with a free rim lacks: air, a road, and damping by loss factors."""
        if has_air(scene):
            raise error(path, "has no air in the tire: take 0, or take out [tire.cavity]")
        if scene.static.on_road:
            raise error(
                path,
                f"= {self.free_rim} needs a tire on no road: under dead forces of road and axle a free rim topples. Take "
                "0, by momentum alone, or take out what places the road in [static] (load, deflection, road_height)",
            )
        if scene.damping is None:
            raise error(
                path,
                f"= {self.free_rim} needs viscous damping: loss factors damp each mode at its own frequency, and those of "
                "a free rim are not those of a held one. Take 0, by momentum alone, or add [damping]",
            )

    def curves(self, seen: Driven, record: Record) -> Curves:
        """Transmissibilities (f, 3, k) of k driven points, from `step` to `to` Hz.

        Force of the tire on the axle per force, -, and moment about the axle's centre per force, m.
        From the momentum of the response's states and, if the scene asks for it, from modes of the
        tire with a free rim (greens.outputs); each checks the other. Collective.
        """
        from tireroad.greens.outputs import by_momentum

        frequency = self.step * np.arange(1, round(self.to / self.step) + 1)
        loads, _ = seen.points()
        total = loads.toarray().reshape(loads.shape[0], -1, 3).sum(axis=1).T
        with record.timing("transmissibility"):
            ratio = by_momentum(seen.response, total, frequency)
        peak = np.unravel_index(np.abs(ratio).argmax(), ratio.shape)
        record.headline["largest force on the axle per force"] = (float(np.abs(ratio[peak])), "-")
        record.headline["force on the axle is largest at"] = (float(frequency[peak[0]]), "Hz")
        curves: Curves = {FREQUENCY: (frequency, "Hz"), MOMENTUM: (ratio, "-")}
        moment = seen.moments(frequency)
        if moment is not None:
            curves[MOMENT] = moment, "m"
        highest = float(seen.modes.product.frequency[-1])
        if self.free_rim:
            with record.timing("free rim"):
                other, top = seen.by_free_rim(self.free_rim, frequency)
            highest = min(highest, top)
            force, turning = np.split(other, 2, axis=1)
            curves |= {FREE_RIM: (force, "-"), FREE_RIM_MOMENT: (turning, "m")}
            for what, values, by_momenta in (("force", force, ratio), ("moment", turning, moment)):
                if by_momenta is not None:
                    compare(record, f"axle {what}", apart(values, by_momenta), self.to)
        if self.to > LIMIT * highest:
            record.warnings.append(
                f"output.transmissibility goes to {self.to:g} Hz; beyond {LIMIT * highest:.4g} Hz, half the highest mode, "
                "it lacks the modes left out: take more of them (modal.count, output.transmissibility.free_rim)"
            )
        return curves


def compare(record: Record, what: str, off: float, to: float) -> None:
    """Record how far the two ways to the axle's force or moment differ up to `to` Hz."""
    record.indicators[f"{what} by the free rim off that by momentum up to {to:.4g} Hz"] = (off, "-")
    if off > APART:
        record.warnings.append(
            f"output.transmissibility: the {what} by the free rim is {100 * off:.2g} % off that by momentum up to {to:.4g} Hz; "
            "one of them is wrong by as much: take more modes (modal.count, output.transmissibility.free_rim), "
            f"greens.residual = {names(joins=True)}, or a lower output.transmissibility.to"
        )


def apart(left: np.ndarray, other: np.ndarray) -> float:
    """Relative distance of two transmissibilities, as root mean squares over all entries."""
    return float(np.linalg.norm(left - other) / np.linalg.norm(other))
