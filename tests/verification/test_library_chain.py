"""Press, modes, roll, Green's functions, contact, spectra: as a library, without files or a scene."""

from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.contact.loop import roll
from tireroad.contact.model import step_solver
from tireroad.contact.results.spectra import amplitudes
from tireroad.contact.roads.road import make_road
from tireroad.contact.roads.under_tire import make_motion
from tireroad.contact.setup import Rolled, contact_setup
from tireroad.contact.tread.laws.elastic import HalfSpace
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.probe import nodes
from tireroad.fem.model import SmallMotions, TireModel
from tireroad.fem.static.press import press
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.wheel import Turning
from tireroad.greens.coupling import wheel_of
from tireroad.greens.recursion import Recursion
from tireroad.greens.responses import make_response
from tireroad.modal.damping import StrainEnergy
from tireroad.modal.rolling import rolling_modes
from tireroad.modal.standing import standing_modes
from tireroad.runs.scene.physics import rolling_shape
from tireroad.tests.validation.cases import thesis_torus

SCENE = """
name = "chain"
[tire]
segments = 16
elements_arc = 6
order = 2
grading = "uniform"
footprint_size = 1.0
elements_thickness = 1
[tire.material]
youngs_modulus = 48e6
poisson_ratio = 0.45
density = 1200.0
[static]
load = 300.0
error_estimate = false
[modal]
count = 20
[damping]
mass = 500.0
[rotation]
speed = 40.0
[contact]
points = "nodes"
youngs_modulus = 2e7
friction = 0.0
[road]
kind = "sine"
run_in = 0.0
amplitude = 5e-4
wavelength = 0.15
[time]
duration = 0.01
step = 5e-5
"""
COMM, SPEED, STEP = MPI.COMM_SELF, 40.0, 5e-5


@pytest.fixture(scope="module")
def tire() -> TireModel:
    section = thesis_torus(segments=16, elements_arc=6, grading="uniform")
    rubber = compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=0.45)
    return TireModel(section, lambda: Body(COMM, section, rubber))


@pytest.mark.long
def test_the_chain_gives_what_the_program_gives(tire, tmp_path, launch) -> None:
    static = press(tire, inflation=2e5, load=300.0, rolling=Rolling(speed=SPEED, damping=500.0))
    motions = SmallMotions(tire, static)
    turning = Turning(speed=SPEED, damping=(500.0, 0.0))
    modes = standing_modes(motions, count=20, turning=turning)
    rolling = rolling_modes(modes, turning, COMM)
    road = make_road(kind="sine", run_in=0.0, amplitude=5e-4, wavelength=0.15)
    speed, still = SPEED * static.rolling_radius(), make_motion("none")
    setup = contact_setup(
        static, tire.lattice, road, Rolled(speed=speed, duration=0.01, motion=still)
    )
    parts = [nodes(setup.patch.index, len(static.points), k) for k in (2, 0, 1)]
    probes = sparse.vstack(parts, "csr")
    given = rolling, probes, probes, "static", lambda: modes
    greens = make_response(lambda: wheel_of(motions, rolling.turning), *given).response
    march = Recursion(response=greens.resolved(STEP), step=STEP, scheme="linear", comm=COMM)
    tread = SimpleNamespace(law=HalfSpace(youngs_modulus=2e7), solver="active-set")
    count = len(setup.patch.points)
    solver = step_solver(tread, setup.patch, march.same_step[:count, :count])
    steps = list(roll(march, solver, setup.patch, setup.drive, STEP, 200))
    force = np.array([[*step.horizontal.sum(axis=0), step.force.sum()] for step in steps])
    frequency, spectrum = amplitudes(force, STEP)

    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    scene.write_text(SCENE)
    done = launch("-m", "runs", "run", scene, "--out", out)
    assert done.returncode == 0, done.stderr + done.stdout
    with h5py.File(out / "contact.h5") as file:
        assert np.ptp(force[:, 2]) > 5.0
        np.testing.assert_allclose(force, file["total_force"][:], atol=1e-6 * force.max())
    assert frequency[1] == pytest.approx(100.0)
    assert spectrum.shape == (101, 3)


@pytest.mark.slow
def test_what_does_not_fit_together_is_refused(tire) -> None:
    static = press(tire, inflation=2e5, rolling=Rolling(speed=SPEED))
    motions = SmallMotions(tire, static)
    with pytest.raises(InputError, match="rolls at 40 rad/s"):
        wheel_of(motions, Turning(speed=50.0))
    standing = standing_modes(motions, count=5, rotation=False)
    with pytest.raises(InputError, match="project the rotation too"):
        rolling_modes(standing, Turning(speed=SPEED), COMM)
    with pytest.raises(InputError, match="load and deflection"):
        press(tire, inflation=2e5, load=300.0, deflection=0.01)
    for wrong in ({"speed": np.nan}, {"speed": -1.0}, {"inertia": "none"}):
        with pytest.raises(InputError):
            Turning(**wrong)
    with pytest.raises(InputError, match="fixed or free"):
        SmallMotions(tire, static, rim="loose")


def test_by_strain_energy_the_rolling_shape_has_inertia_alone() -> None:
    turning = Turning(speed=SPEED, damping=StrainEnergy())
    assert rolling_shape(turning) == Rolling(
        speed=SPEED, damping=0.0, stiffness_damping=0.0, inertia="full"
    )
    turning = Turning(speed=SPEED, damping=(500.0, 1e-6), inertia="doppler")
    assert rolling_shape(turning) == Rolling(
        speed=SPEED, damping=500.0, stiffness_damping=1e-6, inertia="doppler"
    )
