"""Base of the stages that show the whole tire under the forces of a completed run."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import ClassVar, TypeVar

import h5py
import numpy as np
from scipy import signal, sparse

from tireroad.contact.results.spectra import amplitudes
from tireroad.contact.setup import ContactSetup
from tireroad.fem.errors import InputError
from tireroad.fem.static.state import StaticState
from tireroad.greens.basis import Basis
from tireroad.greens.recursion import marched
from tireroad.greens.response import couple
from tireroad.greens.responses import Wanted, band
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.store import opened
from tireroad.runs.process.mpi import on_root
from tireroad.runs.results.wave import FADE
from tireroad.runs.stages.contact_file import INITIAL, ContactHistory
from tireroad.runs.stages.rolling import histories, of_given_forces, recursive
from tireroad.runs.stages.setup import components, probes
from tireroad.runs.stages.spectra import Spectra
from tireroad.runs.stages.stage import Computed, Job, PipelinePart, Result, Shared

_ROWS = 1024  # steps read at a time
_AT_ONCE = 64  # coordinates transformed at a time, to save memory
P = TypeVar("P")


def driven_loads(job: Job, state: StaticState, setup: ContactSetup | None) -> sparse.csr_matrix:
    """The driven points (k, 3 s): the patch's nodes in all components, then prescribed forces."""
    loads = probes(job, state, setup).loads
    if setup is None:
        return loads
    patch = len(components(job)) * len(setup.patch.index)
    return loads[: patch + len(job.scene.force)]


@dataclass(frozen=True, kw_only=True)
class PatchForces:
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
    ) -> PatchForces:
        """From the file of the contact, or of the response to given forces. Root process only."""
        if history is not None:
            time, step, scheme = history.time, history.step, history.scheme
        else:
            with opened(job.path("response")) as file:
                time = file["time"][1:]  # the ends of the steps
            step, scheme = float(time[0]), of_given_forces(job.scene)
        return PatchForces(job=job, setup=setup, time=time, step=step, scheme=scheme, seen=seen)

    @property
    def always(self) -> np.ndarray:
        """Modal forces (m,) N kg^-1/2 of the state in which the loop begins: they have always been there."""
        if self.setup is None:
            return np.zeros(self.seen.shape[1])
        names = INITIAL, "initial_horizontal_force"
        with h5py.File(self.job.path("contact")) as file:
            if names[0] not in file:
                return np.zeros(self.seen.shape[1])
            columns = np.hstack(self._on_nodes(file, *(file[name][:][None] for name in names)))[0]
        return columns @ self.seen[: len(columns)]

    @property
    def sudden(self) -> np.ndarray:
        """Modal forces (m,) N kg^-1/2 that come at t = 0: the prescribed ones alone."""
        force = self.job.scene.force
        return histories(force, np.zeros(1))[0] @ self.seen[len(self.seen) - len(force) :]

    def pushes(self, start: int = 0) -> Iterator[np.ndarray]:
        """Modal forces (n, m) N kg^-1/2 from step `start` on, block by block. Root process only."""
        for first in range(start, len(self.time), _ROWS):
            yield self._force(slice(first, first + _ROWS)) @ self.seen

    def _force(self, some: slice) -> np.ndarray:
        """Forces (n, k) N in the order of the driven points."""
        prescribed = histories(self.job.scene.force, self.time[some])
        if self.setup is None:
            return prescribed
        with h5py.File(self.job.path("contact")) as file:
            horizontal = self.job.scene.horizontal_forces
            arguments = (
                file["normal_force"][some],
                file["horizontal_force"][some] if horizontal else None,
            )
            return np.hstack([*self._on_nodes(file, *arguments), prescribed])

    def _on_nodes(
        self, file: h5py.File, normal: np.ndarray, horizontal: np.ndarray | None
    ) -> list[np.ndarray]:
        """Changes (n, p) N of the forces on the nodes from the static state, in z and, if given, x and y.

        A static state with friction has horizontal forces of its own.
        """
        parts = [normal - file["static_force"][:]]
        if horizontal is not None:
            held = file.get("static_horizontal_force")
            begun = np.zeros(2) if held is None else held[:]
            parts += [(horizontal - begun)[:, :, k] for k in (0, 1)]
        weights = self.setup.patch.weights if self.setup else None
        return parts if weights is None else [(weights.T @ part.T).T for part in parts]


@dataclass(frozen=True, kw_only=True)
class OfRun(PipelinePart[P]):
    """A part that takes the run's forces and states."""

    static: Result[StaticState]
    rotating: Result[RollingModes]
    setup: Result[ContactSetup | None]
    contact: Result[ContactHistory] | None = None

    @property
    def band(self) -> float:
        """Upper end of the frequency band of interest, Hz."""
        return band(self.rotating.product, Wanted(band=self.job.scene.greens.band))

    def taken_in(self) -> tuple[Basis, Callable[[], PatchForces]]:
        """The basis, and what reads the forces on the root process. Collective."""
        basis, setup = Basis.of(self.rotating.product), self.setup.product
        loads = driven_loads(self.job, self.static.product, setup)
        contact = self.contact.product if self.contact else None
        return basis, lambda: PatchForces.of(self.job, setup, contact, basis.seen(loads))


@dataclass(frozen=True, kw_only=True)
class Lines:
    """The coordinates of the tire over frequency, after the run-in, up to the model's limit.

    `frequency` (f,) Hz; `amplitude` (f, m): under a Hann window, scaled to show a sine in full;
    `spectrum` (f, m): the transform of the record of `duration` s whose ends fade, so that the
    motion over time is that of its lines.
    """

    frequency: np.ndarray
    amplitude: np.ndarray
    spectrum: np.ndarray
    duration: float


@dataclass(frozen=True, kw_only=True)
class LinesOfRun(OfRun[Lines | None], Shared[Lines | None]):
    """Not the receptance times the forces of the window: what rings at its start is part of it."""

    name: ClassVar[str] = "lines"
    spectra: Result[Spectra] | None = None

    def make(self) -> Lines | None:
        """On the root process, None on the others. Collective."""
        lines: list[Lines] = []
        basis, forces = self.taken_in()
        spectra = self.spectra.product if self.spectra else None
        top = spectra.limit.frequency if spectra else self.band
        left_out = spectra.left_out if spectra else 0.0
        on_root(self.job.comm, lambda: lines.append(_lines(basis, forces(), left_out, top)))
        return lines[0] if lines else None


def _lines(basis: Basis, forces: PatchForces, left_out: float, top: float) -> Lines:
    """After `left_out` s and up to `top` Hz."""
    steps = range(round(left_out / forces.step), len(forces.time))
    frequency = np.fft.rfftfreq(len(steps), forces.step)
    below = (frequency > 0) & (frequency <= top)
    if not below.any():
        raise InputError(
            f"output.vibration, [sound]: {len(steps) * forces.step:.3g} s of forces have no spectral line up to "
            f"the {top:.4g} Hz to which the modes are an answer; raise time.duration or modal.count"
        )
    moved = replayed(basis, forces, steps)
    amplitude, spectrum = transformed(moved, forces.step, below)
    return Lines(
        frequency=frequency[below],
        amplitude=amplitude,
        spectrum=spectrum,
        duration=len(steps) * forces.step,
    )


def transformed(
    values: np.ndarray, step: float, indices: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude and spectrum (f, d), as those of `Lines`, of values (n, d) at the lines `indices` (mask or numbers)."""
    faded = signal.windows.tukey(len(values), 2 * FADE)[:, None]
    amplitude, spectrum = [], []
    for k in range(0, values.shape[1], _AT_ONCE):
        part = values[:, k : k + _AT_ONCE]
        part = part - part.mean(axis=0)
        amplitude.append(amplitudes(part, step)[1][indices])
        spectrum.append(np.fft.rfft(faded * part, axis=0)[indices] / len(values))
    return np.hstack(amplitude), np.hstack(spectrum)


@dataclass(frozen=True, kw_only=True)
class WholeTire(OfRun[P], Computed[P]):
    """A stage that shows the whole tire under the forces of the run. Its product is the root's alone."""

    reads: ClassVar[tuple[str, ...]] = ("force", "time", "greens.band")


def replayed(basis: Basis, forces: PatchForces, numbers: Collection[int]) -> np.ndarray:
    """The coordinates (g, m) m kg^1/2 at the ends of the steps `numbers`, by the run's own scheme.

    The states are integrated once more under the forces of the run, which are known by now. Root
    process only.
    """
    unit = np.eye(basis.coordinates)
    response = couple(basis.states, unit, unit, np.zeros((3, len(unit))))
    always = forces.always
    begun = always + forces.sudden, forces.pushes(), always
    arguments = response, forces.step, recursive(forces.scheme), *begun
    values = np.empty((len(numbers), len(unit)))
    number = filled = 0
    for moved in marched(*arguments):
        some = [k for k in range(len(moved)) if number + k in numbers]
        values[filled : filled + len(some)] = moved[some]
        filled, number = filled + len(some), number + len(moved)
    return values
