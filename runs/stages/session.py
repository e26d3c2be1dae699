"""What the stages of one run share: the scene, where results go, and models made on demand."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from mpi4py import MPI

from tireroad.fem.timing import Timing
from tireroad.modal.damping import Damping, Proportional, StrainEnergy, beyond
from tireroad.runs.files import store
from tireroad.runs.process.mpi import on_root
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.tables import Scene
from tireroad.runs.scene.tire_section import make_section
from tireroad.runs.stages.tire import make_body, make_lattice


@dataclass
class Record:
    """What a stage tells about itself: figures as name: (value, unit), seconds by part."""

    headline: dict[str, tuple[Any, str]] = field(default_factory=dict)
    indicators: dict[str, tuple[Any, str]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    cost: Timing = field(default_factory=Timing)

    def line(self) -> str:
        """The headline figures in one line."""
        return ", ".join(
            f"{name} {_shown(v)} {unit}".rstrip(" -") for name, (v, unit) in self.headline.items()
        )

    def timing(self, part: str) -> AbstractContextManager[None]:
        """Add the seconds spent inside to a part of the stage's cost."""
        return self.cost(part)


def _shown(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


class Session:
    """One run of one scene. Stages put what later ones need into `static`, `modal`, `state_modes`,
    `patch` and so on; the finite-element model is made when a stage first asks for it.
    """

    def __init__(self, scene: Scene, directory: Path, comm: MPI.Comm, fresh: bool = False):
        self.scene, self.directory, self.comm, self.fresh = scene, directory, comm, fresh
        self.hashes: dict[str, str] = {}
        self.record = Record()

    @contextmanager
    def recording(self, stage: str) -> Iterator[Record]:
        """A fresh record for a stage; solvers' own figures go there."""
        self.record = Record()
        yield self.record

    @property
    def speed(self) -> float:
        """Speed of rotation, rad/s; 0 when the wheel stands."""
        return self.scene.rotation.speed if self.scene.rotation else 0.0

    @property
    def damping(self) -> Damping:
        """In proportion where the scene says so, else by the loss factors of the compounds."""
        given = self.scene.damping
        return StrainEnergy() if given is None else Proportional(given.mass, given.stiffness)

    @property
    def rolling(self) -> tuple[float, float, float, str]:
        """Speed, damping and inertia of the steady-rolling static state; zeros at rest."""
        if not self.scene.static.steady_rolling or self.speed == 0:
            return 0.0, 0.0, 0.0, "full"
        # By strain energy there is no damping before there are modes: the shape has inertia alone.
        damping = (0.0, 0.0) if isinstance(self.damping, StrainEnergy) else self.damping
        return self.speed, *damping, self.scene.rotation.inertia

    @cached_property
    def section(self):
        """The shape of the scene's tire and its elements."""
        return make_section(self.scene.tire)

    @cached_property
    def lattice(self):
        """The nodes of the displacement field, without a mesh."""
        return make_lattice(self.section)

    @cached_property
    def body(self):
        """The finite-element body, at the static state once that is known. Collective."""
        body = make_body(self.comm, self.scene.tire, self.section)
        if hasattr(self, "static"):
            body.set_displacement(self.static.displacement)
        return body

    @cached_property
    def operators(self):
        """Matrices at the static state. Collective."""
        from tireroad.fem.matrices.operators import Operators
        from tireroad.fem.static.virtual_work import Rolling

        with self.record.timing("matrices"):
            return Operators(
                self.body, self.scene.static.inflation, self._support(), Rolling(*self.rolling)
            )

    def _support(self):
        """What holds the tire in its small motions."""
        from tireroad.fem.matrices.support import Support

        wanted = self.scene.modal
        if wanted.road == "forces":
            return Support(wanted.rim)
        face = self.body.surface
        return Support(wanted.rim, face.local[self.static.force[face.place] > 0])

    @cached_property
    def rotation_matrices(self):
        """The matrices of the rotating frame. Collective."""
        with self.record.timing("rotation matrices"):
            return self.operators.rotation()

    @cached_property
    def wheel(self):
        """The full matrices as the wheel turns. Collective."""
        from tireroad.greens.coupling import Wheel

        rotation = self.rotation_matrices if self.speed else None
        inertia = self.scene.rotation.inertia if self.speed else "full"
        tail = None
        if isinstance(self.damping, StrainEnergy):
            tail = beyond(self.damping, self.modal.projection)
        return Wheel(self.operators, rotation, self.speed, self.damping, inertia, self.air, tail)

    @cached_property
    def air(self):
        """The air at the wall of the static state, once the modes are known; None without it. Collective."""
        from tireroad.runs.stages.cavity import make

        return make(self)

    @cached_property
    def modes(self):
        """The modes on all unknowns: as the stage computed them, or once more where it was reused.
        Collective."""
        from tireroad.runs.stages.modes import solve

        with self.record.timing("modes once more"):
            return solve(self)

    @property
    def basis(self):
        """The modes on the outer face with what the stages made of them."""
        from tireroad.greens.coupling import Basis

        return Basis(self.modal.shape, self.modal.projection, self.state_modes)

    def write(self, path: Path, stage: str, fill) -> None:
        """Write a stage's file by `fill(file)` on the root process. Collective."""
        on_root(self.comm, lambda: self._write(path, stage, fill))

    def _write(self, path: Path, stage: str, fill) -> None:
        with store.writing(path, self.provenance(stage)) as file:
            fill(file)

    def provenance(self, stage: str) -> store.Provenance:
        """Where the stage's file comes from."""
        scene = self.scene
        return store.Provenance(scene.name, dumps(scene), stage, self.hashes[stage], self.comm.size)

    def read(self, path: Path, pick) -> Any:
        """What `pick(file)` returns, on every process. Collective."""

        def opened():
            with store.opened(path) as file:
                return pick(file)

        return on_root(self.comm, opened)
