"""The launcher: arguments pass untouched, from any folder, on any number of processes."""

import os
import resource
import shutil
import subprocess
from pathlib import Path

import pytest
from started import environment

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
