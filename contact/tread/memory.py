"""Viscoelastic creep of the tread: the effect of past pressure, convected through the patch.

With a constant Poisson's ratio, the displacement is that of an elastic tread under a pressure
filtered in time,

    u = C~ (p + sum_k c_k q_k),   D q_k/Dt = (p - q_k) / l_k,   D/Dt = d/dt - v d/dx,

C~ being the compliance at the instantaneous modulus, c_k and l_k the creep: J(t) = J_0 [1 + sum_k
c_k (1 - e^(-t/l_k))]. Over a step h with linear pressure, q of the material advances exactly:

    q+ = e^x q + (h/l) [(phi_1 - phi_2)(x) p + phi_2(x) p+],   x = -h/l.

Material points keep their own values, and values between them are interpolated when read: no
numerical diffusion as they travel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.patch import Patch
from tireroad.contact.tread.compliance import Influence
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.shear import KernelShear
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]


def creep_of(share: Array, time: Array) -> tuple[Array, Array]:
    """Creep (c, l) (k,), - and s, of the relaxation E(t) = E_0 [1 - sum_k g_k (1 - e^(-t/t_k))].

    With E(s) = E_0 [1 - sum g_k/(1 + s t_k)] the retardation rates are its zeros, one below each
    relaxation rate, and c_k are the residues of 1/E(s). InputError for invalid shares or times, and
    for shares that leave nothing of the modulus.
    """
    share, time = np.asarray(share, float), np.asarray(time, float)
    if len(share) != len(time) or (share <= 0).any() or (time <= 0).any() or share.sum() >= 1:
        raise InputError(
            "tread: relaxation needs as many shares above 0, of a sum below 1, as times above 0"
        )
    if len(np.unique(time)) != len(time):
        raise InputError("tread: relaxation times must differ")
    # Numerator of 1 - sum g_k/(1 + s t_k) over the product of all (1 + s t_k).
    factors = [np.array([t, 1.0]) for t in time]
    whole = _product(factors)
    numerator = whole.copy()
    for k, g in enumerate(share):
        rest = _product(factors[:k] + factors[k + 1 :])
        numerator[-len(rest) :] -= g * rest
    rates = np.sort(-np.roots(numerator).real)[::-1]
    slope = np.polyder(numerator)
    weight = np.polyval(whole, -rates) / np.polyval(slope, -rates) / rates
    return weight, 1.0 / rates


def _product(factors: list[Array]) -> Array:
    out: Array = np.ones(1)
    for factor in factors:
        out = np.asarray(np.polymul(out, factor), dtype=float)
    return out


def weights(lag: Array, step: float) -> tuple[Array, Array, Array]:
    """(decay, weight of old pressure, of new pressure) (k,) over a step (s), times `lag` (s)."""
    x = step / np.asarray(lag, float)
    decay = np.exp(-x)
    first = -np.expm1(-x) / x  # phi_1(-x)
    second = np.where(x > 1e-4, (1.0 - first) / x, 0.5 - x / 6.0)
    return decay, x * (first - second), x * second


def steady(creep: tuple[Array, Array], patch: Patch, speed: float) -> Array:
    """1 + sum_k c_k F_k (c, c): the filter of a stationary pressure while the tread rolls."""
    size, lag = creep
    if speed == 0:
        return (1.0 + size.sum()) * np.eye(len(patch.points))
    assert patch.places is not None, "creep is for a grid of points"
    shape, place = patch.places.shape, patch.places.place
    decay, old, new = weights(lag, patch.places.spacing[0] / speed)
    n = shape[0]
    apart = np.arange(n)[None, :] - np.arange(n)[:, None]  # points upstream
    line = np.eye(n)
    for c, e, b0, b1 in zip(size, decay, old, new, strict=True):
        far = np.where(apart > 0, e ** np.maximum(apart - 1, 0) * (b0 + e * b1), 0.0)
        line = line + c * (far + b1 * np.eye(n))
    i, j = np.divmod(place, shape[1])
    return line[np.ix_(i, i)] * (j[:, None] == j[None, :])


class TreadMemory:
    """The memory of a viscoelastic tread under c points of a regular grid that rolls over the road.

    `creep` (c_k, l_k); `influence` of the tread at its instantaneous modulus, and `shear` if it
    deforms in shear (contact.tread.shear); `speed` m/s, `step` s. `predict` returns the
    displacements (1, c) m at the end of a step due to past pressure, or (3, c) with `shear`, z
    before x and y. `advance` takes the change of the forces (c,) or (3 c,) N relative to the static
    ones. `at_once` is the factor of C~ for new forces.
    """

    def __init__(
        self,
        creep: tuple[Array, Array],
        influence: Influence,
        patch: Patch,
        speed: float,
        step: float,
        shear: Influence | None = None,
    ) -> None:
        if patch.places is None:
            raise InputError(
                "contact.tread: a viscoelastic tread needs a grid of points: contact.points = { dx, dy }"
            )
        self._shape, self._place = patch.places.shape, patch.places.place
        self._size, lag = creep
        self._decay, self._old, self._new = weights(lag, step)
        self.at_once = 1.0 + float(self._size @ self._new)
        every = np.arange(np.prod(self._shape))
        grid = GridPlaces(self._shape, patch.places.spacing, every)
        self._tread = KernelTread(grid, influence)
        self._shear = None if shear is None else KernelShear(grid, shear)
        parts = 1 if shear is None else 3
        self._way = speed * step / patch.places.spacing[0]
        self._offset = 0.0
        self._kept = np.zeros((len(lag), parts, *self._shape))
        self._force = np.zeros((parts, *self._shape))

    def predict(self) -> Array:
        """Displacements (1 or 3, c) m at the end of the next step without a new force."""
        offset = self._offset + self._way
        jump = int(offset)
        relaxed = _each(self._decay) * self._kept + _each(self._old) * self._force
        self._ahead, self._next = _shifted(relaxed, jump), offset - jump
        field = np.asarray(np.tensordot(self._size, self._ahead, 1), dtype=float)
        here = (1.0 - self._next) * field + self._next * _shifted(field, 1)
        return self._moved(here.reshape(len(here), -1)).take(self._place, axis=1)  # in rows

    def _moved(self, pressed: Array) -> Array:
        """Displacements (1 or 3, n) m of filtered forces (1 or 3, n) N on the whole grid."""
        down = self._tread.apply(pressed[0])
        if self._shear is None:
            return down[None]
        sideways = pressed[1] + 1j * pressed[2]
        moved = self._shear.spread(sideways) + self._shear.drag(pressed[0])
        return np.stack([down + self._shear.lift(sideways), moved.real, moved.imag])

    def advance(self, change: Array) -> None:
        """Set the change (c,) or (3 c,) N of the forces at the end of the step; after `predict`.

        Components beyond those of the memory are ignored.
        """
        parts = len(self._force)
        force = np.zeros((parts, int(np.prod(self._shape))))
        force[:, self._place] = change.reshape(-1, len(self._place))[:parts]
        force = force.reshape(self._force.shape)
        behind = np.zeros_like(force)
        behind[:, 1:] = force[:, :-1]
        self._offset = self._next
        self._force = (1.0 - self._offset) * force + self._offset * behind
        self._kept = self._ahead + _each(self._new) * self._force

    def state(self) -> dict[str, Array]:
        """The state that a checkpoint keeps."""
        return {
            "creep": self._kept,
            "creep_force": self._force,
            "creep_offset": np.array(self._offset),
        }

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from `state`."""
        self._kept, self._force = state["creep"], state["creep_force"]
        self._offset = float(state["creep_offset"])


def _each(factor: Array) -> Array:
    """Factors (k,) for fields (k, parts, nx, ny)."""
    return factor[:, None, None, None]


def _shifted(field: Array, jump: int) -> Array:
    """The field (..., nx, ny) with the material moved by `jump` points towards -x; zero enters."""
    if jump == 0:
        return field
    out = np.zeros_like(field)
    if jump < field.shape[-2]:
        out[..., :-jump, :] = field[..., jump:, :]
    return out
