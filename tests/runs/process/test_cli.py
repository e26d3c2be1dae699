"""The command line: help without heavy imports, exit statuses, one message and no traceback."""

from pathlib import Path

import pytest

from tireroad.runs import cli
from tireroad.runs.files.names import STAGES
from tireroad.runs.scene.load import load
from tireroad.runs.scene.plan import skipped
from tireroad.runs.version import VERSION

LIGHT = """
import sys
from tireroad.runs.cli import main
try:
    status = main(sys.argv[1:])
except SystemExit as ending:
    status = ending.code
heavy = [name for name in ("dolfinx", "petsc4py", "mpi4py", "h5py", "scipy") if name in sys.modules]
sys.exit(f"imports {heavy}" if heavy else status)
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "my scene.toml"
    path.write_text("[static]\nload = 500\n[rotation]\nspeed = 50\n")
    return path


@pytest.mark.parametrize("command", [["--help"], ["run", "--help"], ["check", "--help"]])
def test_help_is_light_and_names_statuses(launch, command: list[str]) -> None:
    done = launch("-c", LIGHT, *command)
    assert done.returncode == 0, done.stderr
    for status in "0234":
        assert f"\n  {status}  " in done.stdout


def test_every_command_is_in_the_help(launch) -> None:
    text = launch("-m", "runs", "--help").stdout
    for command in ("run", "check", "report", "export", "info", "test"):
        assert f"\n    {command} " in text
    text = launch("-m", "runs", "run", "--help").stdout
    for option in ("-n N", "--out", "--set", "--until", "--fresh", "-- PETSc", *STAGES):
        assert option in text


@pytest.mark.slow
def test_check_is_light_and_shows_all(launch, scene: Path) -> None:
    # The section is drawn: its mesh is checked with scipy's graphs, all else heavy stays out.
    light = LIGHT.replace(', "scipy"', "")
    done = launch("-c", light, "check", scene, "--set", "static.load=400")
    assert done.returncode == 0, done.stderr
    lines = [line.split() for line in done.stdout.splitlines()]
    assert ["load", "400.0", "N", "≥", "0.001,", "≤", "1e+08", "vertical", "load"] in [
        line[:9] for line in lines
    ]
    assert ["rotating", "runs"] in lines
    assert "contact   skipped: no [contact]" in done.stdout
    assert "estimated memory" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("processes", [1, 2])
@pytest.mark.parametrize("command", ["run", "check"])
def test_bad_scene_ends_with_two(launch, scene: Path, command: str, processes: int) -> None:
    done = launch("-m", "runs", command, scene, "--set", "static.lod=1", processes=processes)
    assert done.returncode == 2
    assert done.stderr.count("error: --set static.lod: unknown key") == 1
    assert "Traceback" not in done.stderr and done.stdout == ""


def test_bad_scene_touches_nothing(launch, scene: Path, tmp_path: Path) -> None:
    launch("-m", "runs", "run", scene, "--out", tmp_path / "out", "--set", "static.load=-1")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "command",
    [
        ["run"],
        ["go"],
        ["run", "x.toml", "--until", "never"],
        ["run", "x.toml", "--unknown"],
        ["run", "x.toml", "-n", "many"],
        ["report", "nowhere"],
        ["export", "nowhere"],
        ["sweep", "x.toml", "--local", "0"],
        ["sweep", "x.toml", "--local", "-1"],
        ["cache", "--clear", "--unused-for", "-1"],
        ["cache", "--clear", "--unused-for", "nan"],
        ["cache", "--unused-for", "3"],
    ],
)
def test_wrong_commands_end_with_two(launch, tmp_path: Path, command: list[str]) -> None:
    done = launch("-m", "runs", *command, cwd=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr and done.stderr.count("error: ") == 1


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["sweep", "x.toml", "--local", "0"], "--local: 0: must be a whole number, 1 to 9999"),
        (["cache", "--clear", "--unused-for", "-1"], "-1: must be a number of days, 0 or more"),
        (["cache", "--unused-for", "3"], "--unused-for requires --clear"),
    ],
)
def test_a_wrong_number_is_named(capsys, monkeypatch, command: list[str], words: str) -> None:
    monkeypatch.setenv("TIREROAD_CACHE", "off")
    assert cli.main(command) == 2
    assert words in capsys.readouterr().err


def test_wrong_process_count_is_explained(launch, scene: Path) -> None:
    done = launch("-m", "runs", "run", scene, "-n", "5")
    assert done.returncode == 2 and "mpirun -n 5" in done.stderr


@pytest.mark.parametrize(("processes", "warned"), [(5, 1), (4, 0)])
def test_more_processes_than_the_cores_serve_are_warned_of(
    scene: Path, monkeypatch, capsys, processes: int, warned: int
) -> None:
    """By `check` for the processes it is told of, by `run` before MPI starts."""
    monkeypatch.chdir(scene.parent)
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    words = f"warning: {processes} processes on the 2 core(s) of this machine"
    assert cli.main(["check", str(scene), "-n", str(processes)]) == 0
    assert capsys.readouterr().out.count(words) == warned
    for name in ("OMPI_COMM_WORLD_LOCAL_SIZE", "OMPI_COMM_WORLD_SIZE"):
        monkeypatch.setenv(name, str(processes))
    assert cli.main(["run", "nowhere.toml"]) == 2
    assert capsys.readouterr().err.count(words) == warned
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", str(2 * processes))
    assert cli.main(["run", "nowhere.toml"]) == 2
    assert "core(s)" not in capsys.readouterr().err


def test_folder_of_another_scene_is_left_alone(launch, scene: Path, tmp_path: Path) -> None:
    from tireroad.runs.files.folder import Summary

    Summary(tmp_path, "other", 1).record("static", "computed")
    before = (tmp_path / "summary.json").read_bytes()
    done = launch("-m", "runs", "run", scene, "--set", "name=mine", "--out", tmp_path)
    assert done.returncode == 2, done.stderr
    assert '"other"' in done.stderr and "Traceback" not in done.stderr
    assert (tmp_path / "summary.json").read_bytes() == before


def test_unusable_folder_ends_with_two(launch, scene: Path) -> None:
    done = launch("-m", "runs", "run", scene, "--out", "/proc/none/results", processes=2)
    assert done.returncode == 2
    assert done.stderr.count("/proc/none/results") == 1 and "Traceback" not in done.stderr


def test_petsc_options_follow_two_dashes(monkeypatch) -> None:
    seen = []
    monkeypatch.setattr(cli, "_run", lambda args, options: seen.append((args, options)) or 0)
    assert cli.main(["run", "a.toml", "--fresh", "--", "-snes_monitor", "--set", "x"]) == 0
    args, options = seen[0]
    assert args.fresh and args.set == [] and options == ["-snes_monitor", "--set", "x"]


def test_version(launch) -> None:
    assert launch("-m", "runs", "--version").stdout == f"tireroad {VERSION}\n"


def test_version_is_that_of_the_package(root: Path) -> None:
    assert f'version = "{VERSION}"' in (root / "pyproject.toml").read_text()


STILL = {"rotating", "response", "contact", "spectra", "greens", "stiffness"}


@pytest.mark.parametrize(
    ("overrides", "until", "expected"),
    [
        ([], None, {"response", "contact", "spectra", "greens", "stiffness"}),
        (
            ["rotation.speed=0"],
            None,
            STILL,
        ),
        (["force=[{}]", "time={}"], None, {"contact", "spectra", "stiffness"}),
        (["contact={}", "road={}", "time={}"], None, {"response", "stiffness"}),
        (["contact={}", "road={}", "time={}", "output.spectra=false"], None, None),
        ([], "modes", set(STAGES) - {"static", "modes"}),
        (["rotation="], None, STILL | {"modes"}),
        (["rotation=", "modal={}"], None, STILL),
        (["rotation="], "modes", set(STAGES) - {"static", "modes"}),
        (["contact={}"], None, {"response", "contact", "spectra", "greens", "stiffness"}),
        (["contact={}", "force=[{}]"], None, {"response", "contact", "spectra", "stiffness"}),
        (["contact={}", "time={}"], None, {"response", "stiffness"}),
        (
            ["contact={}", "time={}", "static.load="],
            None,
            {"response", "contact", "spectra", "greens", "stiffness"},
        ),
    ],
)
def test_stages_follow_from_the_scene(scene: Path, overrides, until, expected) -> None:
    reasons = skipped(load(scene, overrides, until=until), until)
    wanted = expected if expected is not None else {"response", "spectra", "stiffness"}
    bars = {"accuracy"} if "contact" in wanted else set()
    unasked = {"radiation", "sound", "vibration", "motion", "stretches", "nonlinear"}
    assert set(reasons) == wanted | unasked | bars
    assert all(reasons.values())
