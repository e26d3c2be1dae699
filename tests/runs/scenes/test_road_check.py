"""What `check` says of a road before anything is solved, and that `run` says the same."""

from pathlib import Path

import numpy as np
import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.check import explain
from tireroad.runs.scene.load import load
from tireroad.runs.scene.rules import foot, within_run_in

SCENE = """
[static]
load = 500
[rotation]
speed = 50
[contact]
[road]
kind = "grid"
file = "road.npz"
[time]
duration = 0.1
"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    x, y = np.arange(0.0, 2.0, 0.01), np.arange(-0.2, 0.2, 0.01)
    np.savez(tmp_path / "road.npz", x=x, y=y, z=np.zeros((len(x), len(y))))
    (tmp_path / "scene.toml").write_text(SCENE)
    return tmp_path / "scene.toml"


def test_a_road_that_is_long_enough_passes(scene: Path) -> None:
    """0.1 s at 50 rad/s of 0.32 m: 1.6 m."""
    assert "contact" in explain(load(scene))
    explain(load(scene, ["time.duration=1.0", "road.end=mirror"]))


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("time.duration=0.2", ["2.72 m", "1.99 m", "mirror"]),
        ("road.start=1.0", ["x = 1 to", "[road] start"]),
        ("road.start=-0.6", ["x = -0.6 to", "has 0 to 1.99 m"]),
        ("road.lateral=0.5", ["road.lateral = 0.5 m", "-0.2 to 0.19"]),
    ],
)
def test_a_road_that_is_too_short_is_said_by_check(scene: Path, override, words) -> None:
    with pytest.raises(InputError) as caught:
        explain(load(scene, [override]))
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("end", ["refuse", "mirror"])
def test_check_says_where_a_file_without_x_zero_is_begun(scene: Path, end: str) -> None:
    told = "road: the axle starts at x = 100 m"
    override = [f"road.end={end}"]
    assert told not in explain(load(scene, override))
    x, y = np.arange(100.0, 102.0, 0.01), np.arange(-0.2, 0.2, 0.01)
    np.savez(scene.parent / "road.npz", x=x, y=y, z=np.zeros((len(x), len(y))))
    assert told in explain(load(scene, override))
    assert told not in explain(load(scene, [*override, "road.start=100.1"]))


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["position=3.0"], True),
        (["position=1.0"], False),
        (["position=3.0", "start=2.0"], False),
        (["position=3.0", "drum_radius=1.0"], False),  # met in every turn of 6.28 m
        (["position=30.0", "start=5.0"], True),
    ],
)
def test_check_says_that_a_cleat_is_out_of_reach(scene: Path, more: list[str], said: bool) -> None:
    text = SCENE.replace('"grid"', '"cleat"').replace('file = "road.npz"\n', "")
    scene.write_text(text.replace("speed = 50", "speed = 50\nrolling_radius = 0.3"))
    told = explain(load(scene, [f"road.{one}" for one in more]))
    assert ('warning: the road (kind = "cleat") has no relief under the run' in told) == said


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["position=0.07"], True),
        (["position=0.07", "run_in=0"], False),
        (["position=0.6"], False),
        (["position=0.07", "start=-1"], False),
        (["position=0.07", "drum_radius=1.0"], False),  # met whole in the next turn
    ],
)
def test_check_says_that_a_cleat_lies_in_the_run_in(
    scene: Path, more: list[str], said: bool
) -> None:
    text = SCENE.replace('"grid"', '"cleat"').replace('file = "road.npz"\n', "")
    scene.write_text(text.replace("speed = 50", "speed = 50\nrolling_radius = 0.3"))
    told = explain(load(scene, [f"road.{one}" for one in more]))
    assert ("warning: the cleat at x = 0.07 m lies in the run-in" in told) == said


def test_without_a_run_in_a_cleat_under_the_tire_is_said_to_be_met_as_a_step(scene: Path) -> None:
    """It was said to lie in a run-in of 0 m, to be shortened."""
    text = SCENE.replace('"grid"', '"cleat"').replace('file = "road.npz"\n', "")
    scene.write_text(text)
    road = load(scene, ["road.run_in=0", "road.position=0.05"]).road
    told = within_run_in(road, 0.05, 0.0)
    assert "0.05 m" in told and "as a step" in told and "run_in" not in told


def test_a_road_without_edges_has_no_foot(scene: Path) -> None:
    """NaN for one lay "in the run-in" of every road without a run-in."""
    assert foot(load(scene, ["road.run_in=0"]).road) is None


@pytest.mark.parametrize("holes", ["refuse", "fill"])
def test_heights_that_are_missing_are_said_by_check(scene: Path, holes: str) -> None:
    """Without any, the estimate ended in a traceback; one was told of after static state and modes."""
    x, y = np.arange(0.0, 2.0, 0.01), np.arange(-0.2, 0.2, 0.01)
    z = np.zeros((len(x), len(y)))
    z[80, 20] = np.nan
    np.savez(scene.parent / "road.npz", x=x, y=y, z=z)
    if holes == "fill":
        explain(load(scene, ["road.holes=fill"]))
    else:
        with pytest.raises(InputError, match=r"1 heights are missing .* x = 0\.8 m"):
            explain(load(scene))
    np.savez(scene.parent / "road.npz", x=x, y=y, z=np.full_like(z, np.nan))
    with pytest.raises(InputError, match="missing|no valid height"):
        explain(load(scene, [f"road.holes={holes}"]))


def test_check_opens_the_file(scene: Path) -> None:
    (scene.parent / "road.npz").write_bytes(b"PK\x03\x04 no more")
    with pytest.raises(InputError, match=r"road\.npz: cannot be read"):
        explain(load(scene))


@pytest.mark.slow
def test_run_refuses_before_it_solves(scene: Path, launch, tmp_path: Path) -> None:
    done = launch(
        *("-m", "runs", "run", scene, "--out", tmp_path / "out", "--set", "time.duration=0.2")
    )
    assert done.returncode == 2 and "2.72 m" in done.stderr
    assert not list((tmp_path / "out").glob("*.h5"))


@pytest.mark.parametrize(
    ("road", "said"),
    [
        ('kind = "sine"\namplitude = 2e-3\nwavelength = 0.05', True),
        ('kind = "cleat"\nposition = 0.07', True),
        ('kind = "flat"\noffset = 3e-3', True),
        ('kind = "flat"', False),
    ],
)
def test_check_says_that_a_standing_wheel_meets_no_heights(
    scene: Path, road: str, said: bool
) -> None:
    """They stayed in the run-in for ever, without a word; of a cleat the position was blamed."""
    text = SCENE.replace('kind = "grid"\nfile = "road.npz"', road).replace(
        "speed = 50", "speed = 0"
    )
    scene.write_text(text)
    told = explain(load(scene, []))
    assert ("warning: the wheel stands" in told) == said
    assert "no relief" not in told


def test_the_log_holds_what_was_read_as_what(scene: Path, capsys: pytest.CaptureFixture) -> None:
    """One table for check and run: columns, units, codes, and what was assumed."""
    x, y = np.arange(0.0, 2000.0, 10), np.arange(-200.0, 200.0, 10)
    z = np.round(np.random.default_rng(1).normal(0, 1, (len(x), len(y))), 3)
    z[100, 5] = -9999
    X, Y = np.meshgrid(x, y, indexing="ij")
    rows = "\n".join(
        f"{a};{b};{c}" for a, b, c in zip(X.ravel(), Y.ravel(), z.ravel(), strict=True)
    )
    (scene.parent / "road.csv").write_text("# NODATA_value -9999\nx [mm];y [mm];Höhe (mm)\n" + rows)
    told = explain(load(scene, ["road.file=road.csv", "road.holes=fill"]))
    table = told[told.index("files: what was read as what") :].splitlines()
    assert (
        table[2].split()[:4] == ["road.csv", "x", "column", "1"]
        and 'mm (heading "x [mm]")' in table[2]
    )
    assert 'mm (heading "Höhe (mm)")' in table[4] and "no height: -9999" in table[4]
    assert "x and y and heights in m: assumed" in explain(load(scene))
