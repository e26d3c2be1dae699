"""What the command line takes: commands, options, help."""

import argparse
from pathlib import Path

from tireroad.runs.scene.plan import STAGES
from tireroad.runs.version import PROGRAM, VERSION

EXIT = """\
exit status:
  0  done
  2  the input is wrong: one message, nothing written over
  3  a solver gave up: what, where, what to try; finished stages are kept
  4  stopped on request (SIGINT, SIGTERM, SIGHUP); the same command, or resume, goes on
  anything else is a bug
"""
ABOUT = """\
A rolling tire on a rough road: finite elements, modes, Green's functions, contact.

`./tireroad COMMAND` installs on Debian what is missing and starts the program;
`mpirun -n N python3 -m runs COMMAND` is the same program in a batch script.
"""
RUN = """\
Runs the stages static, modes, rotating, greens, contact, accuracy, response, spectra, report, as far
as the scene needs them. Stages already computed from the same inputs are reused unless --fresh.
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
    sweep = command("sweep", "a family of runs that share what they can, in one table")
    sweep.add_argument("sweep", type=Path, metavar="SWEEP.toml")
    sweep.add_argument("--local", type=int, default=1, metavar="K", help="K members at a time")
    sweep.add_argument("--slurm", action="store_true", help="write job scripts and submit them")
    sweep.add_argument("--gather", action="store_true", help="only gather what is there")
    sweep.add_argument(
        "--out", type=Path, metavar="DIR", help="results/<name of the sweep> by default"
    )
    compare = command("compare", "two to twelve runs in one page and one table")
    compare.add_argument("directories", type=Path, nargs="+", metavar="DIR")
    compare.add_argument("--out", type=Path, metavar="DIR", default=Path("results/compare"))
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


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("the name of the folder is empty")
    return Path(text)


def _run_arguments(run: argparse.ArgumentParser) -> None:
    run.add_argument("scene", type=Path, metavar="SCENE.toml")
    run.add_argument(
        "-n", type=int, metavar="N", dest="processes", help="MPI processes (the launcher's)"
    )
    run.add_argument(
        "--out", type=_folder, metavar="DIR", help="result folder; results/<scene name> by default"
    )
    run.add_argument("--set", action="append", default=[], metavar="a.b=value", help=SET_HELP)
    run.add_argument(
        "--until", choices=STAGES, metavar="STAGE", help=f"last stage: {', '.join(STAGES)}"
    )
    run.add_argument("--fresh", action="store_true", help="compute every stage anew")
