"""Exit statuses, and how they reach the shell from under mpirun."""

import os

DONE, BUG, INPUT, GAVE_UP, STOPPED = 0, 1, 2, 3, 4


def rank_before_mpi() -> int:
    """The rank as the process manager tells it, for commands that never start MPI."""
    for name in ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID"):
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    return 0


def in_parallel() -> bool:
    """Whether the process manager has started more than one process."""
    for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"):
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name]) > 1
    return "PMIX_RANK" in os.environ


def handed_over(status: int, for_all: bool = True) -> int:
    """Leave the status where the launcher asked for it (TIREROAD_STATUS), and 0 to mpirun.

    The root does it where the status is that of `all` processes; who ends alone does it for itself.
    What was left first stays. Without a launcher on this machine, the status itself. Not collective.
    """
    file = os.environ.get("TIREROAD_STATUS", "")
    if not os.path.exists(file):
        return status
    if (rank_before_mpi() == 0 or not for_all) and not os.path.getsize(file):
        with open(file, "w", encoding="ascii") as stream:
            stream.write(str(status))
    return DONE
