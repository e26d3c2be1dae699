"""Green's functions in time and frequency against the full equations of small systems."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import linalg
from systems import make

from tireroad.fem.errors import ConvergenceError, NearlySingular
from tireroad.greens import responses
from tireroad.greens.response import RESOLVED

TIMES = np.array([0.0, 1e-4, 3e-3, 0.02, 0.1])


def matrix_exponential(system, times):
    return np.stack(
        [system.reading @ linalg.expm(system.companion * t) @ system.push for t in times]
    )


@pytest.mark.parametrize("speed", [0.0, 30.0, 90.0])
def test_impulse_is_the_matrix_exponential(speed) -> None:
    system = make(speed=speed)
    exact = matrix_exponential(system, TIMES)
    g = system.response().impulse(TIMES)
    assert np.abs(g - exact).max() < 1e-9 * np.abs(exact).max()
    assert np.abs(g[0]).max() < 1e-12 * np.abs(exact).max()


def test_impulse_is_reciprocal_under_reversed_rotation() -> None:
    """g_ij(Omega) = g_ji(-Omega); at one Omega alone the wheel is not reciprocal."""
    system = make(speed=60.0)
    forth = system.response().impulse(TIMES)
    back = system.reversed().response().impulse(TIMES)
    size = np.abs(forth).max()
    assert np.abs(forth - back.transpose(0, 2, 1)).max() < 1e-10 * size
    assert np.abs(forth - forth.transpose(0, 2, 1)).max() > 1e-3 * size


def test_impulse_is_the_inverse_transform_of_the_receptance() -> None:
    """Agreement to 1e-4 away from t = 0, and at t = 0 as far as the band goes.

    What is left has one reason: H falls as g'(0) / (i omega)^2, and the samples end at the Nyquist
    frequency. The missing tail adds up to g'(0) step / pi^2 at t = 0 and cancels from there as 1/t^2.
    """
    system = make(damping=60.0)
    response = system.response()
    n, step = 1 << 15, 1.0 / (1 << 15)  # e^{-30} at the end: nothing wraps around
    H = response.receptance(np.fft.rfftfreq(n, step))
    transformed = np.fft.irfft(H, n, axis=0)[: n // 4] / step
    g = response.impulse(step * np.arange(n // 4))
    error, size = np.abs(transformed - g), np.abs(g).max()
    assert error[10:].max() < 1e-4 * size
    tail = system.shape @ system.shape.T * step / np.pi**2
    assert np.abs(transformed[0] - tail).max() < 0.05 * np.abs(tail).max()


def test_receptance_inverts_the_dynamic_stiffness() -> None:
    system = make(speed=60.0)
    frequency = np.array([0.0, 10.0, 40.0, 200.0])
    H = system.response().receptance(frequency)
    for found, omega in zip(H, 2 * np.pi * frequency, strict=True):
        dynamic = system.stiffness + 1j * omega * system.drag - omega**2 * np.eye(len(system.drag))
        exact = system.shape @ np.linalg.solve(dynamic, system.shape.T)
        assert np.abs(found - exact).max() < 1e-11 * np.abs(exact).max()


def test_static_limit_with_residual_is_exact() -> None:
    """The modes left out are in the residual: H(0) is the given compliance to 1e-9."""
    system = make(m=12)
    whole = system.shape @ np.linalg.solve(system.stiffness, system.shape.T)
    few = type(system)(system.drag[:5, :5], system.stiffness[:5, :5], system.shape[:, :5])
    response = few.response(compliance=whole)
    assert np.abs(response.receptance(np.zeros(1))[0] - whole).max() < 1e-9 * np.abs(whole).max()
    assert np.abs(response.residual).max() > 1e-3 * np.abs(whole).max()


def test_resolved_keeps_the_static_limit_and_the_slow_modes() -> None:
    system = make(damping=8.0)
    response = system.response()
    step = RESOLVED / np.median(np.abs(response.eigenvalue))
    kept = response.resolved(step)
    assert 0 < len(kept.eigenvalue) < len(response.eigenvalue)
    assert np.abs(kept.eigenvalue).max() * step <= RESOLVED
    low = np.array([0.0, 1.0])
    exact, found = response.receptance(low), kept.receptance(low)
    size = np.abs(exact).max()
    assert np.abs(found[0] - exact[0]).max() < 1e-12 * size
    assert np.abs(found[1] - exact[1]).max() < 1e-3 * size
    assert response.resolved(1e-12) is response


def test_momentum_of_an_impulse() -> None:
    """The rate of momentum after an impulse is that of Sum_k p_k eta_k''."""
    system = make()
    m = len(system.drag)
    response = system.response()
    times = np.array([1e-3, 0.02])
    states = np.stack([linalg.expm(system.companion * t) @ system.push for t in times])
    acceleration = -system.stiffness @ states[:, :m] - system.drag @ states[:, m:]
    exact = np.ones((3, m)) @ acceleration
    assert np.abs(response.momentum_rate(times) - exact).max() < 1e-9 * np.abs(exact).max()
    direct = np.ones((3, m)) @ system.shape.T
    assert np.abs(response.direct_momentum_rate() - direct).max() < 1e-9 * np.abs(direct).max()


@pytest.mark.parametrize(("speed", "names_it"), [(0.0, False), (244.0, True)])
def test_only_a_turning_tire_is_told_of_the_critical_speed(monkeypatch, speed, names_it) -> None:
    """A free rim's singular K was blamed on the speed, which is not in it."""

    def respond(*given):
        raise NearlySingular("the matrix is singular")

    monkeypatch.setattr(responses.Basis, "of", lambda rolling: None)
    one_modulus = SimpleNamespace(projection=SimpleNamespace(parts=None))
    wheel, rolling = (
        SimpleNamespace(speed=speed, respond=respond),
        SimpleNamespace(basis=one_modulus),
    )
    with pytest.raises(ConvergenceError, match="the matrix is singular") as told:
        responses.make_response(lambda: wheel, rolling, None, None, "static", lambda: None)
    assert ("critical speed" in str(told.value)) == names_it
