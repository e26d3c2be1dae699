"""Rings with closed forms as modal bases, by quadrature over the circle; no finite elements."""

import numpy as np

from tireroad.modal.basis import Projection

_THETA = np.linspace(0, 2 * np.pi, 128, endpoint=False)


def wave_ring(frequencies: dict[int, float], repeats: int = 1) -> Projection:
    """A scalar field on a circle, cos and sin of each wave number n with omega_n (1/s): every pair double.

    Body and inertial rate are one for a scalar, so the doppler shift +- i n Omega holds for both.
    """
    numbers = np.repeat(list(frequencies), 2 * repeats)
    squares = np.array([frequencies[n] ** 2 for n in numbers])
    gyroscopic = np.zeros((len(numbers),) * 2)
    for k in range(0, len(numbers), 2):
        gyroscopic[k, k + 1], gyroscopic[k + 1, k] = numbers[k], -numbers[k]
    order = np.argsort(squares, kind="stable")
    gyroscopic, squares = gyroscopic[np.ix_(order, order)], squares[order]
    convective = gyroscopic @ gyroscopic
    momentum = np.zeros((3, len(squares)))
    return Projection(
        squares=squares,
        momentum=momentum,
        gyroscopic=gyroscopic,
        convective=convective,
        body=gyroscopic,
        body_convective=convective,
    )


def inextensional_ring(waves: list[int], bending: float, speed: float) -> Projection:
    """Thin ring in its plane spun up to `speed`: v = cos n theta, w = n sin n theta and their partners.

    `bending` is EI / (rho A R^4), 1/s2. Lambda holds the hoop tension rho A R^2 Omega^2, whose geometric
    stiffness is the integral of |d u / d theta|^2: it takes the centrifugal term -Omega^2 S off again.
    """
    fields, rates, numbers = [], [], []
    tangent = np.stack([np.cos(_THETA), -np.sin(_THETA)])
    radial = np.stack([np.sin(_THETA), np.cos(_THETA)])
    for n in waves:
        for phase in (0.0, np.pi / 2):
            v, w = np.cos(n * _THETA - phase), n * np.sin(n * _THETA - phase)
            dv, dw = -w, n**2 * v
            norm = np.sqrt((n**2 + 1) * np.pi)
            fields.append((v * tangent + w * radial) / norm)
            rates.append(((dv + w) * tangent + (dw - v) * radial) / norm)
            numbers.append(n)
    shapes = np.stack(fields).reshape(len(fields), -1)
    slopes = np.stack(rates).reshape(len(rates), -1)
    weight = 2 * np.pi / len(_THETA)
    gyroscopic, stretch = weight * shapes @ slopes.T, weight * slopes @ slopes.T
    n = np.array(numbers)
    squares = bending * n**2 * (n**2 - 1) ** 2 / (n**2 + 1) + speed**2 * np.diag(stretch)
    turned = np.stack([field[::-1] * [[1], [-1]] for field in fields]).reshape(len(fields), -1)
    body = gyroscopic - weight * shapes @ turned.T
    return Projection(
        squares=squares,
        momentum=np.zeros((3, len(n))),
        gyroscopic=gyroscopic,
        convective=-stretch,
        body=(body - body.T) / 2,
        body_convective=body @ body,
    )


def random_tire(size: int, seed: int = 1) -> Projection:
    """Matrices with the structure of a rolling tire's (skew G and B, S <= 0) and no symmetry at all."""
    random = np.random.default_rng(seed)
    squares = np.sort(random.uniform(300.0, 4000.0, size)) ** 2

    def skew():
        matrix = 3 * random.standard_normal((size, size)) / np.sqrt(size)
        return matrix - matrix.T

    gyroscopic, body = skew(), skew()
    momentum = np.zeros((3, size))
    return Projection(
        squares=squares,
        momentum=momentum,
        gyroscopic=gyroscopic,
        convective=gyroscopic @ gyroscopic,
        body=body,
        body_convective=body @ body,
    )
