"""The command line: commands, options, help texts. Heavy imports are deferred to the command that needs them."""

import argparse
import logging
import math
import os
import sys
from collections.abc import Callable
from contextlib import ExitStack, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.files.names import STAGES
from tireroad.runs.process import console, mpi, signals
from tireroad.runs.process.signals import DONE, INPUT, handed_over, processes_here, rank_before_mpi
from tireroad.runs.process.surroundings import check_surroundings, crowded
from tireroad.runs.version import PROGRAM, VERSION

EXIT = """\
exit status:
  0  finished
  2  invalid input: one message, nothing overwritten
  3  a solver gave up: what, where, what to try; finished stages are kept
  4  stopped on request (SIGINT, SIGTERM, SIGHUP); the same command, or resume, continues
  anything else is a bug
"""
ABOUT = """\
A rolling tire on a rough road: finite elements, modes, Green's functions, contact.

`./tireroad COMMAND` installs missing packages on Debian and starts the program;
`mpirun -n N python3 -m runs COMMAND` is the same program in a batch script.
"""
RUN = """\
Runs the stages static, radiation, modes, rotating, greens, contact, accuracy, response, spectra, vibration, sound,
motion, report, as far as the scene needs them. Stages already computed from the same inputs are reused unless --fresh.
"""
REPRODUCE = """\
Computes the figures and tables of the thesis anew: a page with a picture beside what the thesis shows, what
this program shows, and whether they agree; the same as reproduce.json and reproduce.csv. Without names all of
them. Names: figure-4.2 to figure-4.5, figure-5.5, figure-6.2, figure-6.3, figure-6.5, figure-7.1 to figure-7.4,
figure-C.1, figure-C.2, figure-D.1, table-B.1 to table-B.4. Figures that differ are not a failure: status 0.
"""
SET_HELP = (
    "override a value of the scene, in TOML or as a bare word: static.load=400, road.kind=flat,"
    " force.0.amplitude=2; an empty value removes the key: static.load=. Where it chooses a kind, keys"
    " of the file that only other kinds have are dropped. May be repeated"
)

FIT = """\
Fits compounds and carcass of the built-in tire of a size to the figures of a real one: mass, first modes and damping,
loads at deflections, stiffness, footprint (docs/how-to/fit.md), from a TOML file or from a .tir with [STRUCTURAL].
Writes a scene with that tire and prints the figures beside those reached.
"""


class Argument(NamedTuple):
    """An argument or option of a command: its `names`, and the `settings` of argparse's add_argument."""

    names: tuple[str, ...]
    settings: dict[str, Any]


def argument(*names: str, **settings: Any) -> Argument:
    """An argument or option, given as to argparse's add_argument."""
    return Argument(names, settings)


@dataclass(frozen=True)
class Command:
    """A command: its line in the list of commands (`text`), and its arguments in order.

    `about` and `usage` replace the help that is otherwise generated from these. `alone`: what runs it, of a
    command of one process; `leaves_nothing`: stopped, it has nothing to go on from.
    """

    text: str
    arguments: tuple[Argument, ...]
    about: str = ""
    usage: str | None = None
    alone: Callable[[argparse.Namespace], None] | None = None
    leaves_nothing: bool = False


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 9999:
        raise argparse.ArgumentTypeError(f"{text}: must be a whole number, 1 to 9999")
    return int(text)


def _days(text: str) -> float:
    with suppress(ValueError):
        if 0 <= (days := float(text)) < math.inf:
            return days
    raise argparse.ArgumentTypeError(f"{text}: must be a number of days, 0 or more")


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("the name of the folder is empty")
    return Path(text)


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    top = _parser(argparse.ArgumentParser, PROGRAM, ABOUT)
    top.add_argument("--version", action="version", version=f"{PROGRAM} {VERSION}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, command in COMMANDS.items():
        about = command.about or command.text
        command_parser = _parser(
            commands.add_parser, name, about, help=command.text, usage=command.usage
        )
        for names, settings in command.arguments:
            command_parser.add_argument(*names, **settings)
    return top


def _parser(
    make: Callable[..., argparse.ArgumentParser], name: str, about: str, **given: str | None
) -> argparse.ArgumentParser:
    return make(
        name,
        description=about,
        epilog=EXIT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
        **given,
    )


def _refused_here() -> int:
    """Check that MPI can run here, before it starts; tells why not. Returns the exit status."""
    with mpi.ending() as end:
        check_surroundings()
    if rank_before_mpi() == 0:
        # With far too many processes, MPI's start takes minutes by itself.
        texts = (
            [end.message]
            if end.status
            else [f"warning: {text}" for text in crowded(processes_here())]
        )
        for text in texts:
            print(text, file=sys.stderr, flush=True)
    return end.status


def _world() -> Any:
    """All processes, with output, log and signals set up for them. Collective."""
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    console.set_root(comm.rank == 0)
    console.show_log("tireroad.fem")
    console.show_log("tireroad.runs.files")
    _only_warnings()
    signals.stop_on_signals()
    return comm


@cache
def _only_warnings() -> None:
    """Keep log output below warnings (distutils, at the first use of a form) off the terminal."""
    handler = logging.StreamHandler()
    handler.setLevel(logging.WARNING)
    logging.getLogger().addHandler(handler)


def _run(args: argparse.Namespace, petsc_options: list[str]) -> int:
    """The command `run`; returns the exit status. Collective."""
    comm = _world()
    with mpi.common_ending(comm) as end, ExitStack() as stack:
        scene, remarks = _loaded(args, comm)
        directory = args.out if args.out is not None else Path("results") / scene.name
        mpi.start_petsc(petsc_options)
        from tireroad.runs.files.cache import Cache
        from tireroad.runs.files.folder import claimed
        from tireroad.runs.pipeline import run_scene
        from tireroad.runs.search import journal
        from tireroad.runs.search.search import search, searches, tell_error

        mpi.on_root(comm, lambda: stack.enter_context(claimed(directory, scene.name)))
        stack.enter_context(console.log_to(directory / "log.txt"))
        for remark in remarks:
            console.say(f"note: {remark}")
        arguments = {"fresh": args.fresh, "petsc_options": petsc_options, "cache": Cache.of_user()}
        try:
            if searches(scene, args.until):
                search(scene, directory, comm, **arguments)
            else:
                mpi.on_root(comm, lambda: journal.leave(directory))
                tell_error(scene, run_scene(scene, directory, comm, until=args.until, **arguments))
        except (InputError, ConvergenceError) as error:
            console.log(f"error: {error}")
            raise
    return end.status


def _loaded(args: argparse.Namespace, comm: Any) -> tuple[Any, list[str]]:
    """The scene of the command `run`, and remarks on it for the log."""
    from tireroad.runs.files.folder import check_kept_scene
    from tireroad.runs.scene.load import load

    _check_processes(args, comm.size)
    if getattr(args, "resumed", False):
        check_kept_scene(args.scene)
    remarks: list[str] = []
    return load(args.scene, args.set, remarks.append, args.until), remarks


def _check_processes(args: argparse.Namespace, size: int) -> None:
    if args.processes not in (None, size):
        raise InputError(
            f"-n {args.processes} but {size} processes were started:"
            f" use ./tireroad {args.command} … -n {args.processes},"
            f" or mpirun -n {args.processes} python3 -m runs {args.command} …"
        )


def _reproduce(args: argparse.Namespace) -> int:
    """Recompute figures and tables of the thesis; returns the exit status. Collective."""
    comm = _world()
    with mpi.common_ending(comm) as end:
        _check_processes(args, comm.size)
        _check_checkout("thesis", args.command)
        mpi.start_petsc([])
        from tireroad.tests.thesis.command import reproduce

        reproduce(args.names, args.out, comm)
    return end.status


def _resumed(args: argparse.Namespace) -> argparse.Namespace:
    """Turn `resume DIR` into a `run` of the scene stored in DIR."""
    from tireroad.runs.search.journal import to_resume

    args.resumed = True
    args.command, args.scene, args.out = "run", to_resume(args.directory), args.directory
    args.set, args.until, args.fresh = [], None, False
    return args


def _check(args: argparse.Namespace) -> None:
    if args.scene.suffix.lower() not in ("", ".toml"):
        _check_file(args.scene)
        return
    from tireroad.runs.check import explain
    from tireroad.runs.report.section_figure import write_section
    from tireroad.runs.scene.load import load

    scene = load(args.scene, args.set, lambda remark: print(f"note: {remark}"), args.until)
    print(explain(scene, args.processes, args.until))
    print(write_section(scene, Path("results") / scene.name))


def _check_file(path: Path) -> None:
    """Say what a file that is no scene holds."""
    from tireroad.runs.files.folder import folder_of
    from tireroad.runs.report.input_file import (
        KINDS,
        describe_road,
        describe_tire,
        is_road_file,
        is_tire_file,
    )

    if not path.is_file():
        raise InputError(f"{path}: no such file")
    out = folder_of(path)
    if is_tire_file(path):
        print(describe_tire(path, out))
    elif is_road_file(path):
        print(describe_road(path, out))
    else:
        raise InputError(
            f"{path}: check takes a scene (.toml), a tire's deck or mesh (.inp, .msh), or a road file ({', '.join(KINDS)})"
        )


def _report(args: argparse.Namespace) -> None:
    directory = _results(args.directory)
    from tireroad.runs.report.page import write_report

    print(write_report(directory))


def _fit(args: argparse.Namespace) -> None:
    from tireroad.runs.files.folder import folder_of
    from tireroad.runs.fit import command

    print(command(args.figures, args.out or folder_of(args.figures), args.set))


def _export(args: argparse.Namespace) -> None:
    directory = _results(args.directory)
    from tireroad.runs.results.export import export

    told: list[tuple[str, str]] = []
    paths = export(
        directory, uff=args.uff, tir=args.tir, remark=lambda name, text: told.append((name, text))
    )
    for path in paths:
        print(path)
    written = {path.name for path in paths}
    for name, text in told:
        if name in written:
            print(f"{name}: {text}", file=sys.stderr)
    lacking = [f"no {name}: {text}" for name, text in told if name not in written]
    if lacking:  # all else is written
        raise InputError("; ".join(lacking))


def _info(args: argparse.Namespace) -> None:
    if args.file is None:
        from tireroad.runs.process.packages import described

        mpi.start_petsc([])
        return print(described(args.json))
    from tireroad.runs.results.info import describe

    return print(describe(args.file, args.json))


def _check_checkout(folder: str, command: str) -> None:
    """Raise InputError for commands whose code is part of a checkout only."""
    if not (Path(__file__).resolve().parents[1] / "tests" / folder).is_dir():
        raise InputError(
            f"{command} is part of a checkout, not of an installation: clone the repository and run ./tireroad {command} there"
        )


def _bench(args: argparse.Namespace) -> None:
    _check_checkout("bench", args.command)
    from tireroad.runs.validation.tables import run_all

    run_all("tireroad.tests.bench", args.names, args.out, only=args.only)


def _validate(args: argparse.Namespace) -> None:
    from tireroad.runs.validation.tables import run_all, run_scenes

    scenes = [Path(name) for name in args.names if name.endswith(".toml")]
    if not scenes:
        _check_checkout("validation", args.command)
        return run_all("tireroad.tests.validation", args.names, args.out, args.large, args.only)
    if len(scenes) < len(args.names) or args.large or args.only:
        raise InputError(
            "validate takes names, or scenes of your own: one or the other, and neither --large nor --only with them"
        )
    return run_scenes(scenes, args.out)


def _results(directory: Path) -> Path:
    """The folder, if it is one of results; says which of its files are left out."""
    from tireroad.runs.files.folder import remarks
    from tireroad.runs.results.reader import check_results

    check_results(directory)
    for text in remarks(directory):
        print(f"note: {text}", file=sys.stderr)
    return directory


def _cache(args: argparse.Namespace) -> None:
    from tireroad.runs.files.cache import Cache

    if args.unused_for is not None and not args.clear:
        raise InputError("cache: --unused-for requires --clear; nothing was removed")
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


SCENE = argument("scene", type=Path, metavar="SCENE.toml")
SET = argument("--set", action="append", default=[], metavar="a.b=value", help=SET_HELP)
DIRECTORY = argument("directory", type=Path, metavar="DIR")
PROCESSES = argument(
    "-n", type=int, metavar="N", dest="processes", help="MPI processes (the launcher's)"
)
UNTIL = argument(
    "--until", choices=STAGES, metavar="STAGE", help=f"last stage: {', '.join(STAGES)}"
)
TABLE = argument("--out", type=Path, metavar="FILE.json", help="results, with a page beside them")
ONLY = argument(
    "--only",
    action="append",
    default=[],
    metavar="WORDS",
    help="of one with cases those with all these words, as in 'radial texture 30'; may be given several times",
)

COMMANDS = {
    "run": Command(
        "run a scene and write its report",
        (
            SCENE,
            SET,
            PROCESSES,
            argument(
                "--out",
                type=_folder,
                metavar="DIR",
                help="result folder; results/<scene name> by default",
            ),
            UNTIL,
            argument("--fresh", action="store_true", help="compute every stage anew"),
        ),
        RUN,
        f"{PROGRAM} run SCENE.toml [options] [-- PETSc options]",
    ),
    "resume": Command(
        "continue from the last checkpoint of a result folder", (DIRECTORY, PROCESSES)
    ),
    "check": Command(
        "validate a scene, printed with all defaults, its stages and its memory; or a road file alone",
        (
            SCENE,
            SET,
            UNTIL,
            argument(
                "-n",
                type=_count,
                metavar="N",
                dest="processes",
                default=1,
                help="memory of a run on N processes",
            ),
        ),
        alone=_check,
        leaves_nothing=True,
    ),
    "report": Command(
        "write report.html of a result folder again",
        (DIRECTORY,),
        alone=_report,
        leaves_nothing=True,
    ),
    "fit": Command(
        "the built-in tire's free parameters from a tire's figures (.toml or .tir)",
        (
            argument("figures", type=Path, metavar="FIGURES", help=".toml or .tir"),
            argument(
                "--set",
                action="append",
                default=[],
                metavar="key=value",
                help="another value than the file's, as inflation=2.4e5. May be repeated",
            ),
            argument(
                "--out",
                type=_folder,
                metavar="DIR",
                help="for scene.toml; results/<FIGURES> by default",
            ),
        ),
        FIT,
        alone=_fit,
    ),
    "export": Command(
        "XDMF for ParaView and CSV for spreadsheets from a result folder",
        (
            DIRECTORY,
            argument(
                "--uff",
                action="store_true",
                help="also frequency responses as Universal File 58: response.uff",
            ),
            argument(
                "--tir",
                action="store_true",
                help="also the tire's figures in the form of MF-Tyre/MF-Swift: tire.tir",
            ),
        ),
        alone=_export,
        leaves_nothing=True,
    ),
    "sweep": Command(
        "run a family of scenes that share stages, in one table",
        (
            argument("sweep", type=Path, metavar="SWEEP.toml"),
            argument("--local", type=_count, default=1, metavar="K", help="K members at a time"),
            argument("--slurm", action="store_true", help="write job scripts and submit them"),
            argument("--gather", action="store_true", help="only gather existing results"),
            argument(
                "--out", type=Path, metavar="DIR", help="results/<name of the sweep> by default"
            ),
        ),
        alone=_sweep,
    ),
    "compare": Command(
        "compare two to twelve runs in one page and one table",
        (
            argument("directories", type=Path, nargs="+", metavar="DIR"),
            argument("--out", type=Path, metavar="DIR", default=Path("results/compare")),
        ),
        alone=_compare,
        leaves_nothing=True,
    ),
    "info": Command(
        "list the contents of a result file: datasets, shapes, units, provenance; without one the"
        " versions and places of everything that is installed",
        (
            argument(
                "file",
                type=Path,
                nargs="?",
                metavar="FILE",
                help="none: the installation, with all versions",
            ),
            argument("--json", action="store_true", help="machine-readable output"),
        ),
        alone=_info,
        leaves_nothing=True,
    ),
    "python": Command(
        "run a script, or a prompt, with the python and the path of this program",
        (argument("script", nargs="*", metavar="SCRIPT …", help="as of python3"),),
    ),
    "cache": Command(
        "list or clear the finished stages that runs share (TIREROAD_CACHE or the user's cache)",
        (
            argument(
                "--clear", action="store_true", help="remove them; result folders keep theirs"
            ),
            argument(
                "--unused-for",
                type=_days,
                metavar="DAYS",
                help="with --clear: only those unused for so long",
            ),
        ),
        alone=_cache,
        leaves_nothing=True,
    ),
    "bench": Command(
        "measure run time against error, scaling and lower bounds on this machine",
        (
            argument("names", nargs="*", metavar="NAME", help="all by default"),
            TABLE,
            ONLY,
        ),
        alone=_bench,
    ),
    "reproduce": Command(
        "recompute the thesis's figures and tables, with what agrees and what does not",
        (
            argument(
                "names",
                nargs="*",
                metavar="NAME",
                help="figure-4.2, table-B.1, ...; all by default",
            ),
            PROCESSES,
            argument(
                "--out",
                type=_folder,
                metavar="DIR",
                default=Path("results/reproduce"),
                help="results/reproduce by default",
            ),
        ),
        REPRODUCE,
    ),
    "validate": Command(
        "compare with full finite elements and closed forms, and test extreme input",
        (
            argument(
                "names",
                nargs="*",
                metavar="NAME",
                help="all by default, in a checkout; or a SCENE.toml of your own, which is run against full finite elements in time",
            ),
            TABLE,
            ONLY,
            argument(
                "--large", action="store_true", help="on meshes of full size: hours, not minutes"
            ),
        ),
        alone=_validate,
    ),
    "test": Command(
        "the test suite, serial and on 2 and 3 processes (--all: the long ones too, --fast: the quick ones)",
        (argument("arguments", nargs="*", metavar="PYTEST ARGUMENTS"),),
    ),
}


def _alone(args: argparse.Namespace) -> int:
    """Run a single-process command, on the root process under mpirun; returns the exit status."""
    if rank_before_mpi() != 0:
        return DONE
    signals.stop_on_signals()
    command = COMMANDS[args.command]
    advice = "the same command begins again" if command.leaves_nothing else mpi.KEPT
    with mpi.ending(advice) as end:
        assert command.alone is not None, "a command of one process"
        command.alone(args)
    if end.message:
        print(end.message, file=sys.stderr)
    return end.status


def main(argv: list[str]) -> int:
    """Run a command line; returns the exit status."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # mutes its remarks on the home folder
    if argv[:1] == ["test"] and argv[1:] not in (["-h"], ["--help"]):
        if not (Path(__file__).resolve().parents[1] / "tests").is_dir():
            print("error: the tests are not installed: run them in a checkout", file=sys.stderr)
            return INPUT
        from tireroad.tests.run_tests import run_tests

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
    if args.command not in ("run", "reproduce"):
        return _alone(args)
    status = _refused_here()
    if status == DONE:
        status = _run(args, options) if args.command == "run" else _reproduce(args)
    return handed_over(status)
