"""Shape of the road under the tire: a plane, inclined by the wheel's camber, or a drum.

In the wheel's axes the surface is z = h + s(x, y), h being its height under the axle. The wheel is
tilted by gamma about x (its top to the right, -y, for gamma > 0), so the road's normal is (0, sin
gamma, cos gamma) there, and

    s = -y tan gamma + d(x) / cos gamma,
    d = sqrt(R^2 - x^2) - R on a drum, R - sqrt(R^2 - x^2) inside one,

for a drum with a horizontal axis. Beyond 0.9 R a drum is continued by its tangent; there is no
contact there.

All of these surfaces are developable. A point on the road has the coordinates xi = R asin(x/R) (x
on a plane) along it and eta = y cos gamma - z sin gamma across it. A body on the road that moves up
with it keeps both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_REACH = 0.9  # of the drum's radius


@dataclass(frozen=True, kw_only=True)
class RoadShape:
    """`camber` rad; `drum_radius` m, None: flat road; `inside`: the tire runs inside the drum."""

    camber: float = 0.0
    drum_radius: float | None = None
    inside: bool = False

    @property
    def flat(self) -> bool:
        """Whether the road is a level plane."""
        return self.camber == 0.0 and self.drum_radius is None

    @property
    def upright(self) -> float:
        """cos gamma: component of the road's normal along the wheel's z."""
        return math.cos(self.camber)

    def height(self, x: Array, y: Array) -> Array:
        """s (m) at x, y (m)."""
        lean = -math.tan(self.camber) * y
        if self.drum_radius is None:
            return lean
        near, radius, sign = self._near(x), self.drum_radius, self._sign
        drop = np.sqrt(radius**2 - near**2) - radius
        beyond = -near / np.sqrt(radius**2 - near**2) * (x - near)
        return lean + sign * (drop + beyond) / self.upright

    def slopes(self, x: Array, y: Array) -> tuple[Array, Array]:
        """ds/dx, ds/dy."""
        across = np.full(np.shape(x), -math.tan(self.camber))
        if self.drum_radius is None:
            return np.zeros(np.shape(x)), across
        near = self._near(x)
        return -self._sign * near / np.sqrt(self.drum_radius**2 - near**2) / self.upright, across

    def bending(self, x: Array) -> Array:
        """Curvature along xi towards the road's normal, 1/m: -1/R on a drum, 1/R inside one."""
        if self.drum_radius is None:
            return np.zeros(np.shape(x))
        return np.where(self._near(x) == x, -self._sign / self.drum_radius, 0.0)

    def unrolled(self, places: Array) -> Array:
        """xi, eta (n, 2) m of positions (n, 3) m."""
        if self.flat:
            return places[:, :2]
        x, y, z = places.T
        along = x
        if self.drum_radius is not None:
            near, radius = self._near(x), self.drum_radius
            cosine = np.sqrt(1.0 - (near / radius) ** 2)
            along = radius * np.arcsin(near / radius) + (x - near) / cosine
        return np.stack([along, y * self.upright - z * math.sin(self.camber)], axis=-1)

    def frames(self, x: Array, y: Array) -> Array:
        """Unit vectors (n, 3, 3) in the wheel's axes: along the road, to its left, normal to it."""
        along, across = self.slopes(x, y)
        one, nothing = np.ones(len(along)), np.zeros(len(along))
        left = _unit(np.stack([nothing, one, across], axis=-1))
        normal = _unit(np.stack([-along, -across, one], axis=-1))
        forward = _unit(np.asarray(np.cross(left, normal), dtype=np.float64))
        return np.stack([forward, left, normal], axis=1)

    @property
    def up(self) -> Array:
        """The road's normal (3,) under the axle, along which it is raised."""
        return np.array([0.0, math.sin(self.camber), self.upright])

    def stretch(self, x: Array, y: Array) -> Array:
        """Ratio of the normal force to its component along the wheel's z, and of height to
        distance, at x, y (m)."""
        along, across = self.slopes(x, y)
        return np.sqrt(1.0 + along**2 + across**2)

    @property
    def _sign(self) -> float:
        return -1.0 if self.inside else 1.0

    def _near(self, x: Array) -> Array:
        assert self.drum_radius is not None, "the road is no drum"
        reach = _REACH * self.drum_radius
        return np.clip(x, -reach, reach)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


FLAT = RoadShape()
