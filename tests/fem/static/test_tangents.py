"""The tangent of the static state is the derivative of its residual, term by term."""

import numpy as np
import pytest
from dolfinx import fem

from tireroad.fem import compat
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.virtual_work import Rolling, static_residual, tangent
from tireroad.fem.tire.material import compound

TERMS = {
    "stress": (0.0, Rolling()),
    "pressure": (2e6, Rolling()),
    "inertia": (0.0, Rolling(speed=150.0)),
    "damping": (0.0, Rolling(speed=150.0, damping=500.0)),
    "doppler": (0.0, Rolling(speed=150.0, damping=0.0, stiffness_damping=0.0, inertia="doppler")),
}
MODELS = {
    "linear": {"youngs_modulus": 5e6, "poisson_ratio": 0.49},
    "neo-hookean": {"youngs_modulus": 5e6, "poisson_ratio": 0.49},
    "mooney-rivlin": {"c10": 6e5, "c01": 2e5, "bulk_modulus": 8e7},
    "yeoh": {"c10": 6e5, "c20": 1e5, "c30": 1e5, "bulk_modulus": 8e7},
}


def forces(body, pressure, rolling):
    form = compat.form(static_residual(body, fem.Constant(body.mesh, pressure), rolling))
    return lambda: fem.petsc.assemble_vector(form).array.copy()


def matrix(body, pressure, rolling):
    residual = static_residual(body, fem.Constant(body.mesh, pressure), rolling)
    made = fem.petsc.assemble_matrix(compat.form(tangent(body, residual)))
    made.assemble()
    return made


def central(body, assembled, direction, size):
    here = body.u.x.array.copy()
    ends = []
    for sign in (1, -1):
        body.u.x.array[:] = here + sign * size * direction
        ends.append(assembled())
    body.u.x.array[:] = here
    return (ends[0] - ends[1]) / (2 * size)


def deformed(body):
    """A rough shape, strained by some per cent."""
    rng = np.random.default_rng(1)
    body.u.x.array[:] = 2e-4 * rng.standard_normal(len(body.u.x.array))
    return rng.standard_normal(len(body.u.x.array))


@pytest.mark.parametrize("term", TERMS)
def test_tangent_is_the_derivative_and_every_term_counts(make_body, csr, term):
    body = make_body(segments=8, arc=4)
    direction = deformed(body)
    exact = csr(matrix(body, *TERMS[term])) @ direction
    numeric = central(body, forces(body, *TERMS[term]), direction, 1e-7)
    scale = np.linalg.norm(numeric)
    assert np.linalg.norm(exact - numeric) < 1e-6 * scale
    if term != "stress":
        without = {"damping": "inertia"}.get(term, "stress")
        part = exact - csr(matrix(body, *TERMS[without])) @ direction
        assert np.linalg.norm(part) > 1e-5 * scale  # ten times what the check above lets pass


@pytest.mark.parametrize("model", MODELS)
def test_tangent_of_every_material(make_body, csr, model):
    body = make_body(segments=8, arc=2, material=compound(model, 1200.0, **MODELS[model]))
    direction = deformed(body)
    exact = csr(matrix(body, 0.0, Rolling())) @ direction
    numeric = central(body, forces(body, 0.0, Rolling()), direction, 1e-7)
    assert np.linalg.norm(exact - numeric) < 1e-6 * np.linalg.norm(numeric)


def test_prediction_of_the_stress_changes_no_tangent_at_the_last_iterate(make_body, csr):
    """Newton's matrix of stresses and displacements is the plain one when nothing has moved."""
    body = make_body(segments=8, arc=4)
    deformed(body)
    body.owned(body.u.x.array)[body.rim] = 0.0
    equilibrium = Equilibrium(body)
    equilibrium._before.x.array[:] = body.u.x.array
    equilibrium._assemble_tangent()
    plain = csr(matrix(body, 0.0, Rolling())).tolil()
    rim = (3 * body.rim[:, None] + np.arange(3)).ravel()
    plain[rim] = 0
    plain[:, rim] = 0
    plain[rim, rim] = 1
    difference = abs(csr(equilibrium.matrix) - plain.tocsr()).max()
    assert difference < 1e-12 * abs(plain).max()


def fresh(equilibrium):
    equilibrium._before.x.array[:] = equilibrium.body.u.x.array
    equilibrium._assemble_tangent()
    return equilibrium.matrix


def test_damping_by_the_stiffness_has_a_full_tangent(make_body, csr):
    """Speed 100 rad/s, gamma2 = 0.01 s: too much to leave it out (test_shape_damping)."""
    body = make_body(segments=8, arc=4)
    direction = deformed(body)
    rim = (3 * body.rim[:, None] + np.arange(3)).ravel()
    body.u.x.array[rim] = direction[rim] = 0.0
    found = {}
    for damping in (1e-2, 0.0):
        equilibrium = Equilibrium(
            body, Rolling(speed=100.0, damping=0.0, stiffness_damping=damping)
        )
        equilibrium._assemble_residual()
        exact = csr(fresh(equilibrium)) @ direction
        numeric = central(
            body, lambda e=equilibrium: e._assemble_residual().copy(), direction, 1e-7
        )
        free = np.setdiff1d(np.arange(len(direction)), rim)
        scale = np.linalg.norm(numeric[free])
        assert np.linalg.norm((exact - numeric)[free]) < 1e-6 * scale
        found[damping] = exact
    assert np.linalg.norm(found[1e-2] - found[0.0]) > 0.1 * scale
