"""Tires of validations and tests: a rolling strip without finite elements, and the thesis's torus.

A synthetic tire without finite elements, for tests and benchmarks: a rolling strip on springs.

A periodic strip of length L and width B, simply supported at its sides, with travelling waves

  w = Y_j(y) cos(k_n x), sin(k_n x),  k_n = 2 pi n/L,  Y_j = sin(j pi (y/B + 1/2)),
  omega^2 = omega_0^2 + c^2 (k_n^2 + (j pi/B)^2),

convected at the rolling speed v: a mode n > 0 splits into omega +- k_n v, as modes of a tire do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.patch import Patch
from tireroad.fem.sections.torus import Torus
from tireroad.greens.response import Response

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RollingStrip:
    """Mass (kg), length and width (m), lowest circular frequency (1/s), wave speed (m/s), damping
    gamma1 (1/s), rolling speed (m/s)."""

    mass: float = 8.0
    length: float = 2.0
    width: float = 0.2
    lowest: float = 300.0
    wave_speed: float = 60.0
    damping: float = 100.0
    speed: float = 0.0

    def response(self, points: Array, around: int, across: int, residual: int = 0) -> Response:
        """Vertical response between points (c, 2) m from the waves n <= around, j <= across.

        `residual`: number of further orders of both kinds that respond statically (0: none).
        """
        waves = self._waves(points, around, across)
        if not residual:
            return waves
        more = self._waves(points, around + residual, across + residual)
        return replace(waves, residual=more.static() - waves.static())

    def horizontal_response(
        self, points: Array, around: int, across: int, stiff: float
    ) -> Response:
        """Response (3c, 3c) in z, x, y: vertical, and in the road's plane `stiff` times stiffer.

        The tire is slightly tilted: every mode has its own direction, with x up to 0.3 of z.
        """
        plain = self._waves(points, around, across)
        q = len(plain.eigenvalue)
        lean = 0.3 * np.cos(np.arange(q))
        direction = np.stack([np.ones(q), lean, 0.2 * np.ones(q)])
        # A second set of the same waves moves in the plane only.
        plane = np.stack([-lean, np.ones(q), 0.5 * lean]) / stiff
        out = np.hstack([_stacked(plain.output, d) for d in (direction, plane)])
        into = np.vstack([_stacked(plain.input.T, d).T for d in (direction, plane * stiff)])
        count = len(points)
        return replace(
            plain,
            eigenvalue=np.concatenate([plain.eigenvalue, plain.eigenvalue]),
            output=out,
            input=into,
            block_output=np.zeros((3 * count, 0)),
            block_input=np.zeros((0, 3 * count)),
            residual=np.zeros((3 * count, 3 * count)),
            momentum=np.zeros((3, 2 * q)),
        )

    def _waves(self, points: Array, around: int, across: int) -> Response:
        n, j = (a.ravel() for a in np.meshgrid(np.arange(around + 1), np.arange(1, across + 1)))
        # A wave and its mirror image: two states for n > 0, one for n = 0.
        n, j = np.concatenate([n, -n[n > 0]]), np.concatenate([j, j[n > 0]])
        along = 2 * np.pi * n / self.length
        sideways = j * np.pi / self.width
        omega = np.sqrt(self.lowest**2 + self.wave_speed**2 * (along**2 + sideways**2))
        # One pole of a conjugate pair stands for both; overdamped modes have two real poles.
        root = np.sqrt(self.damping**2 / 4 - omega.astype(complex) ** 2)
        over = np.flatnonzero(root.real > 0)
        pick = np.concatenate([np.arange(len(n)), over])
        sign = np.where(np.arange(len(pick)) < len(n), 1, -1)
        weight = sign / np.where(root.real > 0, 2 * root, root)[pick]
        n, j, along, sideways = n[pick], j[pick], along[pick], sideways[pick]
        shape = np.sin(np.outer(points[:, 1] + self.width / 2, sideways))
        wave = np.exp(1j * np.outer(points[:, 0], along))
        even = np.where(n == 0, 2 * (j % 2) / (np.pi * j), 0.0)  # mean of the shape
        momentum = np.zeros((3, len(n)), complex)
        momentum[2] = 2 * even * weight
        count = len(points)
        return Response(
            eigenvalue=-self.damping / 2 + sign * root[pick] + 1j * along * self.speed,
            output=shape * wave * (2 / self.mass * weight),
            input=(shape * wave.conj()).T.astype(complex),
            block=np.zeros((0, 0)),
            block_output=np.zeros((count, 0)),
            block_input=np.zeros((0, count)),
            residual=np.zeros((count, count)),
            momentum=momentum,
            block_momentum=np.zeros((3, 0)),
        )


def _stacked(values: Array, direction: Array) -> Array:
    """(c, q) scaled for each of three components, (3c, q)."""
    return np.concatenate([values * part for part in direction])


def oval_patch(shape: tuple[int, int], spacing: tuple[float, float], load: float) -> Patch:
    """A grid of points (m) around the origin that carries a load (N) inside an ellipse.

    The ellipse extends to 0.6 of the half sides; outside, the gap grows quadratically.
    """
    x, y = ((np.arange(n) - (n - 1) / 2) * d for n, d in zip(shape, spacing, strict=True))
    px, py = (a.ravel() for a in np.meshgrid(x, y, indexing="ij"))
    inside = 1 - (px / (0.6 * x[-1])) ** 2 - (py / (0.6 * y[-1])) ** 2
    force = np.sqrt(np.maximum(inside, 0.0))
    edge = (np.abs(px) > x[-1] - spacing[0] / 2) | (np.abs(py) > y[-1] - spacing[1] / 2)
    return Patch(
        index=np.arange(len(px)),
        points=np.stack([px, py, np.zeros_like(px)], axis=-1),
        half_sizes=np.tile(np.array(spacing) / 2, (len(px), 1)),
        force=load * force / force.sum(),
        gap=2e-3 * np.maximum(-inside, 0.0),
        edge=edge,
        line=np.arange(len(px)) % shape[1],
    )


def thesis_torus(
    *, segments: int, elements_arc: int, elements_thickness: int = 1, order: int = 2, **more: Any
) -> Torus:
    """Outer radius 0.32 m, section radius 0.1 m, wall 12 mm, 120 deg from the crown to each bead.

    `more`: grading and footprint_size of the Torus.
    """
    return Torus(
        outer_radius=0.32,
        minor_radius=0.10,
        thickness=0.012,
        half_angle=math.radians(120),
        segments=segments,
        elements_arc=elements_arc,
        elements_thickness=elements_thickness,
        order=order,
        **more,
    )
