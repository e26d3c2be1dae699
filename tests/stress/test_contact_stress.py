"""The stress list of `validate stability`, each case over its first steps: whole, or refused with a reason."""

from dataclasses import replace

import numpy as np
import pytest

from contact.synthetic import Strip
from runs.validation.stability import _one_mode, _row, cases

CASES = [replace(case, steps=min(case.steps, 400)) for case in cases()]


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_case_ends_whole_or_refused(case) -> None:
    name, steps, ended, *_ = _row(case)
    if "critical" in name and case.strip.speed > 60:
        assert ended == "whole" or "positive definite" in ended or "without bound" in ended
    else:
        assert ended == "whole"


def test_one_mode_one_point() -> None:
    assert _one_mode()[2] == "whole"


def test_overdamped_strip_has_its_own_static_answer() -> None:
    """Poles and static flexibility of the made-up tire agree whatever its damping."""
    points = np.array([[0.0, 0.0, 0.0], [0.03, 0.02, 0.0]])
    soft = Strip(damping=1.0).response(points, 4, 3).static()
    for damping in (100.0, 2e3, 1e5):
        hard = Strip(damping=damping).response(points, 4, 3)
        assert np.allclose(hard.static(), soft, rtol=1e-5, atol=0)
        # A unit impulse starts with the rate 1/m of the kept waves: g'(0) = Re[C s P].
        rate = ((hard.output * hard.eigenvalue) @ hard.input).real
        light = Strip(damping=1.0).response(points, 4, 3)
        assert np.allclose(rate, ((light.output * light.eigenvalue) @ light.input).real)
