"""Short forms of the attacks; the scripts themselves take counts and seeds, by hand."""

from pathlib import Path

import damaged_files
import kills
import pytest


@pytest.mark.long
def test_killed_runs_recover(tmp_path: Path) -> None:
    assert kills.attack(tmp_path, kills=3, seed=7) == []


@pytest.mark.long
def test_damage_is_never_used(tmp_path: Path) -> None:
    assert damaged_files.attack(tmp_path, files=5, seed=7) == []
