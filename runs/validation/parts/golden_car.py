"""The golden car, without a tire, against its published poles: (case, unit, computed, exact)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI
from scipy import optimize, sparse

from tireroad.fem.axle import Axle
from tireroad.fem.turning import Turning
from tireroad.greens.basis import Basis
from tireroad.greens.response import Response
from tireroad.modal.basis import Projection
from tireroad.modal.corner import Corner
from tireroad.modal.rolling import decouple

GOLDEN = 653.0, 63.3, 6.0, 0.15  # k_t, k_s 1/s2, c 1/s, m_u for a body of 1 kg
PUBLISHED = -2.590 + 7.323j, -20.410 + 64.423j  # 1/s


def rows() -> Iterator[tuple]:
    """Real and imaginary parts of both poles, against the polynomial of the car."""
    for number, (found, exact) in enumerate(zip(poles(), exact_poles(), strict=True), 1):
        for part, one, other in (
            ("real", found.real, exact.real),
            ("imaginary", found.imag, exact.imag),
        ):
            yield f"golden car, pole {number}, {part} part", "1/s", one, other


def golden_car() -> Basis:
    """Wheel and body without a tire, read and loaded at one point under the axle. Collective."""
    _, k_s, c, m_u = GOLDEN
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
        body=nothing, body_convective=nothing,
        own_mass=own, own_stiffness=own, own_gyroscopic=own, own_convective=own,
    )  # fmt: skip
    projection = Projection(squares=np.zeros(0), momentum=np.zeros((3, 0)), corner=corner)
    states = decouple(projection, Turning(damping=(0.0, 0.0)), MPI.COMM_WORLD)
    return Basis(shape=np.zeros((3, 0)), projection=projection, states=states)


def response() -> Response:
    """The vertical response at that point. Collective."""
    point = sparse.csr_matrix([[0.0, 0.0, 1.0]])
    return golden_car().couple(point, point)


def poles() -> list[complex]:
    """Poles 1/s as in PUBLISHED: H(s) + 1/k_t = 0 with a massless tire spring. Collective."""
    wheel = response()

    def closed(
        s: complex,
    ) -> complex:  # `receptance` adds the mirror poles, so it is H(s) off the imaginary axis too
        return wheel.receptance(np.array([s / (2j * np.pi)]))[0, 0, 0] + 1 / GOLDEN[0]

    return [
        complex(optimize.newton(closed, near, x1=near * 1.0001, tol=1e-13)) for near in PUBLISHED
    ]


def exact_poles() -> list[complex]:
    """Poles 1/s, in the same order: (m_u s2 + c s + k_s + k_t)(s2 + c s + k_s) = (c s + k_s)^2."""
    k_t, k_s, c, m_u = GOLDEN
    spring = np.array([c, k_s])
    both = np.polymul([m_u, c, k_s + k_t], [1.0, c, k_s])
    roots = np.roots(np.polysub(both, np.polymul(spring, spring)))
    return [complex(roots[np.abs(roots - near).argmin()]) for near in PUBLISHED]
