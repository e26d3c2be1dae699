"""Endo's free inextensional ring by finite elements: spun up to its hoop tension, turning, both frames.

    omega = 2 n Omega / (n^2 + 1) +- sqrt(n^2 (n^2 - 1)^2 / (n^2 + 1) [EI / (rho A R^4) + Omega^2 / (n^2 + 1)])

in the frame of the ring, +- n Omega in the one at rest (J. Sound Vib. 92 (1984) 261). What it leaves out
is of order (n h / R)^2 and of the hoop strain: h / R = 0.01 and 1e-4 here.
"""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from scipy import sparse
from scipy.sparse.linalg import eigsh, spsolve

from tireroad.fem import compat
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.static.virtual_work import Rolling, static_residual, tangent
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound
from tireroad.fem.tire.mesh import Torus
from tireroad.modal.basis import project
from tireroad.modal.rotating import matrices, rotating
from tireroad.modal.solver.slicing import Modes
from tireroad.modal.waves import FaceWaves

R, H, E, RHO = 0.3, 0.003, 4.8e8, 1200.0
FLAT = 1e3  # m, radius of the section circle: the strip of it in use is flat
WAVES = np.array([2, 3, 4])


def csr(matrix) -> sparse.csr_matrix:
    return sparse.csr_matrix(matrix.getValuesCSR()[::-1], shape=matrix.getSize())


@pytest.fixture(scope="module")
def ring() -> Body:
    """A square cross section, nothing held."""
    section = Torus(
        outer_radius=R + H / 2,
        minor_radius=FLAT,
        thickness=H,
        half_angle=H / 2 / FLAT,
        segments=200,
        elements_arc=1,
        elements_thickness=1,
        order=2,
        grading="uniform",
    )
    body = Body(
        MPI.COMM_SELF, section, compound("linear", RHO, youngs_modulus=E, poisson_ratio=0.3)
    )
    body.rim = np.array([], dtype=np.int32)
    return body


def spin_up(body: Body, speed: float) -> None:
    """Newton's method for the hoop tension; a little mass in the matrix keeps rigid motions out."""
    body.u.x.array[:] = 0.0
    residual = static_residual(body, fem.Constant(body.mesh, 0.0), Rolling(speed=speed))
    forces, stiffness = compat.form(residual), compat.form(tangent(body, residual))
    little = sparse.diags(body.nodal_mass())
    for _ in range(4):
        matrix = fem.petsc.assemble_matrix(stiffness)
        matrix.assemble()
        out = fem.petsc.assemble_vector(forces).array
        body.u.x.array[:] -= spsolve((csr(matrix) + little).tocsc(), out)
    stretch = np.linalg.norm(body.u.x.array.reshape(-1, 3), axis=1).mean() / R
    assert stretch == pytest.approx(RHO * speed**2 * R**2 / E, rel=1e-2)


def lowest(operators: Operators, count: int) -> Modes:
    """The lowest modes: so thin a ring is beyond the digits that modal.solver.undamped demands."""
    stiffness, mass = csr(operators.stiffness).tocsc(), sparse.diags(operators.mass).tocsc()
    squares, vectors = eigsh(stiffness, count, mass, sigma=-1.0)
    order = np.argsort(squares)
    nothing = np.zeros(count)
    return Modes(
        squares=squares[order],
        vectors=vectors[:, order],
        residual=nothing,
        orthonormality=0.0,
        inertia_count=count,
        counted_below=0.0,
        rigid=0,
        sectors=(),
        slices=0,
    )


def in_plane(operators: Operators, count: int = 28) -> tuple[Modes, np.ndarray]:
    """Bending modes in the plane with n = 2, 3, 4, and their n."""
    modes, body = lowest(operators, count), operators.body
    waves = FaceWaves(body.lattice)
    wave = waves.named(waves.read(operators.trace(modes.vectors)), {}).wave
    axial = (operators.mass[:, None] * modes.vectors**2)[1::3].sum(axis=0)
    chosen = np.flatnonzero((axial < 0.5) & np.isin(wave, WAVES))
    return modes.among(chosen), wave[chosen]


def endo(speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Both waves of each n in the frame of the ring, rad/s, (2, 3): against and with the rotation."""
    n, bending = WAVES, E * H**2 / (12 * RHO * R**4)
    root = np.sqrt(n**2 * (n**2 - 1) ** 2 / (n**2 + 1) * (bending + speed**2 / (n**2 + 1)))
    turn = 2 * n * speed / (n**2 + 1)
    return np.stack([turn + root, turn - root])


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.0, 5.0, 20.0])
def test_turning_ring(ring, speed):
    """0.1 % in the ring's frame and in the one at rest."""
    spin_up(ring, speed)
    operators = Operators(ring, 0.0)
    modes, wave = in_plane(operators)
    assert np.unique(wave, return_counts=True)[1].tolist() == [2, 2, 2]
    projection = project(modes, operators.rotation(), operators.carried, ring.comm)
    states = rotating(*matrices(projection, speed, (0.0, 0.0), "full"))
    exact = endo(speed)
    for k, n in enumerate(WAVES):
        part = np.abs(states.right[wave == n]).sum(axis=0) / np.abs(states.right).sum(axis=0)
        found = np.sort(states.eigenvalue.imag[part > 0.9])
        at_rest = np.sort(np.abs(exact[:, k] - n * speed))
        assert np.abs(found / at_rest - 1).max() < 1e-3, n
        # Back in the ring's frame: a wave runs with or against it, which its frequency does not tell.
        back = np.abs(np.concatenate([found - n * speed, found + n * speed]))
        turned = np.abs(exact[:, k])
        assert (np.abs(back[:, None] / turned - 1).min(axis=0) < 1e-3).all(), n
