"""rotating: the second eigenproblem, on the modal basis."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from tireroad.modal.campbell import Campbell, critical_speed, growth, onset, sweep
from tireroad.modal.rotating import StateModes, checks, matrices, rotating
from tireroad.runs.files.store import put
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages import cavity, full_states
from tireroad.runs.stages.session import Session

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
    """The modes, the damping, the speed and the inertia; how many states only where it counts."""
    wanted = session.scene.rotation
    return {
        "modes": session.hashes["modes"],
        "damping": repr(session.damping),
        "speed": session.speed,
        "inertia": wanted.inertia,
        "campbell": asdict(wanted.campbell) if wanted.campbell else None,
        "full": (wanted.count, wanted.window) if wanted.method == "full" else None,
    }


def compute(session: Session, path: Path) -> None:
    """Solve on the root process, share, store. Collective."""
    inertia = session.scene.rotation.inertia
    projection = session.modal.projection
    pencil = matrices(projection, session.speed, session.damping, inertia)
    record = session.record
    with record.timing("eigensolver"):
        # One process solves: LAPACK on another could order repeated eigenvalues differently.
        modes = on_root(session.comm, lambda: rotating(*pencil))
        figures = on_root(session.comm, lambda: checks(modes, *pencil))
    record.indicators |= {f"projected: {name}": (figure, "-") for name, figure in figures.items()}
    if session.scene.rotation.method == "full":
        modes = full_states.compute(session, modes)
    session.state_modes = modes
    _describe(session, critical_speed(projection, inertia))
    if modes.unstable:
        record.warnings.append(_growth(session, projection))
    lines = _campbell(session, projection)
    session.write(path, "rotating", lambda file: _fill(file, session, lines))


def _campbell(session: Session, projection) -> Campbell | None:
    """Branches of eigenvalues over speed, where the scene asks for them. Collective."""
    wanted = session.scene.rotation.campbell
    if wanted is None:
        return None
    speeds = np.arange(0.0, wanted.to + wanted.step / 2, wanted.step)
    inertia = session.scene.rotation.inertia
    with session.record.timing("campbell"):
        lines = on_root(
            session.comm,
            lambda: sweep(projection, session.damping, inertia, speeds, wanted.branches),
        )
    session.record.indicators["least similarity along a branch"] = (
        float(np.nanmin(lines.similarity)),
        "-",
    )
    return lines


def _describe(session: Session, critical: float) -> None:
    record, modes = session.record, session.state_modes
    oscillating = modes.eigenvalue[modes.eigenvalue.imag > 0]
    record.headline |= {
        "pairs": (len(oscillating), "-"),
        "speed": (session.speed, "rad/s"),
        "critical speed": (critical, "rad/s"),
    }
    if session.modal.projection.air is not None:
        cavity.describe(session)
    if len(oscillating):
        record.headline["lowest"] = (float(oscillating.imag.min() / (2 * np.pi)), "Hz")
    record.indicators |= {
        "worst residual": (float(modes.residual.max(initial=0.0)), "-"),
        "worst left residual": (float(modes.left_residual.max(initial=0.0)), "-"),
        "basis condition": (modes.condition, "-"),
        "states in the near-defective block": (len(modes.block), "-"),
    }


def _growth(session: Session, projection) -> str:
    """What to say of a tire whose motion grows. Collective."""
    modes, inertia = session.state_modes, session.scene.rotation.inertia

    def first() -> float:
        if not growth(projection, session.speed, session.damping, inertia):
            return session.speed  # only the full problem has it
        return onset(projection, session.damping, inertia, session.speed)

    return (
        f"{modes.unstable} motion(s) of the rolling tire grow by themselves, the fastest at "
        f"{modes.fastest_growth:.3g} 1/s; on this static state that begins at {on_root(session.comm, first):.4g} "
        "rad/s: the wheel turns beyond its critical speed"
    )


def _fill(file, session: Session, lines: Campbell | None) -> None:
    modes = session.state_modes
    for name, unit in _UNITS.items():
        put(file, name, getattr(modes, name), unit)
    put(file, "frequency", modes.eigenvalue.imag / (2 * np.pi), "Hz")
    if session.scene.rotation.method == "full":
        put(file, "basis/shape", session.modal.shape, "kg^-1/2")
        put(file, "basis/momentum", session.modal.projection.momentum, "kg^1/2")
    if session.modal.projection.air is not None:
        put(file, "air_share", cavity.share(session), "-")
    if lines is not None:
        put(file, "campbell/speed", lines.speed, "rad/s")
        put(file, "campbell/eigenvalue", lines.eigenvalue, "1/s")
        put(file, "campbell/frequency", lines.frequency, "Hz")
        put(file, "campbell/similarity", lines.similarity, "-")
    file.attrs["speed"] = session.speed
    file.attrs["basis_condition"] = modes.condition
    file.attrs["first_unstable"] = modes.unstable


def reuse(session: Session, path: Path) -> None:
    """Read the state modes back. Collective."""

    def pick(file):
        values = {name: file[name][:] for name in _UNITS}
        states = StateModes(condition=float(file.attrs["basis_condition"]), **values)
        if "basis" not in file:
            return states, None
        return states, (file["basis/shape"][:], file["basis/momentum"][:])

    session.state_modes, basis = session.read(path, pick)
    if basis is not None:
        full_states.replace_basis(session, *basis)
