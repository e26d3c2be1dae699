"""Which processes share a time loop."""

from __future__ import annotations

from mpi4py import MPI
from threadpoolctl import threadpool_info

from tireroad.fem.collective import alike
from tireroad.greens.response import Response

# Bytes of both matrices; smaller ones fit the caches, and processes would only wait.
SHARED_FROM = 20e6
_LIBRARY = "user_api", "internal_api", "version", "architecture"


def sharers(response: Response, comm: MPI.Comm) -> MPI.Comm:
    """The processes worth distributing a loop over: all of `comm`, or each one by itself.
    Collective.

    The root solves the contact problem while the others look ahead (greens.recursion). 625 points
    and 410 states have 8 MB, 1,296 and 1,010 have 42 MB. Each process decides from the results of
    the loop whether to continue. Processes whose BLAS rounds differently, on nodes of another kind,
    could decide differently and wait for ever, so they do not share.
    """
    size = response.output.nbytes + response.input.nbytes
    return comm if size >= SHARED_FROM and alike(comm, _kernels()) else MPI.COMM_SELF


def _kernels() -> str:
    """The libraries of this process's products, with the kernels chosen for its processor."""
    found = [[str(lib.get(name)) for name in _LIBRARY] for lib in threadpool_info()]
    return str(sorted(found))
