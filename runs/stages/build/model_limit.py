"""Upper frequency up to which the results of a run are valid."""

from __future__ import annotations

import numpy as np

from tireroad.contact.results.limits import Limit, limits, lowest, pitch
from tireroad.contact.setup import ContactSetup
from tireroad.modal.rolling import RollingModes


def all_limits(setup: ContactSetup, rolling: RollingModes, step: float) -> tuple[Limit, ...]:
    """Limits by the modes, the spacing of the contact points and the `step` (s)."""
    return limits(
        step=step,
        highest=rolling.highest / (2 * np.pi),
        pitch=pitch(setup.patch),
        speed=setup.rolled.speed,
    )


def model_limit(setup: ContactSetup, rolling: RollingModes, step: float) -> Limit:
    """The lowest of the limits."""
    return lowest(all_limits(setup, rolling, step))
