"""Rotation shapes: the static response of the tire to the rotation forces of its modes.

A mode phi with amplitude eta exerts, in a rotating wheel, the Coriolis forces  2 Omega G phi eta'
and the convective forces  Omega^2 S phi eta.  They bend belts out of their own plane; the belts
respond with modes of some kHz, which a basis of the lowest modes lacks, hence statically:

    X = K^-1 [2 Omega G Phi,  Omega^2 S Phi / w] - (component along the modes),   w = omega_m / 2,

where omega_m is the circular frequency of the highest mode. x . K x is the relative shift that a
shape causes in the squared frequencies near w. The leading directions of X in that measure, those
of `TOLERANCE` and more, join the basis (modal.joined) and take part in the rotating problem. They
are found from random combinations of the columns of X, a block at a time until no more are found
(Halko, Martinsson and Tropp, SIAM Review 53 (2011) 217): a few solutions per direction that counts
instead of two per mode.

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
from tireroad.fem.turning import Turning
from tireroad.modal.basis import Projection
from tireroad.modal.joined import combined, joined, take_off
from tireroad.modal.solver.fields import gram, multiply
from tireroad.modal.solver.modes import Modes

Array = np.ndarray

TOLERANCE = 2e-3
BLOCK = 32  # solutions at a time
_SPARE = 16  # directions found beyond those that count, as evidence that none is missing
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
    found = _Found(modes, operators, rotation, turning)
    columns = found.foremost(_uncoupled(projection, turning.inertia))
    return joined(modes, columns, operators) if columns.shape[1] else modes


class _Found:
    """K-orthonormal directions (n, k), M-orthogonal to the modes, and X along them. Collective."""

    def __init__(
        self, modes: Modes, operators: Operators, rotation: Rotation, turning: Turning
    ) -> None:
        self._modes, self._operators, self._comm = modes, operators, operators.body.comm
        speed = up_to(turning.speed)
        middle = np.sqrt(max(float(modes.squares[-1]), speed**2)) / 2
        self._forces = (
            (2 * speed, rotation.coriolis(turning.inertia)),
            (speed**2 / middle, rotation.carrying(turning.inertia)),
        )
        self._fields = np.empty((len(modes.vectors), 0))
        self._of = np.empty((0, 2 * len(modes.squares)))

    def foremost(self, classes: list[Array]) -> Array:
        """Own rows (n, k) of directions that count, sought in each of the `classes` of modes."""
        random = np.random.default_rng(0)
        shapes = LoadedShapes(self._operators, self._operators.stiffness)
        for among in classes:
            self._search(shapes, random, np.tile(among, 2))
        shapes.destroy()
        turn, counts = _counting(self._of)
        return combined(self._fields, turn[:, :counts], self._fields)

    def _search(self, shapes: LoadedShapes, random: np.random.Generator, among: Array) -> None:
        """Find all that counts among the columns `among` (2 m,) of X."""
        known, width, found = len(self._of), int(among.sum()), 0
        while found < width:
            mix = np.zeros((len(among), min(BLOCK, width - found)))
            mix[among] = random.standard_normal((width, mix.shape[1]))
            self._take(shapes.whole(self._load(mix)))
            before, found = found, len(self._of) - known
            if found == before or _counting(self._of[known:, among])[1] + _SPARE <= found:
                return

    def _load(self, mix: Array) -> Array:
        """Own rows (n, b) of the forces [2 Omega G Phi, Omega^2 S Phi / w] mix."""
        parts = zip(self._forces, np.split(mix, 2), strict=True)
        return sum(f * multiply(matrix, self._modes.vectors @ part) for (f, matrix), part in parts)

    def _take(self, more: Array) -> None:
        """Add to the directions what `more` shapes (n, b) contain beyond modes and directions."""
        vectors, comm, ops = self._modes.vectors, self._comm, self._operators
        for _ in range(2):  # the second pass removes the rounding of the first
            take_off(more, vectors, gram(comm, vectors, ops.mass[:, None] * more))
            stretched = multiply(ops.stiffness, more)
            take_off(more, self._fields, gram(comm, self._fields, stretched))
        # What was taken off last is K-orthogonal to `more`.
        sizes, turn = np.linalg.eigh(gram(comm, more, stretched))
        kept = sizes > max(_NOTHING * TOLERANCE, _ROUNDING * sizes.max())
        new = more @ (turn[:, kept] / np.sqrt(sizes[kept]))
        # Q^T K X = Q^T L, with L the forces; for one matrix and one direction q it is G^T q . phi.
        given = [f * self._read(matrix, new) for f, matrix in self._forces]
        self._fields = np.hstack([self._fields, new])
        self._of = np.vstack([self._of, np.hstack(given)])

    def _read(self, matrix: PETSc.Mat, fields: Array) -> Array:
        """fields^T matrix Phi (k, m): right up to a sign, which does not matter for skew G."""
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


def _counting(of: Array) -> tuple[Array, int]:
    """Left singular vectors of the components `of` X, and how many of them count."""
    turn, sizes, _ = np.linalg.svd(of, full_matrices=False)
    return turn, int((sizes**2 > TOLERANCE).sum())
