"""All forces on the tire in a completed run, relative to the static state, on its coordinates.

Common base of the stages that show the whole tire under the forces of a completed run.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

import h5py
import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.contact.setup import ContactSetup
from tireroad.fem.static.state import StaticState
from tireroad.greens.basis import Basis
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import couple
from tireroad.greens.responses import Wanted, band
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.store import opened
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages.contact_file import ContactHistory
from tireroad.runs.stages.rolling import histories, of_given_forces, recursive
from tireroad.runs.stages.setup import components, leaning, leaning_loads, probes
from tireroad.runs.stages.stage import Computed, Done, Job, Record

_ROWS = 4096  # steps read at a time


def driven_loads(job: Job, state: StaticState, setup: ContactSetup | None) -> sparse.csr_matrix:
    """The driven points (k, 3 s): the patch's nodes in all components, then prescribed forces."""
    loads = probes(job, state, setup).loads
    if setup is None:
        return loads
    patch = len(components(job)) * len(setup.patch.index)
    forces = loads[patch : patch + len(job.scene.force)]
    if not leaning(job):
        return loads[: patch + len(job.scene.force)]
    aside = leaning_loads(state, setup, loads.shape[1])
    return sparse.vstack([loads[:patch], aside, forces], format="csr")


@dataclass(frozen=True, kw_only=True)
class Forces:
    """The forces of the steps ending at `time` (n,) s, `step` s apart, integrated by `scheme`.

    They count from the static state, as the loop's do. `seen` (k, m) kg^-1/2: the coordinates'
    displacements at the driven points.
    """

    job: Job
    setup: ContactSetup | None
    time: np.ndarray
    step: float
    scheme: str
    seen: np.ndarray

    @staticmethod
    def of(
        job: Job, setup: ContactSetup | None, history: ContactHistory | None, seen: np.ndarray
    ) -> Forces:
        """From the file of the contact, or of the response to given forces. Root process only."""
        if history is not None:
            time, step, scheme = history.time, history.step, history.scheme
        else:
            with opened(job.path("response")) as file:
                time = file["time"][1:]  # the ends of the steps
            step, scheme = float(time[0]), of_given_forces(job.scene)
        return Forces(job=job, setup=setup, time=time, step=step, scheme=scheme, seen=seen)

    @property
    def begun(self) -> np.ndarray:
        """Modal forces (m,) N kg^-1/2 at t = 0: the prescribed ones alone."""
        given = self.job.scene.force
        return histories(given, np.zeros(1))[0] @ self.seen[len(self.seen) - len(given) :]

    def pushes(self, start: int = 0) -> Iterator[np.ndarray]:
        """Modal forces (n, m) N kg^-1/2 from step `start` on, block by block. Root process only."""
        for first in range(start, len(self.time), _ROWS):
            yield self._force(slice(first, first + _ROWS)) @ self.seen

    def _force(self, some: slice) -> np.ndarray:
        """Forces (n, k) N in the order of the driven points.

        Bristles begin unloaded; a static state with friction has horizontal forces of its own.
        """
        prescribed = histories(self.job.scene.force, self.time[some])
        if self.setup is None:
            return prescribed
        patch = self.setup.patch
        with h5py.File(self.job.path("contact")) as file:
            parts = [file["normal_force"][some] - file["static_force"][:]]
            if self.job.scene.horizontal_forces:
                held = file.get("static_horizontal_force")
                begun = np.zeros(2) if held is None else held[:]
                parts += [(file["horizontal_force"][some] - begun)[:, :, k] for k in (0, 1)]
        if patch.weights is not None:
            parts = [(patch.weights.T @ part.T).T for part in parts]
        return np.hstack([*parts, prescribed])


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
