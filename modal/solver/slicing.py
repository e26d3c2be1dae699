"""All lowest eigenpairs of K x = w^2 M x: slices of the spectrum, block Lanczos, inertia counts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import linalg, sparse

from tireroad.fem.collective import from_local_rows, summed
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.compliance import RIGID
from tireroad.fem.static.checkpoint import Entry, Journal
from tireroad.modal.solver.searches import AUTO, BLOCK

# Longest basis: this many vectors for each wanted one, and this many blocks more.
_LENGTH, _MORE = 6, 30
_EVERY = 3  # blocks between two checks of convergence
_CLEAN = 1e-9  # of the largest: components after whose removal a block is orthogonal to rounding
_LOST = 1e-8  # of the largest: a direction of a new block shorter than this is rounding

# Residual of a Ritz pair relative to theta: as small as the vectors of neighbouring slices must be
# orthogonal to each other, a few digits above rounding.
TOLERANCE = 1e-12
# With deflation: each search finds at least a block of each repeated eigenvalue.
_SEARCHES = 40
_SOFT = 1e-3  # of the matrix norm: noise of a hundred roundings is 1e-11 of an eigenvalue there
_DENSE = 200  # unknowns below which LAPACK takes no longer than one factorisation and its overhead
_MANY = 0.25  # share of all eigenvalues from which on LAPACK takes no longer
_LARGEST_DENSE = 3000
# Krylov-Schur: the longest basis over the wanted eigenvalues, and the share of it that a restart keeps: 193
# solves for 107 eigenvalues (half of it, SLEPc's default: 209; 1.25 and 0.5: 202; 1.75 and 0.9: 201).
_LONGEST, _KEPT = 1.5, 0.7

# Eigenvalues per slice and matrix: fewest, where teams wait for work, and most. The more, the fewer vectors
# each takes (61,071 unknowns: 3.2 of 171, 2.6 of 326) and the fewer factors there are; but the basis grows.
_SLICE = 64, 320
_BASIS = 5e8  # bytes of it on one process, as far as half of that many eigenvalues allow
_VECTORS = 2.6  # of the basis for each eigenvalue
_PROBES = 8
_FINEST = 1e-9  # relative width below which a crowded interval counts as one cluster
_CROWDED = 1.6  # times the wanted number in a step: above, a boundary in between costs less


@dataclass(frozen=True)
class ProcessGroup:
    """The team of this process.

    `comm`: its processes; `number`: its number; `roots`: the rank, among all processes, of the
    first process of each team. Methods on arrays take and return this process's rows, and are
    collective in the team.
    """

    comm: MPI.Comm
    number: int
    roots: tuple[int, ...]

    @classmethod
    def of(cls, comm: MPI.Comm, teams: int) -> ProcessGroup:
        """The team of this process when all are divided into `teams` of about equal size.

        Collective over all of `comm`.
        """
        number = comm.rank * teams // comm.size
        roots = tuple(-(-k * comm.size // teams) for k in range(teams))
        own = MPI.COMM_SELF if teams == comm.size else comm.Split(number, comm.rank)
        return cls(own, number, roots)

    @property
    def alone(self) -> bool:
        """Whether the team is a single process."""
        return self.comm.size == 1

    def disband(self) -> None:
        """Free the communicator, once nothing uses it any more. Collective."""
        if not self.alone:
            self.comm.Free()

    def own(self, size: int) -> slice:
        """This process's rows of `size` of the team, distributed as PETSc does."""
        each, more = divmod(size, self.comm.size)
        start = self.comm.rank * each + min(self.comm.rank, more)
        return slice(start, start + each + (self.comm.rank < more))

    def inner(self, left: np.ndarray, right: np.ndarray) -> np.ndarray:
        """left^T right."""
        return summed(self.comm, left.T @ right)

    def lengths(self, vectors: np.ndarray) -> np.ndarray:
        """Length of each column."""
        return np.sqrt(summed(self.comm, (vectors**2).sum(axis=0)))

    def orthonormal(self, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Q (rows, b) and R (b, b) of the vectors: QR of each process's rows, then of all R."""
        q, r = np.linalg.qr(vectors)
        if self.alone:
            return q, r
        every = self.comm.allgather(r)
        start = sum(len(factor) for factor in every[: self.comm.rank])
        turn, r = np.linalg.qr(np.vstack(every))
        return q @ turn[start : start + q.shape[1]], r

    def random(self, seed: int) -> np.random.Generator:
        """A generator whose numbers differ from process to process."""
        return np.random.default_rng(seed if self.alone else [seed, self.comm.rank])

    def whole(self, rows: sparse.csr_matrix) -> sparse.csr_matrix:
        """A small matrix, whole on every process of the team, from its rows."""
        return rows if self.alone else sparse.vstack(self.comm.allgather(rows), format="csr")

    def at_root(self, rows: np.ndarray) -> np.ndarray | None:
        """All rows (n, k) on the first process of the team; None on the others."""
        if self.alone:
            return rows
        counts = np.array(self.comm.allgather(rows.size))
        every = None
        if self.comm.rank == 0:
            every = np.empty((counts.sum() // rows.shape[1], rows.shape[1]))
        received = None if every is None else [every, counts, MPI.DOUBLE]
        self.comm.Gatherv(np.ascontiguousarray(rows), received)
        return every


ALONE = ProcessGroup(MPI.COMM_SELF, 0, (0,))


def how_many(comm: MPI.Comm, needed: float, room: float) -> int:
    """Number of teams for a part that takes `needed` bytes, the same on every process. Collective.

    `room`: bytes that this process's machine has for all its processes. As many teams as fit, at
    least one.
    """
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    share = room / machine.size
    machine.Free()
    least = comm.size * comm.allreduce(share, MPI.MIN) / max(needed, 1.0)
    return comm.size if math.isinf(least) else int(np.clip(least, 1, comm.size))


@dataclass(frozen=True, kw_only=True)
class Modes:
    """The lowest m modes.

    `squares` omega^2 (m,) 1/s2, ascending; `vectors`: this process's rows (n, m) of the
    mass-normalised shapes, kg^-1/2, with signs and bases of repeated frequencies by rule
    (modal.solver.fields); `residual` (m,) ||K phi - lambda M phi|| / ||lambda M phi||, a bound
    on twice the relative error of the frequency; `inertia_count` eigenvalues below `counted_below`
    (1/s2) by Sylvester's law, equal to the number found there; `rigid`: the number of modes without
    stiffness among them, whose square is 0; `sectors`: sizes of the independent problems that the
    `symmetries` (names) or wave numbers split it into; `slices`: intervals solved; `segments`:
    equal ones around the axle, 1 where none are used.
    """

    squares: np.ndarray
    vectors: np.ndarray
    residual: np.ndarray
    orthonormality: float
    inertia_count: int
    counted_below: float
    rigid: int
    sectors: tuple[int, ...]
    slices: int
    segments: int = 1
    symmetries: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """Number of modes, m; static shapes that joined them (modal.basis) come after."""
        return len(self.residual)

    @property
    def frequency(self) -> np.ndarray:
        """Natural frequencies (m,), Hz; 0 for rigid modes."""
        return np.sqrt(np.maximum(self.squares[: self.count], 0.0)) / (2 * np.pi)

    def first(self, count: int) -> Modes:
        """The `count` lowest modes."""
        return replace(
            self,
            squares=self.squares[:count],
            vectors=self.vectors[:, :count],
            residual=self.residual[:count],
        )

    def among(self, which: np.ndarray) -> Modes:
        """The same with the squares and vectors at `which`, indices or a mask."""
        return replace(self, squares=self.squares[which], vectors=self.vectors[:, which])


class Shifted:
    """A - sigma I = L D L^T by MUMPS, for a symmetric sparse A (n, n).

    Each process of the `team` has its own rows of A. `negative` is the number of eigenvalues of A
    below sigma (Sylvester's law of inertia). `singular` says that sigma is an eigenvalue to
    rounding, so that the inverse must not be used. Raises ConvergenceError if the factorisation
    fails. Collective in the team.
    """

    def __init__(self, matrix: sparse.csr_matrix, shift: float, team: ProcessGroup = ALONE) -> None:
        self.rows, self.size = matrix.shape
        self.shift, self.team = shift, team
        sizes = ((self.rows, self.size), (self.rows, self.size))
        shifted = from_local_rows(matrix, sizes, team.comm)
        shifted.shift(-shift)
        shifted.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._pc = PETSc.PC().create(team.comm)
        self._pc.setOperators(shifted)
        self._pc.setType(PETSc.PC.Type.CHOLESKY)
        self._pc.setFactorSolverType("mumps")
        self._pc.setFactorSetUpSolverType()
        self._factor = self._pc.getFactorMatrix()
        # Without null pivot detection MUMPS counts a zero pivot by the sign of its rounding.
        self._factor.setMumpsIcntl(24, 1)
        if not team.alone:  # last block on one process: MUMPS counts its inertia only there
            self._factor.setMumpsIcntl(13, 1)
        self._pc.setUp()
        self.negative, null, positive = self._factor.getInertia()
        self.singular = null > 0
        if self.negative + null + positive != self.size:
            raise ConvergenceError(
                f"modes: the factorisation at {shift:.6g} 1/s2 failed (its inertia counts "
                f"{self.negative + null + positive} of {self.size} pivots): out of memory, or a "
                "matrix with entries that are not numbers."
            )
        shifted.destroy()

    def solve(self, right: np.ndarray) -> np.ndarray:
        """(A - sigma I)^-1 right, own rows (rows, p).

        A block of many columns costs a fifth of solving one by one.
        """
        sizes, comm = ((self.rows, self.size), (PETSc.DECIDE, right.shape[1])), self.team.comm
        block = PETSc.Mat().createDense(sizes, array=np.asfortranarray(right), comm=comm)
        empty = np.empty(right.shape, order="F")
        answer = PETSc.Mat().createDense(sizes, array=empty, comm=comm)
        self._factor.setMumpsIcntl(27, right.shape[1])
        self._factor.matSolve(block, answer)
        out = answer.getDenseArray().copy()
        block.destroy()
        answer.destroy()
        return out

    def apply(self, right: PETSc.Vec, answer: PETSc.Vec) -> None:
        """answer = (A - sigma I)^-1 right, of one vector."""
        self._pc.apply(right, answer)

    def destroy(self) -> None:
        """Free the factor, the eigensolver's largest memory, which petsc4py does not."""
        self._factor.destroy()
        self._pc.destroy()


class KrylovBasis:
    """Orthonormal vectors (n, m), own rows, orthogonal to `known` (n, k), grown by blocks."""

    def __init__(self, shifted: Shifted, known: np.ndarray, most: int, seed: int) -> None:
        self._shifted, self._known, self._team = shifted, known, shifted.team
        self._random = shifted.team.random(seed)
        room = shifted.size - known.shape[1]
        self._most = min(most, room)
        self._vectors = np.empty((shifted.rows, self._most), order="F")
        self._projected = np.zeros((self._most, self._most))
        self.size = self._done = 0
        self._rest = np.zeros((0, 0))
        self._append(self._random.standard_normal((shifted.rows, min(BLOCK, self._most))))

    @property
    def full(self) -> bool:
        """Whether the basis cannot grow any more."""
        return self._done == self.size

    def grow(self) -> None:
        """Solve for one block, which yields the next block of the basis."""
        start, m = self._done, self.size
        ahead = self._shifted.solve(self._vectors[:, start:m])
        largest = self._team.lengths(ahead).max()
        part = np.zeros((m, m - start))
        # A symmetric operator takes a block to itself, its neighbours and nothing else: with these
        # taken off, one pass over all the rest removes rounding alone, unless it finds more.
        for first in (max(start - BLOCK, 0), 0, 0):
            before = self._vectors[:, first:m]
            share = self._team.inner(before, ahead)
            ahead -= before @ share
            part[first:] += share
            if not first and np.abs(share).max() < _CLEAN * largest:
                break
        ahead -= self._known @ self._team.inner(self._known, ahead)
        self._projected[:m, start:m] = part
        self._projected[start:m, :m] = part.T
        self._done = m
        self._rest = self._append(ahead, largest)

    def ritz(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """theta (m,), residuals (m,) and vectors (m, m) in the part of the basis solved for."""
        m = self._done
        theta, vectors = np.linalg.eigh((self._projected[:m, :m] + self._projected[:m, :m].T) / 2)
        last = vectors[m - self._rest.shape[1] :]
        return theta, np.linalg.norm(self._rest @ last, axis=0), vectors

    def fields(self, vectors: np.ndarray) -> np.ndarray:
        """Vectors (n, k) from those in the basis (m, k)."""
        return self._vectors[:, : len(vectors)] @ vectors

    def _append(self, ahead: np.ndarray, largest: float = 1.0) -> np.ndarray:
        """Add the directions (n, b) as far as there is room; returns R (b', b) of their QR."""
        m = self.size
        block, rest = self._team.orthonormal(ahead)
        short = np.abs(rest.diagonal()) < _LOST * largest
        # Directions that are rounding mean an invariant subspace: replace them by random ones.
        block[:, short] = self._random.standard_normal((len(block), int(short.sum())))
        rest[short] = 0.0
        if short.any() or not m:
            for _ in range(2):
                block -= self._known @ self._team.inner(self._known, block)
                block -= self._vectors[:, :m] @ self._team.inner(self._vectors[:, :m], block)
                block = self._team.orthonormal(block)[0]
        end = min(m + block.shape[1], self._most)
        self._vectors[:, m:end] = block[:, : end - m]
        self.size = end
        return rest


def nearest(
    shifted: Shifted, low: float, high: float, count: int, known: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (k,) from `low` to `high`; orthonormal vectors (n, k) orthogonal to the `known`.

    The search ends when `count` have converged, to a residual below the tolerance relative to
    theta, or when the basis is full. Each process has its rows. Collective in the team.

        W = (A - sigma I)^-1 V_j = V_1..j H_j + V_j+1 R_j,   H s = theta s,   lambda = sigma + 1 / theta

    Every new block is orthogonalised twice against all earlier ones. The residual of a Ritz pair is
    |R_j s_j|, with s_j the last block of s. A triangular solve with one right-hand side is
    memory-bound: eight at once cost less than two one by one, and a third more of them are needed
    (radial tire, 14,919 unknowns, 76 eigenvalues: 248 solves, 1.1 s; SLEPc's Krylov-Schur with one
    vector: 2.8 s). Blocks of 4 and of 16 take 1.3 and 1.4 s. Sources: Golub and Underwood (1977);
    Grimes, Lewis and Simon, SIAM J. Matrix Anal. Appl. 15 (1994) 228.
    """
    basis = KrylovBasis(shifted, known, _LENGTH * count + _MORE * BLOCK, 7 + known.shape[1])
    blocks = 0
    while True:
        basis.grow()
        blocks += 1
        if not basis.full and (basis.size < 2 * count or blocks % _EVERY):
            continue
        theta, residual, vectors = basis.ritz()
        values = shifted.shift + 1 / np.where(theta == 0.0, np.finfo(float).tiny, theta)
        inside = (values > low) & (values < high) & (residual <= tolerance * np.abs(theta))
        if inside.sum() >= count or basis.full:
            return values[inside], basis.fields(vectors[:, inside])


def merged(steps: list[tuple[float, np.ndarray]], most: float) -> list[tuple[float, np.ndarray]]:
    """Join neighbouring steps as long as together they hold at most `most` eigenvalues.

    The first steps are narrow, because the density of eigenvalues is not known yet.
    """
    steps_left = steps[:1]
    for step, following in zip(steps[1:], [*steps[2:], None], strict=True):
        if following is None or (following[1] - steps_left[-1][1]).sum() > most:
            steps_left.append(step)
    return steps_left


def onward(low: float, step: float) -> float:
    """The next boundary, `step` (rad/s) up; at most threefold once the first modes are known."""
    root = np.sqrt(low)
    return (root + (min(step, 2 * root) if root else step)) ** 2


def between(low: float, known: int, high: float, crowd: int, goal: float) -> float:
    """The value with `goal` eigenvalues more than at `low`, interpolated linearly in frequency.

    `known` lie below `low` and `crowd` below `high`; the result stays well inside the interval.
    """
    share = np.clip(goal / (crowd - known), 0.05, 0.9)
    root = np.sqrt(max(low, 0.0))
    return (root + share * (np.sqrt(high) - root)) ** 2


@dataclass(frozen=True)
class Interval:
    """Eigenvalues from `low` to `high`, `count` of them by inertia."""

    low: float
    high: float
    count: int


def eigenpairs(
    matrix: sparse.csr_matrix,
    interval: Interval,
    team: ProcessGroup = ALONE,
    search: Search = nearest,
) -> tuple[np.ndarray, np.ndarray]:
    """The `count` eigenvalues in the interval, ascending, and orthonormal vectors (n, count).

    Of the matrix and of the vectors, each process of the `team` has its rows. Small matrices, and
    those of which most eigenvalues are wanted, are solved densely. Raises ConvergenceError if the
    number found differs from the inertia count. Collective in the team.

        (A - sigma I)^-1 v = theta v,   lambda = sigma + 1 / theta

    The largest |theta| belong to the eigenvalues nearest to the shift. The number of eigenvalues in
    the interval is known beforehand from inertia. A block finds as many directions of a repeated
    eigenvalue as it has vectors, so the search continues with the found ones deflated until the
    count is met, and never ends earlier.
    """
    rows, size = matrix.shape
    if interval.count == 0:
        return np.zeros(0), np.zeros((rows, 0))
    if size <= _DENSE or _MANY * size <= interval.count and size <= _LARGEST_DENSE:
        whole = team.whole(matrix).toarray()
        values, vectors = linalg.eigh(whole, subset_by_value=(interval.low, interval.high))
        _check_count(len(values), interval)
        return values, vectors[team.own(size)]
    shifted = _regular_shift(matrix, interval, team)
    try:
        values, vectors = _search(shifted, interval, search)
        _check_count(len(values), interval)
        order = np.argsort(values, kind="stable")
        values, vectors = values[order], vectors[:, order]
        _polish(matrix, shifted, values, vectors)
    finally:
        shifted.destroy()
    return values, vectors


class _Inverse:
    """(A - sigma I)^-1 as an operator of PETSc."""

    def __init__(self, shifted: Shifted) -> None:
        self._shifted = shifted

    def mult(self, _: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = (A - sigma I)^-1 x."""
        self._shifted.apply(x, y)


def krylov_schur(
    shifted: Shifted, low: float, high: float, count: int, known: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """The same as `nearest` by SLEPc's Krylov-Schur with one vector, the `known` deflated.

    The slices, their factor and their inertia are this program's. Radial tire, 10,600 unknowns and 107 eigenvalues
    of a part, CPU time: 193 solves of 7 ms, 1.5 s; by blocks 312 of 1.4 ms, 0.6 s; by SLEPc's own spectrum slicing
    338 solves, 10.9 s, three quarters of its elapsed time in one symbolic and two numeric factorisations (10.6 s without
    its detection of zeros). A solve with one vector takes as long as reading the factor twice (38 MB), so neither
    a looser tolerance nor another basis or shift helps: 1.8 solves an eigenvalue are needed with any. A single
    orthogonalisation (eta = 0.1) loses the basis. All modes, medians of two to seven pairs on a busy machine
    (2026-11-29): quickstart.toml 5.0 s, by blocks 3.2 s (1.35 to 1.65 times); torus.toml 4.6 and 3.4 s;
    passenger.toml 5.0 and 3.7 s; 500 of a torus of 44,640 unknowns 7.3 and 5.9 s (`bench modes`).
    """
    from slepc4py import SLEPc

    rows, size, comm = shifted.rows, shifted.size, shifted.team.comm
    inverse = PETSc.Mat().createPython(
        ((rows, size), (rows, size)), context=_Inverse(shifted), comm=comm
    )
    inverse.setUp()
    inverse.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    solver = SLEPc.EPS().create(comm)
    vector = inverse.createVecRight()
    try:
        solver.setOptionsPrefix("modes_")
        solver.setOperators(inverse)
        solver.setProblemType(SLEPc.EPS.ProblemType.HEP)
        solver.setType(SLEPc.EPS.Type.KRYLOVSCHUR)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.LARGEST_MAGNITUDE)
        longest = min(math.ceil(_LONGEST * count) + _PROBES, size - known.shape[1])
        solver.setDimensions(min(count, longest), longest, PETSc.DECIDE)
        solver.setKrylovSchurRestart(_KEPT)
        solver.setTolerances(tolerance)
        if known.shape[1]:
            held = [
                PETSc.Vec().createWithArray(np.ascontiguousarray(v), comm=comm) for v in known.T
            ]
            solver.setDeflationSpace(held)
        solver.setFromOptions()
        solver.solve()
        theta, vectors = np.empty(solver.getConverged()), np.empty((rows, solver.getConverged()))
        for k in range(len(theta)):
            theta[k] = solver.getEigenpair(k, vector).real
            vectors[:, k] = vector.array_r
    except PETSc.Error as error:
        raise ConvergenceError(
            f"modes: SLEPc failed from {_hertz(low):.3f} to {_hertz(high):.3f} Hz "
            f'({str(error).splitlines()[-1].strip()}): take modal.solver = "lanczos"'
        ) from error
    finally:
        for item in (vector, solver, inverse):
            item.destroy()
    values = shifted.shift + 1 / np.where(theta == 0.0, np.finfo(float).tiny, theta)
    inside = (values > low) & (values < high)
    return values[inside], vectors[:, inside]


Search = Callable[[Shifted, float, float, int, np.ndarray, float], tuple[np.ndarray, np.ndarray]]
SOLVERS: dict[str, Search] = {"lanczos": nearest, "slepc": krylov_schur}
"""What searches eigenpairs near the shift of a slice."""


def _check_count(count: int, interval: Interval) -> None:
    if count != interval.count:
        raise ConvergenceError(
            f"modes: {count} modes found from {_hertz(interval.low):.3f} to "
            f"{_hertz(interval.high):.3f} Hz, but the inertia of K - sigma M counts {interval.count}. "
            "The matrix may be far from symmetric, or scaled so that rounding hides the low modes."
        )


def _search(shifted: Shifted, interval: Interval, search: Search) -> tuple[np.ndarray, np.ndarray]:
    """Eigenpairs inside the interval, unordered: all of them, or those found in `_SEARCHES`."""
    values, vectors = np.zeros(0), np.zeros((shifted.rows, 0))
    for _ in range(_SEARCHES):
        missing = interval.count - len(values)
        more = search(shifted, interval.low, interval.high, missing, vectors, TOLERANCE)
        values, vectors = np.append(values, more[0]), np.hstack([vectors, more[1]])
        if len(values) >= interval.count or not len(more[0]):
            break
    return values, vectors


def _polish(
    matrix: sparse.csr_matrix, shifted: Shifted, values: np.ndarray, vectors: np.ndarray
) -> None:
    """One step of inverse iteration, in place, where rounding would show in the residual.

    A Krylov basis carries noise in the stiffest directions, which the matrix multiplies by up to
    1e7 times the lowest eigenvalue: low modes are accurate in the inverse norm but not in the
    residual.
    """
    norm = shifted.team.comm.allreduce(float(abs(matrix).sum(axis=1).max()), MPI.MAX)
    soft = np.flatnonzero(values < _SOFT * norm)
    if len(soft):
        better = shifted.solve(vectors[:, soft])
        vectors[:, soft] = (
            better / shifted.team.lengths(better) * np.sign(values[soft] - shifted.shift)
        )


def _hertz(square: float) -> float:
    return float(np.sign(square) * np.sqrt(abs(square)) / (2 * np.pi))


def _regular_shift(matrix: sparse.csr_matrix, interval: Interval, team: ProcessGroup) -> Shifted:
    """Factorised at a shift near the middle that is no eigenvalue; else ConvergenceError."""
    width = interval.high - interval.low
    for part in (0.5, 0.507, 0.489, 0.523):
        shift = interval.low + part * width
        shifted = Shifted(matrix, shift, team)
        if not shifted.singular:
            return shifted
        shifted.destroy()
    raise ConvergenceError(
        f"modes: K - sigma M is singular all around {_hertz(shift):.3f} Hz: the mesh has nodes "
        "without stiffness."
    )


class SymmetricPart(Protocol):
    """A part of a symmetric problem: own rows in the team of a sparse `matrix` (d, d), each
    eigenvalue of which stands for `copies` equal ones of the whole.
    """

    @property
    def matrix(self) -> sparse.csr_matrix: ...
    @property
    def copies(self) -> int: ...

    def fields(self, vectors: np.ndarray) -> np.ndarray:
        """Orthonormal fields (n, k copies) of the whole from vectors (d, k) of the part."""
        ...


@dataclass(frozen=True)
class Slice:
    """Eigenpairs of one part in one interval: `values` (k,), repeated for the part's copies, and
    own rows of its `vectors` (d, k / copies), None but in the team whose first process is `owner`.
    """

    part: int
    interval: Interval
    owner: int
    values: np.ndarray
    vectors: np.ndarray | None


@dataclass(frozen=True)
class LowestEigenvalues:
    """`negative` eigenvalues of all parts lie below -`zero`; `near` (k,) estimates those next to
    zero, ascending.
    """

    zero: float
    negative: int
    near: np.ndarray

    def check_stable(self) -> None:
        """Raise ConvergenceError if an eigenvalue is negative."""
        if self.negative:
            growth = np.sqrt(-min(self.near[0], -self.zero))
            raise ConvergenceError(
                f"modes: the tangent stiffness has {self.negative} negative eigenvalue(s) (growth rate "
                f"about {growth:.3g} 1/s): the state is unstable once the road is replaced by its "
                "forces: the tire buckles, or topples if its rim is free. Lower the load, raise the "
                "inflation or stiffen the wall; let a free rim stand on no road."
            )


class SymmetricProblem:
    """Independent parts of a symmetric problem, the same in all teams of the processes of `comm`;
    no eigenvalue is larger than `norm`. The `journal` holds earlier results; `solver`, of `SOLVERS`.

    Every team has all the matrices and solves slices by itself: no communication between teams
    inside a solve, results independent of their number, cost proportional to the number of slices.
    Memory of a team, distributed over its processes by rows: the matrices (together as many entries
    as the whole one), one factor and one Krylov basis at a time, and the vectors of the slices that
    it has solved.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        parts: list[SymmetricPart],
        team: ProcessGroup,
        norm: float,
        journal: Journal | None = None,
        solver: str = AUTO,
    ) -> None:
        self.comm, self.parts, self.team = comm, parts, team
        self._solver = solver
        self._journal = journal or Journal()
        self.bound = 1.001 * norm

    def _shared(self, work: Callable[[SymmetricPart], np.ndarray | int]) -> list[np.ndarray]:
        """Results for each part, computed by one team and shared with every process. Collective."""
        roots = self.team.roots
        own = range(self.team.number, len(self.parts), len(roots))
        entry = self._journal.step(
            self.team.comm, lambda: {str(k): np.asarray(work(self.parts[k])) for k in own}
        )
        everyone = self.comm.allgather({k: entry[str(k)] for k in own})
        return [everyone[roots[k % len(roots)]][k] for k in range(len(self.parts))]

    def bottom(self) -> LowestEigenvalues:
        """Negative eigenvalues by inertia, and estimates of the lowest. Collective."""
        zero = RIGID * self.bound

        def work(part: SymmetricPart) -> np.ndarray:
            shifted = Shifted(part.matrix, -zero, self.team)
            estimates = np.repeat(_near(shifted) - zero, part.copies)
            negative = part.copies * shifted.negative
            shifted.destroy()
            return np.append(estimates, negative)

        answers = self._shared(work)
        negative = int(sum(answer[-1] for answer in answers))
        return LowestEigenvalues(
            zero, negative, np.sort(np.concatenate([answer[:-1] for answer in answers]))
        )

    def below(self, shift: float) -> np.ndarray:
        """Inertia counts (parts,) below the shift, copies included. Collective."""

        def work(part: SymmetricPart) -> int:
            shifted = Shifted(part.matrix, shift, self.team)
            negative = shifted.negative
            shifted.destroy()
            return part.copies * negative

        return np.array(self._shared(work))

    def boundaries(
        self, bottom: LowestEigenvalues, count: int, limit: float
    ) -> list[tuple[float, np.ndarray]]:
        """(value, eigenvalues below it in each part), ascending, in steps of about one slice.

        From zero to the first value with `count` eigenvalues below, or to `limit`, if that is
        lower. Collective.
        """
        done = [(-bottom.zero, np.zeros(len(self.parts), int))]
        limit = min(limit, self.bound)
        # A slice costs two factorisations: make no more than keep all teams busy.
        rounds = -(-len(self.team.roots) // len(self.parts))
        each = count / (len(self.parts) * rounds) if rounds > 1 else np.inf
        rows = max(part.matrix.shape[0] for part in self.parts)
        most = np.clip(_BASIS / (8 * _VECTORS * rows), _SLICE[1] / 2, _SLICE[1])
        most = self.comm.allreduce(float(most), MPI.MIN)
        largest = float(np.clip(each, _SLICE[0], most)) * len(self.parts)
        # The modal density in frequency changes slowly: the last slice predicts the next one's
        # width.
        density = len(bottom.near) / np.sqrt(np.abs(bottom.near).max())
        ceiling = None  # a value with too many eigenvalues below; the next boundary lies under it
        while True:
            low, known = done[-1]
            remaining = count - known.sum()
            if remaining <= 0 or low >= limit:
                return merged(done, largest)
            # Two per cent and two more: a little too far costs less than another step.
            goal = min(1.02 * remaining + 2, largest)
            trial = onward(max(low, 0.0), goal / density)
            if len(done) == 1 and 2 * goal < len(bottom.near):
                # Ritz values are upper bounds: at least this many eigenvalues lie below.
                trial = max(bottom.near[int(goal)], 2 * bottom.zero)
            trial = min(trial, limit)
            if ceiling and trial >= ceiling[0]:
                trial = between(low, known.sum(), *ceiling, goal)
            below = self.below(trial)
            new = below.sum() - known.sum()
            if new > _CROWDED * goal + _PROBES and trial - low > _FINEST * trial:
                ceiling = (trial, below.sum())
                continue
            rise = np.sqrt(trial) - np.sqrt(max(low, 0.0))
            # If the step has no eigenvalue, double it each time.
            density = max(new, 0.5 * goal * (new == 0)) / rise if rise else density
            done.append((trial, below))
            ceiling = None

    def _found(self, part: int, interval: Interval) -> tuple[np.ndarray, np.ndarray]:
        """The eigenpairs of a part, or the journal's copy of them. Collective in the team."""

        def solve() -> Entry:
            arguments = self.parts[part].matrix, interval, self.team
            values, vectors = eigenpairs(*arguments, SOLVERS[self._solver])
            return {"values": values, "vectors": vectors}

        entry = self._journal.step(self.team.comm, solve)
        return entry["values"], entry["vectors"]

    def slices(self, boundaries: list[tuple[float, np.ndarray]]) -> list[Slice]:
        """All eigenpairs between the boundaries. Collective."""
        tasks = [
            (k, Interval(low, high, int(upper[k] - lower[k]) // part.copies))
            for (low, lower), (high, upper) in zip(boundaries, boundaries[1:], strict=False)
            for k, part in enumerate(self.parts)
        ]
        tasks = [task for task in tasks if task[1].count]
        team = self.team
        owners = _owners([interval.count for _, interval in tasks], len(team.roots))
        answers, error = {}, None
        for task, (k, interval) in enumerate(tasks):
            if owners[task] == team.number and error is None:
                try:
                    answers[task] = self._found(k, interval)
                except Exception as raised:
                    error = raised
        first = next((e for e in self.comm.allgather(error) if e is not None), None)
        if first is not None:
            raise first
        values: dict[int, Any] = {}
        for part in self.comm.allgather({task: pair[0] for task, pair in answers.items()}):
            values |= part
        return [
            Slice(
                k,
                interval,
                team.roots[owners[task]],
                np.repeat(values[task], self.parts[k].copies),
                answers.get(task, (None, None))[1],
            )
            for task, (k, interval) in enumerate(tasks)
        ]


def _near(shifted: Shifted) -> np.ndarray:
    """Rough eigenvalues nearest to the shift, less the shift: three steps of subspace iteration."""
    width, team = min(_PROBES, shifted.size), shifted.team
    basis = team.orthonormal(team.random(3).standard_normal((shifted.rows, width)))[0]
    for _ in range(3):
        moved = shifted.solve(basis)
        product = team.inner(basis, moved)
        theta = np.linalg.eigvalsh((product + product.T) / 2)
        basis = team.orthonormal(moved)[0]
    return 1 / theta


def _owners(counts: list[int], teams: int) -> list[int]:
    """The team of each task: the largest first, each to the team with the least load."""
    load, owners = np.zeros(teams), [0] * len(counts)
    for task in sorted(range(len(counts)), key=lambda k: -counts[k]):
        owners[task] = int(np.argmin(load))
        load[owners[task]] += counts[task] + _SLICE[0] / 4  # the factorisation counts too
    return owners
