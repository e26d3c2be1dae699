"""A short form of fuzz_scenes.py: random scenes and damaged roads end with a message, never a crash."""

from pathlib import Path

import pytest
from fuzz_scenes import fuzz_check, fuzz_road, fuzz_run, road_files


def test_random_scenes_through_check(tmp_path: Path) -> None:
    for number in range(150):
        end, tried = fuzz_check(tmp_path, 11, number)
        assert end in ("exit 0", "exit 2"), f"case {number}, {tried}: {end}"


def test_damaged_road_files(tmp_path: Path) -> None:
    files = list(road_files(tmp_path))
    for number in range(60):
        end, tried = fuzz_road(files, 11, number)
        assert end in ("refused", "driven"), f"case {number}, {tried}: {end}"


@pytest.mark.parametrize("number", range(2))
def test_random_scenes_through_run(tmp_path: Path, monkeypatch, root: Path, number: int) -> None:
    monkeypatch.setenv("PYTHONPATH", str(root))
    end, tried = fuzz_run(tmp_path, 11, number)
    assert end in ("exit 0", "exit 2", "exit 3", "exit 4"), f"{tried}: {end}"
