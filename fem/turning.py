"""Rotation of the wheel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Limits, finite

INERTIAS = ("full", "doppler")
SHAPE_TOLERANCE = 2e-3  # -, of Turning
_RATES = Limits(least=0.0)
TOLERANCES = Limits(least=1e-6, most=1.0)  # -


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
