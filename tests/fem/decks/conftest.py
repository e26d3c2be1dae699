"""The deck writers beside the tests are imported by name."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def own(tmp_path):
    """Reads a deck given as text, with rims and faces as `torus_decks.plain` names them."""
    from tireroad.fem.decks.user_section import Wishes, read

    def from_text(text, name="tire.inp", **wishes):
        data = text if isinstance(text, bytes) else text.encode()
        (tmp_path / name).write_bytes(data)
        return read(tmp_path / name, Wishes(**({"rim": ("RIMNODES",)} | wishes)))

    return from_text
