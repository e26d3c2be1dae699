"""Figures that no tire has are told once, with the usual range; those of a tire are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from synthetic_results import put, sealed, write_results

from tireroad.runs.report.read import Results
from tireroad.runs.report.realism import mean_load, unusual

PASSENGER = {"load": 4000.0, "deflection": 0.020, "inflation": 2.2e5, "mass": 9.3}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A passenger tire's figures (205/60 R15 at 4 kN, published with MF-Swift) in the files of a run."""
    directory = write_results(tmp_path / "run", steps=64, modes=6)
    with sealed(directory / "static.h5", "a") as file:
        file.attrs.update(PASSENGER, footprint_length=0.137, footprint_width=0.143)
        file.attrs["footprint_area"] = 4000.0 / 2.6e5
        force = file["contact/force"]
        force[:, 2] *= 4000.0 / force[:, 2].sum()
    with sealed(directory / "modes.h5", "a") as file:
        put(file, "loss_factor", np.full(6, 0.1), "-")
    with sealed(directory / "contact.h5", "a") as file:
        file["total_force"][:, 2] *= 4000.0 / file["total_force"][:, 2].mean()
        file.attrs["road_relief"] = 0.002
    return directory


def told(directory: Path, **scene: dict) -> str | None:
    with Results(directory, {"contact": {"youngs_modulus": 8e6}} | scene) as results:
        return unusual(results)


def test_a_tire_is_not_remarked_on(folder: Path) -> None:
    assert told(folder, tire={"thickness": 0.014}, road={"kind": "texture"}) is None


def test_an_overloaded_size_is_told_the_inflation_that_it_needs(folder: Path) -> None:
    """4000 N are no load for 205/60 R15, but above what 155/65 R14 is rated for (387 kg at 250 kPa)."""
    usual, small = ({"section": "radial", "size": text} for text in ("205/60 R15", "155/65 R14"))
    assert told(folder, tire=usual) is None
    assert "on 155/65 R14 at 220" in told(folder, tire=small)
    assert "(too much for it)" in told(folder, tire=small)
    with sealed(folder / "static.h5", "a") as file:
        file.attrs["inflation"] = 1.2e5
        file.attrs["footprint_area"] = 4000.0 / 1.5e5
    assert "kPa would do" in told(folder, tire=usual)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"mass": 0.5}, "mass 0.5 kg (3 to 90 kg"),
        ({"deflection": 1e-4}, "vertical stiffness 40 000 N/mm (50 to 1500"),
        ({"deflection": 0.075}, "beyond what such a tire is rated for"),
        ({"footprint_width": 0.02}, "footprint 137 mm long and 20 mm wide"),
        ({"inflation": 4e4}, "6.5 times the inflation (0.6 to 2 times)"),
    ],
)
def test_each_figure_is_told_with_its_range(folder: Path, change: dict, said: str) -> None:
    with sealed(folder / "static.h5", "a") as file:
        file.attrs.update(change)
    text = told(folder).replace("\u202f", " ")
    assert said in text
    assert text.startswith("outside the usual range of tires")


def test_the_tread_the_road_and_the_damping(folder: Path) -> None:
    assert "340 MPa of the tread (rubber: 3 to 15" in told(
        folder, contact={"youngs_modulus": 3.4e8}
    )
    with sealed(folder / "contact.h5", "a") as file:
        file.attrs["road_relief"] = 1.6
    scene = {"tire": {"thickness": 0.012}, "road": {"kind": "grid"}}
    assert "is the file in millimetres" in told(folder, **scene)
    assert told(folder, **scene | {"road": {"kind": "step"}}) is None


def test_the_damping_is_that_of_the_tire(folder: Path) -> None:
    """Neither a wheel's damper (beyond critical: 2400 N s/m, 25 kN/m, 24 kg) nor a frequency that rotation shifts
    to zero is damping of the tire; the lowest mode has 60 Hz."""
    with sealed(folder / "rotating.h5", "a") as file:
        file["eigenvalue"][:4] = [-10.0, -500.0, -20.0 + 1.0j, -20.0 - 1.0j]
    assert told(folder, axle={"kind": "corner"}) is None
    for given, said in (
        ({"mass": 500.0}, "up to 66 % of critical (0.5 to 10 %): look at [damping] mass"),
        (
            {"mass": 10.0, "stiffness": 0.004},
            "up to beyond critical (0.5 to 10 %): look at [damping] stiffness",
        ),
    ):
        assert said in told(folder, damping=given)
    with sealed(folder / "modes.h5", "a") as file:
        file["loss_factor"][0] = 1.2
    assert "up to 60 % of critical (0.5 to 10 %): look at loss_factor" in told(folder)


def test_the_mean_load_is_explained_where_it_differs(folder: Path) -> None:
    with Results(folder, {"road": {"kind": "cobblestones", "datum": "mean"}}) as results:
        assert mean_load(results) is None
    with sealed(folder / "contact.h5", "a") as file:
        file["total_force"][:, 2] *= 1.2
    text = explained(folder, road={"kind": "cobblestones", "datum": "mean"})
    assert "20 % above the 4" in text
    assert "held at its static height" in text and "with a body_mass keeps the load" in text


def explained(folder: Path, **scene: dict) -> str:
    with Results(folder, scene) as results:
        return mean_load(results)


SPRUNG = {"kind": "corner", "locked": ["x", "y"], "body_mass": 400.0}
GROUND = {"kind": "corner", "locked": ["x", "y"]}
RAMP = {"kind": "flat", "motion": {"kind": "ramp"}}


@pytest.mark.parametrize(
    ("scene", "said", "unsaid"),
    [
        ({"axle": SPRUNG, "road": {"kind": "sine"}}, "wheel and body have not come to rest", "held"),
        ({"axle": {"kind": "free"}, "road": {"kind": "sine"}}, "the wheel has not come to rest", "held"),
        ({"axle": GROUND, "road": {"kind": "sine"}}, "follows the mean height of the road, in a longer", "to rest;"),
        ({"axle": SPRUNG | {"locked": ["z"]}, "road": {"kind": "sine"}}, "axle is held", "to rest;"),
        ({"road": RAMP}, "on this flat road it comes from its motion (road.motion).", "settling"),
        ({"axle": GROUND, "road": RAMP}, "it comes from its motion", "settling"),
        ({"road": {"offset": 1e-3}, "pattern": {"pitches": 60}}, "(road.offset) and the grooves", "settling"),
        ({"road": {"motion": {"kind": "none"}}}, "settling on the points' grid", "it comes from"),
    ],
)  # fmt: skip
def test_the_reason_is_that_of_axle_and_road(
    folder: Path, scene: dict, said: str, unsaid: str
) -> None:
    """On springs to the ground no run is long enough; a road that moves is no settling."""
    with sealed(folder / "contact.h5", "a") as file:
        file["total_force"][:, 2] *= 1.2
    text = explained(folder, **scene)
    assert said in text and unsaid not in text


def test_missing_files_are_no_remark(tmp_path: Path) -> None:
    with Results(tmp_path, {}) as results:
        assert unusual(results) is None
        assert mean_load(results) is None
