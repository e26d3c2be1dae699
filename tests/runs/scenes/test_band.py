"""What accuracy.up_to alone chooses, and what it leaves to a scene that says it."""

from pathlib import Path

from tireroad.runs.scene.load import load

NOISE = Path(__file__).parents[3] / "runs/scenes/noise.toml"


def test_the_band_chooses_what_a_scene_leaves_open() -> None:
    scene = load(NOISE)
    edge = 1122.0  # Hz: of the third octave of 1 kHz
    assert scene.modes.up_to >= edge / 0.8
    assert scene.rotation.shape_tolerance == 0.01
    assert 15.5 < 1 / (edge * scene.time.step) < 16.5
    assert scene.time.scheme == "damped"
    assert scene.contact.points.dx == scene.contact.points.dy == 0.0028  # m: 22.5 m/s / 1 kHz / 8


def test_what_the_scene_says_stays() -> None:
    given = ["modal.up_to=600", "rotation.shape_tolerance=0.03", "time.step=1e-4"]
    scene = load(NOISE, [*given, "time.scheme=linear", "accuracy.up_to=400"])
    assert scene.modes.up_to == 600 and scene.rotation.shape_tolerance == 0.03
    assert scene.time.step == 1e-4 and scene.time.scheme == "linear"
    assert scene.contact.points == "auto"  # the nodes lead to points as close as such waves need
    assert scene.tire.segments == 24  # a mesh for that band, which it did not give


def test_without_it_nothing_is_chosen() -> None:
    scene = load(NOISE, ["accuracy.up_to="])
    assert scene.modes.up_to is None and scene.time.step == "auto" and scene.time.scheme == "auto"
    assert scene.rotation.shape_tolerance == 0.002
