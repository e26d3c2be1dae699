"""spectra: contact and axle force in frequency."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from tireroad.contact.setup import ContactSetup
from tireroad.contact.spectra import amplitudes, third_octaves
from tireroad.runs.files.store import put
from tireroad.runs.stages.build import corner
from tireroad.runs.stages.record import Record
from tireroad.runs.stages.stage import Computed, Done
from tireroad.runs.stages.stored.contact_file import ContactHistory

_FEWEST = 32  # steps of which a spectrum says anything


@dataclass(frozen=True, kw_only=True)
class Spectra:
    """Complex amplitudes over `frequency` (f,) Hz of the `contact_force` and, where it is kept, of the
    `axle_force`, (f, 3) N; its third octaves: band `centre` (b,) Hz and `level` (b, 3) dB re 1 N. The
    first `left_out` s of the run, its run-in, are not in them. `wheel`: the motions of a wheel that moves and the
    moments on its hub, (f, 3) or (f, 1), by the names of runs.stages.corner.
    """

    frequency: np.ndarray
    contact_force: np.ndarray
    left_out: float
    wheel: dict[str, np.ndarray] = field(default_factory=dict)
    axle_force: np.ndarray | None = None
    centre: np.ndarray | None = None
    level: np.ndarray | None = None


_UNITS = {
    "frequency": ("frequency", "Hz"),
    "contact_force": ("contact_force", "N"),
    "axle_force": ("axle_force", "N"),
    "centre": ("third_octave/centre", "Hz"),
    "level": ("third_octave/level", "dB re 1 N"),
}


@dataclass(frozen=True, kw_only=True)
class SpectraStage(Computed[Spectra]):
    """From the history of the contact, after the run-in."""

    name: ClassVar[str] = "spectra"
    contact: Done[ContactHistory]
    setup: Done[ContactSetup]

    def inputs(self) -> dict:
        """The contact forces: the length of road that is left out as run-in is in them."""
        return {"contact": self.contact.key}

    def compute(self, record: Record) -> Spectra:
        """Not collective."""
        history = self.contact.product
        start, step = self._after_run_in(record, history.time), history.step
        total = history.total_force[start:]
        if len(total) < _FEWEST:
            record.warnings.append(
                f"the spectra are of {len(total)} steps: lengthen time.duration to have any use of them"
            )
        frequency, contact = amplitudes(total, step)
        record.headline["resolution"] = (1 / (len(total) * step), "Hz")
        axle = {}
        if history.axle_force is not None:
            _, amplitude = amplitudes(history.axle_force[start:], step)
            centre, level = third_octaves(history.axle_force[start:], step)
            axle = {"axle_force": amplitude, "centre": centre, "level": level}
            _largest(record, frequency, amplitude)
        wheel = {
            name: amplitudes(values[start:].reshape(len(total), -1), step)[1]
            for name, values in history.wheel.items()
        }
        if start:
            record.headline["left out as run-in"] = (start * step, "s")
        return Spectra(
            frequency=frequency, contact_force=contact, left_out=start * step, wheel=wheel, **axle
        )

    def _after_run_in(self, record: Record, time: np.ndarray) -> int:
        """First step with the whole patch beyond the run-in.

        0, and a warning, when that takes half the run or more: what is left would resolve too little.
        """
        setup, road = self.setup.product, self.job.scene.road
        speed = setup.rolled.speed
        if speed == 0 or road.kind == "flat":
            return 0
        x0, x1, _, _ = setup.patch.extent
        run_in = (road.run_in + x1 - x0) / speed
        start = int(np.searchsorted(time, run_in))
        if start < len(time) // 2:
            return start
        record.warnings.append(
            f"the spectra hold the run-in: with the patch it takes {run_in:.3g} s of the run's "
            f"{time[-1]:.3g} s, and half or more cannot be left out; take time.duration above "
            f"{2 * run_in:.2g} s, or a shorter road.run_in"
        )
        return 0

    def write(self, file, product: Spectra) -> None:
        """All there is."""
        for name, (stored, unit) in _UNITS.items():
            if getattr(product, name) is not None:
                put(file, stored, getattr(product, name), unit)
        for name, values in product.wheel.items():
            put(file, name, values, corner.UNITS[name])
        file.attrs["left_out"] = product.left_out

    def read(self, file) -> Spectra:
        """The same."""
        kept = {name: file[stored][:] for name, (stored, _) in _UNITS.items() if stored in file}
        wheel = {name: file[name][:] for name in corner.UNITS if name in file}
        return Spectra(left_out=float(file.attrs["left_out"]), wheel=wheel, **kept)


def _largest(record: Record, frequency: np.ndarray, axle: np.ndarray) -> None:
    """The largest line of the vertical axle force below 1 kHz, away from the mean."""
    band = np.flatnonzero((np.arange(len(frequency)) > 2) & (frequency < 1000))
    if len(band):
        peak = band[np.abs(axle[band, 2]).argmax()]
        record.headline["largest vertical axle force"] = (float(np.abs(axle[peak, 2])), "N")
        record.headline["at"] = (float(frequency[peak]), "Hz")
