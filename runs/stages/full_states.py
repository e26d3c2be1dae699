"""States of the rolling tire from the full finite-element matrices, in the place of the projected ones.

Their fields take the place of the modes too: with U the right and W the left vectors (n, q), the basis
is [Re U, Im U, Re W, Im W], on which the states' own coordinates are ones and i.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from modal import quadratic
from modal.basis import momentum
from modal.quadratic import FullModes, truncation
from modal.rotating import StateModes
from runs.session import Session


def compute(session: Session, projected: StateModes) -> StateModes:
    """Solve, put the fields into `session.modal`, and say how far the projected states are off. Collective."""
    from fem.compliance import rotating_stiffness

    operators, rotation = session.operators, session.rotation_matrices
    wanted = session.scene.rotation
    stiffness = rotating_stiffness(
        operators, rotation, session.speed, session.damping, wanted.inertia
    )
    drag = _drag(session)
    with session.record.timing("full eigensolver"):
        found = quadratic.solve(operators.mass, drag, stiffness, wanted.count)
    drag.destroy()
    stiffness.destroy()
    fields = np.hstack([found.right.real, found.right.imag, found.left.real, found.left.imag])
    shape = session.body.surface(operators.spread(fields)).reshape(-1, fields.shape[1])
    replace_basis(session, shape, momentum(session.comm, operators.mass, fields))
    _compare(session, found, projected)
    return _states(found)


def replace_basis(session: Session, shape: np.ndarray, momenta: np.ndarray) -> None:
    """Later stages read the traces (3 s, 4 q) and momenta (3, 4 q) of the fields, not those of the modes."""
    modal = session.modal
    session.modal = replace(
        modal, shape=shape, projection=replace(modal.projection, momentum=momenta)
    )


def _drag(session: Session):
    """D = gamma1 M + gamma2 K + 2 Omega G (doppler: B), kg/s. Collective."""
    operators, rotation = session.operators, session.rotation_matrices
    full = session.scene.rotation.inertia == "full"
    drag = operators.stiffness.copy()
    drag.scale(session.damping[1])
    different = type(drag).Structure.DIFFERENT_NONZERO_PATTERN
    drag.axpy(2 * session.speed, rotation.gyroscopic if full else rotation.body, different)
    diagonal = drag.getDiagonal()
    diagonal.array[:] += session.damping[0] * operators.mass
    drag.setDiagonal(diagonal)
    drag.setOption(type(drag).Option.SYMMETRIC, False)
    return drag


def _states(found: FullModes) -> StateModes:
    s = found.eigenvalue
    one, none = np.eye(len(s)), np.zeros((len(s),) * 2)
    weight = np.where(s.imag > 0, 2.0, 1.0)
    return StateModes(
        s,
        np.vstack([one, 1j * one, none, none]) * weight,
        np.hstack([none, none, one, 1j * one]),
        np.zeros((0, 0)),
        np.zeros((4 * len(s), 0)),
        np.zeros((0, 4 * len(s))),
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
