"""OpenCRG heights against another reader, PyOpenCRG, where that is installed (from PyPI; Debian has none)."""

from pathlib import Path

import numpy as np
import pytest
from test_opencrg import FORMATS, Z, crg

from tireroad.contact.roads.opencrg import read_opencrg

pyopencrg = pytest.importorskip("pyopencrg", reason="PyOpenCRG is not installed")


def differences(file: Path, width: float, **keys: str) -> np.ndarray:
    """Heights of this reader less those of the other, m, at places all over a straight road."""
    ours, other = read_opencrg(file, **keys), pyopencrg.read(file)
    (x0, x1), (y0, y1) = ours.extent
    rng = np.random.default_rng(5)
    x = rng.uniform(x0, x1, 2000)
    y = rng.uniform(max(y0, -width), min(y1, width), 2000)
    return ours.height(x, y) - other.uv_to_z(other.u[0] + x, y)


@pytest.mark.parametrize("code", FORMATS)
def test_every_format(tmp_path: Path, code: str) -> None:
    file = tmp_path / "road.crg"
    file.write_bytes(crg(code, Z))
    assert np.abs(differences(file, 1.25)).max() < 1e-9


@pytest.mark.parametrize(
    "name", ["belgian_block", "handmade_straight", "handmade_straight_minimalist"]
)
def test_measured_roads(roads: Path, name: str) -> None:
    assert np.abs(differences(roads / f"{name}.crg", 1.0)).max() < 1e-9
