"""The response of fewer modes, from the small matrices of one with more, beside that of the finite elements."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from probed_torus import probed_torus

from tireroad.fem.errors import InputError
from tireroad.fem.tire.material import CONSTANT
from tireroad.fem.wheel import StrainEnergy, Turning
from tireroad.greens import coupling
from tireroad.greens.coupling import Basis, Wheel
from tireroad.greens.fewer_modes import of_fewer_modes
from tireroad.greens.responses import make_response
from tireroad.modal.basis import ModalBasis, project
from tireroad.modal.rolling import RollingModes
from tireroad.modal.rotation_shapes import with_rotation_shapes
from tireroad.runs import library

COMM = MPI.COMM_WORLD
DAMPING = (100.0, 0.0)


@pytest.fixture(scope="module")
def tire():
    """60 modes, loads at 9 x 5 points of the footprint."""
    return probed_torus(60, 9, 5)


def attached(tire, count: int, speed: float):
    """Response of so many modes with rotation shapes and attachment modes, and the modes with these, as the points see them."""
    operators, modes, probes = tire
    rotation = operators.rotation() if speed else None
    turning = Turning(speed=speed, damping=DAMPING)
    wheel = Wheel(
        operators=operators, rotation=rotation, speed=speed, damping=DAMPING, inertia="full"
    )
    few = modes.first(count)
    given = operators.carried, COMM
    few = with_rotation_shapes(few, project(few, rotation, *given), operators, rotation, turning)
    projection = project(few, rotation, *given)
    projection = replace(projection, shapes=len(few.squares) - count)
    shape = operators.trace(few.vectors)
    basis = Basis(shape=shape, projection=projection, states=wheel.decouple(projection, COMM))
    response, grown = wheel.respond_attached(basis.at(turning), few, probes, probes)
    seen = ModalBasis(
        frequency=grown.projection.frequency,
        shape=probes @ grown.shape,
        projection=grown.projection,
    )
    return response, RollingModes(basis=seen, states=grown.states, turning=turning)


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.parametrize("speed", [0.0, 30.0, 60.0])
def test_it_is_as_far_off_as_as_few_modes_on_the_finite_elements(tire, speed, monkeypatch):
    """In the band of the fewer modes the difference to the whole response is that of the finite elements' own, within a
    tenth; standing, states that are made static are twice as far off there and more."""
    monkeypatch.setattr(coupling, "FEW", 0)
    _, modes, probes = tire
    run, rolling = attached(tire, 60, speed)
    share = 0.5 * (modes.frequency[41] + modes.frequency[42]) / modes.frequency[59]
    few, _ = attached(tire, 42, speed)
    found, *_ = of_fewer_modes(
        run, rolling, rolling.basis.shape, probes, share, "attachment", (), COMM
    )
    frequency = np.linspace(0.0, 0.8 * share * modes.frequency[59], 12)
    whole = run.receptance(frequency)
    far, true = (np.linalg.norm(one.receptance(frequency) - whole) for one in (found, few))
    assert 0.9 < far / true < 1.1
    limits = 2 * np.pi * modes.frequency[59] * np.array([share, 1.0])
    static = run.keeping_where(lambda s: (np.abs(s) <= limits[0]) | (np.abs(s) > limits[1]))
    assert speed or np.linalg.norm(static.receptance(frequency) - whole) > 2 * true
    np.testing.assert_allclose(found.receptance(np.zeros(1)), whole[:1], rtol=1e-9, atol=1e-18)


def test_all_modes_or_none_are_refused(tire):
    run, rolling = attached(tire, 20, 0.0)
    for share in (1e-3, 1.5):
        with pytest.raises(InputError, match="far below"):
            of_fewer_modes(
                run, rolling, rolling.basis.shape, tire[2], share, "attachment", (), COMM
            )


def test_what_relaxes_stays_as_it_is(tire, monkeypatch):
    """Poles of slow rubber are those of the run, and what they add is not taken for flexibility at once."""
    monkeypatch.setattr(coupling, "FEW", 0)
    run, rolling = attached(tire, 30, 0.0)
    share = 0.5 * (tire[1].frequency[20] + tire[1].frequency[21]) / tire[1].frequency[29]
    given = rolling, rolling.basis.shape, tire[2], share, "attachment", (), COMM
    plain, *_ = of_fewer_modes(run, *given)
    into = np.full((1, run.residual.shape[1]), 3.0)
    output = np.full((len(run.residual), 1), 2e-7)
    slow, *_ = of_fewer_modes(run.with_slow(np.array([-5.0]), output, into), *given)
    assert slow.relaxing == 1 and slow.eigenvalue[-1] == -5.0
    assert np.allclose(slow.residual, plain.residual, rtol=1e-12, atol=0)
    frequency = np.array([0.0, 1.0, 40.0])
    added = output @ into / (5.0 + 2j * np.pi * frequency[:, None, None])
    off = slow.receptance(frequency) - plain.receptance(frequency) - added
    assert np.abs(off).max() < 1e-9 * np.abs(added).max()


@pytest.mark.long
@pytest.mark.parametrize("residual", ["static", "attachment"])
def test_static_shapes_have_the_moduli_beside_as_few_modes(residual):
    """Modes to 175 instead of 250 Hz make a rubber's g ~ f^0.1 outside them softer, by most of 3.5 %."""
    model = library.radial("205/60 R15", segments=8, elements_arc=6)
    static = library.press(model, inflation=2.2e5)
    turning = Turning(speed=72.0, damping=StrainEnergy())
    spots = [(a, b) for a in np.radians([-12.0, 0.0, 12.0]) for b in np.radians([-8.0, 8.0])]

    def made(up_to: float):
        standing = library.modes(model, static, up_to=up_to, turning=turning)
        tire = library.roll(standing, turning)
        probes, basis = tire._probes("at", spots), standing.basis
        given = lambda: tire.wheel, tire.states, probes, probes, residual, lambda: basis
        return make_response(*given), tire, probes

    whole, tire, probes = made(250.0)
    few, fewer, _ = made(250.0 * np.sqrt(0.5))
    rolling = whole.attached or tire.states
    kinds = [kind for kind, _ in tire.standing.motions.body.wall.kinds()]
    spectra = [kind.spectrum for kind in kinds if kind.spectrum != CONSTANT]
    share = fewer.states.highest / rolling.highest * 1.001
    readings = probes @ rolling.basis.shape
    found, *_ = of_fewer_modes(
        whole.response, rolling, readings, probes, share, residual, spectra, COMM
    )

    def at_rest(response) -> np.ndarray:
        kept = response.without_slow()
        return kept.static() + kept.residual

    own, told, true = (at_rest(one) for one in (whole.response, found, few.response))
    far = np.linalg.norm(true - own) / np.linalg.norm(own)
    assert 0.003 < far < 0.035
    print(far, np.linalg.norm(told - true) / np.linalg.norm(true - own))
    assert np.linalg.norm(told - true) < 0.25 * np.linalg.norm(true - own)
