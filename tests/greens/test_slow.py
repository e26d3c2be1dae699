"""Slow motions and the slow moduli of rubber: static flexibility, what lies between, passivity, and energy."""

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.results.energy import Relaxed, Work
from tireroad.fem.matrices.compliance import add_part, compliance
from tireroad.fem.tire.material import Kind, power_law
from tireroad.fem.wheel import StrainEnergy, Turning
from tireroad.greens.recursion import Recursion, marched
from tireroad.greens.response import Response, keep
from tireroad.runs import library

SPOTS = [(a, b) for a in np.radians([-12.0, 0.0, 12.0]) for b in np.radians([-8.0, 8.0])]


@cache
def tire(shared: bool = False) -> library.Standing:
    """A coarse passenger tire, inflated, of this process alone or `shared` by all."""
    comm = MPI.COMM_WORLD if shared else MPI.COMM_SELF
    model = library.radial("205/60 R15", segments=8, elements_arc=6, comm=comm)
    static = library.press(model, inflation=2.2e5)
    return library.modes(
        model, static, up_to=250.0, turning=Turning(speed=72.0, damping=StrainEnergy())
    )


@cache
def response(speed: float, residual: str = "static", shared: bool = False) -> Response:
    turning = Turning(speed=speed, damping=StrainEnergy())
    return library.roll(tire(shared), turning).at(SPOTS, residual)


def at_rest(found: Response) -> np.ndarray:
    return found.static() + found.residual


def of_moduli(frequency: float) -> np.ndarray:
    """Static flexibility of the same points, of all finite elements, storage moduli of a frequency, Hz."""
    standing = tire()
    operators, rolling = (
        standing.motions.operators,
        library.roll(standing, Turning(damping=StrainEnergy())),
    )
    stiffness = operators.stiffness.copy()
    for part in operators.compounds():
        modulus = part.kind.slow_modulus(np.array([frequency]), standing.basis.frequency[0])[0]
        add_part(stiffness, modulus - 1, part.stiffness)
    probes = rolling._probes("at", SPOTS)
    return compliance(operators, stiffness, probes, probes)


def off(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


def test_moduli_of_slow_motions_end_at_those_of_the_static_state():
    """A power law down to the static modulus, which it has below LOADING in any case and never exceeds."""
    frequency = np.array([0.0, 0.01, 1.0, 10.0, 100.0, 1000.0])
    law = power_law(0.1)
    found = Kind(law, 0.2, 1 / 1.5).slow_modulus(frequency, 50.0)
    np.testing.assert_allclose(found, [1 / 1.5, 1 / 1.5, 1 / 1.5, 10**-0.1, 1.0, 10**0.1])
    soft = Kind(law, 0.2, 0.1).slow_modulus(frequency, 50.0)
    np.testing.assert_allclose(soft, [0.1, 0.1, 10**-0.2, 10**-0.1, 1.0, 10**0.1])
    stiff = Kind(law, 0.2, 1.0).slow_modulus(frequency, 50.0)
    np.testing.assert_allclose(stiff, [0.5**0.1] * 4 + [1.0, 10**0.1])


@pytest.mark.slow
@pytest.mark.parametrize("residual", ["static", "attachment"])
def test_at_rest_a_standing_tire_has_its_static_moduli(residual):
    """All finite elements with static moduli: 0.2 %, 10 % and more stiffer without."""
    found, exact = response(0.0, residual), of_moduli(0.0)
    assert found.relaxing
    assert off(at_rest(found), exact) < 2e-3
    assert off(at_rest(found.without_slow()), exact) > 0.1


@pytest.mark.slow
def test_slower_than_the_modes_the_moduli_are_those_of_the_frequency():
    """Storage moduli of 0.5 to 8 Hz by all finite elements, which steps of half a decade have within 2 %."""
    found = response(0.0)
    for frequency in (0.5, 2.0, 8.0):
        moved = found.receptance(np.array([frequency]))[0].real
        assert off(moved, of_moduli(frequency)) < 0.02, frequency


@pytest.mark.slow
def test_at_all_frequencies_it_is_nearer_to_complex_moduli():
    """All finite elements with the complex moduli of each frequency, from below the lowest mode to 200 Hz."""
    found, frequency = response(0.0), np.array([15.0, 30.0, 100.0, 200.0])
    rolling = library.roll(tire(), Turning(damping=StrainEnergy()))
    probes = rolling._probes("at", SPOTS)
    exact = rolling.wheel.receptance(probes, probes, frequency)
    with_slow, without = (one.receptance(frequency) for one in (found, found.without_slow()))
    errors = [
        (off(one, right), off(other, right))
        for one, other, right in zip(with_slow, without, exact, strict=True)
    ]
    assert all(one < other for one, other in errors)
    assert errors[0][0] < 0.5 * errors[0][1]


@pytest.mark.slow
def test_a_rolling_tire_is_the_stiffer_the_faster_between_rest_and_its_modes():
    """In every combination of the forces; and the slower it rolls the nearer to rest."""
    flexibilities = [at_rest(response(speed)) for speed in (0.0, 0.1, 20.0, 72.0)]
    softness = [np.trace(one) for one in flexibilities]
    assert (np.diff(softness[1:]) < 0).all()
    assert off(flexibilities[1], flexibilities[0]) < 0.01
    for speed in (20.0, 72.0):
        whole = response(speed)
        gained = at_rest(whole) - at_rest(whole.without_slow())
        assert np.linalg.eigvalsh((gained + gained.T) / 2)[0] > -1e-12 * np.trace(gained)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.0, 72.0])
def test_slow_rubber_only_stores_and_loses(speed):
    """Output and input of every pole are one vector: springs and dashpots."""
    found = response(speed)
    own = found.of_modes.stop
    rate, output, push = -found.eigenvalue[own:], found.output[:, own:], found.input[own:]
    assert (rate.real > 0).all()
    assert not rate.imag.any()
    np.testing.assert_allclose(push.T / rate, output, atol=1e-12 * np.abs(output).max())
    assert not found.momentum[:, own:].any()


@pytest.mark.parametrize("scheme", ["linear", "damped", "constant"])
def test_energy_of_slow_rubber_adds_up(scheme):
    """Work on springs with dashpots is what they hold and lose, of second order in the step."""
    random = np.random.default_rng(0)
    rate, shape = np.array([5.0, 60.0, 300.0]), random.normal(size=(2, 3))
    found = Response(
        eigenvalue=-rate.astype(complex),
        output=shape.astype(complex),
        input=(rate[:, None] * shape.T).astype(complex),
        block=np.zeros((0, 0)),
        block_output=np.zeros((2, 0)),
        block_input=np.zeros((0, 2)),
        residual=np.zeros((2, 2)),
        momentum=np.zeros((3, 3)),
        block_momentum=np.zeros((3, 0)),
        relaxing=3,
    )
    imbalance = []
    for steps in (200, 400):
        step = 0.2 / steps
        time = step * np.arange(1, steps + 1)[:, None]
        force = np.sin(np.array([30.0, 80.0]) * time) + 0.3
        march, work = (
            Recursion(response=found, step=step, scheme=scheme, comm=MPI.COMM_SELF),
            Work(scheme),
        )
        march.start_steady(np.zeros(2))
        march.keep_samples()
        counted, moved = Relaxed(rate, step, scheme), []
        for f in force:
            free = march.predict()
            march.advance(f)
            moved.append(free + march.same_step @ f)
        work.add(force, np.array(moved))
        states, pushes, _, _ = map(np.array, zip(*march.samples(), strict=True))
        for first in range(0, steps, 37):
            some = slice(first, first + 37)
            counted.add(states[some].real, pushes[some].real)
        given = work.total + work.lead
        held = Relaxed.held(states[-1].real)
        assert counted.lost > 0.1 * given
        imbalance.append(abs(given - held - counted.lost) / given)
        blocks = list(marched(found, step, scheme, np.zeros(2), [force]))
        np.testing.assert_allclose(blocks[0], moved, atol=1e-12)
    assert imbalance[1] < 2e-3
    assert imbalance[1] < 0.35 * imbalance[0] or imbalance[1] < 1e-6


@pytest.mark.slow
def test_without_moduli_over_frequency_there_is_nothing_slow():
    """A torus of one modulus."""
    model = library.torus(segments=8, elements_arc=4)
    static = library.press(model, inflation=1e5)
    rolling = library.roll(library.modes(model, static, count=10), Turning(damping=(500.0, 0.0)))
    found = rolling.at([(0.0, 0.0)])
    assert found.relaxing == 0
    assert found.without_slow().static() == pytest.approx(found.static())


@pytest.mark.slow
def test_a_selection_of_states_keeps_what_relaxes():
    """Fewer dynamic states, or a longer step, and parts of the points."""
    found = response(72.0)
    fewer = keep(found, 20, 100.0)
    assert fewer.relaxing == found.relaxing
    assert len(fewer.eigenvalue) == 20 + found.relaxing
    np.testing.assert_allclose(
        at_rest(fewer), at_rest(found), atol=1e-9 * np.abs(at_rest(found)).max()
    )
    slowest = found.resolved(1.0)
    assert slowest.relaxing < found.relaxing
    np.testing.assert_allclose(
        at_rest(slowest), at_rest(found), atol=1e-9 * np.abs(at_rest(found)).max()
    )
    some = found.between(slice(3), slice(3))
    assert some.relaxing == found.relaxing


@pytest.mark.mpi
@pytest.mark.parametrize("speed", [0.0, 72.0])
def test_the_same_on_any_number_of_processes(speed):
    """Receptances of a tire shared by all processes, and of this process alone; and each process has the same poles."""
    alone, shared = response(speed), response(speed, shared=True)
    frequency = np.array([0.1, 2.0, 30.0])
    exact, found = (one.receptance(frequency) for one in (alone, shared))
    assert np.abs(found - exact).max() < 1e-6 * np.abs(exact).max()
    poles = np.concatenate([shared.eigenvalue, shared.output.ravel()])
    assert np.array_equal(MPI.COMM_WORLD.bcast(poles), poles)
