"""Attachment modes of many points: those that are left out cost no more than the stated tolerance."""

import tracemalloc

import numpy as np
import pytest
from mpi4py import MPI
from probed_torus import probed_torus
from scipy import sparse

from tireroad.fem.matrices import compliance as compliance_module
from tireroad.fem.matrices.compliance import LoadedShapes, compliance, on_own_rows
from tireroad.greens import coupling
from tireroad.greens.coupling import Basis, Wheel
from tireroad.modal.basis import project

COMM = MPI.COMM_WORLD


@pytest.fixture(scope="module")
def tire():
    """40 modes, vertical probes at 15 x 9 points 8 mm apart (closer than the nodes)."""
    return probed_torus(40, 15, 9)


@pytest.mark.long
@pytest.mark.mpi
@pytest.mark.parametrize("speed", [0.0, 30.0, 90.0])
def test_what_is_left_out_is_within_the_tolerance(tire, speed, monkeypatch):
    """Receptance up to half the highest mode against that of all attachment modes: 0.15 % (directions
    and pseudo-modes) to 30 rad/s, 0.42 % at 90 (states beyond FASTEST), none at 0 Hz; and fewer states.
    """
    operators, modes, probes = tire
    wheel = Wheel(
        operators=operators,
        rotation=operators.rotation() if speed else None,
        speed=speed,
        damping=(100.0, 0.0),
        inertia="full",
    )
    projection = project(modes, wheel.rotation, operators.carried, COMM)
    shape = operators.trace(modes.vectors)
    basis = Basis(shape=shape, projection=projection, states=wheel.decouple(projection, COMM))
    monkeypatch.setattr(coupling, "FEW", 0)
    reduced = wheel.respond(basis, modes, probes, probes, "attachment")
    monkeypatch.setattr(coupling, "TOLERANCE", 0.0)
    monkeypatch.setattr(coupling, "FASTEST", np.inf)
    every = wheel.respond(basis, modes, probes, probes, "attachment")
    frequency = np.linspace(0.0, modes.frequency[-1] / 2, 8)
    exact = every.receptance(frequency)
    error = np.linalg.norm(reduced.receptance(frequency) - exact, axis=(1, 2))
    error /= np.linalg.norm(exact, axis=(1, 2))
    assert error[0] < 1e-9
    assert error.max() < (1.5e-3 if speed <= 30.0 else 4.5e-3)
    assert len(reduced.eigenvalue) < 0.9 * len(every.eigenvalue)


@pytest.mark.long
@pytest.mark.mpi
def test_fields_of_all_loads_are_never_held(tire, monkeypatch):
    """The flexibility of 200 loads, solved four at a time, takes a third of their fields at most, and is that of all fields."""
    operators, _, probes = tire
    few = sparse.identity(probes.shape[1], format="csr")[::7][:200]
    monkeypatch.setattr(compliance_module, "_CHUNK", 4)
    tracemalloc.start()
    flexibility = compliance(operators, operators.stiffness, few, few)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    loads = on_own_rows(operators, few)
    assert flexibility.shape == (200, 200) and peak < 8 * loads.shape[0] * 200 / 3
    shapes = LoadedShapes(operators, operators.stiffness)
    fields = shapes.whole(loads)
    shapes.destroy()
    np.testing.assert_allclose(flexibility, COMM.allreduce(loads.T @ fields), atol=1e-18)


def test_directions_that_are_left_out_add_up_to_less_than_the_tolerance():
    """Against the flexibility itself, entry by entry."""
    random = np.random.default_rng(6)
    turn = np.linalg.qr(random.standard_normal((40, 40)))[0]
    missing = turn @ np.diag(np.logspace(0, -9, 40)) @ turn.T
    own = 3.0 * np.diag(missing)
    kept = coupling.foremost(missing, own)
    assert 5 < kept.shape[1] < 30
    lost = missing - kept @ (kept.T @ missing @ kept) @ kept.T
    assert (np.abs(lost) <= coupling.TOLERANCE * np.sqrt(np.outer(own, own))).all()
    assert coupling.foremost(missing, 1e-30 * own).shape[1] == 40
    assert coupling.foremost(missing, 1e6 * own).shape[1] == 0


def test_points_closer_than_nodes_need_no_load_each():
    """Their unit loads and weights make them up again; fewer points than touched numbers stay as they are."""
    random = np.random.default_rng(3)
    probes = sparse.csr_matrix(random.random((12, 4)) @ np.eye(30)[[3, 7, 8, 21]])
    weights, loads = coupling.fewest(probes)
    assert loads.shape == (4, 30)
    np.testing.assert_array_equal((weights @ loads).toarray(), probes.toarray())
    weights, loads = coupling.fewest(probes[:3])
    assert loads.shape == (3, 30)
    np.testing.assert_array_equal((weights @ loads).toarray(), probes[:3].toarray())
