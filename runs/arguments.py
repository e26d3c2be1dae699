"""The command line's commands, options and help texts."""

import argparse
import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tireroad.runs.scene.plan import STAGES
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
Runs the stages static, modes, rotating, greens, contact, accuracy, response, spectra, vibration, motion, report,
as far as the scene needs them. Stages already computed from the same inputs are reused unless --fresh.
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

Arguments = Callable[[argparse.ArgumentParser], object]


@dataclass(frozen=True)
class Command:
    """A command: its line in the list of commands (`text`), and a function that adds its arguments.

    `about` and `usage` replace the help that is otherwise generated from these.
    """

    text: str
    arguments: Arguments
    about: str = ""
    usage: str | None = None


def _run(run: argparse.ArgumentParser) -> None:
    _scene(run)
    _processes(run)
    run.add_argument(
        "--out", type=_folder, metavar="DIR", help="result folder; results/<scene name> by default"
    )
    _until(run)
    run.add_argument("--fresh", action="store_true", help="compute every stage anew")


def _resume(resume: argparse.ArgumentParser) -> None:
    _directory(resume)
    _processes(resume)


def _scene(command: argparse.ArgumentParser) -> None:
    command.add_argument("scene", type=Path, metavar="SCENE.toml")
    command.add_argument("--set", action="append", default=[], metavar="a.b=value", help=SET_HELP)


def _until(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--until", choices=STAGES, metavar="STAGE", help=f"last stage: {', '.join(STAGES)}"
    )


def _check(command: argparse.ArgumentParser) -> None:
    _scene(command)
    _until(command)
    command.add_argument(
        "-n",
        type=_count,
        metavar="N",
        dest="processes",
        default=1,
        help="memory of a run on N processes",
    )


def _directory(command: argparse.ArgumentParser) -> None:
    command.add_argument("directory", type=Path, metavar="DIR")


def _processes(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "-n", type=int, metavar="N", dest="processes", help="MPI processes (the launcher's)"
    )


def _file(info: argparse.ArgumentParser) -> None:
    info.add_argument(
        "file",
        type=Path,
        nargs="?",
        metavar="FILE",
        help="none: the installation, with all versions",
    )
    info.add_argument("--json", action="store_true", help="machine-readable output")


def _sweep(sweep: argparse.ArgumentParser) -> None:
    sweep.add_argument("sweep", type=Path, metavar="SWEEP.toml")
    sweep.add_argument("--local", type=_count, default=1, metavar="K", help="K members at a time")
    sweep.add_argument("--slurm", action="store_true", help="write job scripts and submit them")
    sweep.add_argument("--gather", action="store_true", help="only gather existing results")
    sweep.add_argument(
        "--out", type=Path, metavar="DIR", help="results/<name of the sweep> by default"
    )


def _compare(compare: argparse.ArgumentParser) -> None:
    compare.add_argument("directories", type=Path, nargs="+", metavar="DIR")
    compare.add_argument("--out", type=Path, metavar="DIR", default=Path("results/compare"))


def _cache(cache: argparse.ArgumentParser) -> None:
    cache.add_argument(
        "--clear", action="store_true", help="remove them; result folders keep theirs"
    )
    cache.add_argument(
        "--unused-for",
        type=_days,
        metavar="DAYS",
        help="with --clear: only those unused for so long",
    )


def _bench(bench: argparse.ArgumentParser) -> None:
    bench.add_argument("names", nargs="*", metavar="NAME", help="all by default")
    bench.add_argument(
        "--out", type=Path, metavar="FILE.json", help="results, with a page beside them"
    )


def _reproduce(reproduce: argparse.ArgumentParser) -> None:
    reproduce.add_argument(
        "names", nargs="*", metavar="NAME", help="figure-4.2, table-B.1, ...; all by default"
    )
    _processes(reproduce)
    reproduce.add_argument(
        "--out",
        type=_folder,
        metavar="DIR",
        default=Path("results/reproduce"),
        help="results/reproduce by default",
    )


def _validate(validate: argparse.ArgumentParser) -> None:
    _bench(validate)
    validate.add_argument(
        "--large", action="store_true", help="on meshes of full size: hours, not minutes"
    )


def _test(test: argparse.ArgumentParser) -> None:
    test.add_argument("arguments", nargs="*", metavar="PYTEST ARGUMENTS")


def _script(python: argparse.ArgumentParser) -> None:
    python.add_argument("script", nargs="*", metavar="SCRIPT …", help="as of python3")


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


COMMANDS = {
    "run": Command(
        "run a scene and write its report",
        _run,
        RUN,
        f"{PROGRAM} run SCENE.toml [options] [-- PETSc options]",
    ),
    "resume": Command("continue from the last checkpoint of a result folder", _resume),
    "check": Command(
        "validate a scene; print it with all defaults, its stages and its memory", _check
    ),
    "report": Command("write report.html of a result folder again", _directory),
    "export": Command(
        "XDMF for ParaView and CSV for spreadsheets from a result folder", _directory
    ),
    "sweep": Command("run a family of scenes that share stages, in one table", _sweep),
    "compare": Command("compare two to twelve runs in one page and one table", _compare),
    "info": Command(
        "list the contents of a result file: datasets, shapes, units, provenance; without one the"
        " versions and places of everything that is installed",
        _file,
    ),
    "python": Command(
        "run a script, or a prompt, with the python and the path of this program", _script
    ),
    "cache": Command(
        "list or clear the finished stages that runs share (TIREROAD_CACHE or the user's cache)",
        _cache,
    ),
    "bench": Command(
        "measure run time against error, scaling and lower bounds on this machine", _bench
    ),
    "reproduce": Command(
        "recompute the thesis's figures and tables, with what agrees and what does not",
        _reproduce,
        REPRODUCE,
    ),
    "validate": Command(
        "compare with full finite elements and closed forms, and test extreme input", _validate
    ),
    "test": Command(
        "the test suite, serial and on 2 and 3 processes (--all: the long ones too, --fast: the quick ones)",
        _test,
    ),
}


def parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    top = _parser(argparse.ArgumentParser, PROGRAM, ABOUT)
    top.add_argument("--version", action="version", version=f"{PROGRAM} {VERSION}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, command in COMMANDS.items():
        about = command.about or command.text
        one = _parser(commands.add_parser, name, about, help=command.text, usage=command.usage)
        command.arguments(one)
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
