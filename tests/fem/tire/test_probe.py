"""Forces and readings on the outer face, and the static flexibility between them."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse
from scipy.sparse.linalg import spsolve

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.matrices import probe
from tireroad.fem.matrices.compliance import add_part, compliance, rotating_stiffness
from tireroad.fem.matrices.operators import Operators


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("spread", [(0.0, 0.0), (0.2, 0.1), (0.0, 0.4)])
def test_weights_share_out_one(make_body, order, spread):
    lattice = make_body(order).lattice
    for ring, arc in ((0.0, 0.0), (0.05, -0.3), (6.2, 1.0)):
        weights = probe.spot(lattice, ring, arc, spread)
        assert weights.sum() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("spread", [0.0, 0.1])
def test_a_spot_ends_at_the_bead(make_body, spread):
    """Beyond it the weights were not numbers, and a solver asked for a lower speed."""
    lattice = make_body(2).lattice
    bead = float(lattice.arc_corners[-1])
    assert np.isfinite(probe.spot(lattice, 0.0, bead - spread, (0.0, spread))).all()
    for arc in (bead - spread + 0.01, -bead + spread - 0.01, np.nan):
        with pytest.raises(InputError, match="beyond the bead"):
            probe.spot(lattice, 0.0, arc, (0.0, spread))


def test_a_point_reads_what_stands_there(make_body):
    lattice = make_body(2, 24, 12).lattice
    ring, along = np.meshgrid(lattice.ring, lattice.arc, indexing="ij")
    field = (np.cos(ring) * along**2).ravel()
    assert probe.spot(lattice, 0.7, 0.9) @ field == pytest.approx(np.cos(0.7) * 0.81, rel=1e-4)
    index = 3 * len(lattice.arc) + 2
    weights = probe.spot(lattice, lattice.ring[3], lattice.arc[2])
    np.testing.assert_allclose(weights, np.eye(len(field))[index], atol=1e-12)


def test_directions_are_unit_vectors():
    weights = probe.directed(np.array([0.25, 0.75]), np.array([0.0, 3.0, 4.0]))
    np.testing.assert_allclose(weights, [0, 0.15, 0.2, 0, 0.45, 0.6])


@pytest.mark.mpi
@pytest.mark.parametrize("inertia", ["full", "doppler"])
def test_compliance_is_that_of_a_direct_solve(make_body, csr, inertia):
    speed, damping = 80.0, (300.0, 1e-5)

    def flexibility(comm):
        body = make_body(2, 8, 4, comm=comm)
        operators = Operators(body, 1e5)
        rotation = operators.rotation()
        stiffness = rotating_stiffness(operators, rotation, speed, damping, inertia)
        face = len(body.surface.ids)
        index = np.array([4, 5, 31])
        loads = probe.nodes(index, face)
        return body, operators, rotation, compliance(operators, stiffness, loads, loads)

    *_, shared = flexibility(MPI.COMM_WORLD)
    body, operators, rotation, alone = flexibility(MPI.COMM_SELF)
    np.testing.assert_allclose(shared, alone, rtol=1e-8, atol=1e-8 * abs(alone).max())
    stiffness = csr(operators.stiffness)
    spin = {"full": rotation.convective, "doppler": rotation.body_convective}[inertia]
    turned = stiffness + speed**2 * csr(spin) + speed * damping[0] * csr(rotation.body)
    inverse_mass = sparse.diags(1 / operators.mass)
    turned = turned + speed * damping[1] * stiffness @ inverse_mass @ csr(rotation.body)
    dofs = [
        np.flatnonzero(
            operators.unknowns.free == 3 * np.flatnonzero(body.ids == body.surface.ids[i])[0] + 2
        )[0]
        for i in (4, 5, 31)
    ]
    loads = np.zeros((len(operators.unknowns.free), 3))
    loads[dofs, range(3)] = 1.0
    np.testing.assert_allclose(spsolve(turned.tocsc(), loads)[dofs], alone, rtol=1e-8)


def test_a_tire_that_nothing_holds_has_no_compliance(make_body):
    body = make_body(2, 8, 4, free=True)
    operators = Operators(body, 0.0)
    load = probe.nodes(np.array([7]), len(body.surface.ids))
    with pytest.raises(ConvergenceError, match="singular"):
        compliance(operators, operators.stiffness, load, load)


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_a_part_with_other_entries_is_added_where_they_belong(share: float) -> None:
    """A sum of the numbers alone would put them elsewhere."""
    whole = sparse.random(60, 60, 0.2, format="csr", random_state=1) + sparse.identity(60)
    part = whole.multiply(sparse.random(60, 60, share, random_state=3) > 0).tocsr()
    matrices = []
    for given in (whole, part):
        given.sort_indices()
        csr = given.indptr, given.indices, given.data
        matrices.append(PETSc.Mat().createAIJ(given.shape, csr=csr, comm=PETSc.COMM_SELF))
    add_part(matrices[0], 2.5, matrices[1])
    starts, columns, values = matrices[0].getValuesCSR()
    found = sparse.csr_matrix((values, columns, starts))
    assert abs(found - (whole + 2.5 * part)).max() < 1e-15
