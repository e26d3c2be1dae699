"""The golden car: wheel and body without a tire, against its published poles and in time."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy import sparse

from tireroad.greens.recursion import Recursion
from tireroad.tests.validation import closed_forms

COMM = MPI.COMM_WORLD


def test_the_golden_car_on_its_tire() -> None:
    """Where the road holds a massless tire's spring, H(s) + 1/k_t = 0: published poles, and the polynomial's."""
    assert closed_forms.response().rigid == 2  # wheel and body fall together
    for found, exact, published in zip(
        closed_forms.poles(), closed_forms.exact_poles(), closed_forms.PUBLISHED, strict=True
    ):
        assert abs(found - exact) < 1e-9 * abs(found)
        assert found == pytest.approx(published, abs=1e-3)  # three decimals are published


def test_the_golden_car_in_time() -> None:
    """A push on the wheel under a free corner: momentum by impulse, and springs by the exact recursion."""
    basis = closed_forms.golden_car()
    point = sparse.csr_matrix([[0.0, 0.0, 1.0]])
    reading = sparse.hstack([sparse.csr_matrix((2, 3)), sparse.csr_matrix(np.eye(7)[[2, 6]])])
    response = basis.couple(reading.tocsr(), point)
    step, m_u, body = 1e-3, closed_forms.GOLDEN[3], 1.0
    tire = Recursion(response=response, step=step, scheme="linear", comm=COMM)
    tire.start(np.ones(1))
    places = []
    for _ in range(3000):
        free = tire.predict()
        tire.advance(np.ones(1))
        places.append(free + tire.same_step @ np.ones(1))
    wheel, car = places[-1]
    centre = (m_u * wheel + body * car) / (m_u + body)
    assert centre == pytest.approx(0.5 * 3.0**2 / (m_u + body), rel=1e-9)
    # Carried along at a / (m_u + 1), the spring holds the body's share of the force.
    assert wheel - car == pytest.approx(body / (m_u + body) / closed_forms.GOLDEN[1], rel=1e-4)
