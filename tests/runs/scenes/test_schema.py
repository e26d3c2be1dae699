"""The whole schema: both ends of every range, the key reference, and that every key is read by a run."""

from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest
from scene_keys import KEYS

from tireroad.contact.roads.road import ROADS
from tireroad.fem.parameters import ParameterError


@pytest.mark.parametrize("name", [name for name, key in KEYS.items() if key.limits])
def test_both_ends_of_every_range_hold(name: str) -> None:
    """The ends of a range are read, the next number beyond is not."""
    key = KEYS[name]
    whole = key.read.__qualname__.startswith("integer")
    counted = key.values.split()[0]  # "3 numbers", "ascending numbers": one of them will do
    size = (int(counted) if counted.isdigit() else 1) if "numbers" in key.values else 0

    def read(value: float) -> Any:
        given = int(value) if whole else float(value)
        pitch = {"dx": given, "dy": given} if "{dx, dy}" in key.values else given
        return key.read([given] * size if size else pitch)

    for end, outward in ((key.limits.least, -1), (key.limits.most, 1)):
        if end is None:
            continue
        read(end)
        with pytest.raises(ValueError, match="must be"):
            read(end + outward if whole else np.nextafter(end, outward * np.inf))


def test_numbers_have_ends() -> None:
    """A number without an upper and a lower end is one that nobody has thought about; and above 0 lets in
    5e-324, which no length, modulus or density is: a range ends at the least that makes sense.
    """
    # Programs write up to 1e38 where they have no height.
    free = {
        "PointForceTable.direction",
        *(f"{kind}.missing" for kind in ("LaserFile", "GridFile", "CrgFile")),
    }
    for name, key in KEYS.items():
        limits = key.limits
        if limits and name not in free:
            assert limits.least is not None and limits.most is not None, name
            sizes = [abs(end) for end in (limits.least, limits.most) if end]
            assert min(sizes) >= 1e-12 and max(sizes) <= 1e15, name


def test_constructors_check_like_scenes() -> None:
    with pytest.raises(ParameterError, match="road: wavelength must be ≥ 0.001, .* not -1 m"):
        ROADS["sine"](wavelength=-1)
    with pytest.raises(ParameterError, match="half a block"):
        ROADS["cobblestones"](edge_radius=0.2)


def test_reference_is_current(root: Path) -> None:
    """After a change of keys: ./tireroad python docs/scene_keys.py docs/keys.md"""
    assert (root / "docs" / "keys.md").read_text(encoding="utf-8") == run_path(
        str(root / "docs" / "scene_keys.py")
    )["reference"]()
