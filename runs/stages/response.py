"""Stage response: prescribed point forces in time and frequency, and the scene's outputs."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import numpy as np

from tireroad.fem.static.state import StaticState
from tireroad.greens.coupling import Wheel
from tireroad.greens.outputs import remaining
from tireroad.modal.basis import ModalBasis
from tireroad.runs.files.store import put
from tireroad.runs.process import observe
from tireroad.runs.scene.outputs import Curves
from tireroad.runs.stages.contact_file import ContactHistory
from tireroad.runs.stages.driven import Driven
from tireroad.runs.stages.greens import Responses
from tireroad.runs.stages.record import Record
from tireroad.runs.stages.rolling import (
    Integration,
    directions,
    histories,
    integration,
    of_given_forces,
    planned,
    shortest_period,
)
from tireroad.runs.stages.stage import Computed, Done


@dataclass(frozen=True)
class PointResponse:
    """`curves` by name: (values, unit), as in response.h5."""

    curves: Curves


@dataclass(frozen=True, kw_only=True)
class ResponseStage(Computed[PointResponse]):
    """The response to the prescribed forces, alone or together with contact."""

    name: ClassVar[str] = "response"
    static: Done[StaticState]
    modes: Done[ModalBasis]
    wheel: Done[Wheel]
    greens: Done[Responses]
    contact: Done[ContactHistory] | None = None

    def inputs(self) -> dict:
        """The Green's functions, the forces, the time and the frequency outputs."""
        scene, output = self.job.scene, self.job.scene.output
        return {
            "greens": self.greens.key,
            "forces": [asdict(force) for force in scene.force],
            "time": asdict(scene.time) if scene.time else None,
            "outputs": {name: asdict(kind) for name, kind in output.kinds},
            "contact": self.contact.key if self.contact else None,
            "axle_force": output.axle_force,
        }

    def compute(self, record: Record) -> PointResponse:
        """Integrate in time, then add the scene's outputs. Collective."""
        seen = Driven(
            job=self.job,
            static=self.static.product,
            modes=self.modes,
            wheel=self.wheel,
            greens=self.greens,
        )
        curves: Curves = {}
        if self.contact:
            history = self.contact.product
            seen = replace(seen, history=history, time=history.time)
            curves |= self._in_contact(record, history)
        elif self.job.scene.time and self.job.scene.force:
            chosen = self._integration(record, seen)
            seen = replace(seen, integration=chosen, time=chosen.step * np.arange(chosen.steps + 1))
            curves |= self._in_time(record, seen)
        for _, kind in self.job.scene.output.kinds:
            curves |= kind.curves(seen, record)
        return PointResponse(curves)

    def write(self, file, product: PointResponse) -> None:
        """One dataset per curve."""
        for name, (values, unit) in product.curves.items():
            put(file, name, values, unit)

    def read(self, file) -> PointResponse:
        """The same, without curves in subgroups."""
        datasets = {name: d for name, d in file.items() if hasattr(d, "shape")}
        return PointResponse({name: (d[:], d.attrs["unit"]) for name, d in datasets.items()})

    def _in_contact(self, record: Record, history: ContactHistory) -> Curves:
        """The contact loop's results at the driven points."""
        if history.driven is None:
            return {"time": (history.time, "s")}
        record.headline["largest displacement"] = (_largest(history.driven), "m")
        curves: Curves = {
            "time": (history.time, "s"),
            "force": (histories(self.job.scene.force, history.time), "N"),
            "displacement": (history.driven, "m"),
        }
        if history.axle_force is not None:
            curves["axle_force"] = history.axle_force, "N"
        return curves

    def _integration(self, record: Record, seen: Driven) -> Integration:
        """Step and scheme for prescribed forces. Collective."""
        scene = self.job.scene
        plan = planned(self.job, record, seen.whole, shortest_period(scene.force))
        return integration(self.job, plan, of_given_forces(scene))

    def _in_time(self, record: Record, seen: Driven) -> Curves:
        """Displacements and axle force under the prescribed forces. Collective."""
        scene, chosen, force = self.job.scene, seen.integration, seen.force()
        displacement, axle, moment = self._marched(record, seen, force)
        moved = displacement.reshape(len(force), -1, 3)
        record.headline |= {
            "step": (chosen.step, "s"),
            "scheme": (chosen.scheme, "-"),
            "largest displacement": (_largest(moved), "m"),
        }
        curves: Curves = {
            "time": (seen.time, "s"),
            "force": (force, "N"),
            "displacement": (moved, "m"),
        }
        if scene.output.axle_force and scene.modes.on_axle_alone:
            curves["axle_force"] = axle, "N"
            curves |= {"hub_moment": (moment, "N m")} if moment.size else {}
        elif scene.output.axle_force and scene.modes.rim == "fixed":  # a free axle carries none
            observe.say(
                '  axle force and moments left out: the road carries part of them (modal.road = "held")'
            )
        return curves

    def _marched(self, record: Record, seen: Driven, force: np.ndarray) -> tuple:
        """Time integration under forces (nt, k).

        Returns displacement (nt, 3 k), axle force (nt, 3) and hub moments (nt, 3 or 0). Collective.
        """
        tire, direction = seen.integration.tire, directions(self.job.scene.force)
        displacement, axle = np.zeros((len(force), len(tire.same_step))), np.zeros((len(force), 3))
        tire.start(force[0])
        axle[0] = force[0] @ direction - tire.inertia_force()
        late = seen.whole.pulse
        displacement[0, late:] = seen.whole.residual[late:] @ force[0]
        with record.timing("time loop"), observe.Progress("response", len(force) - 1) as bar:
            for k in range(1, len(force)):
                free = tire.predict()
                tire.advance(force[k])
                displacement[k] = free + tire.same_step @ force[k]
                axle[k] = force[k] @ direction - tire.inertia_force()
                bar.advance()
        axle -= remaining(seen.whole.resolved(seen.integration.step), seen.force(1), seen.force(2))
        displacement, moment = np.split(displacement, [3 * len(direction)], axis=1)
        return displacement, axle, moment


def _largest(moved: np.ndarray) -> float:
    """Length (m) of the largest displacement (nt, k, 3) of a point."""
    return float(np.linalg.norm(moved, axis=2).max())
