"""The search for an accuracy is drawn in the report."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from written_page import page

from tireroad.runs.files.trials import ErrorsByCause, Settings, Trial
from tireroad.runs.report.sections import spectra
from tireroad.runs.search.settings import CAUSES


@pytest.mark.long
def test_a_search_is_drawn_by_cost_and_error(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its trials in the order tried; a page without one, or with one that cannot be read, has none."""
    assert "The search:" not in page(results)
    settings = Settings((16, 8), 3, 200.0, "static", 0.01, 1e-3, dict.fromkeys(CAUSES, 0))
    parts = dict.fromkeys(CAUSES, 0.04)
    found = [
        ErrorsByCause(parts, dict.fromkeys(CAUSES, 0.0), (), dict.fromkeys(CAUSES, ())),
        ErrorsByCause(
            parts | {"mesh": 0.3}, dict.fromkeys(CAUSES, 0.0), (), dict.fromkeys(CAUSES, ())
        ),
    ]
    trials = [
        Trial(settings, {"static": 4.0, "contact": cost}, 3.0, one)
        for cost, one in zip((9.0, 1.0), found, strict=True)
    ]
    text = json.dumps(
        {
            "of": "",
            "trials": [
                asdict(one) for one in [*trials, Trial(settings, {}, 2.0, failed="no balance")]
            ],
        }
    )
    (results / "search.json").write_text(text)
    with (results / "scene.toml").open("a") as file:
        file.write("[accuracy]\ntarget = 0.1\nup_to = 100.0\n")
    drawn = []
    monkeypatch.setattr(
        spectra, "trade", lambda *given: drawn.append(given) or "data:image/png;base64,"
    )
    text = page(results)
    assert "10 % of the axle force up to 100 Hz" in text
    cost, error, causes = drawn[0]
    assert cost.tolist() == [13.0, 5.0]
    assert error == pytest.approx([0.8, np.hypot(3.0, 0.4 * 3**0.5)])
    assert causes.shape == (2, 4) and causes[1, CAUSES.index("mesh")] == pytest.approx(3.0)
    monkeypatch.undo()
    assert spectra.trade(cost, error, causes).startswith("data:image/svg")
    (results / "search.json").write_text("{")
    assert "The search:" not in page(results)
