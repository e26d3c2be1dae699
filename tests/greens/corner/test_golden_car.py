"""The golden car: wheel and body without a tire, against its published poles and in time."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy import optimize, sparse

from tireroad.fem.axle import Axle
from tireroad.fem.turning import Turning
from tireroad.greens.basis import Basis
from tireroad.greens.recursion import Recursion
from tireroad.modal.basis import Projection
from tireroad.modal.corner import Corner
from tireroad.modal.rolling import decouple

COMM = MPI.COMM_WORLD
GOLDEN = 653.0, 63.3, 6.0, 0.15  # k_t, k_s 1/s2, c 1/s, m_u of a body of 1 kg


def golden_car() -> tuple[Axle, Basis]:
    """Wheel and body without any tire, read and loaded at one point under the axle."""
    k_t, k_s, c, m_u = GOLDEN
    axle = Axle(
        wheel_mass=m_u,
        wheel_inertia=(1.0, 1.0, 1.0),
        stiffness=np.array([0, 0, k_s, 0, 0, 0]),
        damping=np.array([0, 0, c, 0, 0, 0]),
        body_mass=1.0,
        locked=("x", "y", "rx", "ry", "rz"),
    )
    nothing, own = np.zeros((0, 6)), np.zeros((6, 6))
    corner = Corner(
        axle=axle, places=np.array([[0.0, 0.0, -0.3]]),
        mass=nothing, stiffness=nothing, gyroscopic=nothing, convective=nothing,
        own_mass=own, own_stiffness=own, own_gyroscopic=own, own_convective=own,
    )  # fmt: skip
    projection = Projection(squares=np.zeros(0), momentum=np.zeros((3, 0)), corner=corner)
    states = decouple(projection, Turning(damping=(0.0, 0.0)), COMM)
    return axle, Basis(shape=np.zeros((3, 0)), projection=projection, states=states)


def test_the_golden_car_on_its_tire() -> None:
    """Where the road holds a massless tire's spring, H(s) + 1/k_t = 0: published poles, and the polynomial's."""
    k_t, k_s, c, m_u = GOLDEN
    _, basis = golden_car()
    point = sparse.csr_matrix([[0.0, 0.0, 1.0]])
    response = basis.couple(point, point)
    assert response.rigid == 2  # wheel and body fall together
    # (m_u s2 + c s + k_s + k_t)(s2 + c s + k_s) = (c s + k_s)^2
    spring = np.array([c, k_s])
    exact = np.polysub(np.polymul([m_u, c, k_s + k_t], [1.0, c, k_s]), np.polymul(spring, spring))
    exact = np.roots(exact)

    def closed(s):
        return response.receptance(np.array([s / (2j * np.pi)]))[0, 0, 0] + 1 / k_t

    # `receptance` adds the mirror poles, so it is H(s) off the imaginary axis too.
    for published in (-2.590 + 7.323j, -20.410 + 64.423j):
        found = optimize.newton(closed, published, x1=published * 1.0001, tol=1e-13)
        assert abs(found - exact[np.abs(exact - found).argmin()]) < 1e-9 * abs(found)
        assert found == pytest.approx(published, abs=1e-3)  # three decimals are published


def test_the_golden_car_in_time() -> None:
    """A push on the wheel under a free corner: momentum by impulse, and springs by the exact recursion."""
    _, basis = golden_car()
    point = sparse.csr_matrix([[0.0, 0.0, 1.0]])
    reading = sparse.hstack([sparse.csr_matrix((2, 3)), sparse.csr_matrix(np.eye(7)[[2, 6]])])
    response = basis.couple(reading.tocsr(), point)
    step, m_u, body = 1e-3, GOLDEN[3], 1.0
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
    assert wheel - car == pytest.approx(body / (m_u + body) / GOLDEN[1], rel=1e-4)
