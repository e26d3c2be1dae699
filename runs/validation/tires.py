"""The two tires of a validation: modes, as many and with the residual wanted, and full finite elements."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

from tireroad.fem.transient.linear import FullTire
from tireroad.fem.transient.modal_damping import ModalDamping
from tireroad.fem.transient.nonlinear import NonlinearTire
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.modal.basis import Projection
from tireroad.modal.damping import StrainEnergy, beyond, rates
from tireroad.modal.rotating import StateModes
from tireroad.modal.undamped import Modes
from tireroad.runs.process import observe
from tireroad.runs.scene.load import load
from tireroad.runs.stages import greens
from tireroad.runs.stages.modes import ModalBasis
from tireroad.runs.stages.pipeline import run_scene
from tireroad.runs.stages.responses import make
from tireroad.runs.stages.session import Session

# Of the full finite elements' scheme. Axle force on a cleat at steps of 1e-4 s with 0, 0.5 and 0.8: 5.4, 2.8
# and 2.1 % off; contact force on cobblestones at 2.5e-5 s: 0 and 0.5 are 0.08 % apart, 0.8 is 0.2 % off.
RADIUS = 0.5


@dataclass(frozen=True)
class Choice:
    """What a run of the modal tire may spend: modes, residual option, time step in s."""

    modes: int
    residual: str
    step: float


class Tires:
    """A scene run up to its modes; its road, and the modes kept, can then be changed at little cost.

    `static_seconds`, `modes_seconds`: what those stages took. Files go to `folder`.
    """

    def __init__(self, scene: str, folder: Path):
        self._file = folder / "scene.toml"
        self._file.write_text(scene)
        with observe.quiet():
            self.session: Session = run_scene(
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
        self._modes, self._modal = self.session.modes, self.session.modal
        self._states: dict[int, StateModes] = {}
        self.change(scene)

    @property
    def unknowns(self) -> int:
        """Free degrees of freedom of the finite elements."""
        return self.session.operators.stiffness.getSize()[0]

    @property
    def setting(self) -> str:
        """Size, and what was spent before any road, for a title."""
        top = self._modal.frequency[-1]
        return (
            f"{self.unknowns} unknowns; static state {self.static_seconds:.1f} s, "
            f"{len(self._modal.frequency)} modes to {top:.0f} Hz {self.modes_seconds:.1f} s"
        )

    def change(self, scene: str) -> None:
        """Take a scene that differs after its modes only: road, forces, contact, time."""
        self._file.write_text(scene)
        self.session.scene = load(self._file)
        self._responses: dict[tuple[int, str], tuple[Response, float]] = {}
        greens.prepare(self.session)

    def modal(self, choice: Choice) -> tuple[Recursion, float, float]:
        """The lowest modes with their residual between the points of the scene; step; set-up in s."""
        key = choice.modes, choice.residual
        if key not in self._responses:
            began = time.perf_counter()
            self._responses[key] = self.response(*key), time.perf_counter() - began
        response, seconds = self._responses[key]
        began = time.perf_counter()
        kept = response.resolved(choice.step)
        tire = Recursion(kept, choice.step, "linear", self.session.comm)
        return tire, choice.step, seconds + time.perf_counter() - began

    def response(self, count: int, residual: str) -> Response:
        """The response of the lowest modes, as the program's own stages make it."""
        session = self.session
        session.modes, session.modal = self._lowest(count)
        if count not in self._states:
            self._states[count] = session.wheel.decouple(session.modal.projection, session.comm)
        session.state_modes = self._states[count]
        wanted = replace(session.scene.greens, residual=residual)
        session.scene = replace(session.scene, greens=wanted)
        _, outputs, loads = greens.probes(session)
        return make(session, outputs, loads)

    def _lowest(self, count: int) -> tuple[Modes, ModalBasis]:
        """The first modes of those there are."""
        modes, modal = self._modes, self._modal
        parts = {f.name: getattr(modal.projection, f.name) for f in fields(Projection)}
        cut = {
            name: values if values is None else values[..., :count]
            for name, values in parts.items()
        }
        for name in ("gyroscopic", "convective", "body", "body_convective"):
            if cut[name] is not None:
                cut[name] = np.ascontiguousarray(cut[name][:count])
        few = replace(modes, squares=modes.squares[:count], vectors=modes.vectors[:, :count])
        shape = modal.shape[:, :count]
        return few, ModalBasis(modal.frequency[:count], shape, Projection(**cut))

    def full(self, step: float, radius: float = RADIUS) -> tuple[FullTire, float, float]:
        """All degrees of freedom between the same points; step; set-up in s."""
        session = self.session
        rotation = session.rotation_matrices if session.speed else None
        _, outputs, loads = greens.probes(session)
        began = time.perf_counter()
        damping, modal = self._damping()
        given = session.operators, rotation, session.speed, damping, step, outputs, loads
        tire = FullTire(*given, spectral_radius=radius, modal=modal)
        return tire, step, time.perf_counter() - began

    def _damping(self) -> tuple[tuple[float, float], ModalDamping | None]:
        """What damps the full matrices uniformly, and mode by mode beside it. Collective."""
        session = self.session
        if not isinstance(session.damping, StrainEnergy):
            return session.damping, None
        projection = self._modal.projection
        uniform = beyond(session.damping, projection)
        excess = rates(session.damping, projection) - uniform.mass
        turning = (session.rotation_matrices.body, session.speed) if session.speed else ()
        modal = ModalDamping(session.operators, self._modes.vectors, excess, *turning)
        return uniform, modal

    def nonlinear(self, step: float) -> tuple[NonlinearTire, float, float]:
        """The full finite elements with large motions, standing; step; set-up in s."""
        session = self.session
        _, outputs, loads = greens.probes(session)
        began = time.perf_counter()
        inflation = session.scene.static.inflation
        damping, modal = self._damping()
        given = session.operators, inflation, damping, step, outputs, loads
        tire = NonlinearTire(*given, spectral_radius=RADIUS, modal=modal)
        return tire, step, time.perf_counter() - began
