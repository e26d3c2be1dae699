"""The built-in radial tire: its first modes beside public ones, and two more sizes inflated."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.interpolate import PchipInterpolator

from tireroad.fem.matrices.operators import Operators
from tireroad.fem.matrices.road_stiffness import road_stiffness
from tireroad.fem.sections.inflated import InflatedRing, lowest
from tireroad.fem.sections.radial import radial
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.press import load_curve
from tireroad.modal.basis import project
from tireroad.modal.solver import undamped
from tireroad.modal.solver.symmetry import DofPositions
from tireroad.runs.scene.load import load
from tireroad.runs.scene.physics import make_body

PRESSURE = 2.2e5


@pytest.mark.slow
def test_first_modes_and_mass_beside_the_public_ones():
    """205/60 R15, rim held, no road: within 10 % of lateral 42.4, wind-up 59.0, yaw 53.5, vertical 77.2 Hz, 9.3 kg."""
    tire = InflatedRing(radial("205/60 R15"), 26, 2, PRESSURE)
    np.testing.assert_allclose(lowest(tire), [42.4, 59.0, 53.5, 77.2], rtol=0.08)
    assert tire.weight == pytest.approx(9.3, rel=0.03)


@pytest.mark.long
def test_loaded_stiffness_beside_the_public_one(tmp_path):
    """Loads at 10.5 and 20.3 mm 2000 and 4000 N, the slope between them, longitudinal (358 to 382 N/mm) and lateral
    stiffness (103 to 158 N/mm) of the stuck footprint: within 10 % on coarse elements, the load at half the
    deflection within 13 %, because the crown is rounder than that tire's.
    """
    path = tmp_path / "radial.toml"
    path.write_text('[tire]\nsection = "radial"\n')
    mesh = ["tire.segments=14", "tire.elements_arc=14", "tire.footprint_size=0.4"]
    tire = load(path, mesh).tire
    body = make_body(MPI.COMM_SELF, tire, tire.ring())
    loader = LoadStepper(Equilibrium(body), lambda progress: None)
    loader.inflate(PRESSURE)
    first, last = [loader.load() for _ in loader.visit((10.5e-3, 20.3e-3))]
    assert first == pytest.approx(2000.0, rel=0.13)
    assert last == pytest.approx(4000.0, rel=0.1)
    assert (last - first) / 9.8 == pytest.approx(2000 / 9.8, rel=0.1)
    force, place = loader.equilibrium.contact_force(), body.lattice.points(body.ids)
    centre = force @ (place + body.owned(body.u.x.array)) / last
    stuck = road_stiffness(body, PRESSURE, np.flatnonzero(force > 0), centre)
    assert stuck.longitudinal == pytest.approx(358e3, rel=0.1)
    assert 103e3 < stuck.lateral < 158e3


@pytest.mark.long
def test_three_dimensional_elements_against_fourier_series(tmp_path):
    """Inflated, with cords and dynamic moduli of their own frequencies: two codes, the same section, 0.1 % in the six lowest frequencies."""
    path = tmp_path / "radial.toml"
    path.write_text('[tire]\nsection = "radial"\n')
    tire = load(path, ["tire.segments=8", "tire.elements_arc=14", "tire.order=2"]).tire
    body = make_body(MPI.COMM_SELF, tire, tire.ring())
    LoadStepper(Equilibrium(body), lambda progress: None).inflate(PRESSURE)
    operators = Operators(body, PRESSURE)
    sites = DofPositions(operators.unknowns.place, operators.unknowns.component)
    modes = undamped.solve(operators.stiffness, operators.mass, 6, sites=sites)
    given = operators.compounds()
    projection = project(modes, None, operators.carried, MPI.COMM_SELF, compounds=given)
    lateral, turning, yaw, vertical = lowest(InflatedRing(radial("205/60 R15"), 14, 2, PRESSURE))
    wanted = np.sort([lateral, yaw, yaw, turning, vertical, vertical])
    np.testing.assert_allclose(projection.frequency, wanted, rtol=1e-3)


@pytest.mark.slow
def test_losses_of_a_rolling_tire_take_off_at_its_critical_speed():
    """The load sinks as by the receptance at 0 Hz, standing and rolling; moments are those of a rolling resistance of 0.5 to
    1.2 % up to the speed symbol (H: 190 rad/s), beyond which they take off, and none without losses.
    """

    made = radial("205/60 R15")

    def rolled(speed, wall=made):
        tire = InflatedRing(wall, 12, 2, PRESSURE, speed)
        return tire, *tire.rolling(tire.patch(0.0, 0.06), 0.2)

    tire, deflection, _ = rolled(0.0)
    at_rest = tire.receptance(tire.patch(0.0, 0.06), 0.2, np.zeros(1), np.zeros(1), 60)
    assert deflection == pytest.approx(at_rest.real.item(), rel=1e-9)
    tire, deflection, _ = rolled(60.0)
    passed = tire.receptance(tire.patch(0.0, 0.06), 0.2, np.zeros(1), np.zeros(1), 60, 60.0)
    assert deflection == pytest.approx(passed.real.item(), rel=1e-6)
    share = {speed: 4000 * rolled(speed)[2] / 0.305 for speed in (60.0, 150.0, 240.0)}
    assert 0.005 < share[60.0] < 0.012
    assert share[150.0] == pytest.approx(share[60.0], rel=0.1)
    assert share[240.0] > 1.5 * share[60.0]
    lossless = {name: {**values, "loss_factor": 0.0} for name, values in made.compounds.items()}
    _, _, moment = rolled(60.0, replace(made, compounds=lossless))
    assert abs(moment) < 1e-6 * share[60.0] / 4000


@pytest.mark.slow
@pytest.mark.parametrize(("size", "width"), [("175/65 R14", 175), ("255/35 R20", 255)])
def test_sizes_inflate_to_about_what_they_say(size, width):
    """Width within 4 %, radius within 1 %, moved by less than 7 mm (4.2 in 205/60 R15)."""
    tire = InflatedRing(radial(size), 26, 2, PRESSURE)
    place = tire.section.nodes + tire.displacement[:, [0, 2]]
    assert np.ptp(place[:, 1]) == pytest.approx(1e-3 * width, rel=0.04)
    assert place[:, 0].max() == pytest.approx(tire.section.nodes[:, 0].max(), rel=0.012)
    assert np.abs(tire.displacement).max() < 7e-3


PSI = 6894.757  # Pa
# Deflection (mm) under 3559 N, slope there (N/mm), and length and width (mm) of the footprint at the pressure next to it:
# measured at Formula Delta by K. Tse on a 9 inch rim, load and slope of a worn Bridgestone RE-71R 255/40R17 (2021),
# the prints of a new Continental ExtremeContact Force of that size (2024).
MEASURED = {24: (17.0, 228.5, 101.3, 206.2), 30: (14.6, 262.5, 92.5, 204.7), 36: (13.1, 292.7, 94.2, 201.9)}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("psi", sorted(MEASURED))
def test_a_low_section_beside_a_measured_one(tmp_path, psi):
    """255/40 R17: deflection within 9 %, slope over pressure within 5 %, print within 9 and 6 % under 3559 N.

    Its measuring rim is the one that the tire stood on. With the rim, crown and walls of before the deflection was 26
    to 35 % too large, the print 30 % too long.
    """
    path = tmp_path / "radial.toml"
    path.write_text('[tire]\nsection = "radial"\nsize = "255/40 R17"\n')
    mesh = ["tire.segments=24", "tire.elements_arc=20", "tire.footprint_size=0.2"]
    tire = load(path, mesh).tire
    assert tire.shape.rim_width == pytest.approx(9 * 0.0254)
    body = make_body(MPI.COMM_SELF, tire, tire.ring())
    loader = LoadStepper(Equilibrium(body), lambda progress: None)
    loader.inflate(psi * PSI)
    points = load_curve(loader, [0.005, 0.010, 0.0135, 0.017, 0.021])
    loads = [0.0, *(point.load for point in points)]
    moved = PchipInterpolator(loads, [0.0, *(point.deflection for point in points)])
    length, width = (
        PchipInterpolator(loads, [0.0, *(getattr(point.footprint, name) for point in points)])
        for name in ("length", "width")
    )
    deflection, slope, long, wide = MEASURED[psi]
    assert 1e3 * moved(3559.0) == pytest.approx(deflection, rel=0.09)
    found = 0.8 / (moved(3959.0) - moved(3159.0))
    assert found == pytest.approx(slope, rel=0.05)
    assert 1e3 * length(3559.0) == pytest.approx(long, rel=0.09)
    assert 1e3 * width(3559.0) == pytest.approx(wide, rel=0.06)
