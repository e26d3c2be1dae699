"""The slip at which a tire rolls freely: no drag on a smooth road.

Bristles are sensitive to the local speed of the surface. For a wheel at speed Omega with
r_e Omega = v, the road's speed, the surface at (x, y) moves at -Omega d(x, y)/dtheta in the
static shape, and so slips by

    s_x = (dx/dtheta) / r_e - 1,     s_y = -(dy/dtheta) / r_e

in addition to the slip of the whole wheel (signs of contact.tread.brush). The resultant of these
forces need not vanish: the wheel rotates slightly faster or slower until it does.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import ConvergenceError

Array = NDArray[np.float64]
_SLIPS = (1e-3, 4e-3, 0.016, 0.064, 0.2)  # tried in turn for a bracket
_TRIALS = 30
TOLERANCE = 1e-4  # of the load


def shape_slip(positions: Array, ring: Array, shape: tuple[int, int], radius: float) -> Array:
    """Slip (s, 2) of the outer face's nodes on a wheel of effective rolling radius `radius` (m).

    `positions` (s, 3) m form a ring of `shape` at the angles `ring` (rad).
    """
    grid = positions.reshape(*shape, 3)[:, :, :2]
    closed = np.concatenate([grid[-1:], grid, grid[:1]])
    angle = np.concatenate([ring[-1:] - 2 * np.pi, ring, ring[:1] + 2 * np.pi])
    rate = np.gradient(closed, angle, axis=0)[1:-1].reshape(-1, 2) / radius
    return np.stack([rate[:, 0] - 1.0, -rate[:, 1]], axis=-1)


def free_slip(drag: Callable[[float], float], load: float) -> float:
    """The slip at which `drag(slip)` (N, forward) vanishes, within 1e-4 of the `load` (N).

    Regula falsi (Illinois) in a bracket sought outwards from 0: 1e-3, then four times as far up to
    0.2. ConvergenceError if there is none.
    """
    small = TOLERANCE * load
    low, at_low = 0.0, drag(0.0)
    if abs(at_low) <= small:
        return 0.0
    high, at_high = _bracket(drag, at_low)
    for _ in range(_TRIALS):
        middle = (low * at_high - high * at_low) / (at_high - at_low)
        found = drag(middle)
        if abs(found) <= small:
            return middle
        if found * at_high < 0:
            low, at_low = high, at_high
        else:
            at_low *= 0.5
        high, at_high = middle, found
    raise ConvergenceError(
        f"contact: the slip of free rolling did not converge to {TOLERANCE:g} of the load in {_TRIALS} trials "
        f"(last {high:.4g}: {at_high:.3g} N of drag): take a smaller time.step"
    )


def _bracket(drag: Callable[[float], float], at_rest: float) -> tuple[float, float]:
    """A slip with drag of the other sign, and that drag: force increases with slip."""
    for size in _SLIPS:
        slip = -np.sign(at_rest) * size
        found = drag(slip)
        if found * at_rest <= 0:
            return slip, found
    raise ConvergenceError(
        f"contact: no free rolling: the road pulls the tire by {at_rest:.4g} N without slip, and by {found:.4g} N at a "
        f"slip of {slip:.3g}: no slip up to {100 * _SLIPS[-1]:g} % cancels this force. Raise "
        "contact.friction, or leave out rotation.free_rolling"
    )
