"""spectra: contact and axle force in frequency."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tireroad.contact.spectra import amplitudes, third_octaves
from tireroad.runs.files.store import put
from tireroad.runs.stages.session import Record, Session

_FEWEST = 32  # steps of which a spectrum says anything


def inputs(session: Session) -> dict:
    """The contact forces: the length of road that is left out as run-in is in them."""
    return {"contact": session.hashes["contact"]}


def compute(session: Session, path: Path) -> None:
    """From the stored time series, after the run-in. Collective."""
    contact = session.directory / "contact.h5"

    def pick(file):
        start = _after_run_in(session, file["time"][:])
        names = [name for name in ("axle_force", "total_force") if name in file]
        return float(file.attrs["step"]), start, {name: file[name][start:] for name in names}

    step, start, forces = session.read(contact, pick)
    record = session.record
    count = len(forces["total_force"])
    if count < _FEWEST:
        record.warnings.append(
            f"the spectra are of {count} steps: lengthen time.duration to have any use of them"
        )
    spectra = {name: amplitudes(values, step) for name, values in forces.items()}
    frequency, _ = spectra["total_force"]
    record.headline["resolution"] = (1 / (count * step), "Hz")
    if "axle_force" in spectra:
        _largest(record, *spectra["axle_force"])
    if start:
        record.headline["left out as run-in"] = (start * step, "s")

    def fill(file) -> None:
        put(file, "frequency", frequency, "Hz")
        put(file, "contact_force", spectra["total_force"][1], "N")
        if "axle_force" in spectra:
            centre, level = third_octaves(forces["axle_force"], step)
            put(file, "axle_force", spectra["axle_force"][1], "N")
            put(file, "third_octave/centre", centre, "Hz")
            put(file, "third_octave/level", level, "dB re 1 N")
        file.attrs["left_out"] = start * step

    session.write(path, "spectra", fill)


def _largest(record: Record, frequency: np.ndarray, axle: np.ndarray) -> None:
    """The largest line of the vertical axle force below 1 kHz, away from the mean."""
    band = np.flatnonzero((np.arange(len(frequency)) > 2) & (frequency < 1000))
    if len(band):
        peak = band[np.abs(axle[band, 2]).argmax()]
        record.headline["largest vertical axle force"] = (float(np.abs(axle[peak, 2])), "N")
        record.headline["at"] = (float(frequency[peak]), "Hz")


def _after_run_in(session: Session, time: np.ndarray) -> int:
    """First step with the whole patch beyond the run-in.

    0, and a warning, when that takes half the run or more: what is left would resolve too little.
    """
    speed, kind = session.road_speed, session.scene.road.kind
    if speed == 0 or kind == "flat":
        return 0
    x0, x1, _, _ = session.patch.extent
    run_in = (session.scene.road.run_in + x1 - x0) / speed
    start = int(np.searchsorted(time, run_in))
    if start < len(time) // 2:
        return start
    session.record.warnings.append(
        f"the spectra hold the run-in: with the patch it takes {run_in:.3g} s of the run's "
        f"{time[-1]:.3g} s, and half or more cannot be left out; take time.duration above "
        f"{2 * run_in:.2g} s, or a shorter road.run_in"
    )
    return 0


def reuse(session: Session, path: Path) -> None:
    """Nothing later needs it."""
