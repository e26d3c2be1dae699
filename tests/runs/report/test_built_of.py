"""What the report says a tire is made of, and at which speed what ends."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

from tireroad.runs.report.page import built_of, parameters
from tireroad.runs.report.sections.speeds import speeds
from tireroad.runs.scene.load import load
from tireroad.runs.scene.resolved import dumps

RADIAL = '[tire]\nsection = "radial"\nsize = "205/60R15 91H"\n'


def scene(tmp_path: Path, text: str) -> dict:
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return tomllib.loads(dumps(load(path)))


def test_the_compounds_and_cords_that_are_used(tmp_path: Path) -> None:
    """Those of the torus, 480 MPa without losses, stood there; its own are listed once."""
    found = scene(tmp_path, f"{RADIAL}[tire.scale]\nskim = 1.1\n")
    compounds, cords = ({row[0]: row for row in rows} for _, _, rows in built_of(found))
    assert compounds["tread"][2:] == ("4.4", "0.49", "1110", "1.8", "0.3", "0.1")
    assert compounds["skim"][2] == "12.87"
    assert cords["belt 1"][1:3] == ("22", "190") and len(cords) == 4
    titles = [title for title, _ in parameters(found)]
    assert "tire" in titles and not [title for title in titles if "region" in title]
    assert "480" not in str(parameters(found))
    assert built_of(scene(tmp_path, "")) == [] and built_of({"tire": {"section": "radial"}}) != []


def test_what_ends_at_which_speed(tmp_path: Path) -> None:
    """157 rad/s of the undamped tire and 210 km/h of its symbol, by the rolling radius of the run."""
    headline = {
        "speed": {"value": 72.0, "unit": "rad/s"},
        "critical speed": {"value": 157.0, "unit": "rad/s"},
        "standing wave at the critical speed": {
            "value": "32 around, largest at y = 100 mm",
            "unit": "-",
        },
    }
    of_the_run = {"static.h5": {"rolling_radius": 0.3}}
    results = SimpleNamespace(
        scene=scene(tmp_path, RADIAL), attribute=lambda file, name: of_the_run[file][name]
    )
    assert speeds(results, {}) is None
    made = speeds(results, {"rotating": {"headline": headline}})
    assert made is not None
    facts = dict(made.facts)
    assert facts["critical speed of the undamped tire"] == "157 rad/s, 169.6 km/h"
    assert facts["speed symbol H"].startswith("194.4 rad/s, 210 km/h")
    assert facts["standing wave at the critical speed"].startswith("32 around")
    assert float(facts["this run"].split(", ")[1].split()[0]) == pytest.approx(77.76, abs=0.05)
