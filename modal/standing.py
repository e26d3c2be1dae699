"""The modes of the standing tire at its static state: the basis of all dynamics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tireroad.fem.cavity import Column
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.model import SmallMotions
from tireroad.fem.parameters import Limits, finite, whole
from tireroad.fem.static.checkpoint import Journal
from tireroad.fem.tire.material import CONSTANT, own_moduli
from tireroad.fem.tire.mesh import NodeGrid
from tireroad.fem.wheel import Axle, Turning
from tireroad.modal.basis import ModalBasis, project, with_air, with_corner
from tireroad.modal.rotation_shapes import with_rotation_shapes
from tireroad.modal.solver import undamped
from tireroad.modal.solver.fields import strain_energies
from tireroad.modal.solver.slicing import Modes
from tireroad.modal.solver.symmetry import DofPositions
from tireroad.modal.waves import RIGID, FaceWaves

_COUNT, _UP_TO = Limits(least=1), Limits(least=1e-3)  # -, Hz
_SAME = 1e-6  # relative difference of the frequencies of one mode in two solutions
_ALIKE = 1e-9  # relative difference of equal squares, which keep their order
_ROWS = 4096  # of all fields at a time, when they are changed in place


def standing_modes(
    motions: SmallMotions,
    *,
    count: int | None = None,
    up_to: float | None = None,
    rotation: bool = True,
    air: Column | None = None,
    axle: Axle | None = None,
    turning: Turning | None = None,
    solver: str = "auto",
) -> ModalBasis:
    """The `count` lowest modes, or all below `up_to` (Hz), with their fields on all unknowns.

    `rotation`: also project the matrices of the rotating frame, without which the wheel can only
    stand. `turning`: how the wheel rotates, so that rotation shapes join the modes
    (modal.rotation_shapes); belts need them. `air`: the air in the cavity joins the projected
    problem, and so does the wheel of an `axle` that moves. InputError unless one of `count` and
    `up_to` is given, within its range; ConvergenceError if a mode is missing, inaccurate or
    unstable. Collective.
    """
    modes = solved(motions.operators, count=count, up_to=up_to, solver=solver)
    return projected(motions, modes, rotation, air, axle, turning)


def fewer(
    basis: ModalBasis, motions: SmallMotions, count: int, turning: Turning, axle: Axle | None
) -> ModalBasis:
    """The basis of the first `count` modes, with their own rotation shapes where it has any.
    Collective.
    """
    few = basis.first(count)
    if not basis.projection.shapes or few.modes is None:
        return few
    return projected(motions, few.modes, True, basis.column, axle, turning)


def solved(
    operators: Operators,
    *,
    count: int | None = None,
    up_to: float | None = None,
    teams: int | None = None,
    journal: Journal | None = None,
    solver: str = "auto",
) -> Modes:
    """The modes alone, found by `teams` of processes (modal.solver.slicing) and a `solver`.

    Results that the `journal` holds are not computed again. InputError unless one of `count` and
    `up_to` (Hz) is given, within its range. Collective.
    """
    _check_wanted(count, up_to)
    modes = undamped.solve(
        operators.stiffness,
        operators.mass,
        count,
        up_to=np.inf if up_to is None else up_to,
        sites=sites(operators),
        teams=teams,
        journal=journal,
        solver=solver,
    )
    return _by_own_frequency(modes, operators, up_to)


def _check_wanted(count: int | None, up_to: float | None) -> None:
    if (count is None) == (up_to is None):
        raise InputError(
            "modes: give either count (number of lowest modes) or up_to (Hz), not both"
        )
    try:
        if count is None:
            _UP_TO.check(finite(up_to), "Hz")
        else:
            _COUNT.check(whole(count), "-")
    except ValueError as error:
        raise InputError(f"modes: {'up_to' if count is None else 'count'} {error}") from None


def projected(
    motions: SmallMotions,
    modes: Modes,
    rotation: bool,
    air: Column | None = None,
    axle: Axle | None = None,
    turning: Turning | None = None,
) -> ModalBasis:
    """The basis of these modes, and of the rotation shapes of `turning` where it is given.
    Collective.
    """
    operators = motions.operators
    matrices = motions.rotation if rotation else None
    comm, compounds = operators.body.comm, operators.compounds()
    doppler = turning is None or turning.inertia == "doppler"
    arguments = matrices, operators.carried, comm
    projection = project(modes, *arguments, compounds=compounds, doppler=doppler)
    if turning is not None and turning.speed:
        modes = with_rotation_shapes(modes, projection, operators, matrices, turning)
        projection = project(modes, *arguments, projection, compounds, doppler)
    for compound in compounds:
        compound.stiffness.destroy()
    wheel = axle, motions.rim_motion(rotation), motions.static.positions, comm
    joined = with_corner(with_air(projection, modes, air), modes, *wheel)
    return ModalBasis(
        frequency=joined.frequency,
        shape=operators.trace(modes.vectors),
        projection=joined,
        modes=modes,
        column=air,
    )


def named(basis: ModalBasis, lattice: NodeGrid) -> ModalBasis:
    """The basis with the names of its modes, on a tire whose nodes are the `lattice`. Not collective."""
    rigid = basis.modes.rigid if basis.modes is not None else int((basis.frequency == 0).sum())
    waves = FaceWaves(lattice)
    fields = waves.read(basis.shape[:, : len(basis.frequency)])
    return replace(basis, names=waves.named(fields, dict.fromkeys(range(rigid), RIGID)))


def _by_own_frequency(modes: Modes, operators: Operators, up_to: float | None) -> Modes:
    """The modes, used up, in the order of the frequencies that they have with moduli at these, to `up_to` Hz.
    Collective.

    The finite elements, by which they were counted, have the moduli of 100 Hz: above that frequency no
    mode that was not found comes to lie below `up_to`, and of those that come to lie above it others
    may be missing.
    """
    kinds = [kind for kind, _ in operators.body.wall.kinds()]
    if all(kind.spectrum == CONSTANT for kind in kinds):
        return modes
    compounds = operators.compounds()
    stored = strain_energies(modes.vectors, compounds, operators.body.comm)
    for compound in compounds:
        compound.stiffness.destroy()
    own = modes.squares + own_moduli(modes.squares, stored, kinds)[0]
    order = np.argsort(own, kind="stable")
    level = np.cumsum(np.diff(own[order], prepend=own[order[:1]]) > _ALIKE * np.abs(own[order]))
    order = order[np.lexsort((order, level))]
    if up_to is not None:
        below = own[order] <= (2 * np.pi * up_to) ** 2
        order = order[below] if below.any() else order
    vectors, kept = modes.vectors, len(order)
    for start in range(0, len(vectors), _ROWS):  # in place: a copy of all modes takes gigabytes
        rows = slice(start, start + _ROWS)
        vectors[rows, :kept] = vectors[rows][:, order]
    squares, residual = modes.squares[order], modes.residual[order]
    return replace(modes, squares=squares, vectors=vectors[:, :kept], residual=residual)


def with_fields(
    basis: ModalBasis,
    motions: SmallMotions,
    *,
    count: int | None,
    up_to: float | None,
    air: Column | None = None,
    axle: Axle | None = None,
    turning: Turning | None = None,
    solver: str = "auto",
) -> ModalBasis:
    """The basis with its fields on all unknowns.

    A basis that has them is returned as it is. For one read from a file, the `count` lowest modes
    or those below `up_to` (Hz) are solved and projected again, and replace all its parts;
    ConvergenceError if their frequencies differ. Collective.
    """
    if basis.modes is not None:
        return basis
    rotation = basis.projection.gyroscopic is not None
    again = standing_modes(
        motions,
        count=count,
        up_to=up_to,
        rotation=rotation,
        air=air,
        axle=axle,
        turning=turning,
        solver=solver,
    )
    top = max(float(basis.frequency.max(initial=0.0)), 1e-300)
    alike = len(again.frequency) == len(basis.frequency)
    if not alike or np.abs(again.frequency - basis.frequency).max(initial=0.0) > _SAME * top:
        raise ConvergenceError(
            "modes: computed again they differ from those of modes.h5; run with --fresh, which "
            "computes every stage anew"
        )
    return again


def sites(operators: Operators) -> DofPositions:
    """The sites of this process's unknowns, where symmetries are sought."""
    return DofPositions(operators.unknowns.place, operators.unknowns.component)
