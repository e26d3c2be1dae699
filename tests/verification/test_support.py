"""The rim free, the road held: rigid modes counted, toppling named, nodes held, and scenes through the program."""

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from tires import soft_torus

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.operators import Operators, Support
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.modal.solver import undamped
from tireroad.modal.solver.slicing import Modes
from tireroad.modal.standing import sites
from tireroad.tests.validation.cases import thesis_torus

pytestmark = pytest.mark.slow

COMM = MPI.COMM_WORLD
RUBBER = compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=0.45)


def tire(inflation: float, deflection: float = 0.0, speed: float = 0.0) -> tuple[Body, np.ndarray]:
    """The body at its static state and its own nodes that touch."""
    section = thesis_torus(segments=16, elements_arc=4)
    body = Body(COMM, section, RUBBER)
    equilibrium = Equilibrium(body, Rolling(speed=speed))
    loader = LoadStepper(equilibrium, lambda progress: None)
    loader.inflate(inflation)
    if deflection:
        loader.deflect(deflection)
    return body, np.flatnonzero(equilibrium.contact_force() > 0)


def solve(operators: Operators, count: int) -> Modes:
    return undamped.solve(operators.stiffness, operators.mass, count, sites=sites(operators))


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("inflation", "speed", "rigid"), [(0.0, 0.0, 6), (2e5, 0.0, 6), (2e5, 60.0, 3)]
)
def test_rigid_modes_of_a_free_rim(inflation, speed, rigid):
    """Six at any inflation; while it turns, the tension alone rights what rotates: three translations."""
    body, _ = tire(inflation, speed=speed)
    operators = Operators(body, inflation, Support("free"), Rolling(speed=speed))
    modes = solve(operators, 12)
    assert modes.rigid == rigid
    assert (modes.squares[:rigid] == 0).all()
    assert modes.inertia_count >= 12
    assert len(modes.sectors) == 4
    assert modes.residual.max() < 1e-8
    transposed = operators.stiffness.transpose(PETSc.Mat())
    transposed.axpy(-1, operators.stiffness)
    assert transposed.norm() < 1e-13 * operators.stiffness.norm()
    again = operators.restrict(operators.spread(modes.vectors))
    np.testing.assert_allclose(again, modes.vectors, atol=1e-11)
    if speed:
        # The spin about the axle: centrifugal forces of the same size point outwards as they turn.
        near = np.sqrt(modes.squares[rigid : rigid + 3]) / speed
        assert np.abs(near - 1).max() < 0.1


@pytest.mark.mpi
def test_a_free_wheel_on_its_load_topples():
    """Dead forces of road and axle: tilting and rolling over release energy, sliding and yawing none."""
    body, _ = tire(2e5, deflection=0.004)
    operators = Operators(body, 2e5, Support("free"))
    with pytest.raises(ConvergenceError, match="2 negative eigenvalue.*topples"):
        solve(operators, 10)


@pytest.mark.mpi
def test_held_nodes_do_not_rise():
    """Unknowns taken out, by that no frequency falls, and each by no more than their number (Cauchy)."""
    body, touching = tire(2e5, deflection=0.008)
    held = COMM.allreduce(len(touching))
    assert held > 0
    operators = Operators(body, 2e5, Support("fixed", touching))
    modes = solve(operators, 20)
    before = solve(Operators(body, 2e5), 20 + held)
    assert len(modes.sectors) == 4
    assert np.abs(operators.spread(modes.vectors)[touching, 2]).max(initial=0.0) == 0.0
    slack = 1e-9 * modes.squares
    assert (modes.squares >= before.squares[:20] - slack).all()
    assert (modes.squares <= before.squares[held:] + slack).all()
    assert (modes.squares > 1.001 * before.squares[:20]).any()


SCENE = (
    soft_torus(16, 4)
    + """[static]
{road}
[modal]
count = 60
{modal}
[damping]
mass = {mass}
stiffness = 1e-5
[rotation]
speed = {speed}
[greens]
residual = "{residual}"
[[force]]
angle = 20.0
frequency = 60.0
[time]
duration = 0.002
step = 1e-4
[output]
receptance = {{ to = 150.0, step = 50.0, direct = 3 }}
"""
)


def run(launch, folder, command="run", speed=0.0, road="", modal="", residual="static", mass=None):
    mass = mass if mass is not None else 0.0 if speed and "free" in modal else 50.0
    scene = folder / "scene.toml"
    scene.write_text(
        SCENE.format(road=road, modal=modal, speed=speed, residual=residual, mass=mass)
    )
    out = ["--out", folder / "out"] if command == "run" else []
    return launch("-m", "runs", command, scene, *out)


@pytest.mark.long
@pytest.mark.parametrize(
    ("speed", "road", "modal", "residual", "rigid"),
    [
        (0.0, "", 'rim = "free"', "static", 6),
        (0.0, "", 'rim = "free"', "attachment", 6),
        (40.0, "", 'rim = "free"', "attachment", 3),
        (0.0, "load = 500.0", 'road = "held"', "static", 0),
        (40.0, "load = 500.0", 'road = "held"', "attachment", 0),
    ],
)
def test_scenes_with_every_support(launch, tmp_path, speed, road, modal, residual, rigid):
    """The receptance of the modes against that of the full matrices of the same support."""
    done = run(launch, tmp_path, speed=speed, road=road, modal=modal, residual=residual)
    assert done.returncode == 0, done.stderr + done.stdout
    with h5py.File(tmp_path / "out" / "modes.h5") as file:
        assert file.attrs["rigid_modes"] == rigid
        assert ("rim" in file) == ("free" in modal)
    with h5py.File(tmp_path / "out" / "response.h5") as file:
        # Where the road holds nodes, it carries part of the force.
        assert ("axle_force" in file) == ("free" not in modal and "held" not in modal)
        shown = dict(zip(file["frequency"], file["receptance"][:, 0, 0], strict=True))
        exact = dict(zip(file["direct/frequency"], file["direct/receptance"][:, 0, 0], strict=True))
        assert np.isfinite(file["displacement"][:]).all()
    for f, value in exact.items():
        assert abs(shown[f] - value) < 0.05 * abs(value), f
    again = run(launch, tmp_path, speed=speed, road=road, modal=modal, residual=residual)
    assert "greens    reused" in again.stdout


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"speed": 40.0, "modal": 'rim = "free"'}, "attachment"),
        ({"speed": 40.0, "modal": 'rim = "free"', "mass": 50.0}, "driven round"),
        ({"modal": 'road = "held"'}, "needs a road"),
        ({"speed": 40.0, "modal": 'rim = "free"', "road": "steady_rolling = false"}, "upright"),
    ],
)
def test_what_has_no_answer_is_refused(launch, tmp_path, keys, words):
    done = run(launch, tmp_path, command="check", **keys)
    assert done.returncode == 2
    assert words in done.stderr
