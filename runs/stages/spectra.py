"""spectra: contact and axle force in frequency."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tireroad.contact.spectra import amplitudes, third_octaves
from tireroad.runs.files.store import put
from tireroad.runs.stages.session import Session


def inputs(session: Session) -> dict:
    """The contact forces and the length of road that is left out as run-in."""
    return {"contact": session.hashes["contact"]}


def compute(session: Session, path: Path) -> None:
    """From the stored time series, after the run-in. Collective."""
    contact = session.directory / "contact.h5"

    def pick(file):
        start = _after_run_in(session, file["time"][:])
        return (
            float(file.attrs["step"]),
            file["axle_force"][start:],
            file["total_force"][start:],
        )

    step, axle, total = session.read(contact, pick)
    record = session.record
    if len(axle) < 32:
        record.warnings.append(
            f"only {len(axle)} steps are left after the run-in: lengthen time.duration"
        )
    frequency, axle_amplitude = amplitudes(axle, step)
    _, contact_amplitude = amplitudes(total, step)
    centre, level = third_octaves(axle, step)
    record.headline["resolution"] = (float(frequency[1]), "Hz")
    band = (frequency > 2 * frequency[1]) & (frequency < 1000)
    if band.any():
        peak = np.flatnonzero(band)[np.abs(axle_amplitude[band, 2]).argmax()]
        record.headline["largest vertical axle force"] = (
            float(np.abs(axle_amplitude[peak, 2])),
            "N",
        )
        record.headline["at"] = (float(frequency[peak]), "Hz")

    def fill(file) -> None:
        put(file, "frequency", frequency, "Hz")
        put(file, "axle_force", axle_amplitude, "N")
        put(file, "contact_force", contact_amplitude, "N")
        put(file, "third_octave/centre", centre, "Hz")
        put(file, "third_octave/level", level, "dB re 1 N")

    session.write(path, "spectra", fill)


def _after_run_in(session: Session, time: np.ndarray) -> int:
    """First step with the whole patch beyond the run-in; 0 when that takes more than half the run."""
    speed = session.road_speed
    if speed == 0:
        return 0
    x0, x1, _, _ = session.patch.extent
    run_in = session.scene.road.run_in if session.scene.road.kind != "flat" else 0.0
    start = int(np.searchsorted(time, (run_in + x1 - x0) / speed))
    return start if start < len(time) // 2 else 0


def reuse(session: Session, path: Path) -> None:
    """Nothing later needs it."""
