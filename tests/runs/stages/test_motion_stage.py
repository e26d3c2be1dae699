"""output.fields: the outer face moves as the time loop itself says, relative to the static state."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from mpi4py import MPI
from tires import soft_torus

import tireroad
from tireroad.contact.results.spectra import amplitudes
from tireroad.greens.outputs import Surface
from tireroad.runs.pipeline import run_scene
from tireroad.runs.process import console
from tireroad.runs.scene.load import load

pytestmark = pytest.mark.slow

TIRE = (
    soft_torus(16, 8, order=2, footprint_size=0.35)
    + """[static]
load = 500.0
error_estimate = false
[modal]
count = 40
[damping]
mass = 300.0
[rotation]
speed = 50.0
[contact]
youngs_modulus = 1e7
[time]
duration = 0.03
step = 2e-4
[accuracy]
estimate = false
[output]
fields = true
"""
)
FLAT = '[road]\nkind = "flat"\n'
# The force of 0 N only reads the loop's displacement; it lies on a node of this mesh.
SINE = """
[road]
kind = "sine"
amplitude = 0.001
wavelength = 0.2
run_in = 0.1
[[force]]
arc = 35.568898
angle = 40.0525187
amplitude = 0.0
direction = [0.0, 1.0, 0.0]
"""
GRID, NODES = "contact.points={dx=0.01,dy=0.01}", "contact.points=nodes"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One for all runs, which reuse each other's stages."""
    return tmp_path_factory.mktemp("motion")


def run(folder: Path, text: str, *changes: str) -> tireroad.RunResults:
    (folder / "scene.toml").write_text(TIRE + text)
    scene = load(folder / "scene.toml", list(changes))
    with console.quiet():
        run_scene(scene, folder, MPI.COMM_SELF, until="motion", fresh=False, petsc_options=[])
    return tireroad.load(folder)


def both(results: tireroad.RunResults) -> tuple[np.ndarray, np.ndarray, int]:
    """The driven point's displacement (n, 3) m by the field and by the loop, and its node."""
    time, field = results["motion/time"], results["motion/displacement"]
    rows = np.searchsorted(results["contact/time"], time - 1e-7)
    loop = results["contact/driven_displacement"][rows, 0]
    node = int(np.abs(field - loop[:, None]).max(axis=(0, 2)).argmin())
    return field[:, node], loop, node


@pytest.mark.parametrize("friction", ["", "static.friction=0.5", "contact.friction=0.8"])
@pytest.mark.parametrize("points", [GRID, NODES])
def test_on_a_flat_road_nothing_moves(folder: Path, points: str, friction: str) -> None:
    """The points of a grid settle in the loop: that load is in their static state as well."""
    if points == NODES and friction.startswith("contact"):
        friction = "contact.brush_stiffness=1e5"  # on nodes a tread does not shear
    # The shape's own slip would shear the footprint.
    still = "rotation.free_rolling=false"
    results = run(folder, FLAT, points, still, *filter(None, [friction]))
    assert results["contact/static_force"].sum() == pytest.approx(500.0, rel=1e-6)
    assert np.abs(results["contact/normal_force"]).max() > 10.0
    assert np.abs(results["motion/displacement"]).max() < 1e-9


@pytest.mark.parametrize(
    "changes",
    [
        (GRID,),
        (NODES,),
        (GRID, "static.friction=0.5"),
        (GRID, "contact.friction=0.8"),
        (GRID, "time.scheme=constant"),
        (GRID, "force.0.amplitude=5", "force.0.frequency=0"),
    ],
)
def test_the_field_is_that_of_the_loop(folder: Path, changes: tuple[str, ...]) -> None:
    """Without a residual both have the same states: the difference is single precision."""
    field, loop, node = both(run(folder, SINE, *changes, "greens.residual=none"))
    assert node == 113 and np.abs(loop).max() > 1e-5
    np.testing.assert_allclose(field, loop, rtol=0, atol=1e-6 * np.abs(loop).max())


CORNER = """
[axle]
kind = "corner"
wheel_mass = 8.0
stiffness = [1e6, 1e6, 2e5, 1e4, 1e4, 1e4]
damping = [1000.0, 1000.0, 2400.0, 10.0, 10.0, 10.0]
locked = []
"""
FREE = """
[axle]
kind = "free"
wheel_mass = 8.0
"""


@pytest.mark.parametrize("axle", [CORNER, FREE], ids=["corner", "free"])
@pytest.mark.parametrize("points", [GRID, NODES])
def test_the_field_moves_with_the_wheel(folder: Path, axle: str, points: str) -> None:
    """Phi eta + R xi, as the loop reads it, not Phi q."""
    results = run(folder, SINE + axle, points, "greens.residual=none")
    field, loop, node = both(results)
    assert node == 113
    assert np.abs(results["contact/wheel/translation"]).max() > 1e-5
    np.testing.assert_allclose(field, loop, rtol=0, atol=1e-6 * np.abs(loop).max())


@pytest.mark.parametrize("axle", ["", CORNER], ids=["held", "corner"])
def test_the_vibration_is_that_of_the_loop(folder: Path, axle: str) -> None:
    """By line: spectra of the same record, after the run-in; and the power is that of this motion."""
    results = run(
        folder,
        SINE + axle,
        NODES,
        "greens.residual=none",
        "output.vibration=true",
        "time.duration=0.3",
    )
    frequency, field = (results[f"vibration/surface/{k}"] for k in ("frequency", "displacement"))
    start = round(results.attributes("spectra")["left_out"] / 2e-4)
    _, lines = amplitudes(results["contact/driven_displacement"][start:, 0], 2e-4)
    loop = lines[1 : len(frequency) + 1]
    strongest = np.linalg.norm(loop, axis=1).argmax()
    np.testing.assert_allclose(
        field[strongest, 113], loop[strongest], rtol=0, atol=0.08 * np.abs(loop[strongest]).max()
    )
    velocity = results["vibration/mean_square_velocity"]
    normal, around = normals(folder)
    seen = np.abs(np.einsum("sk,fsk->fs", normal, field)) ** 2 / np.linalg.norm(normal, axis=1)
    known = (2 * np.pi * frequency) ** 2 * seen.sum(axis=1) / (2 * around)
    np.testing.assert_allclose(velocity, known, rtol=1e-9)


def normals(folder: Path) -> tuple[np.ndarray, float]:
    """Normals (s, 3) m2 times the area of each node of the outer face, and the whole area, m2."""
    with h5py.File(folder / "static.h5") as file:
        points, quads = file["surface/points"][:], file["surface/quads"][:]
    surface = Surface.of(points, quads)
    return surface.normal, surface.area
