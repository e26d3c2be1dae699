"""The second eigenproblem on the modal basis: the rotating tire in the non-rotating frame.

    s^2 I + s (D_mod + 2 Omega G) + (Lambda + Omega^2 S + Omega D_mod B),  D_mod as in modal.damping

(thesis (2.1)-(2.5), corrected; the doppler form takes B for G and S_B for S). Its response to modal
forces is  eta = Re[R z] + R_b y,  z' = s z + L f,  y' = T y + L_b f:  a complex state per conjugate
pair or real eigenvalue, and a real block for those that are nearly defective.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from tireroad.fem.errors import ConvergenceError
from tireroad.modal.basis import Projection
from tireroad.modal.damping import Damping, rates
from tireroad.modal.refined import AT_REST, at_rest, cleared, refined, residual
from tireroad.modal.states import StateModes

Array = np.ndarray
DEFECTIVE = 1e6  # above, an eigenvector has lost six of sixteen digits, and goes to the block
SINGULAR = 1e13  # condition of K~ above which it counts as singular
# States at rest go to the block, as rigid modes do, unless there is one, of at most this condition.
_SKEWED = 1e2

Pencil = tuple[Array, Array]


def matrices(projection: Projection, speed: float, damping: Damping, inertia: str) -> Pencil:
    """D~ (1/s) and K~ (1/s2) of the projected problem; `damping` as in modal.damping."""
    return projection.pencil(*held_matrices(projection, speed, damping, inertia), speed)


def held_matrices(projection: Projection, speed: float, damping: Damping, inertia: str) -> Pencil:
    """The same for tire and air with the rim held, without a corner."""
    pencil = _tire_matrices(projection, speed, damping, inertia)
    return pencil if projection.air is None else projection.air.joined(*pencil, speed)


def _tire_matrices(projection: Projection, speed: float, damping: Damping, inertia: str) -> Pencil:
    """The same for the tire without its air."""
    rate = rates(damping, projection)
    stiffness, drag = np.diag(projection.squares), np.diag(rate)
    if speed == 0:
        return drag, stiffness
    gyroscopic, convective, body = projection.rotating(inertia)
    turning = speed * rate[:, None] * body
    return drag + 2 * speed * gyroscopic, stiffness + speed**2 * convective + turning


def standing(projection: Projection, damping: Damping) -> StateModes:
    """Uncoupled states without rotation: s = -d/2 +- sqrt(d^2/4 - omega^2), a = 2 s + d."""
    squares = projection.squares
    m = len(squares)
    half = rates(damping, projection) / 2
    root = np.sqrt(half.astype(complex) ** 2 - squares)
    # Condition of the eigenvectors of one mode's companion matrix is about omega / |root|.
    size = np.maximum(np.maximum(np.sqrt(np.abs(squares)), half), np.finfo(float).tiny)
    condition = 1 / np.maximum(np.abs(root) / size, np.finfo(float).eps ** 2)
    rigid = squares == 0
    split = (condition <= DEFECTIVE) & ~rigid
    defective = np.concatenate([np.flatnonzero(~split & ~rigid), np.flatnonzero(rigid)])
    paired = np.flatnonzero((root.imag != 0) & split)
    real = np.flatnonzero((root.imag == 0) & split)
    # Of two real roots the slow one is computed as omega^2 over the fast one: no cancellation.
    fast = -half[real] - root[real].real
    eigenvalue = np.concatenate([-half[paired] + root[paired], fast, squares[real] / fast])
    mode = np.concatenate([paired, real, real])
    weight = np.where(eigenvalue.imag != 0, 2.0, 1.0)
    right = np.zeros((m, len(mode)), complex)
    left = np.zeros((len(mode), m), complex)
    k = np.arange(len(mode))
    right[mode, k] = weight
    left[k, mode] = 1 / (2 * eigenvalue + 2 * half[mode])
    block, block_right, block_left = companion_blocks(defective, squares, half, m)
    none = np.zeros(len(mode))
    return StateModes(
        eigenvalue=eigenvalue,
        right=right,
        left=left,
        block=block,
        block_right=block_right,
        block_left=block_left,
        residual=none,
        left_residual=none,
        condition=float(condition[np.r_[paired, real]].max(initial=1.0)),
        rigid=2 * int(rigid.sum()),
    )


LIMITS = 1e-8, 1e-6  # largest residual, and largest error of an identity, that are accepted


def checks(
    modes: StateModes, drag: Array, stiffness: Array, limits: tuple[float, float] = LIMITS
) -> dict[str, float]:
    """How well the decoupled equations satisfy the original problem: relative figures by name.

    Over all 2m states  sum u w^T / a = 0,  sum s u w^T / a = 1,  sum -u w^T / (a s) = K~^-1,  and
    w_i^T [(s_i + s_j) + D~] u_j = a_i delta_ij among states with vectors. The third only for an
    invertible K~ (no rigid modes). ConvergenceError if a residual or an identity exceeds its
    `limits`.
    """
    m = len(drag)
    s, block = modes.eigenvalue, modes.block
    displacement = (modes.right @ modes.left).real + modes.block_right @ modes.block_left
    rate = (modes.right * s @ modes.left).real + modes.block_right @ block @ modes.block_left
    # A displacement per velocity is a time: relative to that of the slowest state.
    slowest = np.abs(s).min(initial=np.inf) if len(s) else 1.0
    figures = {
        "worst residual": float(modes.residual.max(initial=0.0)),
        "worst left residual": float(modes.left_residual.max(initial=0.0)),
        "sum identity 0": float(np.abs(displacement).max() * slowest),
        "sum identity 1": float(np.abs(rate - np.eye(m)).max()),
        "biorthogonality": float(
            np.abs(overlap(modes, modes, drag) - np.eye(len(s))).max(initial=0.0)
        ),
    }
    if np.linalg.cond(stiffness, 1) < SINGULAR:
        compliance = -(modes.right / s @ modes.left).real
        if len(block):
            compliance -= modes.block_right @ np.linalg.solve(block, modes.block_left)
        figures["sum identity K^-1"] = float(np.abs(stiffness @ compliance - np.eye(m)).max())
    for name, figure in figures.items():
        if not figure <= limits["residual" not in name]:
            raise ConvergenceError(
                f"rotating: {name} is {figure:.1e}: the rotating eigenproblem is too far from normal "
                "for double precision. Take fewer modes, a lower speed or less damping."
            )
    return figures


def overlap(one: StateModes, other: StateModes, drag: Array) -> Array:
    """(q, q') share of the states of `other` in those of `one`: the identity for the same problem.

    w_i^T [(s_i + s'_j) + D~] u'_j / a_i: left times right vectors of the companion matrices.
    """
    weight = np.where(other.eigenvalue.imag > 0, 2.0, 1.0)
    right = other.right / weight
    near = one.left @ right
    return one.eigenvalue[:, None] * near + near * other.eigenvalue + one.left @ (drag @ right)


def companion_blocks(
    modes: Array, squares: Array, half: Array, m: int
) -> tuple[Array, Array, Array]:
    """(T, R_b, L_b) of critically damped or rigid modes, each a companion matrix of its own."""
    k = 2 * len(modes)
    block, right, left = np.zeros((k, k)), np.zeros((m, k)), np.zeros((k, m))
    for i, mode in enumerate(modes):
        block[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, 1], [-squares[mode], -2 * half[mode]]]
        right[mode, 2 * i] = left[2 * i + 1, mode] = 1
    return block, right, left


def rotating(drag: Array, stiffness: Array, defective: float = DEFECTIVE) -> StateModes:
    """Decouple s^2 + s D~ + K~ by the eigenvectors of its companion matrix and their inverse.

    Eigenvalues whose vectors have a condition above `defective` stay together in a block. The right
    half of a row of the inverse is w^T / a, biorthogonal also inside clusters.
    """
    m = len(drag)
    # Velocities scaled by a mean circular frequency, to be as large as displacements.
    scale = np.sqrt(np.abs(np.diag(stiffness)).mean())
    companion = np.block([[np.zeros((m, m)), scale * np.eye(m)], [-stiffness / scale, -drag]])
    values, vectors = linalg.eig(companion)
    upper = values.imag >= 0
    values, vectors = _in_order(values[upper], vectors[:, upper])
    block, block_vectors = np.zeros((0, 0)), np.zeros((2 * m, 0))
    inverse, _ = _inverse(values, vectors, block_vectors)
    condition = np.linalg.norm(inverse, axis=1)
    slow = AT_REST * np.abs(values).max()
    rest = np.abs(values) <= slow
    good = (condition <= defective) & ~(rest & ((condition > _SKEWED) | (rest.sum() > 1)))
    block_inverse = block_vectors.T
    if not good.all():
        block, block_vectors, good = _invariant(companion, values, good)
        if rest[~good].all():
            block, block_vectors = at_rest(companion, block_vectors, slow)
        values, vectors = values[good], vectors[:, good]
        _, block_inverse = _inverse(values, vectors, block_vectors)
        vectors = cleared(companion, values, vectors, block, block_vectors, block_inverse)
        inverse, block_inverse = _inverse(values, vectors, block_vectors)
    values, right, left = refined(drag, stiffness, values, vectors[:m], inverse[:, m:] / scale)
    return StateModes(
        eigenvalue=values,
        right=right * np.where(values.imag > 0, 2.0, 1.0),
        left=left,
        block=block,
        block_right=block_vectors[:m],
        block_left=block_inverse[:, m:] / scale,
        residual=residual(drag, stiffness, values, right),
        left_residual=residual(drag.T, stiffness.T, values, left.T),
        condition=float(condition[good].max(initial=1.0)),
    )


def _in_order(values: Array, vectors: Array) -> tuple[Array, Array]:
    """States ascending in Im s, then in Re s, with vectors of length 1 whose largest component, or
    the first of those within a thousandth of it, is real and positive.
    """
    order = np.lexsort((values.real, values.imag))
    values, vectors = values[order], vectors[:, order]
    size = np.abs(vectors)
    first = (size >= 0.999 * size.max(axis=0)).argmax(axis=0)
    turn = np.exp(-1j * np.angle(vectors[first, np.arange(len(values))]))
    return values, vectors * turn / np.linalg.norm(vectors, axis=0)


def _inverse(values: Array, vectors: Array, block_vectors: Array) -> tuple[Array, Array]:
    """Rows of the inverse of [vectors, their conjugates, block vectors] for the first and the last,
    from [Re v, Im v] in real arithmetic at a quarter of the work.
    """
    pairs = values.imag > 0
    real = np.hstack([vectors.real, vectors.imag[:, pairs], block_vectors])
    inverse = np.linalg.inv(real)
    count, waves = len(values), int(pairs.sum())
    rows = inverse[:count].astype(complex)
    rows[pairs] = (inverse[:count][pairs] - 1j * inverse[count : count + waves]) / 2
    return rows, inverse[count + waves :]


def _invariant(companion: Array, values: Array, good: Array) -> tuple[Array, Array, Array]:
    """Schur block and real orthonormal basis of the invariant subspace of eigenvalues not `good`,
    and which are good in the end: those that cannot be told from the others join them.

    The Schur form reproduces a defective eigenvalue only within a small fraction of itself or,
    where it is zero, of the matrix. ConvergenceError if none of the distances separates them.
    """
    chosen, everything = values[~good], float(np.linalg.norm(companion, 2))
    for near in (1e-6 * float(np.abs(chosen).max()), 1e-7 * everything, 1e-6 * everything):

        def taken(re: float, im: float, near: float = near) -> bool:
            both = np.abs([chosen - complex(re, im), chosen - complex(re, -im)])
            return bool(both.min() < near)

        within = np.array([taken(v.real, v.imag) for v in values])
        schur, basis, count = linalg.schur(companion, output="real", sort=taken)
        if count == np.where(values[within].imag > 0, 2, 1).sum():
            return schur[:count, :count], basis[:, :count], ~within
    raise ConvergenceError(
        f"rotating: {len(chosen)} eigenvalues next to defective ones ({np.abs(chosen).min():.4g} to "
        f"{np.abs(chosen).max():.4g} 1/s) cannot be distinguished from others. Change the damping or the speed a "
        "little."
    )
