"""Materials of decks against the definitions of the Abaqus manual."""

import numpy as np
import pytest
from torus_decks import Torus, plain

from tireroad.fem.errors import InputError

DENSITY = "*DENSITY\n1100.\n"


@pytest.fixture
def rubber(own):
    def of(text):
        return own(
            plain(Torus(arcs=4), materials="*MATERIAL, NAME=RUBBER\n" + text + DENSITY)
        ).rubbers[0]

    return of


def _shear_and_bulk(values):
    modulus, poisson = values["youngs_modulus"], values["poisson_ratio"]
    return modulus / (2 * (1 + poisson)), modulus / (3 * (1 - 2 * poisson))


def test_neo_hooke(rubber):
    """mu = 2 C10, kappa = 2/D1."""
    found = rubber("*HYPERELASTIC, NEO HOOKE\n1.E6, 2.E-8\n").coefficients
    assert _shear_and_bulk(found) == pytest.approx((2e6, 1e8))


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
    moduli = [_shear_and_bulk(found.coefficients) for found in (slow, fast)]
    # As in Abaqus a series without k leaves the bulk modulus.
    assert moduli[1] == pytest.approx((0.7 * moduli[0][0], moduli[0][1]))
    with_k = rubber(law.format("INSTANTANEOUS") + "*VISCOELASTIC, TIME=PRONY\n0.2, 0.4, 1.E-3\n")
    assert _shear_and_bulk(with_k.coefficients) == pytest.approx((1.6e6, 0.6e8))


def _tensions(law):
    """Nominal stress of a deck's law in uniaxial, equibiaxial and planar tension, by its energy in the elements."""
    import ufl
    from dolfinx import fem, mesh
    from mpi4py import MPI

    from tireroad.fem import compat
    from tireroad.fem.tire.material import compound

    made = compound(law.model, 1.0, **law.coefficients).law
    cube = mesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
    C = fem.Constant(cube, np.eye(3))
    numbers = [fem.Constant(cube, getattr(made, name)) for name in made.coefficients]
    form = compat.form(sum(made.energy(C, *numbers)) * ufl.dx(cube, degree=0))

    def energy(stretch, second):
        C.value[:] = np.diag([stretch**2, stretch ** (2 * second), stretch ** (-2 - 2 * second)])
        return fem.assemble_scalar(form)

    def tension(second, stretch):
        step = 1e-4
        return (energy(stretch + step, second) - energy(stretch - step, second)) / (2 * step)

    return lambda s: np.array([tension(-0.5, s), tension(1.0, s) / 2, tension(0.0, s)])


def _of_invariants(first, second):
    """Nominal stresses for W_1 and W_2 as functions of I1 and I2 (Abaqus's theory manual, 4.6.2)."""

    def at(s):
        uni = s**2 + 2 / s, 2 * s + s**-2
        bi = 2 * s**2 + s**-4, s**4 + 2 * s**-2
        planar = s**2 + s**-2 + 1, s**2 + s**-2 + 1
        return np.array(
            [
                2 * (s - s**-2) * (first(*uni) + second(*uni) / s),
                2 * (s - s**-5) * (first(*bi) + s**2 * second(*bi)),
                2 * (s - s**-3) * (first(*planar) + second(*planar)),
            ]
        )

    return at


def _of_powers(moduli, powers):
    def at(s):
        terms = [
            [
                s ** (a - 1) - s ** (-a / 2 - 1),
                s ** (a - 1) - s ** (-2 * a - 1),
                s ** (a - 1) - s ** (-a - 1),
            ]
            for a in powers
        ]
        return np.array([2 * m / a for m, a in zip(moduli, powers, strict=True)]) @ np.array(terms)

    return at


def _arruda_boyce(mu, limit):
    series = 1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750
    return _of_invariants(
        lambda i1, _: (
            mu * sum((k + 1) * c * i1**k / limit ** (2 * k) for k, c in enumerate(series))
        ),
        lambda *_: 0.0,
    )


LAWS = {
    "OGDEN\n6.E5, 1.3, 4.E-9\n": _of_powers([6e5], [1.3]),
    "OGDEN, N=2\n6.E5, 1.3, 1.E5, -2., 4.E-9, 0.\n": _of_powers([6e5, 1e5], [1.3, -2.0]),
    # Treloar's rubber (Ogden 1972).
    "OGDEN, N=3\n4.095E5, 1.3, 3.E3, 5., 1.E4, -2., 4.E-9, 0.\n0.\n": _of_powers(
        [4.095e5, 3e3, 1e4], [1.3, 5.0, -2.0]
    ),
    "OGDEN, N=4\n4.E5, 1.3, 3.E3, 5., 1.E4, -2., 1.E3, 9.\n4.E-9, 0., 0., 0.\n": _of_powers(
        [4e5, 3e3, 1e4, 1e3], [1.3, 5.0, -2.0, 9.0]
    ),
    "OGDEN, N=6\n4.E5, 1.3, 3.E3, 5., 1.E4, -2., 1.E3, 9.\n2.E3, 2., -1.E3, 3.3, 4.E-9, 0., 0., 0.\n0., 0.\n": _of_powers(
        [4e5, 3e3, 1e4, 1e3, 2e3, -1e3], [1.3, 5.0, -2.0, 9.0, 2.0, 3.3]
    ),
    "ARRUDA-BOYCE\n5.E5, 2.2, 4.E-9\n": _arruda_boyce(5e5, 2.2),
    "REDUCED POLYNOMIAL, N=5\n4.E5, -2.E4, 6.E3, -5.E2, 30., 4.E-9, 0., 0.\n0., 0.\n": _of_invariants(
        lambda i1, _: sum(
            k * c * (i1 - 3) ** (k - 1) for k, c in enumerate((4e5, -2e4, 6e3, -5e2, 30.0), 1)
        ),
        lambda *_: 0.0,
    ),
    "POLYNOMIAL, N=2\n4.E5, -3.E4, 1.E4, 2.E3, -5.E2, 4.E-9, 0.\n": _of_invariants(
        lambda i1, i2: 4e5 + 2 * 1e4 * (i1 - 3) + 2e3 * (i2 - 3),
        lambda i1, i2: -3e4 + 2e3 * (i1 - 3) + 2 * -5e2 * (i2 - 3),
    ),
}
STRETCHES = 0.7, 0.95, 1.0, 1.1, 1.5


@pytest.mark.parametrize("text", LAWS, ids=lambda text: text.split("\n")[0])
def test_stress_of_laws(rubber, text):
    """Elements have the stress of the manual's closed forms in three kinds of tension."""
    found = rubber("*HYPERELASTIC, " + text)
    assert found.coefficients["bulk_modulus"] == pytest.approx(2 / 4e-9)
    stress = _tensions(found)
    expected = np.array([LAWS[text](s) for s in STRETCHES])
    np.testing.assert_allclose(
        [stress(s) for s in STRETCHES], expected, atol=2e-6 * abs(expected).max()
    )


def _tests(stress, kinds=(0, 1, 2)):
    """Test data of a law, as the deck's tables of nominal stress and strain."""
    at = np.linspace(0.1, 0.9, 9)
    names = "UNIAXIAL", "BIAXIAL", "PLANAR"
    return "".join(
        f"*{names[k]} TEST DATA\n" + "".join(f"{stress(1 + e)[k]:.12g}, {e:.12g}\n" for e in at)
        for k in kinds
    )


@pytest.mark.parametrize("text", [key for key in LAWS if "N=6" not in key and "N=4" not in key])
def test_fitted_to_its_own_stress(rubber, text):
    """A law fitted to test data that it made itself has the stress of them, between them, too."""
    keyword = text.split("\n")[0]
    found = rubber(
        f"*HYPERELASTIC, {keyword}, TEST DATA INPUT, POISSON=0.495\n" + _tests(LAWS[text])
    )
    assert found.fit.error < 1e-5
    stress = _tensions(found)
    between = 1.05, 1.33, 1.77
    expected = np.array([LAWS[text](s) for s in between])
    np.testing.assert_allclose([stress(s) for s in between], expected, rtol=2e-3)
    shear = sum(found.coefficients["moduli"]) if "moduli" in found.coefficients else None
    if shear:
        assert found.coefficients["bulk_modulus"] == pytest.approx(
            2 * shear * 1.495 / (3 * (1 - 2 * 0.495))
        )


def test_least_squares_in_stress(rubber):
    """One coefficient: sum T_i t_i / sum t_i^2, with t = 2 (s - s^-2)."""
    strain, stress = np.array([0.1, 0.3, 0.7]), np.array([3e5, 7e5, 9e5])
    unit = 2 * ((1 + strain) - (1 + strain) ** -2)
    lines = "".join(f"{s}, {e}\n" for s, e in zip(stress, strain, strict=True))
    found = rubber(f"*HYPERELASTIC, NEO HOOKE, TEST DATA INPUT\n*UNIAXIAL TEST DATA\n{lines}")
    c10 = stress @ unit / (unit @ unit)
    assert found.coefficients["c10"] == pytest.approx(c10)
    off = np.linalg.norm(c10 * unit - stress) / np.linalg.norm(stress)
    assert found.fit.error == pytest.approx(off)
    assert any("uniaxial test data" in note and "34" in note for note in found.notes) == (
        f"{100 * off:.2g}" == "34"
    )


def test_marlow(rubber):
    """Follows the one test it has, and foretells the others by the first invariant alone."""
    law = _of_invariants(lambda i1, _: 4e5 + 3e4 * (i1 - 3), lambda *_: 0.0)
    found = rubber("*HYPERELASTIC, MARLOW\n" + _tests(law, [0]))
    np.testing.assert_allclose(_tensions(found)(1.4), law(1.4), rtol=0.02)


def test_volumetric_data(rubber):
    text = "*HYPERELASTIC, NEO HOOKE, TEST DATA INPUT\n" + _tests(_of_powers([6e5], [2.0]), [0])
    found = rubber(text + "*VOLUMETRIC TEST DATA\n2.E6, 0.999\n4.E6, 0.998\n")
    assert found.coefficients["bulk_modulus"] == pytest.approx(2e9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("YEOH, TEST DATA INPUT\n", "test data are missing"),
        ("YEOH, TEST DATA INPUT\n*UNIAXIAL TEST DATA\n1.E5, -0.1\n", "different sign"),
        ("YEOH, TEST DATA INPUT\n*UNIAXIAL TEST DATA\n-1.E5, -1.1\n", "above -1"),
        ("OGDEN, N=7\n1.E5, 2., 0.\n", "OGDEN, N=7; 1 to 6"),
        ("OGDEN, N=1\n1.E6, 30., 0.\n", "beyond what the elements carry"),
        ("VAN DER WAALS\n1.E6, 10., 0.1, 0., 0.\n", "VAN DER WAALS is not among"),
    ],
)
def test_refused(own, text, words):
    from tireroad.fem.errors import InputError

    with pytest.raises(InputError, match=words):
        own(
            plain(
                Torus(arcs=4), materials="*MATERIAL, NAME=RUBBER\n*HYPERELASTIC, " + text + DENSITY
            )
        )


def test_constants_that_were_fitted_say_so_when_they_are_refused(rubber):
    """The deck states no C10: it is what Mooney and Rivlin's law makes of tension alone, -54381 Pa."""
    lines = "".join(
        f"{2 * (1 - s**-3) * (-54381.0 * s + 3e5):.9g}, {s - 1:.9g}\n" for s in (1.1, 1.3, 1.6, 2.0)
    )
    with pytest.raises(
        InputError,
        match=r"must be .*not -5438.*states no constants: those of mooney-rivlin were fitted to its \*UNIAXIAL TEST DATA",
    ):
        rubber(f"*HYPERELASTIC, MOONEY-RIVLIN, TEST DATA INPUT\n*UNIAXIAL TEST DATA\n{lines}")
