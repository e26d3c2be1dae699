"""rotating: the second eigenproblem, on the modal basis."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np

from modal.campbell import critical_speed, onset
from modal.rotating import StateModes, checks, matrices, rotating
from runs.mpi import on_root
from runs.session import Session
from runs.store import put

_UNITS = {
    "eigenvalue": "1/s",
    "right": "-",
    "left": "s",
    "block": "1/s",
    "block_right": "-",
    "block_left": "s",
    "residual": "-",
    "left_residual": "-",
}


def inputs(session: Session) -> dict:
    """The modes, the damping, the speed and the inertia."""
    return {
        "modes": session.hashes["modes"],
        "damping": session.damping,
        "speed": session.speed,
        "inertia": session.scene.rotation.inertia,
    }


def compute(session: Session, path: Path) -> None:
    """Solve on the root process, share, store. Collective."""
    inertia = session.scene.rotation.inertia
    pencil = matrices(session.modal.projection, session.speed, session.damping, inertia)
    record = session.record
    with record.timing("eigensolver"):
        # One process solves: LAPACK on another could order repeated eigenvalues differently.
        modes = on_root(session.comm, lambda: rotating(*pencil))
        figures = on_root(session.comm, lambda: checks(modes, *pencil))
    session.state_modes = modes
    oscillating = modes.eigenvalue[modes.eigenvalue.imag > 0]
    record.headline |= {
        "pairs": (len(oscillating), "-"),
        "speed": (session.speed, "rad/s"),
        "critical speed": (critical_speed(session.modal.projection, inertia), "rad/s"),
    }
    if len(oscillating):
        record.headline["lowest"] = (float(oscillating.imag.min() / (2 * np.pi)), "Hz")
    record.indicators |= {name: (figure, "-") for name, figure in figures.items()}
    record.indicators |= {
        "basis condition": (modes.condition, "-"),
        "states in the near-defective block": (len(modes.block), "-"),
    }
    if modes.unstable:
        record.warnings.append(_growth(session, modes))
    session.write(path, "rotating", lambda file: _fill(file, session))


def _growth(session: Session, modes: StateModes) -> str:
    """What to say of a tire whose motion grows. Collective."""
    scene = session.scene

    def first() -> float:
        return onset(
            session.modal.projection, session.damping, scene.rotation.inertia, session.speed
        )

    fastest = max([*modes.eigenvalue.real, *np.linalg.eigvals(modes.block).real])
    return (
        f"{modes.unstable} motion(s) of the rolling tire grow by themselves, the fastest at "
        f"{fastest:.3g} 1/s; on this static state that begins at {on_root(session.comm, first):.4g} "
        "rad/s: the wheel turns beyond its critical speed"
    )


def _fill(file, session: Session) -> None:
    modes = session.state_modes
    for name, unit in _UNITS.items():
        put(file, name, getattr(modes, name), unit)
    put(file, "frequency", modes.eigenvalue.imag / (2 * np.pi), "Hz")
    file.attrs["speed"] = session.speed
    file.attrs["basis_condition"] = modes.condition
    file.attrs["first_unstable"] = modes.unstable


def reuse(session: Session, path: Path) -> None:
    """Read the state modes back. Collective."""

    def pick(file):
        values = {f.name: file[f.name][:] for f in fields(StateModes) if f.name != "condition"}
        return StateModes(condition=float(file.attrs["basis_condition"]), **values)

    session.state_modes = session.read(path, pick)
