"""response: prescribed point forces on the tire, in time and in frequency."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np

from tireroad.fem.static.state import StaticState
from tireroad.greens.coupling import Wheel
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.modal.basis import ModalBasis
from tireroad.runs.files.store import put
from tireroad.runs.process import observe
from tireroad.runs.stages.build.point_forces import directions, histories, shortest_period
from tireroad.runs.stages.build.setup import driven_points
from tireroad.runs.stages.build.stepping import Integration, integration, planned
from tireroad.runs.stages.build.transmissibility import transmissibility
from tireroad.runs.stages.greens import Responses
from tireroad.runs.stages.record import Record
from tireroad.runs.stages.stage import Computed, Done
from tireroad.runs.stages.stored.contact_file import ContactHistory

Curves = dict[str, tuple[np.ndarray, str]]


@dataclass(frozen=True)
class PointResponse:
    """`curves` by name: (values, unit), as in response.h5."""

    curves: Curves


@dataclass(frozen=True, kw_only=True)
class ResponseStage(Computed[PointResponse]):
    """What the prescribed forces do, alone or in contact."""

    name: ClassVar[str] = "response"
    static: Done[StaticState]
    modes: Done[ModalBasis]
    wheel: Done[Wheel]
    greens: Done[Responses]
    contact: Done[ContactHistory] | None = None

    def inputs(self) -> dict:
        """The Green's functions, the forces, the time and what is read in frequency."""
        scene, output = self.job.scene, self.job.scene.output
        return {
            "greens": self.greens.key,
            "forces": [asdict(force) for force in scene.force],
            "time": asdict(scene.time) if scene.time else None,
            "receptance": asdict(output.receptance) if output.receptance else None,
            "contact": self.contact.key if self.contact else None,
            "axle_force": output.axle_force,
            "transmissibility": asdict(output.transmissibility)
            if output.transmissibility
            else None,
            "also": [output.velocity, output.acceleration, output.impulse],
        }

    def compute(self, record: Record) -> PointResponse:
        """Integrate and sweep. Collective."""
        scene = self.job.scene
        curves: dict[str, tuple[np.ndarray, str]] = {}
        if self.contact:
            curves |= self._in_contact(record, self.contact.product)
        elif scene.time:
            curves |= self._in_time(record)
        if scene.time and scene.output.impulse:
            curves["impulse"] = self._impulse(record, curves["time"][0]), "m/(N s)"
        if scene.output.receptance:
            curves |= self._in_frequency(record)
        if scene.output.transmissibility:
            highest = float(self.modes.product.frequency[-1])
            given = self.static.product, self._response, highest
            curves |= transmissibility(self.job, record, *given)
        return PointResponse(curves)

    def write(self, file, product: PointResponse) -> None:
        """Curve by curve."""
        for name, (values, unit) in product.curves.items():
            put(file, name, values, unit)

    def read(self, file) -> PointResponse:
        """The same, without those in groups of their own."""
        datasets = {name: d for name, d in file.items() if hasattr(d, "shape")}
        return PointResponse({name: (d[:], d.attrs["unit"]) for name, d in datasets.items()})

    @property
    def _response(self) -> Response:
        return self.greens.product.force

    @property
    def _drifts(self) -> bool:
        """Whether a constant force moves the tire ever further: it has no receptance at 0 Hz then."""
        return self.job.scene.modal.rim == "free" or self._response.rigid > 0

    def _in_contact(self, record: Record, history: ContactHistory) -> Curves:
        """What the contact loop found at the driven points, contact included."""
        largest = float(np.abs(history.driven).max())
        record.headline["largest displacement"] = (largest, "m")
        curves: Curves = {
            "time": (history.time, "s"),
            "force": (histories(self.job.scene.force, history.time), "N"),
            "displacement": (history.driven, "m"),
        }
        if history.axle_force is not None:
            curves["axle_force"] = history.axle_force, "N"
        return curves

    def _in_time(self, record: Record) -> Curves:
        """Displacements and axle force of the prescribed forces. Collective."""
        forces = self.job.scene.force
        plan = planned(self.job, record, self._response, shortest_period(forces))
        wanted = self.job.scene.time.scheme
        # Given forces have no contact to chatter: linear over the step is of the higher order.
        chosen = integration(self.job, plan, "linear" if wanted == "auto" else wanted)
        time = chosen.step * np.arange(chosen.steps + 1)
        force = histories(forces, time)
        displacement, axle = self._marched(record, chosen, force)
        record.headline |= {
            "step": (chosen.step, "s"),
            "scheme": (chosen.scheme, "-"),
            "largest displacement": (float(np.abs(displacement).max()), "m"),
        }
        curves: Curves = {
            "time": (time, "s"),
            "force": (force, "N"),
            "displacement": (displacement.reshape(len(time), -1, 3), "m"),
        }
        if (
            self.job.scene.output.axle_force and self.job.scene.modal.rim != "free"
        ):  # else nothing holds the axle
            curves["axle_force"] = axle, "N"
        return curves | self._rates(time, chosen)

    def _marched(self, record: Record, chosen: Integration, force: np.ndarray) -> tuple:
        """Displacement (nt, 3 k) and axle force (nt, 3) under forces (nt, k). Collective."""
        tire, response, direction = chosen.tire, self._response, directions(self.job.scene.force)
        displacement, axle = np.zeros((len(force), 3 * len(direction))), np.zeros((len(force), 3))
        tire.start(force[0])
        axle[0] = force[0] @ direction - tire.inertia_force()
        if not response.pulse:
            displacement[0] = response.residual @ force[0]
        with record.timing("time loop"), observe.Progress("response", chosen.steps) as bar:
            for k in range(1, len(force)):
                free = tire.predict()
                tire.advance(force[k])
                displacement[k] = free + tire.same_step @ force[k]
                axle[k] = force[k] @ direction - tire.inertia_force()
                bar.advance()
        return displacement, axle

    def _rates(self, time: np.ndarray, chosen: Integration) -> Curves:
        """Velocities and accelerations of the driven points, where wanted. Collective."""
        output, response = self.job.scene.output, self._response.resolved(chosen.step)
        scheme = "linear" if chosen.scheme == "convolution" else chosen.scheme
        velocity = response.rate()
        forces = [histories(self.job.scene.force, time, order) for order in range(3)]
        out = {}
        if output.velocity:
            moved = self._march(velocity, chosen.step, scheme, forces[0])
            out["velocity"] = moved + forces[1] @ response.residual.T, "m/s"
        if output.acceleration:
            moved = self._march(velocity.rate(), chosen.step, scheme, forces[0])
            moved += forces[1] @ velocity.residual.T + forces[2] @ response.residual.T
            out["acceleration"] = moved, "m/s2"
        return {name: (v.reshape(len(time), -1, 3), unit) for name, (v, unit) in out.items()}

    def _march(self, response: Response, step: float, scheme: str, force) -> np.ndarray:
        """Readings (nt, r) under forces (nt, k) from rest. Collective."""
        tire = Recursion(response=response, step=step, scheme=scheme, comm=self.job.comm)
        tire.start(force[0])
        out = [response.residual @ force[0]]
        for new in force[1:]:
            free = tire.predict()
            tire.advance(new)
            out.append(free + tire.same_step @ new)
        return np.stack(out)

    def _impulse(self, record: Record, time: np.ndarray) -> np.ndarray:
        """g (nt, k, k) along the forces, without the residual's delta at t = 0."""
        with record.timing("impulse responses"):
            return _along(self._response.impulse(time), self.job.scene.force)

    def _in_frequency(self, record: Record) -> Curves:
        """Receptances between the driven points, each along its own force. Collective."""
        wanted, forces = self.job.scene.output.receptance, self.job.scene.force
        frequency = np.arange(0.0, wanted.to + wanted.step / 2, wanted.step)
        if self._drifts:
            frequency = frequency[1:]
        with record.timing("receptance"):
            full = self._response.receptance(frequency)
        along = _along(full, forces)
        peak = int(np.abs(along[:, 0, 0]).argmax())
        record.headline["largest receptance"] = (float(np.abs(along[peak, 0, 0])), "m/N")
        record.headline["at"] = (float(frequency[peak]), "Hz")
        out = {"frequency": (frequency, "Hz"), "receptance": (along, "m/N")}
        return out | (self._direct(record) if wanted.direct else {})

    def _direct(self, record: Record) -> Curves:
        """The same receptances without modes, at a few frequencies, and how far the modes are off."""
        wanted, forces = self.job.scene.output.receptance, self.job.scene.force
        frequency = wanted.to * np.arange(1, wanted.direct + 1) / wanted.direct
        loads, readings = driven_points(self.job)
        with record.timing("receptance of the full matrices"):
            full = self.wheel.product.receptance(readings, loads, frequency)
        off = self._response.receptance(frequency) - full
        share = np.linalg.norm(off, axis=(1, 2)) / np.linalg.norm(full, axis=(1, 2))
        name = f"receptance off the full matrices' up to {wanted.to:.4g} Hz"
        record.indicators[name] = (float(share.max()), "-")
        return {
            "direct/frequency": (frequency, "Hz"),
            "direct/receptance": (_along(full, forces), "m/N"),
        }


def _along(full: np.ndarray, forces) -> np.ndarray:
    """Each point's displacement along its own force, (n, k, k), from its components (n, 3 k, k)."""
    components = full.reshape(len(full), len(forces), 3, len(forces))
    return np.einsum("frdk,rd->frk", components, directions(forces))
