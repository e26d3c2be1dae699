"""Shapes of turning: what a tire's modes set off, as it turns, in motions that no mode has.

On a mode phi that moves at the rate eta' the turning wheel exerts the Coriolis forces  2 Omega G phi eta'  and the
convective ones  Omega^2 S phi eta.  Belts that roll round are bent out of their own plane by them, so that they answer by
modes of some kHz, which no basis of the lowest has; they answer statically,

    X = K^-1 [2 Omega G Phi,  Omega^2 S Phi / w] - (the modes' part),   w half the highest mode's circular frequency.

x . K x is by how much a shape shifts squares of frequencies, relative to them, of motions at w. The foremost directions
of X in that measure, those of `TOLERANCE` and more, join the basis (modal.joined) and turn with it. They are found from
random combinations of its columns, some at a time until no more is found (Halko, Martinsson and Tropp, SIAM Review 53
(2011) 217): some solutions for each direction that counts, not two for each mode.

Of a belted tire at 80 rad/s (20,520 unknowns, 100 modes to 322 Hz, 37 points of its footprint, against its full
matrices) the receptance up to 161 Hz is 45 % off without them where it is worst, 7.2 % with attachment modes in their
place, 8.7 % with 70 of them, 2.2 % with both; of a torus of rubber a few count, and change little.
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
_SPARE = 16  # directions found beyond those that count, by which they are known to be all
_ROUNDING = 1e-14  # of the largest of a block
_NOTHING = 1e-6  # of the tolerance: what rounding leaves where the modes are all there are
_COUPLED = 1e-7  # of the largest of what turning couples: less is rounding


def up_to(speed: float) -> float:
    """The speed (rad/s) for which shapes are made: the next power of two, so that members of a family share them."""
    return float(2.0 ** np.ceil(np.log2(abs(speed)))) if speed else 0.0


def with_turning(
    modes: Modes,
    projection: Projection,
    operators: Operators,
    rotation: Rotation | None,
    turning: Turning,
) -> Modes:
    """The modes, `projection` what they project, followed by the shapes of turning up to `up_to` the speed; as they are of
    a wheel that stands, or with a free rim, which has no static shapes. Collective."""
    if not turning.speed or operators.unknowns.rim is not None:
        return modes
    if rotation is None:
        raise InputError("rotation shapes: the matrices of the rotating frame are needed")
    found = _Found(modes, operators, rotation, turning)
    columns = found.foremost(_uncoupled(projection, turning.inertia))
    return joined(modes, columns, operators) if columns.shape[1] else modes


class _Found:
    """K-orthonormal directions (n, k), M-orthogonal to the modes, and what X has of them. Collective."""

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
        """Own rows (n, k) of the directions that count, found for each of the `classes` of modes by itself."""
        random = np.random.default_rng(0)
        shapes = LoadedShapes(self._operators, self._operators.stiffness)
        for among in classes:
            self._search(shapes, random, np.tile(among, 2))
        shapes.destroy()
        turn, counts = _counting(self._of)
        return combined(self._fields, turn[:, :counts], self._fields)

    def _search(self, shapes: LoadedShapes, random: np.random.Generator, among: Array) -> None:
        """Find all that counts of the columns `among` (2 m,) those of X."""
        known, width, found = len(self._of), int(among.sum()), 0
        while found < width:
            mix = np.zeros((len(among), min(BLOCK, width - found)))
            mix[among] = random.standard_normal((width, mix.shape[1]))
            self._take(shapes.whole(self._load(mix)))
            before, found = found, len(self._of) - known
            if found == before or _counting(self._of[known:, among])[1] + _SPARE <= found:
                return

    def _load(self, mix: Array) -> Array:
        """Own rows (n, b) of forces: [2 Omega G Phi, Omega^2 S Phi / w] mix."""
        parts = zip(self._forces, np.split(mix, 2), strict=True)
        return sum(f * multiply(matrix, self._modes.vectors @ part) for (f, matrix), part in parts)

    def _take(self, more: Array) -> None:
        """Of `more` shapes (n, b) what is in no mode and not known joins the directions."""
        vectors, comm, ops = self._modes.vectors, self._comm, self._operators
        for _ in range(2):  # once leaves what the first pass's rounding brought back
            take_off(more, vectors, gram(comm, vectors, ops.mass[:, None] * more))
            take_off(more, self._fields, gram(comm, self._fields, multiply(ops.stiffness, more)))
        sizes, turn = np.linalg.eigh(gram(comm, more, multiply(ops.stiffness, more)))
        kept = sizes > max(_NOTHING * TOLERANCE, _ROUNDING * sizes.max())
        new = more @ (turn[:, kept] / np.sqrt(sizes[kept]))
        # Q^T K X = Q^T L, and L of one matrix and one direction is G^T q . phi.
        given = [f * self._read(matrix, new) for f, matrix in self._forces]
        self._fields = np.hstack([self._fields, new])
        self._of = np.vstack([self._of, np.hstack(given)])

    def _read(self, matrix: PETSc.Mat, fields: Array) -> Array:
        """fields^T matrix Phi (k, m): G is skew and S symmetric, but for signs, which do not count."""
        return gram(self._comm, multiply(matrix, fields), self._modes.vectors)


def _uncoupled(projection: Projection, inertia: str) -> list[Array]:
    """Masks (m,) of modes that turning does not couple, as of a mirror's two kinds: mixed at random their shapes would have
    no symmetry any more."""
    coupled = np.zeros(2 * projection.squares.shape)
    for matrix in projection.rotating(inertia)[:2]:
        part = np.abs(matrix)
        coupled += part / max(part.max(), np.finfo(float).tiny)
    count, label = connected_components(coupled > _COUPLED, directed=False)
    return [label == k for k in range(count)]


def _counting(of: Array) -> tuple[Array, int]:
    """Singular directions of what X has of those found, and how many of them count."""
    turn, sizes, _ = np.linalg.svd(of, full_matrices=False)
    return turn, int((sizes**2 > TOLERANCE).sum())
