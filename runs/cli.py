"""The command line. Nothing heavy is imported before the command that needs it."""

import argparse
import logging
import os
import sys
from collections.abc import Callable
from contextlib import ExitStack, redirect_stderr, redirect_stdout
from pathlib import Path

from fem.errors import ConvergenceError, InputError
from runs import mpi, observe
from runs.plan import STAGES
from runs.version import PROGRAM, VERSION

EXIT = """\
exit status:
  0  done
  2  the input is wrong: one message, nothing written over
  3  a solver gave up: what, where, what to try; finished stages are kept
  4  stopped on request (SIGINT, SIGTERM); the same command, or resume, goes on
  anything else is a bug
"""
ABOUT = """\
A rolling tire on a rough road: finite elements, modes, Green's functions, contact.

`./tireroad COMMAND` installs on Debian what is missing and starts the program;
`mpirun -n N python3 -m runs COMMAND` is the same program in a batch script.
"""
RUN = """\
Runs the stages static, modes, rotating, greens, response, contact, spectra, report, as far as the
scene needs them. Stages already computed from the same inputs are reused unless --fresh.
"""
SET_HELP = (
    "lay a value over the scene, in TOML or as a bare word: static.load=400, road.kind=flat,"
    " force.0.amplitude=2; an empty value takes the key away: static.load=. May be repeated"
)


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    top = argparse.ArgumentParser(
        PROGRAM,
        description=ABOUT,
        epilog=EXIT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    top.add_argument("--version", action="version", version=f"{PROGRAM} {VERSION}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)

    def command(name: str, text: str, about: str = "", usage: str | None = None):
        return commands.add_parser(
            name,
            help=text,
            description=about or text,
            epilog=EXIT,
            usage=usage,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )

    _run_arguments(
        command(
            "run",
            "the main job: a scene to its report",
            RUN,
            f"{PROGRAM} run SCENE.toml [options] [-- PETSc options]",
        )
    )
    resume = command("resume", "go on from the last checkpoint of a result folder")
    resume.add_argument("directory", type=Path, metavar="DIR")
    resume.add_argument(
        "-n", type=int, metavar="N", dest="processes", help="MPI processes (the launcher's)"
    )
    check = command("check", "validate a scene; show it resolved, its stages, its memory")
    check.add_argument("scene", type=Path, metavar="SCENE.toml")
    check.add_argument("--set", action="append", default=[], metavar="a.b=value", help=SET_HELP)
    for name, text in (
        ("report", "(re)make report.html of a result folder"),
        ("export", "XDMF for ParaView and CSV for spreadsheets from a result folder"),
    ):
        command(name, text).add_argument("directory", type=Path, metavar="DIR")
    command("info", "what a result file holds: datasets, shapes, units, provenance").add_argument(
        "file", type=Path, metavar="FILE"
    )
    for name, text in (
        ("bench", "run time against error, scaling and floors, measured on this machine"),
        ("validate", "against full finite elements, closed forms and stress"),
    ):
        some = command(name, text)
        some.add_argument("names", nargs="*", metavar="NAME", help="all by default")
        some.add_argument("--out", type=Path, metavar="FILE.json", help="also a page beside it")
        if name == "validate":
            some.add_argument(
                "--large", action="store_true", help="on meshes of full size: hours, not minutes"
            )
    test = command("test", "the test suite, serial and on 2 and 3 processes")
    test.add_argument("arguments", nargs="*", metavar="PYTEST ARGUMENTS")
    return top


def _run_arguments(run: argparse.ArgumentParser) -> None:
    run.add_argument("scene", type=Path, metavar="SCENE.toml")
    run.add_argument(
        "-n", type=int, metavar="N", dest="processes", help="MPI processes (the launcher's)"
    )
    run.add_argument(
        "--out", type=Path, metavar="DIR", help="result folder; results/<scene name> by default"
    )
    run.add_argument("--set", action="append", default=[], metavar="a.b=value", help=SET_HELP)
    run.add_argument(
        "--until", choices=STAGES, metavar="STAGE", help=f"last stage: {', '.join(STAGES)}"
    )
    run.add_argument("--fresh", action="store_true", help="compute every stage anew")


def _run(args: argparse.Namespace, petsc_options: list[str]) -> int:
    """The main job. Collective over all processes."""
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    observe.set_root(comm.rank == 0)
    _only_warnings()
    mpi.stop_on_signals()
    return mpi.guarded(comm, lambda: _run_inside(args, petsc_options, comm))


def _only_warnings() -> None:
    """Keep the compiler's chatter (distutils, at its first use of a form) off the terminal."""
    handler = logging.StreamHandler()
    handler.setLevel(logging.WARNING)
    logging.getLogger().addHandler(handler)


def _run_inside(args: argparse.Namespace, petsc_options: list[str], comm) -> None:
    from runs.folder import claimed
    from runs.scene import load

    if args.processes not in (None, comm.size):
        raise InputError(
            f"-n {args.processes} but {comm.size} processes were started:"
            f" use ./tireroad run … -n {args.processes},"
            f" or mpirun -n {args.processes} python3 -m runs run …"
        )
    scene = load(args.scene, args.set)
    directory = args.out if args.out is not None else Path("results") / scene.name
    mpi.start_petsc(petsc_options)
    with ExitStack() as stack:

        def claim() -> None:
            stack.enter_context(claimed(directory, scene.name))

        mpi.on_root(comm, claim)
        stack.enter_context(observe.log_to(directory / "log.txt"))
        from runs.pipeline import run_scene

        try:
            run_scene(
                scene,
                directory,
                comm,
                until=args.until,
                fresh=args.fresh,
                petsc_options=petsc_options,
            )
        except (InputError, ConvergenceError) as error:
            observe.log(f"error: {error}")
            raise


def _resumed(args: argparse.Namespace) -> argparse.Namespace:
    """`resume DIR` as the run of the scene that DIR keeps."""
    args.command, args.scene, args.out = "run", args.directory / "scene.toml", args.directory
    args.set, args.until, args.fresh = [], None, False
    return args


def _check(args: argparse.Namespace) -> None:
    from runs.check import explain
    from runs.scene import load

    print(explain(load(args.scene, args.set)))


def _report(args: argparse.Namespace) -> None:
    directory = _results(args.directory)
    from runs.report import write_report

    print(write_report(directory))


def _export(args: argparse.Namespace) -> None:
    directory = _results(args.directory)
    from runs.export import export

    for path in export(directory):
        print(path)


def _info(args: argparse.Namespace) -> None:
    from runs.info import describe

    print(describe(args.file))


def _bench(args: argparse.Namespace) -> None:
    from runs.tabulate import run_all

    run_all("runs.bench", args.names, args.out)


def _validate(args: argparse.Namespace) -> None:
    from runs.tabulate import run_all

    run_all("runs.validation", args.names, args.out, args.large)


def _results(directory: Path) -> Path:
    if not (directory / "summary.json").is_file():
        raise InputError(f"{directory}: no result folder: it has no summary.json")
    return directory


ALONE: dict[str, Callable[[argparse.Namespace], None]] = {
    "check": _check,
    "report": _report,
    "export": _export,
    "info": _info,
    "bench": _bench,
    "validate": _validate,
}


def _alone(function: Callable[[], None]) -> int:
    """A command of one process; under mpirun the root does it."""
    if mpi.rank_before_mpi() != 0:
        return mpi.DONE
    mpi.stop_on_signals()
    status, message = mpi.judged(function)
    if message:
        print(message, file=sys.stderr)
    return status


def main(argv: list[str]) -> int:
    """The exit status of a command line."""
    if argv[:1] == ["test"] and argv[1:] not in (["-h"], ["--help"]):
        from runs.testing import run_tests

        return run_tests(argv[1:])  # all of it is pytest's
    options: list[str] = []
    if "--" in argv and argv[0] == "run":
        cut = argv.index("--")
        argv, options = argv[:cut], argv[cut + 1 :]
    try:
        with open(os.devnull, "w") as nowhere, ExitStack() as quiet:
            if mpi.rank_before_mpi() != 0:
                quiet.enter_context(redirect_stdout(nowhere))
                quiet.enter_context(redirect_stderr(nowhere))
            args = parser().parse_args(argv)
    except SystemExit as ending:
        return mpi.handed_over(int(ending.code or 0))
    if args.command == "resume":
        args = _resumed(args)
    if args.command == "run":
        return mpi.handed_over(_run(args, options))
    try:
        return _alone(lambda: ALONE[args.command](args))
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return mpi.DONE
