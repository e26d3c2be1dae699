"""Where an answer ends in frequency: modes, points that pass, steps."""

from types import SimpleNamespace

import numpy as np
import pytest

from tireroad.contact.results.spectra import limits, lowest, pitch


@pytest.mark.parametrize(
    ("changed", "frequency", "cause"),
    [
        ({}, 320.0, "highest mode"),
        ({"highest": 4000.0}, 1500.0, "passing frequency of the contact points, 3000 Hz"),
        ({"highest": 4000.0, "speed": 0.0}, 3200.0, "highest mode"),
        ({"highest": 4000.0, "speed": 0.0, "step": 1e-3}, 500.0, "time step"),
    ],
)
def test_the_lowest_of_all_counts_and_says_what_it_is(changed, frequency, cause):
    given = {"step": 1e-4, "highest": 400.0, "pitch": 0.005, "speed": 15.0} | changed
    limit = lowest(limits(**given))
    assert limit.frequency == pytest.approx(frequency)
    assert cause in limit.cause


def test_the_pitch_is_of_the_points_that_touch():
    sizes = np.array([[0.004, 0.1], [0.002, 0.1], [0.003, 0.1]])
    patch = SimpleNamespace(force=np.array([0.0, 1.0, 2.0]), half_sizes=sizes)
    assert pitch(patch) == pytest.approx(0.006)
    patch.force = np.zeros(3)
    assert pitch(patch) == pytest.approx(0.008)
