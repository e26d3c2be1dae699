"""States of the rolling tire from the full finite-element matrices, in the place of the projected ones.

Their fields take the place of the modes too: the basis is M-orthonormal, as that of the modes is, and
spans [Re U, Im U, Re W, Im W], with U the right and W the left vectors (n, q).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tireroad.modal import quadratic
from tireroad.modal.agreement import missing, truncation
from tireroad.modal.fields import gram
from tireroad.modal.quadratic import FullModes
from tireroad.modal.rotating import StateModes
from tireroad.runs.stages.session import Session

_ROUNDING = 1e-14  # of the largest squared length: directions below are the fields' rounding


def compute(session: Session, projected: StateModes) -> StateModes:
    """Solve, put the fields into `session.modal`, and say how far the projected states are off. Collective."""
    operators, wheel = session.operators, session.wheel
    with session.record.timing("full eigensolver"):
        pencil = operators.mass, wheel.rotating_damping, wheel.rotating_stiffness
        found = _solve(session, pencil, projected.eigenvalue)
    basis, coordinates = _orthonormal(session, found)
    momenta = session.comm.allreduce(operators.carried @ basis)
    replace_basis(session, operators.trace(basis), momenta)
    _compare(session, found, projected)
    return _states(found, coordinates)


def _solve(session: Session, pencil, projected: np.ndarray) -> FullModes:
    """As many pairs as the scene wants, or all in its window. Collective."""
    wanted, (mass, stiffness) = session.scene.rotation, session.damping
    if not any(wanted.window):
        found = quadratic.solve(*pencil, wanted.count)
        sizes = np.abs(found.eigenvalue), np.abs(projected)
        _warn_of_missing(session, missing(*sizes, 0.0, float(sizes[0].max())))
        return found
    low, high = (2 * np.pi * f for f in wanted.window)
    rate = mass + stiffness * high**2
    below = int((np.abs(projected) <= np.hypot(high, rate / 2)).sum())
    found = quadratic.window(*pencil, (low, high), rate, below)
    inside = int(((projected.imag >= low) & (projected.imag <= high)).sum())
    session.record.indicators |= {
        "states in the window": (len(found.eigenvalue), "-"),
        "projected states in the window": (inside, "-"),
    }
    _warn_of_missing(session, missing(found.eigenvalue.imag, projected.imag, low, high))
    return found


def _warn_of_missing(session: Session, count: int) -> None:
    if count:
        session.record.warnings.append(
            f'rotation.method = "full" found {count} state(s) fewer than the projected problem has in the same '
            "range: some may be missing. Ask for more by rotation.count or a wider rotation.window."
        )


def _orthonormal(session: Session, found: FullModes) -> tuple[np.ndarray, np.ndarray]:
    """An M-orthonormal basis (own rows n, p) of all fields, and their coordinates (p, 4 q). Collective."""
    comm, mass = session.comm, session.operators.mass[:, None]
    fields = np.hstack([found.right.real, found.right.imag, found.left.real, found.left.imag])
    lengths = np.sqrt(comm.allreduce((mass * fields**2).sum(axis=0)))
    lengths[lengths == 0] = 1.0  # the imaginary part of a real state
    products = gram(comm, fields / lengths, mass * fields / lengths)
    sizes, directions = np.linalg.eigh(products)
    kept = sizes > _ROUNDING * sizes.max()
    turn = directions[:, kept] / np.sqrt(sizes[kept])
    coordinates = (directions[:, kept] * np.sqrt(sizes[kept])).T * lengths
    return fields / lengths @ turn, coordinates


def replace_basis(session: Session, shape: np.ndarray, momenta: np.ndarray) -> None:
    """Later stages read the traces (3 s, p) and momenta (3, p) of this basis, not those of the modes."""
    modal = session.modal
    session.modal = replace(
        modal, shape=shape, projection=replace(modal.projection, momentum=momenta)
    )


def _states(found: FullModes, coordinates: np.ndarray) -> StateModes:
    s, size = found.eigenvalue, len(coordinates)
    real, imaginary, left_real, left_imaginary = np.split(coordinates, 4, axis=1)
    weight = np.where(s.imag > 0, 2.0, 1.0)
    return StateModes(
        s,
        (real + 1j * imaginary) * weight,
        (left_real + 1j * left_imaginary).T,
        np.zeros((0, 0)),
        np.zeros((size, 0)),
        np.zeros((0, size)),
        found.residual,
        found.left_residual,
        found.condition,
    )


def _compare(session: Session, found: FullModes, projected: StateModes) -> None:
    """Truncation error of the projected eigenvalues: how many modes are enough."""
    error = truncation(found.eigenvalue, projected.eigenvalue)
    half = error[: max(len(error) // 2, 1)]
    session.record.indicators |= {
        "truncation error of the projected eigenvalues, lower half": (float(half.max()), "-"),
        "truncation error of the projected eigenvalues": (float(error.max()), "-"),
    }
