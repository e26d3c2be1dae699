"""A short form of fuzz_scenes.py: random scenes and damaged roads end with a message, never a crash."""

import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from damaged_roads import fuzz_road, road_files
from fuzz_scenes import fuzz_check
from started import environment


@pytest.mark.slow
def test_random_scenes_through_check(tmp_path: Path) -> None:
    for number in range(150):
        end, tried = fuzz_check(tmp_path, 11, number)
        assert end in ("exit 0", "exit 2"), f"case {number}, {tried}: {end}"


@pytest.mark.long
def test_damaged_road_files(tmp_path: Path) -> None:
    files = list(road_files(tmp_path))
    for number in range(60):
        end, tried = fuzz_road(files, 11, number)
        assert end in ("refused", "driven"), f"case {number}, {tried}: {end}"


@pytest.mark.long
def test_random_scenes_through_run(root: Path, launch: Callable) -> None:
    """In a process of its own: a fork of this one would count what other tests hold as the run's memory."""
    script, limit = root / "tests" / "stress" / "fuzz_scenes.py", 600
    counts = ["--seed", "11", "--checks", "0", "--roads", "0", "--runs", "3"]
    paths = environment(PYTHONPATH=os.pathsep.join(map(str, (root, script.parent, root / "tests"))))
    done = launch(script, *counts, "--limit", limit, env=paths)
    assert done.returncode == 0 and "stopped" not in done.stdout, done.stdout + done.stderr
    assert len(re.findall(r"^  run \d: exit [0234]", done.stdout, re.MULTILINE)) == 3
