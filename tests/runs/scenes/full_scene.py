"""A scene with every table a road needs, and what the reader says of a scene it refuses."""

from pathlib import Path

import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.scene.load import load

FULL = """
[static]
load = 500
[rotation]
speed = 50
[[force]]
amplitude = 2
[contact]
[road]
kind = "cobblestones"
[time]
duration = 0.1
"""


def refused(path: Path, *overrides: str) -> str:
    with pytest.raises(InputError) as caught:
        load(path, overrides)
    return str(caught.value)
