"""The tire's responses as a scene wants them: residual, dynamic states, their price, their storage."""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np

from tireroad.greens.response import Response
from tireroad.greens.state_selection import keep
from tireroad.greens.truncation import Cutoff, estimate
from tireroad.modal.damping import beyond
from tireroad.runs.files.store import put
from tireroad.runs.stages.session import Session

# Points and frequencies at which the truncation is estimated: enough for its size.
_SAMPLE = 40
_FREQUENCIES = 25
# Residual states faster than this many times the highest mode follow statically: they would set the
# automatic step and change the receptance up to half the highest mode by 0.001 at most (measured).
_FASTEST = 3.0

_UNITS = {
    "eigenvalue": "1/s",
    "output": "kg^-1/2",
    "input": "s/kg^1/2",
    "block": "1/s",
    "block_output": "kg^-1/2",
    "block_input": "s/kg^1/2",
    "residual": "m/N",
    "momentum": "kg^1/2",
    "block_momentum": "kg^1/2",
}


def make(session: Session, outputs, loads) -> Response:
    """The response with the scene's residual. Collective."""
    option = session.scene.greens.residual
    basis = session.basis
    if option == "none":
        return basis.couple(outputs, loads)
    modes = known = None
    if option == "attachment":
        # Vectors that are solved once more are not those of the stored projection.
        known = session.modal.projection if "modes" in vars(session) else None
        modes = session.modes
    with session.record.timing("residual flexibility"):
        response = session.wheel.respond(basis, modes, outputs, loads, option, known)
    if option in ("static", "dirac"):
        return response
    cutoff = _cutoff(session)
    limit = _FASTEST * max(cutoff.circular, cutoff.rate)
    return response.keeping_where(lambda s: np.abs(s) <= limit)


def chosen(session: Session, response: Response) -> Response:
    """The states that stay dynamic; without a residual the others are gone altogether."""
    wanted = session.scene.greens
    if wanted.dynamic is None:
        return response
    kept = keep(response, wanted.dynamic, _band(session), wanted.choice)
    return replace(kept, residual=response.residual) if wanted.residual == "none" else kept


def _band(session: Session) -> float:
    """Frequencies that matter, Hz: as given, or up to half the highest mode."""
    return session.scene.greens.band or _cutoff(session).circular / (4 * np.pi)


def _cutoff(session: Session) -> Cutoff:
    """The highest mode, or state of the full problem, and the damping of those beyond it."""
    circular = 2 * np.pi * session.modal.frequency[-1]
    if session.speed and session.scene.rotation.method == "full":
        circular = np.abs(session.state_modes.eigenvalue.imag).max()
    mass, stiffness = beyond(session.damping, session.modal.projection)
    return Cutoff(circular, mass + stiffness * circular**2)


def judge(session: Session, name: str, whole: Response, response: Response) -> None:
    """How far off the receptance may be within the band: by the modes left out, by the states."""
    band, record = _band(session), session.record
    some = [slice(None, None, -(-n // _SAMPLE)) for n in whole.residual.shape]
    whole, response = whole.between(*some), response.between(*some)
    frequency = np.linspace(0, band, _FREQUENCIES)[1 if whole.rigid else 0 :]
    off = estimate(whole, session.scene.greens.residual, _cutoff(session), frequency)
    label = f"up to {band:.4g} Hz, {name}"
    record.indicators[f"estimated truncation error {label}"] = (float(off.max()), "-")
    if session.scene.greens.dynamic is not None:
        H = whole.receptance(frequency)
        lost = np.linalg.norm(response.receptance(frequency) - H, axis=(1, 2))
        lost /= np.linalg.norm(H, axis=(1, 2))
        record.indicators[f"error of the states made static {label}"] = (float(lost.max()), "-")


def fill_response(file: h5py.File, name: str, response: Response) -> None:
    """Write a response as a group, and its static flexibility for whoever reads the file."""
    for key, unit in _UNITS.items():
        put(file, f"{name}/{key}", getattr(response, key), unit)
    put(file, f"{name}/static_flexibility", response.residual + response.static(), "m/N")
    file[name].attrs["rigid_states"] = response.rigid


def read_responses(file: h5py.File, pulse: bool) -> dict[str, Response]:
    """All the responses of a file, by name."""
    return {
        name: Response(
            **{key: group[key][:] for key in _UNITS},
            pulse=pulse,
            rigid=int(group.attrs["rigid_states"]),
        )
        for name, group in file.items()
        if "output" in group
    }
