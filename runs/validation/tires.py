"""The two tire models of a validation: modes with any residual, and full finite elements."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

from mpi4py import MPI

from tireroad.fem.transient.linear import FullTire
from tireroad.fem.transient.modal_damping import ModalDamping
from tireroad.fem.transient.nonlinear import NonlinearTire
from tireroad.greens.coupling import Wheel
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.greens.responses import make_response
from tireroad.modal.damping import StrainEnergy, beyond, rates
from tireroad.modal.rolling import RollingModes, rolling_modes
from tireroad.modal.standing import fewer
from tireroad.runs.process import observe
from tireroad.runs.scene.load import load
from tireroad.runs.stages.build.setup import probes, scene_setup
from tireroad.runs.stages.build.turning import turning_of
from tireroad.runs.stages.pipeline import Finished, run_scene
from tireroad.runs.validation.histories import Trial

# Spectral radius of the full finite elements' scheme. Axle force on a cleat at steps of 1e-4 s with
# 0, 0.5 and 0.8: 5.4, 2.8 and 2.1 % off; contact force on cobblestones at 2.5e-5 s: 0 and 0.5 are
# 0.08 % apart, 0.8 is 0.2 % off.
RADIUS = 0.5
LOADED = """
name = "validate"
[tire]
segments = {segments}
elements_arc = {elements_arc}
footprint_size = 0.35
[tire.material]
youngs_modulus = 48e6
[static]
load = 500.0
"""
"""Beginning of a scene: the soft torus under 500 N, with the elements left open."""


@dataclass(frozen=True)
class Choice:
    """Settings of a modal run: modes, residual option, time step in s."""

    modes: int
    residual: str
    step: float


class Tires:
    """A scene run up to its modes; its road, and the modes kept, can then be changed at low cost.

    `static_seconds`, `modes_seconds`: duration of those stages. Files go to `folder`.
    """

    def __init__(self, scene: str, folder: Path):
        self._file = folder / "scene.toml"
        self._file.write_text(scene)
        with observe.quiet():
            self.run: Finished = run_scene(
                load(self._file),
                folder,
                MPI.COMM_SELF,
                until="modes",
                fresh=False,
                petsc_options=[],
            )
        stages = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["stages"]
        self.static_seconds, self.modes_seconds = (
            stages[name]["seconds"] for name in ("static", "modes")
        )
        self.motions, self.modes = self.run.motions, self.run.fields
        self._rolling: dict[int, RollingModes] = {}
        self.change(scene)

    @property
    def unknowns(self) -> int:
        """Free degrees of freedom of the finite elements."""
        return self.motions.unknowns

    @property
    def setting(self) -> str:
        """Size, and cost before any road, for a title."""
        top = self.modes.frequency[-1]
        return (
            f"{self.unknowns} unknowns; static state {self.static_seconds:.1f} s, "
            f"{len(self.modes.frequency)} modes to {top:.0f} Hz {self.modes_seconds:.1f} s"
        )

    def change(self, scene: str) -> None:
        """Switch to a scene that differs only after its modes: road, forces, contact, time."""
        self._file.write_text(scene)
        self.job = replace(self.run.job, scene=load(self._file))
        self._responses: dict[tuple[int, str], tuple[Response, float]] = {}
        static, contact = self.run.static, self.job.scene.contact
        setup = scene_setup(self.job, static) if contact else None
        self.probes = probes(self.job, static, setup)
        if setup:
            self.trial = Trial(contact, setup, self.job.scene.time.duration)

    @property
    def wheel(self) -> Wheel:
        """The full matrices of the rotating wheel."""
        return self.run.wheel

    def modal(self, choice: Choice) -> tuple[Recursion, float, float]:
        """The lowest modes with their residual between the scene's points; step; set-up in s."""
        key = choice.modes, choice.residual
        if key not in self._responses:
            began = time.perf_counter()
            self._responses[key] = self.response(*key), time.perf_counter() - began
        response, seconds = self._responses[key]
        began = time.perf_counter()
        kept = response.resolved(choice.step)
        tire = Recursion(response=kept, step=choice.step, scheme="linear", comm=self.job.comm)
        return tire, choice.step, seconds + time.perf_counter() - began

    def response(self, count: int, residual: str, counted: bool = True) -> Response:
        """The response of the lowest modes as the stages make it; the `counted` part, or all."""
        if count not in self._rolling:
            turning = turning_of(self.job)
            few = fewer(self.modes, self.motions, count, turning, self.job.axle)
            self._rolling[count] = rolling_modes(few, turning, self.job.comm)
        rolling, points = self._rolling[count], self.probes
        points = points.on_face if counted else points
        given = points.outputs, points.loads, residual
        return make_response(lambda: self.wheel, rolling, *given, lambda: rolling.basis).response

    def full(self, step: float, radius: float = RADIUS) -> tuple[FullTire, float, float]:
        """All degrees of freedom between the same points; step; set-up in s."""
        wheel, points = self.wheel, self.probes.on_face
        axle = self.job.axle
        began = time.perf_counter()
        damping, modal = self._damping()
        tire = FullTire(
            operators=wheel.operators,
            rotation=wheel.rotation,
            speed=wheel.speed,
            damping=damping,
            step=step,
            outputs=points.outputs,
            loads=points.loads,
            inertia=wheel.inertia,
            spectral_radius=radius,
            modal=modal,
            air=wheel.air,
            corner=(axle, self.motions.rim_motion(wheel.speed != 0)) if axle else None,
        )
        return tire, step, time.perf_counter() - began

    def _damping(self) -> tuple[tuple[float, float], ModalDamping | None]:
        """Uniform damping of the full matrices, and additional modal damping. Collective."""
        wheel, modes = self.wheel, self.modes
        if not isinstance(wheel.damping, StrainEnergy):
            return wheel.damping, None
        uniform = beyond(wheel.damping, modes.projection)
        excess = rates(wheel.damping, modes.projection) - uniform.mass
        turning = (wheel.rotation.body, wheel.speed) if wheel.speed else ()
        return uniform, ModalDamping(wheel.operators, modes.modes.vectors, excess, *turning)

    def nonlinear(self, step: float) -> tuple[NonlinearTire, float, float]:
        """The full finite elements with large motions; step; set-up in s."""
        points, static, wheel = self.probes.on_face, self.run.static, self.wheel
        began = time.perf_counter()
        damping, modal = self._damping()
        tire = NonlinearTire(
            operators=self.motions.operators,
            inflation=static.inflation,
            damping=damping,
            step=step,
            outputs=points.outputs,
            loads=points.loads,
            spectral_radius=RADIUS,
            modal=modal,
            turning=(wheel.rotation, static.rolling) if wheel.speed else None,
        )
        return tire, step, time.perf_counter() - began
