"""`bench convergence`: what it compares, and with which scenes."""

import tomllib

import numpy as np
import pytest

from tireroad.runs.scene.load import load
from tireroad.runs.validation.tables import Table
from tireroad.tests.bench.accuracy import convergence, rough_road


@pytest.mark.long
def test_convergence_tells_what_each_change_costs(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(convergence, "DURATION", 0.03)
    finest = {"segments": 12, "arc": 6, "order": 2, "footprint": 0.5}
    base = {"modes": 24, "residual": "static", "pitch": 0.01, "step": 2e-4}
    changes = {"modes": ({"modes": 12},), "step": ({"step": 4e-4},)}
    found = convergence.table(tmp_path, "rough", finest, base, changes)
    assert [row[:3] for row in found.rows[:3]] == [
        ["converged", "", ""],
        ["modes", "modes 12", "contact"],
        ["modes", "modes 12", "axle"],
    ]
    assert all(row[3] > 0 for row in found.rows[1:])
    assert all(row[-1] > 0 for row in found.rows)  # those whose modes are reused too


def test_default_settings_are_a_scene_without_their_keys(tmp_path, monkeypatch) -> None:
    """What the bench calls so names no key that it compares, and keeps what is no setting."""
    taken = {}

    def run(folder, mesh, *sets, cache, **keys):
        folder.mkdir(parents=True)
        scene = rough_road.write_scene(folder / "given.toml", mesh, **keys)
        taken["scene"], taken["sets"] = tomllib.loads(scene.read_text()), sets

    monkeypatch.setattr(convergence, "rolled", run)
    keys = (dict.fromkeys(one) for one in (convergence.FINEST, convergence.BASE))
    convergence._rolled(tmp_path, "cleat", *keys, {"pitch": 0.004})
    scene = taken["scene"]
    assert scene["tire"] == {"material": {"youngs_modulus": 48e6}}
    assert scene["static"] == {"load": 500.0} and scene["rotation"] == {"speed": 50.0}
    assert scene["contact"] == {"points": {"dx": 0.004, "dy": 0.004}, "youngs_modulus": 1e7}
    assert scene["modal"] == scene["greens"] == {} and scene["time"] == {"duration": 0.16}
    assert taken["sets"] == ("static.error_estimate=false",)


def test_a_road_that_was_kept_is_not_run_again(tmp_path, monkeypatch) -> None:
    made = []

    def table(folder, road, *given) -> Table:
        made.append(road)
        return Table(road, [("cost", "s")], [["converged", 1.5]], ["note"])

    monkeypatch.setattr(convergence, "table", table)
    first, again = (convergence.run(tmp_path / "bench.kept") for _ in range(2))
    assert first == [table(tmp_path, road) for road in convergence.ROADS]
    assert [one.rows for one in again] == [one.rows for one in first]
    assert made == [*convergence.ROADS] * 2
    monkeypatch.setattr(convergence, "BASE", convergence.BASE | {"modes": 400})
    convergence.run(tmp_path / "bench.kept")
    assert len(made) == 9


@pytest.mark.parametrize("road", convergence.ROADS)
def test_the_scene_of_each_road_is_one(tmp_path, road) -> None:
    """A table of the texture's keys under another kind of road was refused."""
    keys = {"pitch": 0.004, "road": convergence.ROADS[road]}
    scene = load(
        rough_road.write_scene(tmp_path / "scene.toml", rough_road.Mesh(20, 8, 0.3), **keys)
    )
    assert scene.road.kind == tomllib.loads(convergence.ROADS[road])["kind"]


def test_bands_are_compared_where_both_have_them_and_force_is() -> None:
    centre = np.array([15.8, 100.0, 125.9, 158.5, 199.5])
    exact = centre, np.array([60.0, 20.0, 12.0, -11.0, np.nan])
    found = centre[1:], np.array([20.1, 11.6, -4.0, 3.0])
    assert convergence.levels(exact, found) == pytest.approx((0.4, 125.9, 7.0))
    assert np.isnan(convergence.levels((centre[:1], exact[1][:1]), found)).all()
