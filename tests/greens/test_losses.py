"""Losses by strain energy beyond the modes: residuals and the reference in time, against dense matrices."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from scipy import linalg, sparse

from tireroad.fem.matrices.compliance import on_own_rows
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.matrices.probe import nodes
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.material import compound, power_law
from tireroad.fem.tire.mesh import Region
from tireroad.fem.transient import FullTire, ModalDamping
from tireroad.greens.coupling import Basis, Wheel
from tireroad.modal.basis import project
from tireroad.modal.damping import StrainEnergy, beyond, tail_growth
from tireroad.modal.solver import undamped
from tireroad.tests.validation.cases import thesis_torus

INFLATION, KEPT = 1e5, 30


@cache
def tire(exponents=(0.0, 0.0)) -> SimpleNamespace:
    """A torus of two compounds with 30 modes, and its matrices in full; `exponents` of tread and wall."""
    laws = [power_law(one) for one in exponents]
    rubber = {"density": 1200.0, "youngs_modulus": 48e6, "poisson_ratio": 0.45}
    tread = Region(
        material=compound("neo-hookean", **rubber, loss_factor=0.3, spectrum=laws[0]),
        arc=(0.0, np.radians(60)),
    )
    section = thesis_torus(segments=8, elements_arc=4)
    wall = compound("neo-hookean", **rubber, loss_factor=0.1, spectrum=laws[1])
    body = Body(MPI.COMM_SELF, section, wall, (tread,))
    equilibrium = Equilibrium(body)
    equilibrium.pressure.value = INFLATION
    assert equilibrium.solve().converged
    operators = Operators(body, INFLATION)
    rotation = operators.rotation()
    modes = undamped.solve(operators.stiffness, operators.mass, KEPT)
    projection = project(
        modes, rotation, operators.carried, MPI.COMM_SELF, compounds=operators.compounds()
    )
    face = len(body.surface.ids)
    inside = np.arange(face)[[4, face // 2, face // 2 + 3]]  # nine nodes from bead to bead
    return SimpleNamespace(
        operators=operators,
        rotation=rotation,
        modes=modes,
        projection=projection,
        probes=nodes(inside, face, 2),
    )


def dense(matrix) -> np.ndarray:
    indptr, indices, data = matrix.getValuesCSR()
    return sparse.csr_matrix((data, indices, indptr), shape=matrix.getSize()).toarray()


def damping_matrix(t) -> np.ndarray:
    """M Phi (D_mod - d_c) Phi^T M + d_c M."""
    tail = beyond(StrainEnergy(), t.projection).mass
    mass = np.diag(t.operators.mass)
    shapes = mass @ t.modes.vectors
    excess = t.projection.losses - tail * np.eye(KEPT)
    return shapes @ excess @ shapes.T + tail * mass


def stiffness_matrix(t) -> np.ndarray:
    """g_c K + M Phi (stiffness - g_c squares) Phi^T M."""
    growth, projection = tail_growth(t.projection), t.projection
    shapes = t.operators.mass[:, None] * t.modes.vectors
    excess = projection.stiffness - growth * np.diag(projection.squares)
    return growth * dense(t.operators.stiffness) + shapes @ excess @ shapes.T


def pencil(t, speed):
    """D + 2 Omega G and K_Omega, dense, with the damping's turning Omega D M^-1 B."""
    D, B = damping_matrix(t), dense(t.rotation.body)
    stiffness = stiffness_matrix(t) + speed**2 * dense(t.rotation.convective)
    stiffness += speed * D @ (B / t.operators.mass[:, None])
    return D + 2 * speed * dense(t.rotation.gyroscopic), stiffness


def made(t, speed) -> tuple[Wheel, Basis]:
    tail = beyond(StrainEnergy(), t.projection)
    rotation = t.rotation if speed else None
    wheel = Wheel(
        operators=t.operators,
        rotation=rotation,
        speed=speed,
        damping=StrainEnergy(),
        inertia="full",
        beyond=tail,
        growth=None if t.projection.rise is None else tail_growth(t.projection),
    )
    states = wheel.decouple(t.projection, MPI.COMM_SELF)
    return wheel, Basis(
        shape=t.operators.trace(t.modes.vectors), projection=t.projection, states=states
    )


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.0, 60.0])
@pytest.mark.parametrize("option", ["static", "attachment"])
@pytest.mark.parametrize("exponents", [(0.0, 0.0), (0.2, 0.1)])
def test_every_residual_with_losses(speed, option, exponents):
    """Receptance at 0 Hz and at a third of the highest mode against the dense matrices, whose motions beyond the
    modes have one rate; residual states have each their own, which is the percent between them. So they do
    with moduli that grow with frequency, beyond the modes by one factor, of attachment modes by their own."""
    t = tire(exponents)
    assert (t.projection.rise is None) == (exponents == (0.0, 0.0))
    wheel, basis = made(t, speed)
    response = wheel.respond(basis, t.modes, t.probes, t.probes, option)
    drag, stiffness = pencil(t, speed)
    loads = on_own_rows(t.operators, t.probes).toarray()
    top = np.sqrt(t.projection.squares[-1])
    still = 1e-3 if speed else 1e-9  # rolling, K_Omega itself has the damping in it
    if t.projection.rise is not None and option == "attachment":
        still = 0.02
    for omega, limit in ((0.0, still), (top / 3, 0.08 if option == "static" else 0.02)):
        matrix = stiffness + 1j * omega * drag - omega**2 * np.diag(t.operators.mass)
        exact = loads.T @ np.linalg.solve(matrix, loads)
        found = response.receptance(np.array([omega / (2 * np.pi)]))[0]
        assert np.linalg.norm(found - exact) < limit * np.linalg.norm(exact), omega


def test_residual_states_lose_by_their_own_frequency():
    """Attachment states beyond the modes have zeta = eta / 2 of rubber, 0.05 to 0.15, and not the
    uniform rate's, which falls with the frequency."""
    t = tire()
    wheel, basis = made(t, 0.0)
    response = wheel.respond(basis, t.modes, t.probes, t.probes, "attachment")
    beyond_modes = np.abs(response.eigenvalue) > 1.001 * np.sqrt(t.projection.squares[-1])
    s = response.eigenvalue[beyond_modes]
    assert len(s) >= 2
    zeta = -s.real / np.abs(s)
    assert (zeta > 0.045).all()
    assert (zeta < 0.155).all()


@pytest.mark.long
@pytest.mark.parametrize("speed", [0.0, 60.0])
def test_the_reference_in_time_has_the_same_losses(speed):
    """A pulse on full finite elements with mode by mode damping against the matrix exponential of the dense
    pencil: the low-rank solver and the rolling term."""
    t = tire()
    projection, operators = t.projection, t.operators
    tail = beyond(StrainEnergy(), projection)
    excess = projection.losses - tail.mass * np.eye(KEPT)
    turning = (t.rotation.body, speed) if speed else ()
    modal = ModalDamping(operators, t.modes.vectors, excess, *turning)
    drag, stiffness = pencil(t, speed)
    # An impulse along a few modes, so that a step resolves all that moves.
    start = t.modes.vectors[:, :6].sum(axis=1)
    h, steps = 1e-4, 100
    rotation = t.rotation if speed else None
    full = FullTire(
        operators=operators,
        rotation=rotation,
        speed=speed,
        damping=tail,
        step=h,
        outputs=t.probes,
        loads=t.probes,
        spectral_radius=1.0,
        modal=modal,
    )
    full.velocity = start.copy()
    none = np.zeros(t.probes.shape[0])
    minus = np.linalg.solve(np.diag(operators.mass), np.hstack([stiffness, drag]))
    full.acceleration = full.balanced = -minus[:, len(start) :] @ start
    for _ in range(steps):
        full.predict()
        full.advance(none)
    n = len(start)
    companion = np.block([[np.zeros((n, n)), np.eye(n)], [-minus]])
    exact = (linalg.expm(h * steps * companion) @ np.append(np.zeros(n), start))[:n]
    assert np.linalg.norm(full.displacement - exact) < 0.01 * np.linalg.norm(exact)
