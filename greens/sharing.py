"""Which processes share a time loop."""

from __future__ import annotations

from mpi4py import MPI
from threadpoolctl import threadpool_info

from tireroad.fem.collective import alike
from tireroad.greens.response import Response

SHARED_FROM = 20e6  # bytes of both matrices: less is in reach of the caches, and processes only wait for each other
_LIBRARY = "user_api", "internal_api", "version", "architecture"


def sharers(response: Response, comm: MPI.Comm) -> MPI.Comm:
    """The processes that a loop by this response is worth spreading over: all of `comm`, or each one by itself.

    The root solves the contact problem while the others look ahead (greens.recursion). 625 points and 410 states have 8 MB,
    1,296 and 1,010 42 MB. From what the loop gives each decides for itself whether it goes on: processes whose BLAS rounds
    otherwise, on nodes of another kind, would wait for each other for ever, so they do not share. Collective.
    """
    size = response.output.nbytes + response.input.nbytes
    return comm if size >= SHARED_FROM and alike(comm, _kernels()) else MPI.COMM_SELF


def _kernels() -> str:
    """What this process computes products with: libraries and the kernels they took for its processor."""
    found = [[str(lib.get(name)) for name in _LIBRARY] for lib in threadpool_info()]
    return str(sorted(found))
