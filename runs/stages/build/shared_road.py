"""A road file, read by one process of each machine and shared with the others."""

from __future__ import annotations

from mpi4py import MPI

from tireroad.contact.roads.kind import RoadKind
from tireroad.contact.roads.under_tire import Road
from tireroad.fem.collective import broadcast
from tireroad.fem.errors import InputError
from tireroad.runs.scene.road_rules import keep, made


def share(surface: RoadKind, comm: MPI.Comm) -> None:
    """Make the road of a file available on every process, where `made` finds it.

    Heights in memory are sent as buffers; a file, the user's or a temporary one, is opened by each
    process, which reads what it drives over. A process that cannot open it reads the road file
    itself on first use. Raises InputError on all processes if one machine cannot use the file.
    Collective.
    """
    if comm.size == 1 or surface.reads is None:
        return
    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    road, error = None, None
    if node.rank == 0:
        try:
            road = made(surface)
        except InputError as told:
            error = told
    failed = [one for one in comm.allgather(error) if one is not None]
    if not failed and (found := _sent(road, node)) is not None:
        keep(surface, found)
    node.Free()
    if failed:
        raise failed[0]


def _sent(road: Road | None, node: MPI.Comm) -> Road | None:
    """The road of the machine's first process if this one can open it, else None. Collective.

    No process leaves before all have opened it: the first one may then close its temporary file.
    """
    try:
        return broadcast(node, road)
    except OSError:
        return None
    finally:
        node.Barrier()
