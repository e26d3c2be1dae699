"""The examples run, and give the numbers they are pinned to."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


@pytest.fixture(autouse=True)
def _examples_on_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    for path in EXAMPLES.glob("*.py"):
        sys.modules.pop(path.stem, None)


def test_make_road_writes_what_is_shipped(tmp_path: Path) -> None:
    import make_road

    assert make_road.main(tmp_path / "road.npz") == pytest.approx(0.4, rel=1e-6)
    made = np.load(tmp_path / "road.npz")
    shipped = np.load(EXAMPLES.parent / "runs" / "scenes" / "measured_road.npz")
    assert all(np.allclose(made[key], shipped[key], atol=1e-9) for key in "xyz")
    # Valleys deeper than peaks are high.
    assert ((made["z"] / made["z"].std()) ** 3).mean() < -0.5


def test_own_road_and_tread(capsys: pytest.CaptureFixture[str]) -> None:
    """Registered classes serve in a scene as ours do; pinned when it was written."""
    import own_road

    from tireroad.contact.roads.kind import ROADS
    from tireroad.contact.tread.law import TREADS

    try:
        assert own_road.main() == pytest.approx(839.94, rel=1e-3)
        assert capsys.readouterr().out.endswith("N at most\n")
    finally:
        ROADS.forget("humps")
        TREADS.forget("brush-blocks")
