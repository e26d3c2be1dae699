"""response: prescribed point forces on the tire, in time and in frequency."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from runs import observe
from runs.session import Session
from runs.stages.contact import integration
from runs.store import put


def inputs(session: Session) -> dict:
    """The Green's functions, the forces, the time and what is read in frequency."""
    scene = session.scene
    return {
        "greens": session.hashes["greens"],
        "forces": [asdict(force) for force in scene.force],
        "time": asdict(scene.time) if scene.time else None,
        "receptance": asdict(scene.output.receptance) if scene.output.receptance else None,
    }


def compute(session: Session, path: Path) -> None:
    """Integrate and sweep, then store. Collective."""
    out: dict[str, tuple[np.ndarray, str]] = {}
    if session.scene.time:
        out |= _in_time(session)
    if session.scene.output.receptance:
        out |= _in_frequency(session)

    def fill(file) -> None:
        for name, (values, unit) in out.items():
            put(file, name, values, unit)

    session.write(path, "response", fill)


def _in_time(session: Session) -> dict:
    """Displacements and axle force of the prescribed forces. Collective."""
    forces = session.scene.force
    fastest = max(force.frequency for force in forces)
    shortest = 1 / fastest if fastest else np.inf
    tire, step, steps, scheme = integration(session, session.force_response, shortest)
    time = step * np.arange(steps + 1)
    force = np.stack([_history(f, time) for f in forces], axis=-1)
    direction = _directions(forces)
    displacement = np.zeros((steps + 1, 3 * len(forces)))
    axle = np.zeros((steps + 1, 3))
    tire.start(force[0])
    axle[0] = force[0] @ direction - tire.inertia_force()
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
    return {
        "time": (time, "s"),
        "force": (force, "N"),
        "displacement": (displacement.reshape(steps + 1, -1, 3), "m"),
        "axle_force": (axle, "N"),
    }


def _directions(forces) -> np.ndarray:
    """Unit vectors of the forces, (k, 3)."""
    given = np.array([force.direction for force in forces])
    return given / np.linalg.norm(given, axis=1, keepdims=True)


def _history(force, time: np.ndarray) -> np.ndarray:
    """amplitude sin(2 pi f t), or the constant amplitude from t = 0 on, N."""
    if force.frequency == 0:
        return np.full(len(time), force.amplitude)
    return force.amplitude * np.sin(2 * np.pi * force.frequency * time)


def _in_frequency(session: Session) -> dict:
    """Receptances between the driven points, each along its own force."""
    wanted, forces = session.scene.output.receptance, session.scene.force
    frequency = np.arange(0.0, wanted.to + wanted.step / 2, wanted.step)
    with session.record.timing("receptance"):
        full = session.force_response.receptance(frequency)
    direction = _directions(forces)
    components = full.reshape(len(frequency), len(forces), 3, len(forces))
    along = np.einsum("frdk,rd->frk", components, direction)
    peak = int(np.abs(along[:, 0, 0]).argmax())
    session.record.headline["largest receptance"] = (float(np.abs(along[peak, 0, 0])), "m/N")
    session.record.headline["at"] = (float(frequency[peak]), "Hz")
    return {"frequency": (frequency, "Hz"), "receptance": (along, "m/N")}


def reuse(session: Session, path: Path) -> None:
    """Nothing later needs it."""
