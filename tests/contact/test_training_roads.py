"""The roads of a training reach as far as the standing tire meets the road of its run."""

from types import SimpleNamespace

import numpy as np
import pytest

from tireroad.contact.training_roads import LEAST, PITCH, TrainingRoads

RADIUS, DEEP, WIDE = 0.31, 0.01, 0.06  # m
BEFORE, LENGTH, TRAVEL = 0.25, 0.05, 0.3  # m


def standing(height: float, lift: float = 0.0) -> SimpleNamespace:
    """A round tire, 10 mm deep in a level road, that rolls to a bar of a `height`."""
    x, y = np.linspace(-0.2, 0.2, 201), np.linspace(-0.05, 0.05, 11)
    places = np.stack([part.ravel() for part in np.meshgrid(x, y, indexing="ij")], axis=1)
    gap = np.maximum(places[:, 0] ** 2 / (2 * RADIUS) - DEEP, 0.0)
    gap += np.maximum(np.abs(places[:, 1]) - 0.03, 0.0) ** 2 / WIDE

    def heights(x, y):
        return np.where((x >= BEFORE) & (x <= BEFORE + LENGTH), height, 0.0)[:, None] + 0.0 * y

    return SimpleNamespace(
        patch=SimpleNamespace(points=np.column_stack([places, gap]), gap=gap),
        rolled=SimpleNamespace(travel=TRAVEL, lift=lift),
        heights=heights,
    )


def meets(height: float) -> float:
    """x (m) of the foremost point under which a bar touches the tire."""
    return float(np.sqrt(2 * RADIUS * (DEEP + height)))


@pytest.mark.parametrize("height", [0.002, 0.01, 0.025])
def test_a_bar_is_trained_from_where_the_tire_meets_it(height):
    roads = TrainingRoads.of(standing(height))
    assert roads.reach[0] >= meets(height) - PITCH[0]
    first = roads.ways()[0]
    assert BEFORE - first >= meets(height) - PITCH[0]
    under = roads.under(first)
    assert under.largest == pytest.approx(height)
    assert under.x[0] <= -meets(height) + PITCH[0]


@pytest.mark.parametrize("height", [0.002, 0.01, 0.025])
def test_runs_begin_before_the_bar_is_met(height):
    setup = standing(height)
    way, last = TrainingRoads.of(setup).passage()
    x, y = setup.patch.points[:, 0], np.zeros(1)
    assert way > 0.0
    assert (setup.heights(x + way, y)[:, 0] - setup.patch.gap).max() <= LEAST
    assert last >= BEFORE + meets(height)


def test_a_hole_and_a_low_road_reach_as_far_as_before():
    hole, level = (TrainingRoads.of(standing(height)) for height in (-0.03, 0.0))
    assert hole.met == level.met
    assert level.passage() == (0.0, 0.0)


def test_a_road_that_rises_is_trained_on_all_the_tire_that_it_meets():
    """From the first touch on the footprint grows to several times its length."""
    still, lifted = (TrainingRoads.of(standing(0.0, lift)) for lift in (0.0, 0.02))
    assert lifted.reach[0] >= meets(0.02) - PITCH[0] > still.reach[0]
    assert lifted.reach[1] > still.reach[1] - PITCH[1]
