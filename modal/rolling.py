"""The states of a rolling tire and the wheel's motion that they were computed for: by projection, or in full.

The full method solves the quadratic problem on the finite elements by SLEPc for a few states, and
measures how far the projected ones are from them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import optimize

from tireroad.fem.collective import summed
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.matrices.operators import Operators, RimMotion
from tireroad.fem.parallel import on_root
from tireroad.fem.wheel import Axle, Damping, StrainEnergy, Turning
from tireroad.modal.basis import ModalBasis, Projection
from tireroad.modal.campbell import Campbell
from tireroad.modal.corner import meeting
from tireroad.modal.damping import beyond
from tireroad.modal.rotating import (
    DEFECTIVE,
    checks,
    matrices,
    rotating,
    standing,
    with_free_motions,
)
from tireroad.modal.solver import quadratic
from tireroad.modal.solver.fields import gram
from tireroad.modal.solver.quadratic import FullModes
from tireroad.modal.states import StateModes
from tireroad.modal.waves import (
    HALF,
    STILL,
    WHEEL,
    FaceWaves,
    ModeNames,
    air_waves,
)

_BORDER = 0.02  # relative: truncation may move a state across a limit by as much
_ROUNDING = 1e-14  # of the largest squared length: smaller directions are rounding of the fields
Figures = dict[str, tuple[float, str]]

# Conditions above which vectors count as defective. Where the checks fail, a lower limit moves more
# states into the block (observed beside the rigid motions of a free rim with air, on two processes
# of three).
_CONDITIONS = DEFECTIVE, 1e4, 1e2


def truncation(full: np.ndarray, projected: np.ndarray) -> np.ndarray:
    """Relative error (q,) of the projected eigenvalue matched to each full eigenvalue."""
    distance = np.abs(full[:, None] - projected)
    rows, columns = optimize.linear_sum_assignment(distance)
    error = np.full(len(full), np.inf)  # inf: no projected state left to match
    error[rows] = distance[rows, columns]
    return error / np.abs(full)


def missing(full: np.ndarray, projected: np.ndarray, low: float, high: float) -> int:
    """Number of states missing from the full problem between two limits (1/s).

    `full`, `projected` are magnitudes (Im s or |s|). Projected states within 2 % of a limit are not
    counted, since truncation may have moved them across it.
    """
    inside = (projected > low * (1 + _BORDER)) & (projected < high * (1 - _BORDER))
    found = (full >= low) & (full <= high)
    return max(int(inside.sum()) - int(found.sum()), 0)


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
    pencil_states, figures, lacking = _solve(operators, pencil, projected, count, window)
    fields, coordinates = _orthonormal(operators, pencil_states)
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
    states = _states(pencil_states, coordinates)
    full = RollingModes(basis=basis, states=states, turning=projected.turning, full=True)
    warnings = (
        []
        if not lacking
        else [
            f'rotation.method = "full" found {lacking} state(s) fewer than the projected problem has in the same '
            "range: some may be missing. Ask for more by rotation.count or a wider rotation.window."
        ]
    )
    return full, figures | _compared(pencil_states, projected.states), warnings


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
        solution = quadratic.solve(*whole, count)
        sizes = np.abs(solution.eigenvalue), np.abs(s)
        return solution, {}, missing(*sizes, 0.0, float(sizes[0].max()))
    mass, stiffness = beyond(projected.turning.damping, projected.basis.projection)
    low, high = (2 * np.pi * f for f in window)
    rate = mass + stiffness * high**2
    below = int((np.abs(s) <= np.hypot(high, rate / 2)).sum())
    solution = quadratic.window(*whole, (low, high), rate, below)
    inside = int(((s.imag >= low) & (s.imag <= high)).sum())
    figures = {
        "states in the window": (len(solution.eigenvalue), "-"),
        "projected states in the window": (inside, "-"),
    }
    return solution, figures, missing(solution.eigenvalue.imag, s.imag, low, high)


def _orthonormal(operators: Operators, modes: FullModes) -> tuple[np.ndarray, np.ndarray]:
    """An M-orthonormal basis (own rows n, p) of all fields, and their coordinates (p, 4 q).
    Collective.
    """
    comm, mass = operators.body.comm, operators.mass[:, None]
    fields = np.hstack([modes.right.real, modes.right.imag, modes.left.real, modes.left.imag])
    lengths = np.sqrt(comm.allreduce((mass * fields**2).sum(axis=0)))
    lengths[lengths == 0] = 1.0  # the imaginary part of a real state
    products = gram(comm, fields / lengths, mass * fields / lengths)
    sizes, directions = np.linalg.eigh(products)
    independent = sizes > _ROUNDING * sizes.max()
    turn = directions[:, independent] / np.sqrt(sizes[independent])
    coordinates = (directions[:, independent] * np.sqrt(sizes[independent])).T * lengths
    return fields / lengths @ turn, coordinates


def _states(modes: FullModes, coordinates: np.ndarray) -> StateModes:
    s, size = modes.eigenvalue, len(coordinates)
    real, imaginary, left_real, left_imaginary = np.split(coordinates, 4, axis=1)
    weight = np.where(s.imag > 0, 2.0, 1.0)
    return StateModes(
        eigenvalue=s,
        right=(real + 1j * imaginary) * weight,
        left=(left_real + 1j * left_imaginary).T,
        block=np.zeros((0, 0)),
        block_right=np.zeros((size, 0)),
        block_left=np.zeros((0, size)),
        residual=modes.residual,
        left_residual=modes.left_residual,
        condition=modes.condition,
    )


def _compared(modes: FullModes, projected: StateModes) -> Figures:
    """Truncation error of the projected eigenvalues, which tells whether there are enough modes."""
    error = truncation(modes.eigenvalue, projected.eigenvalue)
    half = error[: max(len(error) // 2, 1)]
    return {
        "truncation error of the projected eigenvalues, lower half": (float(half.max()), "-"),
        "truncation error of the projected eigenvalues": (float(error.max()), "-"),
    }


def pencil(projection: Projection, turning: Turning) -> tuple[np.ndarray, np.ndarray]:
    """D~ (1/s) and K~ (1/s2) of the projected problem."""
    return matrices(projection, turning.speed, turning.damping, turning.inertia)


@dataclass(frozen=True, kw_only=True)
class RollingModes:
    """The decoupled `states` on the fields of `basis`, for a wheel that moves as `turning` says.

    `full`: these are states of the full finite-element matrices, and the basis consists of their
    own fields. `campbell`: eigenvalues over speed, where requested; `names` of the states, where
    they were given any. `figures`: how accurately the states satisfy the problem that they solve
    (modal.rotating.checks).
    """

    basis: ModalBasis
    states: StateModes
    turning: Turning
    full: bool = False
    campbell: Campbell | None = None
    names: ModeNames | None = None
    figures: Mapping[str, float] = field(default_factory=dict)

    @property
    def highest(self) -> float:
        """Circular frequency of the highest mode or full state, rad/s; truncation begins there."""
        if self.full:
            return float(np.abs(self.states.eigenvalue.imag).max())
        return 2 * np.pi * float(self.basis.frequency[-1])


def rolling_modes(basis: ModalBasis, turning: Turning, comm: MPI.Comm) -> RollingModes:
    """The second eigenproblem on the modal basis; in closed form for a standing tire without air.
    Collective.
    """
    states, figures = _decoupled(basis.projection, turning, comm)
    return RollingModes(basis=basis, states=states, turning=turning, figures=figures)


def named_states(
    states: StateModes, shape: np.ndarray, projection: Projection, waves: FaceWaves
) -> ModeNames:
    """Names of the states (q,), by their fields on the outer face (modal.waves).

    Or by the air, or the wheel and what carries it, where half of the kinetic energy is in them. `shape` (3 s
    or more, m) kg^-1/2: the coordinates' fields on the face. Not collective.
    """
    order = np.lexsort((states.eigenvalue.real, states.eigenvalue.imag))
    right, own = states.right[:, order], shape.shape[1]
    fields = np.tensordot(waves.read(shape), right[:own], 1)
    names = {int(k): STILL for k in np.flatnonzero(states.eigenvalue[order].imag == 0)}
    beside, air = own, None
    if projection.air is not None and len(right) > own:  # full states have none of their own
        duct, beside = projection.air.duct, own + projection.air.count
        pressure = duct.pressure[1:].T @ (duct.circular[:, None] * right[own:beside])
        air = air_waves(projection.air.share(right), pressure[1::2], pressure[2::2])
    square = np.abs(right) ** 2
    wheel = square[beside:].sum(axis=0) >= HALF * square.sum(axis=0)
    names |= {int(k): WHEEL for k in np.flatnonzero(wheel)}
    return waves.named(fields, names, air).at(np.argsort(order))


def decouple(projection: Projection, turning: Turning, comm: MPI.Comm) -> StateModes:
    """The states of the projected problem, on every process, with their identities checked.
    Collective.
    """
    return _decoupled(projection, turning, comm)[0]


def _coupled(projection: Projection, damping: Damping) -> bool:
    """Whether the losses or the moduli of compounds couple the modes of a standing tire."""
    return projection.rise is not None or isinstance(damping, StrainEnergy)


def _decoupled(projection: Projection, turning: Turning, comm: MPI.Comm) -> tuple[StateModes, dict]:
    """The states, and the figures of modal.rotating.checks. Collective."""
    alone = turning.speed == 0 and projection.air is None and not projection.moves
    if alone and not _coupled(projection, turning.damping):
        return standing(projection, turning.damping), {}
    if turning.speed and projection.gyroscopic is None:
        raise InputError(
            "these modes were projected for a standing wheel: project the rotation too"
        )
    if projection.moves:
        projection.wheel.check(turning.speed)
    pencils, free_motions = pencil(projection, turning), projection.free_motions
    if alone:
        free_motions = np.eye(projection.own)[:, projection.squares == 0]

    def solve() -> tuple[StateModes, dict]:
        if free_motions.shape[1]:
            states = with_free_motions(*pencils, free_motions)
            return states, checks(states, *pencils)
        for condition in _CONDITIONS:
            states = rotating(*pencils, condition)
            try:
                return states, checks(states, *pencils)
            except ConvergenceError as error:
                failed = error
        raise failed

    # Only one process solves, because LAPACK on another could order repeated eigenvalues
    # differently.
    return on_root(comm, solve)
