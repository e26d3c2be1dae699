""".ci/run passes only when every test of the suite ran and none failed."""

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
    (tmp_path / ".ci").mkdir()
    shutil.copy(root / ".ci" / "run", tmp_path / ".ci" / "run")
    fake = tmp_path / "tireroad"
    fake.write_text(FAKE.format(collected=collected, last=last, status=status))
    fake.chmod(0o755)
    done = subprocess.run([tmp_path / ".ci" / "run"], capture_output=True, text=True, timeout=300)
    assert done.returncode == expected, done.stdout + done.stderr
