"""States of the rotating tire on its modes: eigenproblem, refinement, unrestrained motions.

    s^2 I + s (D_mod + 2 Omega G) + (Lambda + Omega^2 S + Omega D_mod B),  D_mod as in modal.damping

(thesis (2.1)-(2.5), corrected; the doppler form takes B for G and S_B for S). Its response to modal
forces is  eta = Re[R z] + R_b y,  z' = s z + L f,  y' = T y + L_b f:  a complex state per conjugate
pair or real eigenvalue, and a real block for those that are nearly defective.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import linalg

from tireroad.fem.errors import ConvergenceError
from tireroad.modal.basis import Projection
from tireroad.modal.damping import Damping, modal_damping, rates
from tireroad.modal.states import StateModes

Array = np.ndarray

# States slower than this fraction of the fastest have terms of rounding alone; a residual is
# relative to at least this fraction of the fastest |s|^2.
AT_REST = 1e-5
_ROUGH = 1e-11  # residual above which a state is refined
_MOST = 20  # refinements, a factorisation each; only a few slow states ever need one
_SAME = 1e-4  # relative change beyond which inverse iteration has moved on to a neighbouring state
DEFECTIVE = 1e6  # above, an eigenvector has lost six of sixteen digits, and goes to the block
SINGULAR = 1e13  # condition of K~ above which it counts as singular
# States at rest go to the block, as rigid modes do, unless there is one, of at most this condition.
_SKEWED = 1e2
Pencil = tuple[Array, Array]
LIMITS = 1e-8, 1e-6  # largest residual, and largest error of an identity, that are accepted


def _real_by_complex(matrix: Array, vectors: Array) -> Array:
    """matrix (m, n) vectors (n, q), as one product of real matrices: parts side by side."""
    if not vectors.size:
        return np.zeros((len(matrix), vectors.shape[1]), complex)
    side_by_side = np.ascontiguousarray(vectors, complex).view(float)
    return (matrix @ side_by_side).view(complex)


def residual(drag: Array, stiffness: Array, values: Array, vectors: Array) -> Array:
    """||(s^2 + s D + K) u|| over the sum of the norms of its terms, column by column."""

    terms = (
        vectors * values**2,
        _real_by_complex(drag, vectors) * values,
        _real_by_complex(stiffness, vectors),
    )
    size = sum(np.linalg.norm(term, axis=0) for term in terms)
    least = AT_REST * np.abs(values).max(initial=0.0) ** 2 * np.linalg.norm(vectors, axis=0)
    return np.linalg.norm(sum(terms), axis=0) / np.maximum(size, least)


def refined(
    drag: Array,
    stiffness: Array,
    values: Array,
    right: Array,
    left: Array,
) -> tuple[Array, Array, Array]:
    """Values (q,), right (m, q) and left vectors (q, m), w^T (2 s + D) u = 1, the worst refined.

    A state too close to another for one step to separate them is left unchanged.

    The companion matrix of a wide spectrum determines its slow states only to rounding of the fast
    ones; the states of a free rim, close to rest, suffer most. Such a state gets one step of
    inverse iteration on the quadratic problem,

        Q(s) u+ = u,   Q(s)^T w+ = w,   Q(s) = s^2 + s D + K,

    is normalised again, w^T (2 s + D) u = 1, and its eigenvalue follows from Lancaster's two-sided
    quotient, s+ = s - w^T Q(s) u, whose error is of second order in those of the vectors.
    """
    rough = np.maximum(
        residual(drag, stiffness, values, right), residual(drag.T, stiffness.T, values, left.T)
    )
    chosen = [k for k in np.argsort(-rough)[:_MOST] if rough[k] > _ROUGH]
    values, right, left = values.copy(), right.copy(), left.copy()
    for k in chosen:
        better = _better(drag, stiffness, values[k], right[:, k], left[k])
        if better is not None:
            values[k], right[:, k], left[k] = better
    return values, right, left


def _better(
    drag: Array, stiffness: Array, s: complex, u: Array, w: Array
) -> tuple[complex, Array, Array] | None:
    """One state after a refinement step, real if it was real; None if it turned into another."""
    if s.imag == 0:
        s, u, w = s.real, u.real, w.real
    unit = np.eye(len(u))
    matrix = s * (s * unit + drag) + stiffness
    try:
        u, before, w, also = np.linalg.solve(matrix, u), u, np.linalg.solve(matrix.T, w), w
    except np.linalg.LinAlgError:  # the state is exact
        return None
    u, w = (x / np.abs(x).max() for x in (u, w))  # a nearly singular solve can return any length
    u = u * (np.vdot(u, before) / np.vdot(u, u))  # the original length and phase
    w = w / (w @ (2 * s * u + drag @ u))
    same = np.linalg.norm(u - before) < _SAME * np.linalg.norm(before)
    if not (same and np.linalg.norm(w - also) < _SAME * np.linalg.norm(also)):
        return None
    return s - w @ (s * (s * u + drag @ u) + stiffness @ u), u, w


def cleared(
    matrix: Array,
    values: Array,
    vectors: Array,
    block: Array,
    span: Array,
    inverse: Array,
) -> Array:
    """Eigenvectors (n, q) of a real matrix (n, n), cleared of an invariant subspace.

    The subspace, which contains none of them, is spanned by `span` (n, b), on which the matrix is
    T = `block` (b, b); `inverse` (b, n) is its left basis. One first-order step: with
    r = A v - s v,  v+ = v + span (s - T)^-1 inverse r. The left vectors of drifting motions are so
    long that the rounding of fast vectors is amplified a million times along them.
    """
    if not len(block):
        return vectors
    rest = _real_by_complex(matrix, vectors) - vectors * values
    shifted = values[:, None, None] * np.eye(len(block)) - block
    share = np.linalg.solve(shifted, (inverse @ rest).T[:, :, None])[:, :, 0]
    return vectors + span @ share.T


def at_rest(matrix: Array, span: Array, shift: float) -> tuple[Array, Array]:
    """(T, V) of a real matrix (n, n) on its invariant subspace of nearly zero eigenvalues.

    `span` (n, b), orthonormal, is improved by inverse iteration at the `shift`, far below all other
    eigenvalues. T = shift + (V^T (A - shift)^-1 V)^-1, so entries that are small beside the matrix
    are not lost in A V.
    """
    factor = linalg.lu_factor(matrix - shift * np.eye(len(matrix)))
    for _ in range(2):
        span = np.linalg.qr(linalg.lu_solve(factor, span))[0]
    inverse = span.T @ linalg.lu_solve(factor, span)
    return shift * np.eye(len(inverse)) + np.linalg.inv(inverse), span


def matrices(projection: Projection, speed: float, damping: Damping, inertia: str) -> Pencil:
    """D~ (1/s) and K~ (1/s2) of the projected problem; `damping` as in modal.damping."""
    return projection.pencil(*held_matrices(projection, speed, damping, inertia), speed)


def held_matrices(projection: Projection, speed: float, damping: Damping, inertia: str) -> Pencil:
    """The same for tire and air with the rim held, without a corner."""
    pencil = _tire_matrices(projection, speed, damping, inertia)
    return pencil if projection.air is None else projection.air.with_tire(*pencil, speed)


def _tire_matrices(projection: Projection, speed: float, damping: Damping, inertia: str) -> Pencil:
    """The same for the tire without its air."""
    stiffness, drag = projection.stiffness, modal_damping(damping, projection)
    if speed == 0:
        return drag, stiffness
    gyroscopic, convective, body = projection.rotating(inertia)
    turning = speed * drag @ body
    return drag + 2 * speed * gyroscopic, stiffness + speed**2 * convective + turning


def standing(projection: Projection, damping: Damping) -> StateModes:
    """States without rotation of modes that nothing couples: s = -d/2 +- sqrt(d^2/4 - omega^2), a = 2 s + d."""
    squares = projection.own_squares
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


def overlap(states: StateModes, other: StateModes, drag: Array) -> Array:
    """(q, q') share of the states of `other` in `states`: the identity for the same problem.

    w_i^T [(s_i + s'_j) + D~] u'_j / a_i: left times right vectors of the companion matrices.
    """
    weight = np.where(other.eigenvalue.imag > 0, 2.0, 1.0)
    right = other.right / weight
    near = states.left @ right
    return (
        states.eigenvalue[:, None] * near + near * other.eigenvalue + states.left @ (drag @ right)
    )


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


# Conditions above which vectors count as defective. Where the checks fail, a lower limit moves more
# states into the block (observed beside the rigid motions of a free rim with air, on two processes
# of three).


def with_free_motions(
    drag: np.ndarray, stiffness: np.ndarray, free_motions: np.ndarray
) -> StateModes:
    """`rotating` where the orthonormal motions `adrift` (m, r) meet no stiffness or damping.

    They are split off exactly and drift in a block of their own.
    """
    m, r = free_motions.shape
    others = linalg.qr(free_motions)[0][:, r:]
    states = rotating(others.T @ drag @ others, others.T @ stiffness @ others)
    block, right, left = companion_blocks(np.arange(r), np.zeros(r), np.zeros(r), r)
    return replace(
        states,
        right=others @ states.right,
        left=states.left @ others.T,
        block=linalg.block_diag(states.block, block),
        block_right=np.hstack([others @ states.block_right, free_motions @ right]),
        block_left=np.vstack([states.block_left @ others.T, left @ free_motions.T]),
        rigid=2 * r,
    )
