"""Rubber that relaxes in a rolling tire: full finite elements in time, internal variables on modes, and the law of a run."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.fem.matrices import probe
from tireroad.fem.tire.material import REFERENCE, compound, prony
from tireroad.fem.wheel import StrainEnergy, Turning
from tireroad.runs import library
from tireroad.runs.scene.load import load
from tireroad.runs.scene.physics import compounds
from tireroad.tests.validation import relaxing

SHARES, TIMES, SPEED = (0.1, 0.12, 0.2), (4e-3, 8e-4, 1.6e-4), 60.0
PLACES = np.radians([0.0, 90.0, -90.0])
FREQUENCY = np.array([31.5, 40, 50, 63, 80, 100, 125, 160, 200])


@pytest.fixture(scope="module")
def tire() -> SimpleNamespace:
    """A soft inflated torus of one compound that turns, and patches at its lowest point and a quarter turn from it."""
    dynamic, loss, spectrum = prony(SHARES, TIMES)
    rubber = compound(
        "neo-hookean",
        1200.0,
        youngs_modulus=2e7,
        poisson_ratio=0.45,
        dynamic=dynamic,
        loss_factor=loss,
        spectrum=spectrum,
    )
    mesh = {"segments": 12, "elements_arc": 4, "order": 2, "footprint_size": 1.0}
    model = library.torus(material=rubber, comm=MPI.COMM_SELF, **mesh)
    turning = Turning(speed=SPEED, damping=StrainEnergy())
    static = library.press(model, inflation=2e5)
    rolling = library.roll(library.modes(model, static, count=300, turning=turning), turning)
    wide = np.radians(20), np.radians(20)
    patches = [probe.directed(probe.spot(model.lattice, a, 0.0, wide), (0, 0, 1.0)) for a in PLACES]
    probes = sparse.csr_matrix(np.array(patches))
    elements = relaxing.by_pulse(rolling, probes, 1e-4)
    return SimpleNamespace(rolling=rolling, probes=probes, elements=elements)


def off(found: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Relative difference of receptances (f, a), of each place."""
    return np.linalg.norm(found - exact, axis=0) / np.linalg.norm(exact, axis=0)


@pytest.mark.slow
def test_internal_variables_on_the_modes_are_those_of_the_elements(tire):
    """Convection by the projected body rate against turning by Fourier series: force and readers at rest in space, ahead and behind."""
    kinds = [kind for kind, _ in tire.rolling.standing.motions.body.wall.kinds()]
    run = tire.rolling.respond(tire.probes, tire.probes[:1])
    exact = relaxing.relaxing(run, tire.rolling.states, kinds, tire.probes, tire.probes[:1])
    assert exact.growth[0] == 0
    assert (off(exact.receptance(FREQUENCY)[:, :, 0], tire.elements) < 0.01).all()
    # Drawn the other way around, what is ahead would be behind.
    ahead, behind = tire.elements.T[1:]
    assert np.linalg.norm(ahead - behind) > 0.2 * np.linalg.norm(ahead)


@pytest.mark.slow
def test_the_law_of_a_run_is_near(tire):
    """Moduli and losses of each mode at its own frequency: some percent at the patch, more where waves cancel."""
    run = tire.rolling.respond(tire.probes, tire.probes[:1], "attachment")
    errors = off(run.receptance(FREQUENCY)[:, :, 0], tire.elements)
    assert errors[0] < 0.06
    assert (errors < 0.08).all()


def test_the_rubber_of_the_validation_is_what_its_page_says(tmp_path):
    """Loss factors from 20 to 500 Hz, and the same moduli at 100 Hz where there is one for all frequencies."""
    found = {}
    for name, rubber in (("relaxing", relaxing.RUBBER), ("one", relaxing.ONE_MODULUS)):
        for speed, cases in relaxing.CASES.items():
            for case in cases:
                (tmp_path / "scene.toml").write_text(relaxing.scene(rubber, speed, *case))
                found[name] = load(tmp_path / "scene.toml")
    rubbers, elastic = (compounds(one.tire, REFERENCE) for one in found.values())
    for region, loss in {"tread": 0.3, "sidewall": 0.2, "bead": 0.05}.items():
        lost = [rubbers[region].loss(f) for f in (20.0, 50.0, 100.0, 200.0, 500.0)]
        np.testing.assert_allclose(lost, loss, rtol=0.05)
        assert elastic[region].dynamic == pytest.approx(rubbers[region].dynamic, rel=0.01)
        assert elastic[region].spectrum.exponent == 0.0
