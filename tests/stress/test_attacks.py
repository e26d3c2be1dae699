"""Short forms of the attacks; the scripts themselves take counts and seeds, by hand."""

from pathlib import Path

import damaged_files
import kills
import pytest
import reused


@pytest.mark.long
def test_killed_runs_recover(tmp_path: Path) -> None:
    assert kills.attack(tmp_path, kills=3, seed=7) == []


@pytest.mark.long
def test_damage_is_never_used(tmp_path: Path) -> None:
    assert damaged_files.attack(tmp_path, files=5, seed=7) == []


@pytest.mark.long
def test_stages_from_files_are_those_of_the_first_run(tmp_path: Path) -> None:
    assert reused.attack(tmp_path, scenes=2, seed=5) == []
