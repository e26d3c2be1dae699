"""All forces on the tire in a completed run, relative to the static state, on its coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import h5py
import numpy as np
from scipy import sparse

from tireroad.contact.setup import ContactSetup
from tireroad.fem.static.state import StaticState
from tireroad.runs.files.store import opened
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.build.point_forces import histories
from tireroad.runs.stages.build.rolling.scheme import of_given_forces
from tireroad.runs.stages.build.setup import components, probes
from tireroad.runs.stages.stored.contact_file import ContactHistory

_ROWS = 4096  # steps read at a time


def driven_loads(job: Job, state: StaticState, setup: ContactSetup | None) -> sparse.csr_matrix:
    """The driven points (k, 3 s): the patch's nodes in all components, then prescribed forces."""
    loads = probes(job, state, setup).loads
    if setup is None:
        return loads
    patch = len(components(job)) * len(setup.patch.index)
    return loads[: patch + len(job.scene.force)]


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

        Only the normal ones have a static part here: a static state with friction excludes
        horizontal forces of the loop, whose bristles begin unloaded.
        """
        prescribed = histories(self.job.scene.force, self.time[some])
        if self.setup is None:
            return prescribed
        patch = self.setup.patch
        with h5py.File(self.job.path("contact")) as file:
            parts = [file["normal_force"][some] - file["static_force"][:]]
            if len(components(self.job)) > 1:
                parts += [file["horizontal_force"][some, :, k] for k in (0, 1)]
        if patch.weights is not None:
            parts = [(patch.weights.T @ part.T).T for part in parts]
        return np.hstack([*parts, prescribed])
