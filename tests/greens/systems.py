"""Small tires made of random matrices: no mesh, no solver, every eigenvalue known."""

from dataclasses import dataclass

import numpy as np

from tireroad.greens.response import Response, couple
from tireroad.modal.rotating import rotating


@dataclass(frozen=True)
class System:
    """u'' + D u' + K u = shape^T f in modal coordinates, read by `shape` (k, m)."""

    drag: np.ndarray
    stiffness: np.ndarray
    shape: np.ndarray

    @property
    def companion(self) -> np.ndarray:
        m = len(self.drag)
        return np.block([[np.zeros((m, m)), np.eye(m)], [-self.stiffness, -self.drag]])

    @property
    def push(self) -> np.ndarray:
        """Forces into the companion's states, (2m, k)."""
        return np.vstack([0 * self.shape.T, self.shape.T])

    @property
    def reading(self) -> np.ndarray:
        """Displacements out of the companion's states, (k, 2m)."""
        return np.hstack([self.shape, 0 * self.shape])

    def reversed(self) -> "System":
        """The same wheel turning the other way."""
        return System(self.drag.T, self.stiffness.T, self.shape)

    def response(self, **options) -> Response:
        m = self.shape.shape[1]
        modes = rotating(self.drag, self.stiffness)
        return couple(modes, self.shape, self.shape, np.ones((3, m)), **options)


def make(
    seed: int = 0, m: int = 8, points: int = 4, speed: float = 30.0, damping: float = 8.0
) -> System:
    """A rolling system of m modes with gyroscopic and circulatory terms."""
    rng = np.random.default_rng(seed)
    squares = np.linspace(80.0, 900.0, m) ** 2
    skew = [a - a.T for a in rng.normal(size=(2, m, m)) / m]
    convective = rng.normal(size=(m, m)) / m
    drag = damping * np.eye(m) + 2 * speed * skew[0]
    stiffness = np.diag(squares) - speed**2 * convective @ convective.T
    stiffness += damping * speed * skew[1]
    return System(drag, stiffness, rng.normal(size=(points, m)))
