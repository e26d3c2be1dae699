"""Rotation shapes: the static response of the tire to the rotation forces of its modes.

A mode phi with amplitude eta exerts, in a rotating wheel, the Coriolis forces  2 Omega G phi eta'
and the convective forces  Omega^2 S phi eta.  They bend belts out of their own plane; the belts
respond with modes of some kHz, which a basis of the lowest modes lacks, hence statically:

    X = K^-1 [2 Omega G Phi,  Omega^2 S Phi / w] - (component along the modes),   w = omega_m / 2,

where omega_m is the circular frequency of the highest mode. x . K x is the relative shift that a
shape causes in the squared frequencies near w. The leading directions of X in that measure, those
of Turning.shape_tolerance and more, join the basis (modal.basis) and take part in the rotating
problem. They are found in the block Krylov space of X X^T K, begun with random combinations of the
columns of X (Musco and Musco, Advances in Neural Information Processing Systems 28 (2015) 1396): a
few solutions per direction that counts instead of two per mode. Blocks are added until what counts
has settled. Their measure falls slowly where it is cut, so that directions from random combinations
alone differ from one choice of these to the next: between a tire and its mirror image, forces on
the axle differed by 0.4 to 3 % in the band.

For a belted tire at 80 rad/s (20,520 unknowns, 100 modes to 322 Hz, 37 points of its footprint,
against its full matrices) the largest error of the receptance up to 161 Hz is 45 % without them,
7.2 % with attachment modes instead, 8.7 % with 70 rotation shapes and 2.2 % with both. In a torus
of rubber a few count, and change little.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc
from scipy.sparse.csgraph import connected_components

from tireroad.fem.errors import InputError
from tireroad.fem.matrices.compliance import LoadedShapes
from tireroad.fem.matrices.operators import Operators, Rotation
from tireroad.fem.wheel import Turning
from tireroad.modal.basis import Projection, combined, extended, take_off
from tireroad.modal.solver.fields import gram, multiply
from tireroad.modal.solver.slicing import Modes

Array = np.ndarray

BLOCK = 32  # solutions at a time
_SPARE = 8  # directions found beyond those that count, as evidence that none is missing
_SETTLED = 1e-3  # largest relative change of what counts by the last block
_ROUNDING = 1e-14  # of the largest of a block
_NOTHING = 1e-6  # of the tolerance: what rounding leaves where the modes span everything
_COUPLED = 1e-7  # of the largest coupling by rotation: less is rounding


def up_to(speed: float) -> float:
    """The speed (rad/s) of the shapes: the next power of two, shared by a family of speeds."""
    return float(2.0 ** np.ceil(np.log2(abs(speed)))) if speed else 0.0


def with_rotation_shapes(
    modes: Modes,
    projection: Projection,
    operators: Operators,
    rotation: Rotation | None,
    turning: Turning,
) -> Modes:
    """The modes followed by the rotation shapes for `up_to` the speed; `projection` is the modes'.

    Unchanged for a standing wheel, and for a free rim, which has no static shapes. InputError
    without the rotation matrices. Collective.
    """
    if not turning.speed or operators.unknowns.rim is not None:
        return modes
    if rotation is None:
        raise InputError("rotation shapes: the matrices of the rotating frame are needed")
    shapes = _Found(modes, projection, operators, rotation, turning)
    columns = shapes.foremost(_uncoupled(projection, turning.inertia))
    return extended(modes, columns, operators) if columns.shape[1] else modes


def among_others(projection: Projection, count: int, turning: Turning) -> Array:
    """Rotation shapes (m - count, k) of the first `count` modes, in the other coordinates of a `projection` that has
    enough of them: without finite elements.

    None for a standing wheel, and for a free rim. Not collective.
    """
    rest = projection.squares[count:, None]
    if not turning.speed or not (projection.squares > 0).all():
        return np.zeros((len(rest), 0))
    speed = up_to(turning.speed)
    middle = np.sqrt(max(float(projection.squares[count - 1]), speed**2)) / 2
    coriolis, carrying, _ = projection.rotating(turning.inertia)
    forces = np.hstack([2 * speed * coriolis, speed**2 / middle * carrying])
    forces = forces[count:, np.r_[:count, projection.own : projection.own + count]]
    turn, sizes, _ = np.linalg.svd(forces / np.sqrt(rest), full_matrices=False)
    return turn[:, sizes**2 > turning.shape_tolerance] / np.sqrt(rest)


class _Found:
    """K-orthonormal directions (n, k), M-orthogonal to the modes, and X along them. Collective."""

    def __init__(
        self,
        modes: Modes,
        projection: Projection,
        operators: Operators,
        rotation: Rotation,
        turning: Turning,
    ) -> None:
        self._modes, self._operators, self._comm = modes, operators, operators.body.comm
        speed = up_to(turning.speed)
        middle = np.sqrt(max(float(modes.squares[-1]), speed**2)) / 2
        # Factor, matrix, its projection on the modes, and the sign of its transpose: G is skew, S
        # symmetric.
        projected = projection.rotating(turning.inertia)
        self._forces = (
            (2 * speed, rotation.coriolis(turning.inertia), projected[0], -1.0),
            (speed**2 / middle, rotation.carrying(turning.inertia), projected[1], 1.0),
        )
        self._tolerance = turning.shape_tolerance
        self._fields = np.empty((len(modes.vectors), 0))
        self._of = np.empty((0, 2 * len(modes.squares)))

    def foremost(self, classes: list[Array]) -> Array:
        """Own rows (n, k) of directions that count, sought in each of the `classes` of modes."""
        random = np.random.default_rng(0)
        shapes = LoadedShapes(self._operators, self._operators.stiffness)
        for among in classes:
            self._search(shapes, random, np.tile(among, 2))
        shapes.destroy()
        turn, counts = self._counting(self._of)
        return combined(self._fields, turn[:, : len(counts)], self._fields)

    def _search(self, shapes: LoadedShapes, random: np.random.Generator, among: Array) -> None:
        """Find all that counts among the columns `among` (2 m,) of X."""
        known, width, before = len(self._of), int(among.sum()), np.empty(0)
        mix = random.standard_normal((width, min(BLOCK, width)))
        while mix.shape[1]:
            spread = np.zeros((len(among), mix.shape[1]))
            spread[among] = mix
            last = len(self._of)
            more = shapes.whole(self._load(spread))
            take_off(more, self._modes.vectors, self._along_modes(spread))
            self._take(more)
            of = self._of[known:, among]
            counts = self._counting(of)[1]
            if len(of) >= width or (len(of) >= len(counts) + _SPARE and _settled(counts, before)):
                return
            mix, before = np.linalg.qr(self._of[last:, among].T)[0], counts

    def _load(self, mix: Array) -> Array:
        """Own rows (n, b) of the forces L mix, L = [2 Omega G Phi, Omega^2 S Phi / w]."""
        parts = zip(self._forces, np.split(mix, 2), strict=True)
        vectors = self._modes.vectors
        return sum(f * multiply(matrix, vectors @ part) for (f, matrix, _, _), part in parts)

    def _along_modes(self, mix: Array) -> Array:
        """Phi^T M K^-1 L mix = Lambda^-1 Phi^T L mix (m, b): no product of fields."""
        parts = zip(self._forces, np.split(mix, 2), strict=True)
        return (
            sum(f * (small @ part) for (f, _, small, _), part in parts)
            / self._modes.squares[:, None]
        )

    def _take(self, more: Array) -> None:
        """Add to the directions what `more` shapes (n, b), without modes, contain beyond them."""
        ops, comm = self._operators, self._comm
        for _ in range(2):  # the second pass removes the rounding of the first
            stretched = multiply(ops.stiffness, more)
            take_off(more, self._fields, gram(comm, self._fields, stretched))
        # What was taken off last is K-orthogonal to `more`.
        sizes, turn = np.linalg.eigh(gram(comm, more, stretched))
        independent = sizes > max(_NOTHING * self._tolerance, _ROUNDING * sizes.max())
        new = more @ (turn[:, independent] / np.sqrt(sizes[independent]))
        # Q^T K X = Q^T L, with L the forces; for one matrix and one direction q it is G^T q . phi.
        reads = [sign * f * self._read(matrix, new) for f, matrix, _, sign in self._forces]
        self._fields = np.hstack([self._fields, new])
        self._of = np.vstack([self._of, np.hstack(reads)])

    def _counting(self, of: Array) -> tuple[Array, Array]:
        """Left singular vectors of the components `of` X, and the squared values of those that count.

        By `of` of^T, whose rounding of 1e-16 of the largest is far below the tolerance.
        """
        sizes, turn = np.linalg.eigh(of @ of.T)
        sizes, turn = sizes[::-1], turn[:, ::-1]
        return turn, sizes[sizes > self._tolerance]

    def _read(self, matrix: PETSc.Mat, fields: Array) -> Array:
        """(matrix fields)^T Phi (k, m)."""
        return gram(self._comm, multiply(matrix, fields), self._modes.vectors)


def _uncoupled(projection: Projection, inertia: str) -> list[Array]:
    """Masks (m,) of modes that rotation does not couple, such as the two parities of a mirror.

    Random mixtures across them would lose the symmetry of the shapes.
    """
    coupled = np.zeros(2 * projection.squares.shape)
    for matrix in projection.rotating(inertia)[:2]:
        part = np.abs(matrix)
        coupled += part / max(part.max(), np.finfo(float).tiny)
    count, label = connected_components(coupled > _COUPLED, directed=False)
    return [label == k for k in range(count)]


def _settled(now: Array, before: Array) -> bool:
    """Whether as many directions count as before the last block, and as much."""
    return len(now) == len(before) and bool(np.all(now - before <= _SETTLED * now))
