"""Exit statuses, and how they reach the shell through mpirun."""

import os

DONE, BUG, INPUT, GAVE_UP, STOPPED = 0, 1, 2, 3, 4


def rank_before_mpi() -> int:
    """The rank according to the process manager, for commands that never start MPI."""
    for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID"):
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    return 0


def processes_here() -> int:
    """Number of processes according to the process manager if all are on this machine, else 1."""
    here, whole = (
        next((int(found) for name in names if (found := os.environ.get(name, "")).isdigit()), 1)
        for names in (
            ("OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS"),
            ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE"),
        )
    )
    return whole if here == whole else 1


def in_parallel() -> bool:
    """Whether the process manager has started more than one process."""
    for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"):
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name]) > 1
    return "PMIX_RANK" in os.environ


def handed_over(status: int, for_all: bool = True) -> int:
    """Write the status to the launcher's file (TIREROAD_STATUS) and return 0 for mpirun.

    The root process writes a status common to all; with `for_all` False, each process writes its
    own. The first entry is kept. Without a launcher on this machine, returns the status itself. Not
    collective.
    """
    file = os.environ.get("TIREROAD_STATUS", "")
    if not os.path.exists(file):
        return status
    if (rank_before_mpi() == 0 or not for_all) and not os.path.getsize(file):
        with open(file, "w", encoding="ascii") as stream:
            stream.write(str(status))
    return DONE
