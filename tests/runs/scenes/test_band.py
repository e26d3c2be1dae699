"""What accuracy.up_to alone chooses, and what it leaves to a scene that says it."""

from pathlib import Path

import numpy as np

from tireroad.runs.scene.load import load

NOISE = Path(__file__).parents[3] / "runs/scenes/noise.toml"


def test_the_band_chooses_what_a_scene_leaves_open() -> None:
    scene = load(NOISE)
    edge = 1122.0  # Hz: of the third octave of 1 kHz
    assert scene.modes.up_to >= edge / 0.8
    assert scene.rotation.shape_tolerance == 0.01
    assert 15.5 < 1 / (edge * scene.time.step) < 16.5
    assert scene.time.scheme == "damped"
    assert scene.contact.points.dx == scene.contact.points.dy == 0.003  # m: 22.5 m/s / 1 kHz / 8


def test_the_passing_of_the_points_is_not_heard() -> None:
    """2.8 mm, eight to the wave, pass at 7.9 kHz, which steps of 112 us of a companion take for 1.06 kHz."""
    scene = load(NOISE)
    speed = 71.9 * 0.3066  # m/s, of the rolling radius
    for step in (scene.time.step, 2 * scene.time.step):
        for passing in (speed / scene.contact.points.dx, speed / 2 / scene.contact.points.dx):
            for f in passing * np.arange(1, 4):
                assert abs(f - round(f * step) / step) > 1122, (step, f)


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
