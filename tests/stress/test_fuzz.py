"""A short form of fuzz_scenes.py: random scenes and damaged roads end with a message, never a crash."""

from pathlib import Path

import pytest
from damaged_roads import fuzz_road, road_files
from fuzz_scenes import fuzz_check, fuzz_run


def test_random_scenes_through_check(tmp_path: Path) -> None:
    for number in range(150):
        end, tried = fuzz_check(tmp_path, 11, number)
        assert end in ("exit 0", "exit 2"), f"case {number}, {tried}: {end}"


def test_damaged_road_files(tmp_path: Path) -> None:
    files = list(road_files(tmp_path))
    for number in range(60):
        end, tried = fuzz_road(files, 11, number)
        assert end in ("refused", "driven"), f"case {number}, {tried}: {end}"


@pytest.mark.parametrize("number", range(3))
def test_random_scenes_through_run(tmp_path: Path, number: int) -> None:
    end, tried = fuzz_run(tmp_path, 11, number)
    assert end in ("exit 0", "exit 2", "exit 3", "exit 4"), f"{tried}: {end}"
