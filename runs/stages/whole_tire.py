"""Base of the stages that show the whole tire under the forces of a completed run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, TypeVar

import numpy as np
from scipy import signal

from tireroad.contact.results.spectra import amplitudes
from tireroad.contact.setup import ContactSetup
from tireroad.fem.errors import InputError
from tireroad.fem.static.state import StaticState
from tireroad.greens.basis import Basis
from tireroad.greens.responses import Wanted, band
from tireroad.modal.rolling import RollingModes
from tireroad.runs.process.mpi import on_root
from tireroad.runs.results.wave import FADE
from tireroad.runs.stages.contact_file import ContactHistory
from tireroad.runs.stages.replay import PatchForces, driven_loads, replayed
from tireroad.runs.stages.spectra import Spectra
from tireroad.runs.stages.stage import Computed, PipelinePart, Result, Shared

_AT_ONCE = 64  # coordinates transformed at a time, to save memory
P = TypeVar("P")


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
