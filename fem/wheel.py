"""The wheel: how it is suspended (held, a corner of a car, a constant force only) and how it rotates.

The wheel and its brake are one rigid body attached to the rim. Springs and dampers connect it to a
body that moves vertically, or to the ground. In all other directions the body moves at the constant
speed of the car.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Limits, finite

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
_VERTICAL = 2
INERTIAS = ("full", "doppler")
SHAPE_TOLERANCE = 2e-3  # -, of Turning
_RATES = Limits(least=0.0)
TOLERANCES = Limits(least=1e-6, most=1.0)  # -


@dataclass(frozen=True, kw_only=True)
class Axle:
    """A wheel that moves in the directions that are not `locked`.

    `wheel_mass` kg; `wheel_inertia` (3,) kg m2 about x, y, z; `stiffness` and `damping` (6, 6)
    between wheel and body: N/m and N s/m for the three translations of the axle's centre, N m/rad
    and N m s/rad for the rotations; `body_mass` kg, None: springs and dampers go to the ground. The
    static load is carried by a constant force.
    """

    wheel_mass: float
    wheel_inertia: tuple[float, float, float]
    stiffness: np.ndarray
    damping: np.ndarray
    body_mass: float | None = None
    locked: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        unknown = set(self.locked) - set(DIRECTIONS)
        if unknown:
            raise InputError(
                f"axle: locked {sorted(unknown)} unknown: take {', '.join(DIRECTIONS)}"
            )
        for name in ("stiffness", "damping"):
            matrix = np.asarray(getattr(self, name), float)
            matrix = np.diag(matrix) if matrix.ndim == 1 else matrix
            least = np.linalg.eigvalsh(matrix)[0] if np.isfinite(matrix).all() else -math.inf
            if np.abs(matrix - matrix.T).max() > 1e-12 * np.abs(matrix).max() or (
                least < -1e-9 * np.abs(matrix).max()
            ):
                raise InputError(
                    f"axle: {name} must be symmetric and positive semidefinite (6 x 6)"
                )
            object.__setattr__(self, name, matrix)
        moving = (
            self.wheel_mass,
            *np.asarray(self.wheel_inertia)[[d - 3 for d in self.moving if d > 2]],
        )
        if min(moving) <= 0 or (self.body_mass is not None and self.body_mass <= 0):
            raise InputError(
                "axle: directions that are not locked need a mass or a moment of inertia above 0"
            )

    @classmethod
    def held(cls) -> Axle:
        """An axle with all six directions locked."""
        return cls(
            wheel_mass=1.0,
            wheel_inertia=(1.0, 1.0, 1.0),
            stiffness=np.zeros(6),
            damping=np.zeros(6),
            locked=DIRECTIONS,
        )

    @property
    def moving(self) -> list[int]:
        """Indices (0 to 5) of the directions in which the wheel moves."""
        return [k for k, name in enumerate(DIRECTIONS) if name not in self.locked]

    @property
    def taking_part(self) -> list[int]:
        """Indices of the degrees of freedom in use: 0 to 5 of the wheel, 6 of the body."""
        return self.moving + [6] * self.has_body

    @property
    def has_body(self) -> bool:
        """Whether a body moves in addition to the wheel."""
        return self.body_mass is not None and _VERTICAL in self.moving

    @property
    def mass(self) -> np.ndarray:
        """Mass matrix (6, 6) of the wheel: kg, kg m2."""
        return np.diag([*[self.wheel_mass] * 3, *self.wheel_inertia])

    @property
    def gyroscopic(self) -> np.ndarray:
        """Gyroscopic matrix (6, 6), kg m2, at 1 rad/s: tilt rate x (I_yy e_y)."""
        out = np.zeros((6, 6))
        out[3, 5], out[5, 3] = -self.wheel_inertia[1], self.wheel_inertia[1]
        return out

    @property
    def free_motions(self) -> np.ndarray:
        """Motions (7, r) of wheel and body, one per column, that neither spring nor damper resists.

        Translations without spring and damper; with a body, wheel and body together in height.
        """
        columns = []
        for k in self.moving:
            alone = not (self.stiffness[k].any() or self.damping[k].any())
            together = k == _VERTICAL and self.has_body
            if k < 3 and (alone or together):
                column = np.zeros(7)
                column[k] = 1.0
                column[6] = together
                columns.append(column)
        return np.array(columns).reshape(-1, 7).T

    def between_wheel_and_body(self, matrix: np.ndarray) -> np.ndarray:
        """The matrix (6, 6) of springs or dampers in terms of wheel and body (7, 7): their
        elongation is wheel minus body in height."""
        apart = np.hstack([np.eye(6), -np.eye(6)[:, [_VERTICAL]]])
        return apart.T @ matrix @ apart


class Proportional(NamedTuple):
    """D = mass M + stiffness K: gamma1 in 1/s, gamma2 in s."""

    mass: float = 0.0
    stiffness: float = 0.0


@dataclass(frozen=True)
class StrainEnergy:
    """Damping by the loss factors of the modes, `Projection.loss_factor`."""


Damping = Proportional | tuple[float, float] | StrainEnergy


@dataclass(frozen=True, kw_only=True)
class Turning:
    """Rotation of the wheel, and its damping.

    `speed` rad/s, 0: standing; `damping` of the material, (gamma1 1/s, gamma2 s) or by strain
    energy, as in modal.damping; `inertia` "full", or "doppler": without Coriolis and centrifugal
    forces; `shape_tolerance`: the relative shift of squared frequencies from which on a rotation shape
    joins the modes (modal.rotation_shapes). InputError for a value that is out of range.
    """

    speed: float = 0.0
    damping: Damping = (0.0, 0.0)
    inertia: str = "full"
    shape_tolerance: float = SHAPE_TOLERANCE

    def __post_init__(self) -> None:
        try:
            _RATES.check(finite(self.speed), "rad/s")
        except (TypeError, ValueError):
            raise InputError(
                f"speed = {self.speed!r} rad/s must be a number, 0 or more, and finite"
            ) from None
        try:
            TOLERANCES.check(finite(self.shape_tolerance), "-")
        except (TypeError, ValueError) as error:
            raise InputError(f"shape_tolerance = {self.shape_tolerance!r}: {error}") from None
        if self.inertia not in INERTIAS:
            raise InputError(f'inertia = "{self.inertia}" is unknown: take "full" or "doppler"')
        if not isinstance(self.damping, StrainEnergy):
            _check_rates(self.damping)


def _check_rates(damping: tuple[float, float]) -> None:
    """InputError unless `damping` is two numbers of at least 0."""
    try:
        mass, stiffness = damping
        for value in (mass, stiffness):
            _RATES.check(finite(value), "-")
    except (TypeError, ValueError):
        raise InputError(
            f"damping = {damping!r} must be two numbers of 0 or more, (gamma1 in 1/s, gamma2 in s), "
            "such as (500.0, 0.0)"
        ) from None
