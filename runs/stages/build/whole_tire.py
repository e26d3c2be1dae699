"""Common base of the stages that show the whole tire under the forces of a completed run."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI

from tireroad.contact.setup import ContactSetup
from tireroad.fem.static.state import StaticState
from tireroad.greens.basis import Basis
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import couple
from tireroad.greens.responses import Wanted, band
from tireroad.modal.rolling import RollingModes
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.base.stage import Computed, Done
from tireroad.runs.stages.build.forces import Forces, driven_loads
from tireroad.runs.stages.build.rolling.scheme import recursive
from tireroad.runs.stages.stored.contact_file import ContactHistory

P = TypeVar("P")


@dataclass(frozen=True, kw_only=True)
class WholeTire(Computed[P]):
    """Computed on the root process from contact and prescribed forces as stored in their files."""

    static: Done[StaticState]
    rotating: Done[RollingModes]
    setup: Done[ContactSetup | None]
    contact: Done[ContactHistory] | None = None

    def inputs(self) -> dict[str, Any]:
        """The forces over time, the states, and the band."""
        scene = self.job.scene
        return {
            "modes": self.rotating.key,
            "contact": self.contact.key if self.contact else None,
            "forces": [vars(force) for force in scene.force],
            "time": vars(scene.time),
            "band": scene.greens.band,
        }

    def compute(self, record: Record) -> P | None:
        """The product on the root process, None on the others. Collective."""
        made: list[P] = []
        basis, setup = Basis.of(self.rotating.product), self.setup.product
        loads = driven_loads(self.job, self.static.product, setup)

        def on_one() -> dict[str, tuple[float, str]]:
            contact = self.contact.product if self.contact else None
            forces = Forces.of(self.job, setup, contact, basis.seen(loads))
            product, figures = self.seen(basis, forces)
            made.append(product)
            return figures

        record.headline |= on_root(self.job.comm, on_one)
        return made[0] if made else None

    @abstractmethod
    def seen(self, basis: Basis, forces: Forces) -> tuple[P, dict[str, tuple[float, str]]]:
        """The product and its headline figures. Root process only."""

    @property
    def band(self) -> float:
        """Upper end of the frequency band of interest, Hz."""
        return band(self.rotating.product, Wanted(band=self.job.scene.greens.band))


def replayed(basis: Basis, forces: Forces, wanted: Collection[int]) -> np.ndarray:
    """The coordinates (g, m) m kg^1/2 at the ends of the `wanted` steps, by the run's own scheme.

    The states are integrated once more under the forces of the run, which are known by now. Root
    process only.
    """
    unit = np.eye(basis.coordinates)
    response = couple(basis.states, unit, unit, np.zeros((3, len(unit))))
    scheme = recursive(forces.scheme)
    tire = Recursion(response=response, step=forces.step, scheme=scheme, comm=MPI.COMM_SELF)
    tire.start(forces.begun)
    found = np.empty((len(wanted), len(unit)))
    number = filled = 0
    for block in forces.pushes():
        for push in block:
            free = tire.predict()
            if number in wanted:
                found[filled] = free + tire.same_step @ push
                filled += 1
            tire.advance(push)
            number += 1
    return found
