""".ci/run passes only when lint, documentation and every test of the suite ran and none failed."""

import shutil
import subprocess
from pathlib import Path

import pytest

FAKE = """#!/bin/sh
case "$*" in *--collect-only*) echo "{collected}"; exit 0 ;; esac
echo "12 passed in 3 s"
echo "{last}"
exit {status}
"""


def _run(root: Path, folder: Path, fake: str, failing: str = "") -> subprocess.CompletedProcess:
    """.ci/run of a checkout whose launcher, lint and documentation only say that they passed or failed."""
    (folder / ".ci").mkdir()
    shutil.copy(root / ".ci" / "run", folder / ".ci" / "run")
    texts = {".ci/lint": "#!/bin/sh\n", ".ci/docs": "#!/bin/sh\n", "tireroad": fake}
    for name, text in texts.items():
        (folder / name).write_text(text + ("exit 1\n" if name == failing else ""))
        (folder / name).chmod(0o755)
    return subprocess.run([folder / ".ci" / "run"], capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize(
    ("collected", "last", "status", "expected"),
    [
        ("5 collected", "4 passed, 0 failed, 1 skipped", 0, 0),
        ("5 collected", "3 passed, 1 failed, 1 skipped", 1, 1),
        ("5 collected", "3 passed, 0 failed, 1 skipped", 0, 1),
        ("5 collected", "killed", 0, 1),
        ("0 collected", "0 passed, 0 failed, 0 skipped", 0, 1),
        ("no idea", "4 passed, 0 failed, 1 skipped", 0, 1),
    ],
)
def test_ci(
    root: Path, tmp_path: Path, collected: str, last: str, status: int, expected: int
) -> None:
    done = _run(root, tmp_path, FAKE.format(collected=collected, last=last, status=status))
    assert done.returncode == expected, done.stdout + done.stderr


@pytest.mark.parametrize("step", [".ci/lint", ".ci/docs"])
def test_ci_fails_before_the_suite(root: Path, tmp_path: Path, step: str) -> None:
    passing = FAKE.format(collected="1 collected", last="1 passed, 0 failed, 0 skipped", status=0)
    done = _run(root, tmp_path, passing, failing=step)
    assert done.returncode == 1
    assert f"{step} failed" in done.stdout and "passed" not in done.stdout
