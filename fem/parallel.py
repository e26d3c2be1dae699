"""One process does it, all of them have it: for what is not shared out over processes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar, cast

from tireroad.fem.errors import ConvergenceError, InputError

if TYPE_CHECKING:  # the command line needs this module, and starts without MPI
    from mpi4py import MPI

T = TypeVar("T")


class FailedOnRoot(RuntimeError):
    """The root process failed unexpectedly and says so; the others end without a word."""


def on_root(
    comm: MPI.Comm,
    function: Callable[[], T],
    clear: tuple[type[Exception], ...] = (InputError, ConvergenceError),
) -> T:
    """Run `function` on the root process; its value on every process.

    Where it fails, every process raises: the same error where it is one of `clear`, or on the others
    FailedOnRoot for an error that is a bug. Collective.
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
        from tireroad.fem.collective import broadcast  # not needed before there are processes

        known_error = comm.bcast(error if known else FailedOnRoot())
        value = broadcast(comm, value if error is None else None)
        error = error or known_error
    if error is not None:
        raise error
    return cast(T, value)  # every process has what the function returned
