"""The lowest eigenvalues of independent symmetric matrices: spectrum slicing by teams of processes.

Every team has all the matrices and solves slices by itself: no communication between teams inside a
solve, results independent of their number, cost proportional to the number of slices. Memory of a
team, distributed over its processes by rows: the matrices (together as many entries as the whole
one), one factor and one Krylov basis at a time, and the vectors of the slices that it has solved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.inertia_relief import RIGID
from tireroad.fem.static.path.journal import Entry, Journal
from tireroad.modal.solver.boundaries import between, merged, onward
from tireroad.modal.solver.shifted import Shifted
from tireroad.modal.solver.slices import Interval, eigenpairs
from tireroad.modal.solver.team import Team

# Eigenvalues per slice and matrix: fewest, where teams wait for work, and most, to limit the basis.
_SLICE = 64, 160
_PROBES = 8
_FINEST = 1e-9  # relative width below which a crowded interval counts as one cluster
_CROWDED = 1.6  # times the wanted number in a step: above, a boundary in between costs less


class Part(Protocol):
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
class Bottom:
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


class Spectrum:
    """Independent parts of a symmetric problem, the same in all teams of the processes of `comm`;
    no eigenvalue is larger than `norm`. The `journal` holds earlier results.
    """

    def __init__(
        self,
        comm: MPI.Comm,
        parts: list[Part],
        team: Team,
        norm: float,
        journal: Journal | None = None,
    ) -> None:
        self.comm, self.parts, self.team = comm, parts, team
        self._journal = journal or Journal()
        self.bound = 1.001 * norm

    def _shared(self, work: Callable[[Part], np.ndarray | int]) -> list[np.ndarray]:
        """Results for each part, computed by one team and shared with every process. Collective."""
        roots = self.team.roots
        own = range(self.team.number, len(self.parts), len(roots))
        entry = self._journal.step(
            self.team.comm, lambda: {str(k): np.asarray(work(self.parts[k])) for k in own}
        )
        everyone = self.comm.allgather({k: entry[str(k)] for k in own})
        return [everyone[roots[k % len(roots)]][k] for k in range(len(self.parts))]

    def bottom(self) -> Bottom:
        """Negative eigenvalues by inertia, and estimates of the lowest. Collective."""
        zero = RIGID * self.bound

        def work(part: Part) -> np.ndarray:
            shifted = Shifted(part.matrix, -zero, self.team)
            estimates = np.repeat(_near(shifted) - zero, part.copies)
            negative = part.copies * shifted.negative
            shifted.destroy()
            return np.append(estimates, negative)

        found = self._shared(work)
        negative = int(sum(one[-1] for one in found))
        return Bottom(zero, negative, np.sort(np.concatenate([one[:-1] for one in found])))

    def below(self, shift: float) -> np.ndarray:
        """Inertia counts (parts,) below the shift, copies included. Collective."""

        def work(part: Part) -> int:
            shifted = Shifted(part.matrix, shift, self.team)
            negative = shifted.negative
            shifted.destroy()
            return part.copies * negative

        return np.array(self._shared(work))

    def boundaries(
        self, bottom: Bottom, count: int, limit: float
    ) -> list[tuple[float, np.ndarray]]:
        """(value, eigenvalues below it in each part), ascending, in steps of about one slice.

        From zero to the first value with `count` eigenvalues below, or to `limit`, if that is
        lower. Collective.
        """
        limit = min(limit, self.bound)
        done = [(-bottom.zero, np.zeros(len(self.parts), int))]
        # A slice costs two factorisations: make no more than keep all teams busy.
        rounds = -(-len(self.team.roots) // len(self.parts))
        each = count / (len(self.parts) * rounds) if rounds > 1 else np.inf
        largest = float(np.clip(each, *_SLICE)) * len(self.parts)
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
        """`slices.eigenpairs` of a part, or the journal's copy of them. Collective in the team."""

        def solve() -> Entry:
            values, vectors = eigenpairs(self.parts[part].matrix, interval, self.team)
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
