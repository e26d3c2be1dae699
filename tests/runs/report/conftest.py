"""A result folder as a finished run leaves it."""

from pathlib import Path

import pytest
from synthetic_results import write_results


@pytest.fixture
def results(tmp_path: Path) -> Path:
    return write_results(tmp_path / "run")
