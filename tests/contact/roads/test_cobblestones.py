"""Generated cobblestones: repeatable, continuous, endless, and shaped as their sizes say."""

from dataclasses import replace

import numpy as np
import pytest

from tireroad.contact.roads.kinds.cobblestones import Cobblestones
from tireroad.fem.errors import InputError

BLOCKS = Cobblestones(
    block_length=0.10,
    block_width=0.08,
    joint_width=0.01,
    joint_depth=0.012,
    edge_radius=0.005,
    height_scatter=0.002,
    seed=4,
)


def test_same_seed_same_road_other_seed_another() -> None:
    x, y = np.random.default_rng(0).uniform(-50, 50, (2, 2000))
    first = BLOCKS.make().height(x, y)
    assert np.array_equal(first, BLOCKS.make().height(x, y))
    assert not np.allclose(first, replace(BLOCKS, seed=5).make().height(x, y))


def test_prepared_strip_is_the_same_road() -> None:
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-3, 7, 5000), rng.uniform(-0.3, 0.2, 5000)
    road = BLOCKS.make()
    assert np.array_equal(road.prepare(-3, 7, -0.3, 0.2).height(x, y), road.height(x, y))


def test_heights_of_top_edge_and_joint() -> None:
    blocks = replace(BLOCKS, height_scatter=0.0, stagger=False)
    road = blocks.make()
    pitch, y = 0.11, np.full(5, 0.045)
    # Middle, plateau's end, half the edge radius, block's side, joint's middle.
    x = 3 * pitch + np.array([0.055, 0.1, 0.1025, 0.105, 0.11])
    drop = 0.005 - np.sqrt(0.005**2 - 0.0025**2)
    expected = [0.0, 0.0, -drop, -0.005, -0.012]
    assert np.allclose(road.height(x, y), expected, atol=1e-12)


def test_stagger_shifts_every_second_row_by_half_a_block() -> None:
    road = replace(BLOCKS, height_scatter=0.0).make()
    y = np.linspace(0.0, 0.4, 300)
    even, odd = road.height(np.full(300, 0.055), y), road.height(np.full(300, 0.165), y + 0.045)
    assert np.allclose(even, odd, atol=1e-12)
    assert not np.allclose(even, road.height(np.full(300, 0.165), y), atol=1e-4)


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2, 2.2])
def test_continuous_along_any_line(angle: float) -> None:
    s = np.linspace(0.0, 0.5, 400_001)
    z = BLOCKS.make().height(0.013 + s * np.cos(angle), 0.007 + s * np.sin(angle))
    # The edge's circle ends upright: over ds it falls by sqrt(2 r ds) at most.
    assert np.abs(np.diff(z)).max() < 1.5 * np.sqrt(2 * 0.005 * (s[1] - s[0]))


def test_scatter_has_its_deviation_and_stays_within_three() -> None:
    blocks = replace(BLOCKS, stagger=False)
    i, j = np.meshgrid(np.arange(-150, 150), np.arange(-150, 150), indexing="ij")
    tops = blocks.make().height((i + 0.5) * 0.11, (j + 0.5) * 0.09)
    assert np.abs(tops).max() <= 3 * 0.002
    # A normal distribution cut at three sigmas keeps 0.9866 of its deviation.
    assert tops.std() == pytest.approx(0.9866 * 0.002, rel=0.01)
    assert abs(tops.mean()) < 5 * 0.002 / 300
    neighbours = np.corrcoef(tops[:-1].ravel(), tops[1:].ravel())[0, 1]
    assert abs(neighbours) < 5 / 300


def test_far_away_costs_nothing() -> None:
    road = BLOCKS.make().prepare(1e6, 1e6 + 3.0, -0.1, 0.1)
    z = road.height(np.linspace(1e6, 1e6 + 3, 1000), np.zeros(1000))
    assert -0.012 <= z.min() < z.max() <= 0.006


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joint_width": 0.0}, "joint_width"),
        ({"block_length": -1.0}, "block_length"),
        ({"edge_radius": 0.05}, "half a block"),
        ({"height_scatter": 0.005}, "third of joint_depth"),
        ({"height_scatter": np.nan}, "height_scatter"),
    ],
)
def test_refuses(change: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(BLOCKS, **change)
