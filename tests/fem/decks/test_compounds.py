"""Materials of decks against the definitions of the Abaqus manual."""

import numpy as np
import pytest
from torus_decks import Torus, plain

DENSITY = "*DENSITY\n1100.\n"


@pytest.fixture
def rubber(own):
    def of(text):
        return own(
            plain(Torus(arcs=4), materials="*MATERIAL, NAME=RUBBER\n" + text + DENSITY)
        ).rubbers[0]

    return of


def test_neo_hooke(rubber):
    """mu = 2 C10, kappa = 2/D1."""
    found = rubber("*HYPERELASTIC, NEO HOOKE\n1.E6, 2.E-8\n").coefficients
    modulus, poisson = found["youngs_modulus"], found["poisson_ratio"]
    assert modulus / (2 * (1 + poisson)) == pytest.approx(2e6)
    assert modulus / (3 * (1 - 2 * poisson)) == pytest.approx(1e8)


@pytest.mark.parametrize("blank", ["1.E6\n", "1.E6,\n", "1.E6, , 20.\n", "1.E6, 0.\n"])
def test_incompressible(rubber, blank):
    """A blank D1 becomes nu = 0.49 at the same shear modulus, and that is said."""
    found = rubber("*HYPERELASTIC, NEO HOOKE\n" + blank)
    values = found.coefficients
    assert values["poisson_ratio"] == 0.49
    assert values["youngs_modulus"] == pytest.approx(2e6 * 2 * 1.49)
    assert any("0.49" in note for note in found.notes)


@pytest.mark.parametrize(
    ("text", "model", "values"),
    [
        ("MOONEY-RIVLIN\n4.E5, 1.E5, 4.E-9\n", "mooney-rivlin", {"c10": 4e5, "c01": 1e5}),
        ("YEOH\n4.E5, -1.E5, 2.E4, 4.E-9\n", "yeoh", {"c10": 4e5, "c20": -1e5, "c30": 2e4}),
        ("N=1\n4.E5, 1.E5, 4.E-9\n", "mooney-rivlin", {"c10": 4e5, "c01": 1e5}),
        ("POLYNOMIAL, N=2\n4.E5, 0., 7., 0., 0., 4.E-9\n", "yeoh", {"c10": 4e5, "c20": 7.0}),
        (
            "N=3\n4.E5, 0., 7., 0., 0., 9., 0., 0.\n0., 4.E-9\n",
            "yeoh",
            {"c10": 4e5, "c20": 7.0, "c30": 9.0},
        ),
        ("REDUCED POLYNOMIAL, N=2\n4.E5, 7., 4.E-9\n", "yeoh", {"c10": 4e5, "c20": 7.0}),
    ],
)
def test_polynomials(rubber, text, model, values):
    found = rubber("*HYPERELASTIC, " + text)
    assert found.model == model
    assert {key: found.coefficients[key] for key in values} == pytest.approx(values)
    assert found.coefficients["bulk_modulus"] == pytest.approx(2 / 4e-9)


def test_prony(rubber):
    """E*(omega) / E_infinity = (1 - g + g (i w t)/(1 + i w t)) / (1 - g) at 100 Hz; both MODULI."""
    series = "*VISCOELASTIC, TIME=PRONY\n0.2, 0., 1.E-3\n0.1, 0., 1.E-2\n"
    law = "*HYPERELASTIC, NEO HOOKE, MODULI={}\n1.E6, 2.E-8\n"
    w = 2j * np.pi * 100
    complex_modulus = 0.7 + 0.2 * w * 1e-3 / (1 + w * 1e-3) + 0.1 * w * 1e-2 / (1 + w * 1e-2)
    slow, fast = (rubber(law.format(m) + series) for m in ("LONG TERM", "INSTANTANEOUS"))
    for found in (slow, fast):
        assert found.dynamic == pytest.approx(complex_modulus.real / 0.7)
        assert found.loss_factor == pytest.approx(complex_modulus.imag / complex_modulus.real)
    ratio = fast.coefficients["youngs_modulus"] / slow.coefficients["youngs_modulus"]
    assert ratio == pytest.approx(0.7)
