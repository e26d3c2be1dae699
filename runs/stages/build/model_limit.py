"""Where the answer of a run ends in frequency."""

from __future__ import annotations

import numpy as np

from tireroad.contact.results.limits import Limit, limits, lowest, pitch
from tireroad.contact.setup import ContactSetup
from tireroad.modal.rolling import RollingModes


def all_limits(setup: ContactSetup, rolling: RollingModes, step: float) -> tuple[Limit, ...]:
    """Of the modes, the points that pass, and the `step` (s)."""
    return limits(
        step=step,
        highest=rolling.highest / (2 * np.pi),
        pitch=pitch(setup.patch),
        speed=setup.rolled.speed,
    )


def model_limit(setup: ContactSetup, rolling: RollingModes, step: float) -> Limit:
    """The one that counts."""
    return lowest(all_limits(setup, rolling, step))
