"""The wave that stands at the critical speed makes K~ singular there, and more modes lower that speed."""

from __future__ import annotations

import numpy as np
import pytest

import tireroad as tr
from tireroad.modal.campbell import critical_speed, standing_wave
from tireroad.modal.standing import standing_modes


@pytest.mark.slow
def test_the_wave_stands(tmp_path) -> None:
    tire = tr.torus(youngs_modulus=48e6, segments=20, elements_arc=6, order=2)
    standing = tr.modes(tire, tr.press(tire, inflation=2e5, load=300.0), count=60)
    projection = standing_modes(standing.motions, count=60).projection
    speed, wave = standing_wave(projection, "full")
    stiff = np.diag(projection.squares) + speed**2 * projection.convective
    assert np.linalg.norm(stiff @ wave) < 1e-8 * np.linalg.norm(projection.squares * wave)
    assert critical_speed(projection, "full") == speed
    speeds = [critical_speed(projection.first(count), "full") for count in (20, 40, 60)]
    assert speeds[0] >= speeds[1] >= speeds[2] == speed
