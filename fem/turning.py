"""Rotation of the wheel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from tireroad.fem.errors import InputError

INERTIAS = ("full", "doppler")


@dataclass(frozen=True, kw_only=True)
class Turning:
    """Rotation of the wheel, and its damping.

    `speed` rad/s, 0: standing; `damping` of the material, (gamma1 1/s, gamma2 s) or by strain
    energy, as in modal.damping; `inertia` "full", or "doppler": without Coriolis and centrifugal
    forces.
    """

    speed: float = 0.0
    damping: Any = (0.0, 0.0)
    inertia: str = "full"

    def __post_init__(self) -> None:
        if not (math.isfinite(self.speed) and self.speed >= 0.0):
            raise InputError(f"speed = {self.speed:g} rad/s must be 0 or more, and finite")
        if self.inertia not in INERTIAS:
            raise InputError(f'inertia = "{self.inertia}" is unknown: take "full" or "doppler"')
