"""Contact with a half-space that gives way sideways: pushed, bonded and rolling bodies (tests.validation.contact_closed_forms)."""

import numpy as np
import pytest

from tireroad.tests.validation import contact_closed_forms


@pytest.mark.parametrize("nu", [0.0, 0.25])
def test_bonded_punch(nu: float) -> None:
    """Flat, round, stuck to a half-space: P = 4 G a d ln(3 - 4 nu)/(1 - 2 nu); Mossakovskii 1954, Spence 1968."""
    exact = np.log(3 - 4 * nu) * (1 - nu) / (1 - 2 * nu)
    coarse, fine = (contact_closed_forms.bonded(nu, n) / exact - 1 for n in (12, 24))
    assert abs(fine) < 0.003
    assert abs(fine) < 0.6 * abs(coarse)


@pytest.mark.parametrize("nu", [0.25, 0.5])
def test_cattaneo_mindlin_with_any_poisson_ratio(nu: float) -> None:
    """Force within 0.3 %, the radius of what sticks within 2 % of the sphere's."""
    for name, unit, found, exact in contact_closed_forms.pushed(nu, 24):
        assert found == pytest.approx(exact, abs=0.003 * exact if unit == "N" else 0.02), name


@pytest.mark.slow
@pytest.mark.parametrize("nu", [0.25, 0.5])
def test_kalkers_creep_coefficients(nu: float) -> None:
    """Along, across and spin with 12 cells across the contact: 1.6, 3.3 and 6 %, from 6 cells on falling."""
    coarse, fine = (
        np.array(contact_closed_forms.creep(nu, n)) / contact_closed_forms.KALKER[nu] - 1
        for n in (6, 12)
    )
    assert np.all(np.abs(fine) < [0.018, 0.035, 0.065])
    assert np.all(np.abs(fine) < 0.75 * np.abs(coarse))
