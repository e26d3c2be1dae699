"""States of the rolling tire from the full finite-element matrices, instead of the projected ones.

Their fields also replace the modes: the basis is M-orthonormal, as that of the modes is, and spans
[Re U, Im U, Re W, Im W], where U are the right and W the left vectors (n, q).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from petsc4py import PETSc

from tireroad.fem.axle import Axle
from tireroad.fem.collective import summed
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.matrices.rim_motion import RimMotion
from tireroad.modal.corner import meeting
from tireroad.modal.damping import beyond
from tireroad.modal.rolling import RollingModes
from tireroad.modal.rotating import StateModes
from tireroad.modal.solver import quadratic
from tireroad.modal.solver.agreement import missing, truncation
from tireroad.modal.solver.fields import gram
from tireroad.modal.solver.quadratic import FullModes

_ROUNDING = 1e-14  # of the largest squared length: smaller directions are rounding of the fields

Figures = dict[str, tuple[float, str]]


def full_states(
    operators: Operators,
    pencil: tuple[PETSc.Mat, PETSc.Mat],
    projected: RollingModes,
    rim: RimMotion | None = None,
    *,
    count: int,
    window: tuple[float, float] = (0.0, 0.0),
) -> tuple[RollingModes, Figures, list[str]]:
    """`count` pairs nearest to zero, or all in the `window` (Hz), with figures and warnings.

    The figures tell how far the projected states are from them. `pencil`: D + 2 Omega G and K_Omega
    as in fem.matrices.compliance; `rim`: the reactions to motions of a held rim, for the moments on
    its hub. Collective.
    """
    found, figures, lacking = _solve(operators, pencil, projected, count, window)
    fields, coordinates = _orthonormal(operators, found)
    comm, old = operators.body.comm, projected.basis
    momenta = summed(comm, operators.carried @ fields)
    projection, corner = old.projection, None
    if rim is not None:
        corner = meeting(Axle.held(), rim, fields, projection.wheel.places, comm)
    basis = replace(
        old,
        shape=operators.trace(fields),
        projection=replace(projection, momentum=momenta, corner=corner),
        modes=None,
    )
    states = _states(found, coordinates)
    full = RollingModes(basis=basis, states=states, turning=projected.turning, full=True)
    warnings = (
        []
        if not lacking
        else [
            f'rotation.method = "full" found {lacking} state(s) fewer than the projected problem has in the same '
            "range: some may be missing. Ask for more by rotation.count or a wider rotation.window."
        ]
    )
    return full, figures | _compared(found, projected.states), warnings


def _solve(
    operators: Operators,
    pencil: tuple[PETSc.Mat, PETSc.Mat],
    projected: RollingModes,
    count: int,
    window: tuple[float, float],
) -> tuple:
    """The requested pairs or all in the window, figures, and the number missing. Collective."""
    drag, full_stiffness = pencil
    whole, s = (operators.mass, drag, full_stiffness), projected.states.eigenvalue
    if not any(window):
        found = quadratic.solve(*whole, count)
        sizes = np.abs(found.eigenvalue), np.abs(s)
        return found, {}, missing(*sizes, 0.0, float(sizes[0].max()))
    mass, stiffness = beyond(projected.turning.damping, projected.basis.projection)
    low, high = (2 * np.pi * f for f in window)
    rate = mass + stiffness * high**2
    below = int((np.abs(s) <= np.hypot(high, rate / 2)).sum())
    found = quadratic.window(*whole, (low, high), rate, below)
    inside = int(((s.imag >= low) & (s.imag <= high)).sum())
    figures = {
        "states in the window": (len(found.eigenvalue), "-"),
        "projected states in the window": (inside, "-"),
    }
    return found, figures, missing(found.eigenvalue.imag, s.imag, low, high)


def _orthonormal(operators: Operators, found: FullModes) -> tuple[np.ndarray, np.ndarray]:
    """An M-orthonormal basis (own rows n, p) of all fields, and their coordinates (p, 4 q).
    Collective.
    """
    comm, mass = operators.body.comm, operators.mass[:, None]
    fields = np.hstack([found.right.real, found.right.imag, found.left.real, found.left.imag])
    lengths = np.sqrt(comm.allreduce((mass * fields**2).sum(axis=0)))
    lengths[lengths == 0] = 1.0  # the imaginary part of a real state
    products = gram(comm, fields / lengths, mass * fields / lengths)
    sizes, directions = np.linalg.eigh(products)
    kept = sizes > _ROUNDING * sizes.max()
    turn = directions[:, kept] / np.sqrt(sizes[kept])
    coordinates = (directions[:, kept] * np.sqrt(sizes[kept])).T * lengths
    return fields / lengths @ turn, coordinates


def _states(found: FullModes, coordinates: np.ndarray) -> StateModes:
    s, size = found.eigenvalue, len(coordinates)
    real, imaginary, left_real, left_imaginary = np.split(coordinates, 4, axis=1)
    weight = np.where(s.imag > 0, 2.0, 1.0)
    return StateModes(
        eigenvalue=s,
        right=(real + 1j * imaginary) * weight,
        left=(left_real + 1j * left_imaginary).T,
        block=np.zeros((0, 0)),
        block_right=np.zeros((size, 0)),
        block_left=np.zeros((0, size)),
        residual=found.residual,
        left_residual=found.left_residual,
        condition=found.condition,
    )


def _compared(found: FullModes, projected: StateModes) -> Figures:
    """Truncation error of the projected eigenvalues, which tells whether there are enough modes."""
    error = truncation(found.eigenvalue, projected.eigenvalue)
    half = error[: max(len(error) // 2, 1)]
    return {
        "truncation error of the projected eigenvalues, lower half": (float(half.max()), "-"),
        "truncation error of the projected eigenvalues": (float(error.max()), "-"),
    }
