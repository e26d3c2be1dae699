"""A scene written to a file."""

from pathlib import Path

import pytest


@pytest.fixture
def scene_file(tmp_path: Path):
    def write(text: str, name: str = "scene.toml") -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write
