"""Work that one process does for all of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar, cast

from tireroad.fem.errors import ConvergenceError, InputError

if TYPE_CHECKING:  # the command line needs this module and must start without MPI
    from mpi4py import MPI

T = TypeVar("T")


class FailedOnRoot(RuntimeError):
    """The root process failed unexpectedly and reports it; the others end silently."""


def on_root(
    comm: MPI.Comm,
    function: Callable[[], T],
    clear: tuple[type[Exception], ...] = (InputError, ConvergenceError),
) -> T:
    """Run `function` on the root process and return its value on every process.

    If it fails, every process raises: all of them the same error if it is one of `clear`; otherwise
    root raises its own and the others FailedOnRoot (a bug). Collective.
    """
    value: T | None = None
    error: Exception | None = None
    if comm.rank == 0:
        try:
            value = function()
        except Exception as raised:
            error = raised
    if comm.size > 1:
        known = error is None or isinstance(error, clear)
        from tireroad.fem.collective import broadcast  # mpi4py is needed on several processes only

        known_error = comm.bcast(error if known else FailedOnRoot())
        value = broadcast(comm, value if error is None else None)
        error = error or known_error
    if error is not None:
        raise error
    return cast(T, value)  # every process has the value by now
