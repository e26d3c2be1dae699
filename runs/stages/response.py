"""response: prescribed point forces on the tire, in time and in frequency."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.runs.files.store import put
from tireroad.runs.process import observe
from tireroad.runs.stages.contact_file import DRIVEN
from tireroad.runs.stages.point_forces import directions, histories, shortest_period
from tireroad.runs.stages.session import Session
from tireroad.runs.stages.stepping import integration


def inputs(session: Session) -> dict:
    """The Green's functions, the forces, the time and what is read in frequency."""
    scene = session.scene
    return {
        "greens": session.hashes["greens"],
        "forces": [asdict(force) for force in scene.force],
        "time": asdict(scene.time) if scene.time else None,
        "receptance": asdict(scene.output.receptance) if scene.output.receptance else None,
        "contact": session.hashes.get("contact"),
        "axle_force": scene.output.axle_force,
        "also": [scene.output.velocity, scene.output.acceleration, scene.output.impulse],
    }


def compute(session: Session, path: Path) -> None:
    """Integrate and sweep, then store. Collective."""
    out: dict[str, tuple[np.ndarray, str]] = {}
    if session.scene.contact:
        out |= _in_contact(session)
    elif session.scene.time:
        out |= _in_time(session)
    if session.scene.time and session.scene.output.impulse:
        out["impulse"] = _impulse(session, out["time"][0]), "m/(N s)"
    if session.scene.output.receptance:
        out |= _in_frequency(session)

    def fill(file) -> None:
        for name, (values, unit) in out.items():
            put(file, name, values, unit)

    session.write(path, "response", fill)


def _in_contact(session: Session) -> dict:
    """What the contact loop found at the driven points, contact included. Collective."""

    def pick(file):
        axle = {"axle_force": (file["axle_force"][:], "N")} if "axle_force" in file else {}
        return file["time"][:], file[DRIVEN][:], axle

    time, displacement, axle = session.read(session.directory / "contact.h5", pick)
    largest = float(np.abs(displacement).max())
    session.record.headline["largest displacement"] = (largest, "m")
    return {
        "time": (time, "s"),
        "force": (histories(session.scene.force, time), "N"),
        "displacement": (displacement, "m"),
    } | axle


def _in_time(session: Session) -> dict:
    """Displacements and axle force of the prescribed forces. Collective."""
    forces = session.scene.force
    tire, step, steps, scheme = integration(
        session, session.force_response, shortest_period(forces)
    )
    time = step * np.arange(steps + 1)
    force = histories(forces, time)
    direction = directions(forces)
    displacement = np.zeros((steps + 1, 3 * len(forces)))
    axle = np.zeros((steps + 1, 3))
    tire.start(force[0])
    axle[0] = force[0] @ direction - tire.inertia_force()
    if not session.force_response.pulse:
        displacement[0] = session.force_response.residual @ force[0]
    with session.record.timing("time loop"), observe.Progress("response", steps) as bar:
        for k in range(1, steps + 1):
            free = tire.predict()
            tire.advance(force[k])
            displacement[k] = free + tire.same_step @ force[k]
            axle[k] = force[k] @ direction - tire.inertia_force()
            bar.advance()
    session.record.headline |= {
        "step": (step, "s"),
        "scheme": (scheme, "-"),
        "largest displacement": (float(np.abs(displacement).max()), "m"),
    }
    out = {
        "time": (time, "s"),
        "force": (force, "N"),
        "displacement": (displacement.reshape(steps + 1, -1, 3), "m"),
    }
    if session.scene.output.axle_force and not _drifts(
        session
    ):  # nothing holds the axle of a free rim
        out["axle_force"] = axle, "N"
    return out | _rates(session, time, step, "linear" if scheme == "convolution" else scheme)


def _rates(session: Session, time: np.ndarray, step: float, scheme: str) -> dict:
    """Velocities and accelerations of the driven points, where wanted. Collective."""
    output, response = session.scene.output, session.force_response.resolved(step)
    velocity = response.rate()
    forces = [histories(session.scene.force, time, order) for order in range(3)]
    out = {}
    if output.velocity:
        moved = _march(session, velocity, step, scheme, forces[0])
        out["velocity"] = moved + forces[1] @ response.residual.T, "m/s"
    if output.acceleration:
        moved = _march(session, velocity.rate(), step, scheme, forces[0])
        moved += forces[1] @ velocity.residual.T + forces[2] @ response.residual.T
        out["acceleration"] = moved, "m/s2"
    return {name: (v.reshape(len(time), -1, 3), unit) for name, (v, unit) in out.items()}


def _impulse(session: Session, time: np.ndarray) -> np.ndarray:
    """g (nt, k, k) along the forces, without the residual's delta at t = 0."""
    with session.record.timing("impulse responses"):
        return _along(session.force_response.impulse(time), session.scene.force)


def _march(session: Session, response: Response, step: float, scheme: str, force) -> np.ndarray:
    """Readings (nt, r) under forces (nt, k) from rest. Collective."""
    tire = Recursion(response, step, scheme, session.comm)
    tire.start(force[0])
    out = [response.residual @ force[0]]
    for new in force[1:]:
        free = tire.predict()
        tire.advance(new)
        out.append(free + tire.same_step @ new)
    return np.stack(out)


def _in_frequency(session: Session) -> dict:
    """Receptances between the driven points, each along its own force."""
    wanted, forces = session.scene.output.receptance, session.scene.force
    frequency = np.arange(0.0, wanted.to + wanted.step / 2, wanted.step)
    if _drifts(session):
        frequency = frequency[1:]
    with session.record.timing("receptance"):
        full = session.force_response.receptance(frequency)
    along = _along(full, forces)
    peak = int(np.abs(along[:, 0, 0]).argmax())
    session.record.headline["largest receptance"] = (float(np.abs(along[peak, 0, 0])), "m/N")
    session.record.headline["at"] = (float(frequency[peak]), "Hz")
    out = {"frequency": (frequency, "Hz"), "receptance": (along, "m/N")}
    return out | (_direct(session) if wanted.direct else {})


def _drifts(session: Session) -> bool:
    """Whether a constant force moves the tire ever further: it has no receptance at 0 Hz then."""
    return session.scene.modal.rim == "free"


def _along(full: np.ndarray, forces) -> np.ndarray:
    """Each point's displacement along its own force, (n, k, k), from its components (n, 3 k, k)."""
    components = full.reshape(len(full), len(forces), 3, len(forces))
    return np.einsum("frdk,rd->frk", components, directions(forces))


def _direct(session: Session) -> dict:
    """The same receptances without modes, at a few frequencies, and how far the modes are off."""
    wanted, forces = session.scene.output.receptance, session.scene.force
    frequency = wanted.to * np.arange(1, wanted.direct + 1) / wanted.direct
    with session.record.timing("receptance of the full matrices"):
        full = session.wheel.receptance(session.readings, session.loads, frequency)
    off = session.force_response.receptance(frequency) - full
    share = np.linalg.norm(off, axis=(1, 2)) / np.linalg.norm(full, axis=(1, 2))
    name = f"receptance off the full matrices' up to {wanted.to:.4g} Hz"
    session.record.indicators[name] = (float(share.max()), "-")
    return {
        "direct/frequency": (frequency, "Hz"),
        "direct/receptance": (_along(full, forces), "m/N"),
    }


def reuse(session: Session, path: Path) -> None:
    """Nothing later needs it."""
