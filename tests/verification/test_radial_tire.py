"""The built-in radial tire: its first modes beside public ones, and two more sizes inflated."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.fem.matrices.operators import Operators
from tireroad.fem.sections.radial import radial
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.loading import Loader
from tireroad.modal.solver import undamped
from tireroad.modal.solver.symmetry import Sites
from tireroad.runs.bench.series.inflated import InflatedRing, lowest
from tireroad.runs.scene.load import load
from tireroad.runs.stages.build.tire import make_body

PRESSURE = 2.2e5


@pytest.mark.slow
def test_first_modes_and_mass_beside_the_public_ones():
    """205/60 R15, rim held, no road: within 10 % of lateral 42.4, wind-up 59.0, yaw 53.5, vertical 77.2 Hz, 9.3 kg."""
    tire = InflatedRing(radial("205/60 R15"), 26, 2, PRESSURE)
    np.testing.assert_allclose(lowest(tire), [42.4, 59.0, 53.5, 77.2], rtol=0.08)
    assert tire.weight == pytest.approx(9.3, rel=0.03)


@pytest.mark.slow
def test_three_dimensional_elements_against_fourier_series(tmp_path):
    """Inflated, with cords and dynamic moduli: two codes, the same section, 0.1 % in the six lowest frequencies."""
    path = tmp_path / "radial.toml"
    path.write_text('[tire]\nsection = "radial"\n')
    tire = load(path, ["tire.segments=8", "tire.elements_arc=14", "tire.order=2"]).tire
    body = make_body(MPI.COMM_SELF, tire, tire.ring())
    Loader(Equilibrium(body), lambda progress: None).inflate(PRESSURE)
    operators = Operators(body, PRESSURE)
    sites = Sites(operators.unknowns.place, operators.unknowns.component)
    modes = undamped.solve(operators.stiffness, operators.mass, 6, sites=sites)
    lateral, turning, yaw, vertical = lowest(InflatedRing(radial("205/60 R15"), 14, 2, PRESSURE))
    wanted = np.sort([lateral, yaw, yaw, turning, vertical, vertical])
    np.testing.assert_allclose(modes.frequency, wanted, rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("size", "width"), [("175/65 R14", 175), ("255/35 R20", 255)])
def test_sizes_inflate_to_about_what_they_say(size, width):
    """Width within 4 %, radius within 1 %, moved by less than 6 mm."""
    tire = InflatedRing(radial(size), 26, 2, PRESSURE)
    place = tire.section.nodes + tire.displacement[:, [0, 2]]
    assert np.ptp(place[:, 1]) == pytest.approx(1e-3 * width, rel=0.04)
    assert place[:, 0].max() == pytest.approx(tire.section.nodes[:, 0].max(), rel=0.012)
    assert np.abs(tire.displacement).max() < 6e-3
