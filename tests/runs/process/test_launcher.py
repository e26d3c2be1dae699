"""The launcher: arguments pass untouched, from any folder, on any number of processes."""

import json
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from started import environment

from tireroad.runs.process import installation

SCENE = "[static]\nload = 500\n"


@pytest.fixture
def launcher(root: Path, tmp_path: Path):
    """The launcher called through a link from a folder with a blank in its name."""
    folder = tmp_path / "a folder"
    folder.mkdir()
    (folder / "my scene.toml").write_text(SCENE)
    (folder / "tireroad").symlink_to(root / "tireroad")

    def run(*arguments: str, **extra: str) -> subprocess.CompletedProcess:
        return subprocess.run(
            ["./tireroad", *arguments],
            cwd=folder,
            env=environment(**extra),
            capture_output=True,
            text=True,
            timeout=1200,
        )

    return run


@pytest.mark.slow
def test_check_from_anywhere(launcher) -> None:
    done = launcher("check", "my scene.toml", "--set", "static.load=400")
    assert done.returncode == 0, done.stderr
    assert "400.0" in done.stdout


@pytest.mark.slow
def test_start_up_is_quick(launcher) -> None:
    launcher("--version")
    spent = []
    for _ in range(3):
        began = resource.getrusage(resource.RUSAGE_CHILDREN)
        assert launcher("--version").returncode == 0
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime)
    assert min(spent) < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("where", [["-n", "2", "x.toml"], ["x.toml", "-n2"], ["x.toml", "-n", "2"]])
def test_processes_are_taken_out(launcher, where: list[str]) -> None:
    done = launcher("run", *where)
    assert done.returncode == 2
    assert done.stderr == "error: x.toml: no such scene file\n"


@pytest.mark.parametrize("number", ["0", "-1", "two", "1.5", "", "99999"])
def test_bad_process_numbers(launcher, number: str) -> None:
    done = launcher("run", "x.toml", "-n", number)
    assert done.returncode == 2 and "number of processes" in done.stderr


@pytest.mark.slow
def test_bad_value_with_blanks_arrives_whole(launcher) -> None:
    done = launcher("run", "my scene.toml", "--set", "name=a  b", "-n", "2")
    assert done.returncode == 2
    assert '"a  b"' in done.stderr


def test_without_packages_and_rights_one_line_is_printed(launcher, root: Path, tmp_path) -> None:
    """A machine with sh, apt-get and no rights: the line to run, status 2, nothing installed."""
    tools = tmp_path / "tools"
    tools.mkdir()
    for name in ("sh", "dirname", "readlink", "getconf"):
        (tools / name).symlink_to(shutil.which(name))
    for name, text in (("id", "echo 1000"), ("apt-get", "touch installed"), ("python3", "exit 1")):
        (tools / name).write_text(f"#!/bin/sh\n{text}\n")
        (tools / name).chmod(0o755)
    copy = tmp_path / "tireroad"
    text = (root / "tireroad").read_text()
    copy.write_text(text.replace("/usr/bin/python3", str(tools / "python3")))
    done = subprocess.run(
        ["sh", str(copy), "check", "x.toml"],
        env={"PATH": str(tools)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=600,
    )
    assert done.returncode == 2
    assert "apt-get update && apt-get install -y --no-install-recommends python3 " in done.stderr
    assert "python3-dolfinx-real" in done.stderr and not (tmp_path / "installed").exists()


@pytest.mark.skipif(not os.path.exists("/bin/dash"), reason="no dash here")
def test_is_plain_shell(root: Path) -> None:
    done = subprocess.run(["/bin/dash", "-n", root / "tireroad"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_python_that_is_named_goes_first(launcher, tmp_path: Path) -> None:
    """It is taken or refused by name; no other one is looked for."""
    done = launcher("--version", TIREROAD_PYTHON=str(tmp_path / "none"))
    assert done.returncode == 2 and "none: no such program" in done.stderr
    bare = tmp_path / "python"
    bare.write_text("#!/bin/sh\necho python3-dolfinx-real\n")
    bare.chmod(0o755)
    done = launcher("--version", TIREROAD_PYTHON=str(bare))
    assert done.returncode == 2 and "lacks what Debian calls: python3-dolfinx-real" in done.stderr
    done = launcher("--version", TIREROAD_PYTHON=sys.executable)
    assert (done.returncode, done.stdout) == (0, "tireroad 0.1.0\n")


def test_a_script_runs_with_the_launchers_python(launcher, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text("import sys, neighbour, tireroad\nprint(sys.argv[1:], neighbour.NAME)\n")
    (tmp_path / "neighbour.py").write_text("NAME = 'beside'\n")
    done = launcher("python", str(script), "a b", "-n", "2")
    assert (done.returncode, done.stdout) == (0, "['a b', '-n', '2'] beside\n")
    assert launcher("python", "-c", "import sys; sys.exit(7)").returncode == 7


def test_info_without_a_file_tells_the_installation(launcher) -> None:
    done = launcher("info", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert Path(found["Python"].split("(")[1][:-1]).samefile(sys.executable)
    assert {"dolfinx", "PETSc", "SLEPc", "MPI", "BLAS", "numpy", "C compiler"} <= found.keys()
    assert "unknown" not in found.values()


def _environment_maker(root: Path, tmp_path: Path, made: str) -> Path:
    """A python3 without packages that makes an environment, whose python is the shell script `made`."""
    tools = tmp_path / "tools"
    tools.mkdir()
    for name in ("sh", "dirname", "readlink", "getconf", "mkdir", "cat", "chmod"):
        (tools / name).symlink_to(shutil.which(name))
    (tools / "id").write_text("#!/bin/sh\necho 1000\n")
    (tools / "python3").write_text(
        f"""#!/bin/sh
case "$*" in
*ensurepip*) exit 0 ;;
*missing*) echo python3-dolfinx-real ;;
*make*)
    for folder; do case $folder in */environment) break ;; esac; done
    mkdir -p "$folder/bin"
    printf '#!/bin/sh\\n{made}\\n' >"$folder/bin/python"
    chmod +x "$folder/bin/python"
    echo made >&2 ;;
esac
"""
    )
    for name in ("id", "python3"):
        (tools / name).chmod(0o755)
    copy = tmp_path / "tireroad"
    copy.write_text((root / "tireroad").read_text().replace("/usr/bin/python3", "no-python3"))
    return tools


def test_without_rights_and_apt_an_environment_is_made_once(root: Path, tmp_path: Path) -> None:
    script = 'case "$*" in *missing*) ;; *runs*) echo "runs $*" ;; esac'
    tools = _environment_maker(root, tmp_path, script)
    cache = tmp_path / "the cache"
    for made in (True, False):
        done = subprocess.run(
            ["sh", tmp_path / "tireroad", "check", "x.toml"],
            env={"PATH": str(tools), "XDG_CACHE_HOME": str(cache)},
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
        )
        assert done.returncode == 0, done.stderr
        assert done.stdout == "runs -P -m runs check x.toml\n"
        assert ("made" in done.stderr) == made
    assert (cache / "tireroad" / "environment" / "bin" / "python").exists()


def test_what_an_environment_is_made_of(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the extras that `pip install ".[solver]"` takes; with a compiler only where there is none."""
    assert installation.requirements(tests=False)[0].startswith("dolfinx-solver-real")
    assert "pytest" in installation.requirements(tests=True)
    monkeypatch.setattr(installation, "compiler", lambda: None)
    assert "ziglang" in installation.requirements(tests=False)
    monkeypatch.setattr(installation, "found", lambda module: module not in ("ziglang", "h5py"))
    monkeypatch.setattr(installation, "beside", lambda program: None)
    assert installation.missing(tests=False, processes=2) == ["python3-h5py", "gcc", "openmpi-bin"]
