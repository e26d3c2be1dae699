"""States kept dynamic, and what their number costs."""

from dataclasses import replace

import numpy as np
import pytest
from systems import make

from tireroad.greens.response import keep, participation
from tireroad.greens.responses import Cutoff, estimate


def error(found, exact, frequency) -> np.ndarray:
    difference = found.receptance(frequency) - exact.receptance(frequency)
    return np.linalg.norm(difference, axis=(1, 2)) / np.linalg.norm(
        exact.receptance(frequency), axis=(1, 2)
    )


@pytest.fixture
def uneven():
    """Every second mode hardly moves the points: a tire's antisymmetric modes under its middle."""
    system = make(m=30, damping=10.0, speed=0.0)
    shape = system.shape * np.where(np.arange(30) % 2, 1.0, 0.02)
    response = type(system)(system.drag, system.stiffness, shape).response()
    return replace(response, momentum=1e-6 * response.momentum)


def momentum_rate(response):
    """The rate of momentum (3,) per force, as a response of its own."""
    output = response.momentum * response.eigenvalue**2
    none = np.zeros((3, response.input.shape[1]))
    return replace(response, output=output, block_output=none[:, :0], residual=none)


@pytest.mark.slow
@pytest.mark.parametrize("carried", [1e-6, 1.0])
def test_participation_is_what_making_static_loses(uneven, carried) -> None:
    """With little momentum the displacements decide, with much of it the axle force does."""
    band = 60.0
    frequency = np.linspace(0, band, 4001)
    whole = replace(uneven, momentum=1e6 * carried * uneven.momentum)
    forces = np.eye(whole.input.shape[1])
    still = np.linalg.norm(whole.static())
    found = participation(whole, band)
    for q in (0, 3, 8, 29):
        alone = np.arange(30) != q
        shares = []
        for seen, size in ((whole, still), (momentum_rate(whole), np.linalg.norm(forces))):
            lost = seen.receptance(frequency) - seen.keeping(alone).receptance(frequency)
            shares.append(np.linalg.norm(lost, axis=(1, 2)).max() / size)
        assert shares.index(max(shares)) == (0 if carried < 1e-3 else 1)
        assert found[q] == pytest.approx(max(shares), rel=0.02)


def test_choice_by_participation_beats_the_slowest(uneven) -> None:
    band = 60.0
    frequency = np.linspace(0, band, 301)
    slowest = np.argsort(np.abs(uneven.eigenvalue), kind="stable")[:10]
    first = uneven.keeping(np.isin(np.arange(30), slowest))
    chosen = keep(uneven, 10, band)
    assert len(first.eigenvalue) == len(chosen.eigenvalue) == 10
    assert error(chosen, uneven, frequency).max() < error(first, uneven, frequency).max() / 5


def test_static_limit_stays_and_all_states_are_nothing_new(uneven) -> None:
    zero = np.zeros(1)
    assert error(keep(uneven, 5, 60.0), uneven, zero)[0] < 1e-12
    assert keep(uneven, 30, 60.0) is uneven


@pytest.mark.parametrize("damping", [0.0, 20.0, 300.0])
def test_estimate_bounds_the_error_of_the_static_residual(damping) -> None:
    """Standing it is a bound, and not an empty one."""
    whole = make(m=30, points=6, speed=0.0, damping=damping).response()
    slow = np.argsort(np.abs(whole.eigenvalue.imag))
    kept = whole.keeping(np.isin(np.arange(len(whole.eigenvalue)), slow[:10]))
    circular = np.abs(kept.eigenvalue).max()
    frequency = np.linspace(0, circular / (4 * np.pi), 40)
    true = error(kept, whole, frequency)
    estimated = estimate(kept, "static", Cutoff(circular, damping), frequency)
    assert (true <= estimated + 1e-12).all()
    assert estimated.max() < 20 * true.max()


def test_estimate_without_residual_is_of_the_right_size() -> None:
    whole = make(m=60, points=6, speed=0.0, damping=20.0).response()
    kept = whole.keeping(np.abs(whole.eigenvalue) < 400)
    kept = type(kept)(**{**vars(kept), "residual": 0 * kept.residual})
    circular = np.abs(kept.eigenvalue).max()
    frequency = np.linspace(0, circular / (4 * np.pi), 40)
    true = error(kept, whole, frequency).max()
    estimated = estimate(kept, "none", Cutoff(circular, 20.0), frequency).max()
    assert true / 3 < estimated < true * 3
