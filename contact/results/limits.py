"""The frequency up to which a time-domain run is valid, and what limits it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tireroad.contact.patch import Patch

# Of the highest mode: beyond, the truncated modes respond dynamically, not by their static residual
# alone.
USABLE = 0.5


@dataclass(frozen=True)
class Limit:
    """A limiting `frequency` in Hz, and its `cause` in words."""

    frequency: float
    cause: str


def limits(*, step: float, highest: float, pitch: float, speed: float) -> tuple[Limit, ...]:
    """All limits: of `step` (s), `highest` mode (Hz), points `pitch` m apart at `speed` m/s.

    A wave of the road needs at least two points, hence half the frequency at which points pass,
    speed / pitch. Shorter waves are aliased, and at the passing frequency the force of any road has
    a spurious peak, since points come into contact one by one.
    """
    found = [
        Limit(0.5 / step, f"half the sampling rate of the time step of {step:.4g} s"),
        Limit(USABLE * highest, f"half the highest mode kept, {highest:.5g} Hz"),
    ]
    if speed > 0 and np.isfinite(pitch):
        passing = speed / pitch
        found.append(
            Limit(
                0.5 * passing, f"half the passing frequency of the contact points, {passing:.5g} Hz"
            )
        )
    return tuple(found)


def lowest(found: Iterable[Limit]) -> Limit:
    """The lowest limit, which counts."""
    return min(found, key=lambda limit: limit.frequency)


def pitch(patch: Patch) -> float:
    """Largest distance (m) along x between neighbouring points at rest, or of all without any."""
    some = patch.force > 0
    sizes = patch.half_sizes[some if some.any() else slice(None), 0]
    return float(2 * sizes.max())
