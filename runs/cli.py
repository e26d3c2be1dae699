"""The command line. Heavy imports are deferred to the command that needs them."""

import argparse
import logging
import os
import sys
from collections.abc import Callable
from contextlib import ExitStack, redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path
from typing import Any

from tireroad.fem import form_cache
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.arguments import parser
from tireroad.runs.process import mpi, observe, signals
from tireroad.runs.process.signals import DONE, handed_over, processes_here, rank_before_mpi
from tireroad.runs.process.surroundings import check_surroundings, crowded


def _together(function: Callable[[Any], None]) -> int:
    """Run `function(comm)` on all processes; returns the exit status. Collective."""
    status, message = mpi.judged(check_surroundings)
    if status != DONE:
        if rank_before_mpi() == 0:
            print(message, file=sys.stderr)
        return status
    if rank_before_mpi() == 0:
        # Before MPI starts, which with far too many processes takes minutes by itself.
        for text in crowded(processes_here()):
            print(f"warning: {text}", file=sys.stderr, flush=True)
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    observe.set_root(comm.rank == 0)
    _only_warnings()
    signals.stop_on_signals()
    return mpi.guarded(comm, lambda: function(comm))


@cache
def _only_warnings() -> None:
    """Keep log output below warnings (distutils, at the first use of a form) off the terminal."""
    handler = logging.StreamHandler()
    handler.setLevel(logging.WARNING)
    logging.getLogger().addHandler(handler)


def _run(args: argparse.Namespace, petsc_options: list[str]) -> int:
    """The command `run`. Collective over all processes."""
    return _together(lambda comm: _run_inside(args, petsc_options, comm))


def _run_inside(args: argparse.Namespace, petsc_options: list[str], comm) -> None:
    from tireroad.runs.files.cache import Cache
    from tireroad.runs.files.folder import check_kept_scene, claimed
    from tireroad.runs.scene.load import load

    _check_processes(args, comm.size)
    if getattr(args, "resumed", False):
        check_kept_scene(args.scene)
    remarks: list[str] = []
    scene = load(args.scene, args.set, remarks.append, args.until)
    directory = args.out if args.out is not None else Path("results") / scene.name
    mpi.start_petsc(petsc_options)
    form_cache.announce = observe.say
    with ExitStack() as stack:

        def claim() -> None:
            stack.enter_context(claimed(directory, scene.name))

        mpi.on_root(comm, claim)
        stack.enter_context(observe.log_to(directory / "log.txt"))
        for remark in remarks:
            observe.say(f"note: {remark}")
        from tireroad.runs.search.search import run

        try:
            run(
                scene,
                directory,
                comm,
                until=args.until,
                fresh=args.fresh,
                petsc_options=petsc_options,
                cache=Cache.of_user(),
            )
        except (InputError, ConvergenceError) as error:
            observe.log(f"error: {error}")
            raise


def _check_processes(args: argparse.Namespace, size: int) -> None:
    if args.processes not in (None, size):
        raise InputError(
            f"-n {args.processes} but {size} processes were started:"
            f" use ./tireroad {args.command} … -n {args.processes},"
            f" or mpirun -n {args.processes} python3 -m runs {args.command} …"
        )


def _reproduce(args: argparse.Namespace, comm) -> None:
    """Recompute figures and tables of the thesis. Collective."""
    _check_processes(args, comm.size)
    _check_checkout("thesis", args.command)
    mpi.start_petsc([])
    from tireroad.tests.thesis.command import reproduce

    reproduce(args.names, args.out, comm)


def _resumed(args: argparse.Namespace) -> argparse.Namespace:
    """Turn `resume DIR` into a `run` of the scene stored in DIR."""
    from tireroad.runs.search.journal import to_resume

    args.resumed = True
    args.command, args.scene, args.out = "run", to_resume(args.directory), args.directory
    args.set, args.until, args.fresh = [], None, False
    return args


def _check(args: argparse.Namespace) -> None:
    from tireroad.runs.report.section_figure import write_section
    from tireroad.runs.scene.check import explain
    from tireroad.runs.scene.load import load

    scene = load(args.scene, args.set, lambda remark: print(f"note: {remark}"), args.until)
    print(explain(scene, args.processes, args.until))
    print(write_section(scene, Path("results") / scene.name))


def _report(args: argparse.Namespace) -> None:
    directory = _results(args.directory)
    from tireroad.runs.report.page import write_report

    print(write_report(directory))


def _export(args: argparse.Namespace) -> None:
    directory = _results(args.directory)
    from tireroad.runs.files.export import export

    for path in export(directory):
        print(path)


def _info(args: argparse.Namespace) -> None:
    if args.file is None:
        from tireroad.runs.process.packages import described

        mpi.start_petsc([])
        return print(described(args.json))
    from tireroad.runs.files.info import describe

    return print(describe(args.file, args.json))


def _check_checkout(folder: str, command: str) -> None:
    """Refuse what an installation leaves out: evidence that stands beside the tests."""
    if not (Path(__file__).resolve().parents[1] / "tests" / folder).is_dir():
        raise InputError(
            f"{command} is part of a checkout, not of an installation: clone the repository and run ./tireroad {command} there"
        )


def _bench(args: argparse.Namespace) -> None:
    _check_checkout("bench", args.command)
    from tireroad.runs.validation.tables import run_all

    run_all("tireroad.tests.bench", args.names, args.out)


def _validate(args: argparse.Namespace) -> None:
    from tireroad.runs.validation.tables import run_all

    run_all("tireroad.runs.validation", args.names, args.out, args.large)


def _results(directory: Path) -> Path:
    """The folder, if it is one of results; says which of its files are left out."""
    from tireroad.runs.files.folder import remarks
    from tireroad.runs.files.reader import check_results

    check_results(directory)
    for text in remarks(directory):
        print(f"note: {text}", file=sys.stderr)
    return directory


def _cache(args: argparse.Namespace) -> None:
    from tireroad.runs.files.cache import Cache

    if args.unused_for is not None and not args.clear:
        raise InputError("cache: --unused-for belongs to --clear, and nothing is removed without")
    cache = Cache.of_user()
    if args.clear:
        print(cache.clear(args.unused_for or 0.0))
    print(cache.described())


def _compare(args: argparse.Namespace) -> None:
    from tireroad.runs.report.compare import compare

    print(compare([_results(directory) for directory in args.directories], args.out))


def _sweep(args: argparse.Namespace) -> None:
    from tireroad.runs.sweep.command import sweep

    sweep(args.sweep, args.out, at_once=args.local, batch=args.slurm, only_gather=args.gather)


ALONE: dict[str, Callable[[argparse.Namespace], None]] = {
    "check": _check,
    "report": _report,
    "export": _export,
    "compare": _compare,
    "sweep": _sweep,
    "info": _info,
    "bench": _bench,
    "validate": _validate,
    "cache": _cache,
}


READERS = "check", "report", "export", "compare", "info", "cache"  # leave nothing to go on from


def _alone(args: argparse.Namespace) -> int:
    """Run a single-process command, on the root process under mpirun; returns the exit status."""
    if rank_before_mpi() != 0:
        return DONE
    signals.stop_on_signals()
    kept = "the same command begins again" if args.command in READERS else mpi.KEPT
    status, message = mpi.judged(lambda: ALONE[args.command](args), kept)
    if message:
        print(message, file=sys.stderr)
    return status


def main(argv: list[str]) -> int:
    """Run a command line; returns the exit status."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # mutes its remarks on the home folder
    if argv[:1] == ["test"] and argv[1:] not in (["-h"], ["--help"]):
        from tireroad.runs.process.testing import run_tests

        return run_tests(argv[1:])  # pytest parses all of its arguments
    options: list[str] = []
    if "--" in argv and argv[0] == "run":
        cut = argv.index("--")
        argv, options = argv[:cut], argv[cut + 1 :]
    try:
        with open(os.devnull, "w") as nowhere, ExitStack() as quiet:
            if rank_before_mpi() != 0:
                quiet.enter_context(redirect_stdout(nowhere))
                quiet.enter_context(redirect_stderr(nowhere))
            args = parser().parse_args(argv)
    except SystemExit as ending:
        return handed_over(int(ending.code or 0))
    args = _resumed(args) if args.command == "resume" else args
    if args.command == "run":
        return handed_over(_run(args, options))
    if args.command == "reproduce":
        return handed_over(_together(lambda comm: _reproduce(args, comm)))
    return _alone(args)
