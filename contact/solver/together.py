"""A step's contact problem, solved by one of the processes that share a time loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from mpi4py import MPI

from tireroad.contact.solver.conditions import Array
from tireroad.fem.errors import ConvergenceError, InputError


class Solved(NamedTuple):
    """The solution at the contact points, and the residual and `penetration` (m) of it.

    `force` (c,) N, `gap` (c,) m, `horizontal` (c, 2) N, or (0, 2) without friction.
    """

    force: Array
    gap: Array
    horizontal: Array
    residual: float
    penetration: float


class Ahead(Protocol):
    """A tire that computes part of the next step ahead of this one's force (greens.recursion)."""

    def look_ahead(self) -> None: ...

    def exchange(self) -> None: ...


class Together:
    """The root process of `comm` solves for `count` points and sends the result to the others.

    Meanwhile the others look `ahead` if the tire can. A single process sends nothing and does not
    look ahead.
    """

    def __init__(self, comm: MPI.Comm, count: int, ahead: Ahead | None) -> None:
        self._comm, self._count, self._ahead = comm, count, ahead

    def __call__(
        self, predict: Callable[[], Array], solve: Callable[[Array], Solved], horizontal: bool
    ) -> tuple[Array, Solved]:
        """The tire's prediction, and the solution that `solve` finds for it on the root process.

        `horizontal`: whether there are horizontal forces. A ConvergenceError or InputError on the
        root is raised on all processes. Collective.
        """
        if self._comm.size == 1:
            return (free := predict()), solve(free)
        if self._ahead is None:
            return (free := predict()), self._told(solve, free, horizontal)
        free = predict() if self._comm.rank == 0 else np.empty(0)
        self._ahead.look_ahead()
        found = self._told(solve, free, horizontal)
        self._ahead.exchange()
        return free if self._comm.rank == 0 else predict(), found

    def _told(self, solve: Callable[[Array], Solved], free: Array, horizontal: bool) -> Solved:
        values, failed = np.empty(2 + (4 if horizontal else 2) * self._count), None
        if self._comm.rank == 0:
            try:
                values = _packed(solve(free))
            except (ConvergenceError, InputError) as error:
                values[0], failed = np.nan, error
        self._comm.Bcast(values)
        if np.isnan(values[0]):
            failed = self._comm.bcast(failed)
            assert failed is not None, "what stopped the root process"
            raise failed
        return self._unpacked(values)

    def _unpacked(self, values: Array) -> Solved:
        c = self._count
        force, gap = values[2 : 2 + c], values[2 + c : 2 + 2 * c]
        residual, penetration = values[:2].tolist()
        return Solved(force, gap, values[2 + 2 * c :].reshape(-1, 2), residual, penetration)


def _packed(found: Solved) -> Array:
    scalars = found.residual, found.penetration
    return np.concatenate([scalars, found.force, found.gap, found.horizontal.ravel()])
