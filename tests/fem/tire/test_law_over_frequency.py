"""The law of a rubber over frequency and temperature: integrals, dispersion relations, published shifts."""

import numpy as np
import pytest
from scipy import integrate

from tireroad.fem.errors import InputError
from tireroad.fem.tire.material import (
    LOADING,
    compound,
    measured,
    power_law,
    prony,
    shore_a,
    warmed,
    wlf,
)

SHARES, TIMES = [0.2, 0.15, 0.1], [3e-2, 2e-3, 1e-4]
FREQUENCY = np.array([0.5, 7.0, 60.0, 100.0, 450.0, 3000.0])


def series(frequency):
    """Complex modulus (f,) over the long-term one as the program has it."""
    dynamic, loss, spectrum = prony(SHARES, TIMES)
    storage = dynamic * spectrum.modulus(frequency)
    return storage * (1 + 1j * loss * spectrum.loss_factor(frequency))


def test_a_series_is_the_transform_of_its_relaxation():
    """E' - E_inf = w int R(t) sin wt dt, E'' = w int R(t) cos wt dt, R the part of the modulus that relaxes."""
    left = 1 - sum(SHARES)

    def relaxing(t):
        return sum(g * np.exp(-t / tau) for g, tau in zip(SHARES, TIMES, strict=True)) / left

    for f, found in zip(FREQUENCY, series(FREQUENCY), strict=True):
        w = 2 * np.pi * f
        end = 30 * max(TIMES)
        edges = np.concatenate([[0.0], np.geomspace(1e-7, end, 60)])
        parts = [
            sum(
                integrate.quad(relaxing, a, b, weight=kind, wvar=w)[0]
                for a, b in zip(edges[:-1], edges[1:], strict=True)
            )
            for kind in ("sin", "cos")
        ]
        assert found == pytest.approx(1 + w * parts[0] + 1j * w * parts[1], rel=2e-3)


@pytest.mark.parametrize("shift", [1.0, 0.03])
def test_what_relaxes_in_time_is_the_series(shift):
    """Complex moduli of springs and dashpots by `relaxing`, at the reference and at another temperature: those of the spectrum."""
    _, loss, spectrum = prony(SHARES, TIMES)
    warm = spectrum.shifted(shift)
    loss *= float(spectrum.loss_factor(np.array([shift * 100.0]))[0])
    instant, relaxes = warm.relaxing()
    s = 2j * np.pi * FREQUENCY
    found = instant - sum(part / (1 + s * time) for time, part in relaxes.items())
    exact = warm.modulus(FREQUENCY) * (1 + 1j * loss * warm.loss_factor(FREQUENCY))
    np.testing.assert_allclose(found, exact, rtol=2e-3)


def test_a_power_law_does_not_relax_by_a_series():
    with pytest.raises(InputError, match="prony_shares"):
        power_law(0.1).relaxing()


def test_storage_and_loss_obey_the_dispersion_relation():
    """Kramers and Kronig: E'(w) - E_inf = (2 w^2 / pi) PV int E''(x) / (x (w^2 - x^2)) dx."""
    x = np.geomspace(1e-3, 1e6, 200_001)
    lost = series(x / (2 * np.pi)).imag
    for w in (20.0, 628.0, 5e3):
        near = np.interp(np.log(w), np.log(x), lost)
        # PV int dx / (w^2 - x^2) = 0 over (0, inf): what is constant may be taken off.
        smooth = (lost / x - near / w) / (w**2 - x**2)
        smooth[np.abs(x - w) < 1e-9 * w] = 0.0
        whole = integrate.trapezoid(smooth, x)
        tail = -near / w * (1 / x[-1] - x[0] / w**2)  # of the part taken off, beyond the ends
        stored = 1 + 2 * w**2 / np.pi * (whole - tail)
        assert series(np.array([w / (2 * np.pi)])).real[0] == pytest.approx(stored, rel=5e-3)


def test_a_measured_spring_pot():
    """Of E* = c (i w)^b a curve of five points in a decade has the slope b and tan(pi b / 2) everywhere."""
    b, c = 0.17, 3e5
    f = np.geomspace(1e-2, 1e5, 36)
    whole = c * (2j * np.pi * f) ** b
    modulus, loss, spectrum = measured(f, whole.real, whole.imag)
    exact = c * (2j * np.pi * FREQUENCY) ** b
    np.testing.assert_allclose(modulus * spectrum.modulus(FREQUENCY), exact.real, rtol=1e-9)
    found = loss * spectrum.loss_factor(FREQUENCY)
    np.testing.assert_allclose(found, np.tan(np.pi * b / 2), rtol=1e-9)


@pytest.mark.parametrize(
    ("frequency", "storage", "loss", "said"),
    [
        ([10.0], [1e6], [1e5], "two frequencies"),
        ([10.0, 5.0], [1e6, 2e6], [1e5, 1e5], "ascending"),
        ([10.0, 1e3], [2e6, 1e6], [1e5, 1e5], "do not fall"),
        ([10.0, 1e3], [1e6, 2e6], [1e5, -1e5], "0 or more"),
        ([10.0, 1e3], [1e6, np.nan], [1e5, 1e5], "do not fall"),
        ([200.0, 1e3], [1e6, 2e6], [1e5, 1e5], "100 Hz between"),
    ],
)
def test_a_curve_that_is_none(frequency, storage, loss, said):
    with pytest.raises(InputError, match=said):
        measured(frequency, storage, loss)


def test_the_shift_of_williams_landel_and_ferry():
    """By the constants about 20 degrees C that follow from those about the transition, and by hand at 60 degrees C."""
    first, second = 17.44 * 51.6 / (51.6 + 70), 51.6 + 70
    for T in (-20.0, 0.0, 20.0, 60.0, 110.0):
        assert np.log10(wlf(T)) == pytest.approx(-first * (T - 20) / (second + T - 20), abs=1e-12)
    assert np.log10(wlf(60.0)) == pytest.approx(-1.832, abs=1e-3)
    with pytest.raises(InputError, match="-30 degrees C up"):
        wlf(-40.0)


def absolute(rubber, frequency):
    """Complex modulus (f,), Pa."""
    storage = rubber.law.youngs * rubber.dynamic * rubber.spectrum.modulus(frequency)
    return storage * (1 + 1j * rubber.loss_factor * rubber.spectrum.loss_factor(frequency))


def rubbers():
    curve = np.geomspace(0.01, 1e6, 30)
    dynamic, loss, relaxing = prony(SHARES, TIMES)
    _, of_curve, table = measured(curve, 4e6 + 1e6 * curve**0.3, 5e5 * curve**0.2)
    for dynamic_, loss_, spectrum in (
        (1.8, 0.3, power_law(0.1)),
        (dynamic, loss, relaxing),
        (1.5, of_curve, table),
    ):
        yield compound(
            "neo-hookean",
            1100.0,
            youngs_modulus=4e6,
            poisson_ratio=0.49,
            dynamic=dynamic_,
            loss_factor=loss_,
            spectrum=spectrum,
        )


@pytest.mark.parametrize("temperature", [0.0, 60.0])
@pytest.mark.parametrize("rubber", rubbers(), ids=["power law", "series", "curve"])
def test_a_rubber_at_another_temperature(rubber, temperature):
    """The moduli at f are those that it has at 20 degrees C at a_T f; the static one is shifted at the rate of loading."""
    warm, shift = rubber.at(temperature), wlf(temperature)
    f = FREQUENCY[1:4] / min(shift, 1.0) / 3
    np.testing.assert_allclose(absolute(warm, f), absolute(rubber, shift * f), rtol=2e-3)
    slow = rubber.spectrum.stiffer(shift, LOADING)
    assert warm.law.youngs == pytest.approx(slow * rubber.law.youngs)
    assert warm.law.poisson == pytest.approx(0.49)
    assert (warm.law.youngs < rubber.law.youngs) == (temperature > 20) or slow == pytest.approx(1)
    assert rubber.at(20.0) is rubber


def test_elastic_rubbers_do_not_feel_the_temperature():
    rubber = compound("neo-hookean", 1100.0, loss_factor=0.2)
    assert rubber.at(80.0) is rubber


def test_hardness_by_gent():
    """65 Shore A is the built-in tread of 4.4 MPa; 40, 50, 60, 70 by the formula as it is tabulated."""
    assert shore_a(65.0) == pytest.approx(4.4e6, rel=0.01)
    tabulated = {40: 1.7e6, 50: 2.5e6, 60: 3.6e6, 70: 5.5e6}
    for hardness, modulus in tabulated.items():
        assert shore_a(hardness) == pytest.approx(modulus, rel=0.04)


def test_the_gas_law_by_hand():
    """321.3 kPa at 293.15 K are 365.2 kPa at 333.15 K."""
    assert warmed(220e3, 20.0, 60.0) == pytest.approx(263.84e3, rel=1e-4)
    assert warmed(220e3, 20.0, 20.0) == 220e3
    assert warmed(0.0, 20.0, 60.0) == 0.0
    assert warmed(1e3, 20.0, -20.0) == 0.0
