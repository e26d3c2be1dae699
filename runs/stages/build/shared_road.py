"""The road of a file, read by one process of each machine: the others have what it found."""

from __future__ import annotations

from mpi4py import MPI

from tireroad.contact.roads.kind import RoadKind
from tireroad.contact.roads.under_tire import Road
from tireroad.fem.collective import broadcast
from tireroad.fem.errors import InputError
from tireroad.runs.scene.rules.road import keep, made


def share(surface: RoadKind, comm: MPI.Comm) -> None:
    """Have the road of a file on every process, where `made` finds it. Collective.

    Heights in memory are sent as buffers; a file, the user's or a temporary one, is opened by each process, which reads
    from it what it drives over. Where a process cannot open it, it reads the file by itself when it wants it. InputError on
    all processes where one machine cannot use the file.
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
    """What the first process of a machine has, where this one can open it. Collective.

    No process leaves before all have opened it: the first one may close its temporary file from then on.
    """
    try:
        return broadcast(node, road)
    except OSError:
        return None
    finally:
        node.Barrier()
