"""Entry point: sets up streams and signals before anything heavy is imported."""

import os
import signal
import sys
import tempfile
from pathlib import Path

from tireroad.runs.process import signals, supervisor
from tireroad.runs.process.packages import missing
from tireroad.runs.process.signals import DONE, INPUT, STOPPED, handed_over

_APART = (
    "error: srun started {tasks} processes without MPI, so that each would compute all by itself: start one "
    "(srun -n 1 --pty bash) and take ./tireroad run … -n {tasks} in it, or mpirun -n {tasks} python3 -m runs run …, or "
    "srun --mpi=pmix where the cluster's MPI has it"
)


def program() -> None:
    """The command `tireroad`: takes the process's arguments and sets its exit status."""
    if sys.argv[1:2] == ["python"] and sys.argv[2:] not in (["-h"], ["--help"]):
        os.execv(sys.executable, [sys.executable, *sys.argv[2:]])  # the launcher does it by itself
    signal.pthread_sigmask(signal.SIG_BLOCK, signals.STOP_SIGNALS)
    supervisor.mend()
    if (tasks := signals.without_mpi(os.environ)) > 1:
        if signals.rank_before_mpi() == 0:
            print(_APART.format(tasks=tasks), file=sys.stderr)
        os._exit(INPUT)
    _need_home()
    # A second BLAS thread waits by spinning: half as much processor time again for no second less, from
    # 30,000 to 100,000 unknowns. More cores are used by more processes.
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    arguments = sys.argv[1:]
    sys.argv[1:] = []  # some libraries parse argv and fail on names that are not valid text
    if arguments[:1] in (["run"], ["resume"], ["work"]) and not {"-h", "--help"} & set(arguments):
        from tireroad.runs.process.supervisor import supervise

        supervise()
    try:
        signals.stop_on_signals()
        sys.exit(_status(arguments))
    except (signals.Stopped, Exception):
        if not signals.raised():
            raise
        print(f"stopped by {signals.raised()} before anything was started", file=sys.stderr)
        os._exit(handed_over(STOPPED, for_all=False))


def _need_home() -> None:
    """Where the user has no home (a number without a name, in a container), take a temporary folder:
    dolfinx cannot even be imported without one."""
    if os.path.expanduser("~") == "~":
        os.environ["HOME"] = str(Path(tempfile.gettempdir()) / f"tireroad-{os.getuid()}")


def _status(arguments: list[str]) -> int:
    try:
        if arguments == ["work"]:  # internal: computes members of a sweep
            from tireroad.runs.sweep.worker import work

            return work()
        from tireroad.runs.cli import main

        status = main(arguments)
    except ModuleNotFoundError as error:
        message = missing(error)
        if message is None:
            raise
        print(message, file=sys.stderr)
        return INPUT
    refused = supervisor.refused()
    if status == DONE and refused is not None and arguments[:1] not in (["run"], ["resume"]):
        print(f"error: standard output cannot be written: {refused.strerror}", file=sys.stderr)
        return INPUT
    return status
