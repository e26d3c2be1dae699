"""Stage response: prescribed point forces in time and frequency, and the scene's outputs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy import sparse

from tireroad.fem.model import SmallMotions
from tireroad.fem.static.state import StaticState
from tireroad.greens.coupling import Wheel, wheel_of
from tireroad.greens.outputs import by_free_rim, remaining
from tireroad.greens.response import Response
from tireroad.modal.basis import ModalBasis
from tireroad.modal.standing import standing_modes
from tireroad.runs.files.store import put
from tireroad.runs.process import console
from tireroad.runs.scene.outputs import Curves
from tireroad.runs.scene.physics import turning_of
from tireroad.runs.stages.contact_file import ContactHistory
from tireroad.runs.stages.greens import Responses
from tireroad.runs.stages.rolling import (
    Integration,
    directions,
    histories,
    integration,
    of_given_forces,
    planned,
    shortest_period,
)
from tireroad.runs.stages.setup import driven_points
from tireroad.runs.stages.stage import Computed, Job, Record, Result

Array = np.ndarray


@dataclass(frozen=True, kw_only=True)
class Driven:
    """The k points of the scene's [[force]] tables, and the contact, as outputs see them.

    `time` (nt,) s, None without [time]; `integration`: how prescribed forces were integrated, None
    with contact or without time integration; `history` of the contact, None without contact.
    """

    job: Job
    static: StaticState
    modes: Result[ModalBasis]
    wheel: Result[Wheel]
    greens: Result[Responses]
    time: Array | None = None
    integration: Integration | None = None
    history: ContactHistory | None = None

    @property
    def response(self) -> Response:
        """Displacement (3 k) per force (k) of the rotating tire, without the road."""
        return self.whole.between(slice(3 * len(self.job.scene.force)), slice(None))

    @property
    def whole(self) -> Response:
        """`response`, then the moments (3) on the axle: of a wheel that moves without contact only."""
        return self.greens.product.force

    def moments(self, frequency: Array) -> Array | None:
        """Moment (f, 3, k) m on the held axle per force at `frequency` (f,) Hz; None if unknown."""
        read = self.whole.between(slice(3 * len(self.job.scene.force), None), slice(None))
        return read.receptance(frequency) if len(read.residual) else None

    def of_contact(self, name: str) -> Array:
        """An array of contact.h5, e.g. "normal_force" (nt, c) N, on every process. Collective."""
        return self.job.read(self.job.path("contact"), lambda file: file[name][:])

    def points(self) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
        """Loads (k, 3 s) of unit forces as directed, and readings (3 k, 3 s) of their points."""
        return driven_points(self.job)

    def by_free_rim(self, count: int, frequency: Array) -> tuple[Array, float]:
        """Force and moment (f, 6, k) of the tire on the held axle per unit force, by the free rim.

        From `count` modes of the same static state with its rim released; also returns the highest
        of them, Hz. Collective.
        """
        turning = turning_of(self.job.scene, self.job.speed)
        motions = SmallMotions(
            self.job.tire, self.static, rim="free", road=self.job.scene.modes.road
        )
        basis = standing_modes(motions, count=count, rotation=turning.speed != 0)
        wheel = wheel_of(motions, turning, projection=basis.projection)
        held = SmallMotions(self.job.tire, self.static)
        motion = held.rim_motion(turning.speed != 0)
        receptances = by_free_rim(wheel, basis.modes, self.points()[0], frequency, motion)
        return receptances, float(basis.frequency[-1])

    @property
    def drifts(self) -> bool:
        """Whether a constant force makes the tire drift: there is then no receptance at 0 Hz."""
        return self.job.scene.modes.rim == "free" or self.response.rigid > 0

    def force(self, order: int = 0) -> Array:
        """The prescribed forces (nt, k) N, or their time derivative of that order."""
        return histories(self.job.scene.force, self.time, order)

    def along(self, full: Array) -> Array:
        """Motion of each point along its own force, (n, k, k), from its components (n, 3 k, k)."""
        forces = self.job.scene.force
        components = full.reshape(len(full), len(forces), 3, len(forces))
        return np.einsum("frdk,rd->frk", components, directions(forces))


@dataclass(frozen=True)
class PointResponse:
    """`curves` by name: (values, unit), as in response.h5."""

    curves: Curves


@dataclass(frozen=True, kw_only=True)
class ResponseStage(Computed[PointResponse]):
    """The response to the prescribed forces, alone or together with contact."""

    name: ClassVar[str] = "response"
    reads: ClassVar[tuple[str, ...]] = ("force", "time", "output.kinds", "output.axle_force")
    static: Result[StaticState]
    modes: Result[ModalBasis]
    wheel: Result[Wheel]
    greens: Result[Responses]
    contact: Result[ContactHistory] | None = None

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
            console.say(
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
        with record.timing("time loop"), console.ProgressBar("response", len(force) - 1) as bar:
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
