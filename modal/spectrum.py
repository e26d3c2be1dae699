"""The lowest eigenvalues of independent symmetric matrices, sliced by inertia over the processes.

Every process holds the matrices whole and solves slices by itself: no communication inside a solve,
results that do not depend on the number of processes, and cost proportional to the slices' number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.modal.lanczos import Interval, eigenpairs
from tireroad.modal.shifted import Shifted

ZERO = 1e-12  # of the matrix norm: eigenvalues nearer to zero are rigid modes, rounding is 1e-16
_SLICE = 64  # eigenvalues a slice and matrix: the basis stays small, factorisations few
_PROBES = 8
_FINEST = 1e-9  # relative width below which a crowded interval counts as one cluster


@dataclass(frozen=True)
class Slice:
    """One interval of one matrix, and its answer: `values` (k,), `vectors` (n, k) on `owner` only."""

    matrix: int
    interval: Interval
    owner: int
    values: np.ndarray
    vectors: np.ndarray | None


@dataclass(frozen=True)
class Bottom:
    """Below -`zero` lie `negative` eigenvalues of all matrices; `near` (k,) estimates next to zero."""

    zero: float
    negative: int
    near: np.ndarray


class Spectrum:
    """Independent symmetric matrices, the same on all processes of `comm`."""

    def __init__(self, comm: MPI.Comm, matrices: list[sparse.csr_matrix]):
        self.comm, self.matrices = comm, matrices
        self.size = sum(matrix.shape[0] for matrix in matrices)
        self.bound = 1.001 * max(float(abs(matrix).sum(axis=1).max()) for matrix in matrices)

    def shared(self, tasks: int, work: Callable[[int], np.ndarray]) -> list[np.ndarray]:
        """The results of all tasks on every process, each computed by one of them. Collective."""
        mine = {task: work(task) for task in range(self.comm.rank, tasks, self.comm.size)}
        everyone = self.comm.allgather(mine)
        return [everyone[task % self.comm.size][task] for task in range(tasks)]

    def bottom(self) -> Bottom:
        """Negative eigenvalues by inertia, and rough values of the lowest. Collective."""
        zero = ZERO * self.bound

        def work(task: int) -> np.ndarray:
            shifted = Shifted(self.matrices[task], -zero)
            estimates = _near(shifted) - zero
            negative = shifted.negative
            shifted.destroy()
            return np.append(estimates, negative)

        found = self.shared(len(self.matrices), work)
        negative = int(sum(one[-1] for one in found))
        return Bottom(zero, negative, np.sort(np.concatenate([one[:-1] for one in found])))

    def below(self, shift: float) -> np.ndarray:
        """Eigenvalues below the shift, (matrices,), by inertia. Collective."""

        def work(task: int) -> int:
            shifted = Shifted(self.matrices[task], shift)
            negative = shifted.negative
            shifted.destroy()
            return negative

        return np.array(self.shared(len(self.matrices), work))

    def boundaries(
        self, bottom: Bottom, count: int, limit: float
    ) -> list[tuple[float, np.ndarray]]:
        """(value, eigenvalues below it in each matrix), ascending, in steps of about one slice.

        From zero up to the first value with `count` eigenvalues below, or to `limit`, if that is less.
        Collective.
        """
        limit = min(limit, self.bound)
        done = [(-bottom.zero, np.zeros(len(self.matrices), int))]
        largest = _SLICE * len(self.matrices)
        # The density of modes in frequency changes slowly: the last slice tells the next one's width.
        density = len(bottom.near) / np.sqrt(np.abs(bottom.near).max())
        ceiling = None  # a value with too many below: the next boundary lies under it
        while True:
            low, known = done[-1]
            remaining = count - known.sum()
            if remaining <= 0 or low >= limit:
                return done
            # Two per cent and two more: a little too far costs less than one step more.
            goal = min(1.02 * remaining + 2, largest)
            trial = min(_next(max(low, 0.0), goal / density), limit)
            if ceiling and trial >= ceiling[0]:
                trial = _between(low, known.sum(), *ceiling, goal)
            below = self.below(trial)
            new = below.sum() - known.sum()
            if new > 1.6 * largest and trial - low > _FINEST * trial:
                ceiling = (trial, below.sum())
                continue
            rise = np.sqrt(trial) - np.sqrt(max(low, 0.0))
            # No eigenvalue in the step: step wider, twice each time.
            density = max(new, 0.5 * goal * (new == 0)) / rise if rise else density
            done.append((trial, below))
            ceiling = None

    def slices(self, boundaries: list[tuple[float, np.ndarray]]) -> list[Slice]:
        """All eigenpairs between the boundaries. Collective."""
        tasks = [
            (matrix, Interval(low, high, int(upper[matrix] - lower[matrix])))
            for (low, lower), (high, upper) in zip(boundaries, boundaries[1:], strict=False)
            for matrix in range(len(self.matrices))
        ]
        tasks = [task for task in tasks if task[1].count]
        owners = _owners([interval.count for _, interval in tasks], self.comm.size)
        answers, error = {}, None
        for task, (matrix, interval) in enumerate(tasks):
            if owners[task] == self.comm.rank and error is None:
                try:
                    answers[task] = eigenpairs(self.matrices[matrix], interval)
                except Exception as raised:
                    error = raised
        first = next((e for e in self.comm.allgather(error) if e is not None), None)
        if first is not None:
            raise first
        values = {}
        for part in self.comm.allgather({task: pair[0] for task, pair in answers.items()}):
            values |= part
        return [
            Slice(*tasks[task], owners[task], values[task], answers.get(task, (None, None))[1])
            for task in range(len(tasks))
        ]


def _near(shifted: Shifted) -> np.ndarray:
    """Rough eigenvalues nearest to the shift, relative to it, by three steps of inverse iteration."""
    width = min(_PROBES, shifted.size)
    basis = np.linalg.qr(np.random.default_rng(3).standard_normal((shifted.size, width)))[0]
    for _ in range(3):
        moved = shifted.solve(basis)
        theta = np.linalg.eigvalsh((basis.T @ moved + moved.T @ basis) / 2)
        basis = np.linalg.qr(moved)[0]
    return 1 / theta


def _next(low: float, step: float) -> float:
    """A step up in frequency, at most threefold once the first modes are known."""
    root = np.sqrt(low)
    return (root + (min(step, 2 * root) if root else step)) ** 2


def _between(low: float, known: int, high: float, crowd: int, goal: float) -> float:
    """Where a straight line in frequency has `goal` more eigenvalues than at `low`, well inside."""
    share = np.clip(goal / (crowd - known), 0.05, 0.9)
    root = np.sqrt(max(low, 0.0))
    return (root + share * (np.sqrt(high) - root)) ** 2


def _owners(counts: list[int], processes: int) -> list[int]:
    """The process of each task: the largest first, each to the one with least to do."""
    load, owners = np.zeros(processes), [0] * len(counts)
    for task in sorted(range(len(counts)), key=lambda k: -counts[k]):
        owners[task] = int(np.argmin(load))
        load[owners[task]] += counts[task] + _SLICE / 4  # the factorisation counts too
    return owners
