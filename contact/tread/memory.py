"""Viscoelastic creep of the tread: the effect of past pressure, convected through the patch.

With a constant Poisson's ratio, the displacement is that of an elastic tread under a pressure
filtered in time,

    u = C~ (p + sum_k c_k q_k),   D q_k/Dt = (p - q_k) / l_k,   D/Dt = d/dt - v d/dx,

C~ being the compliance at the instantaneous modulus, c_k and l_k the creep: J(t) = J_0 [1 + sum_k
c_k (1 - e^(-t/l_k))]. Over a step h with linear pressure, q of the material advances exactly:

    q+ = e^x q + (h/l) [(phi_1 - phi_2)(x) p + phi_2(x) p+],   x = -h/l.

Where the material of a point was a step before, q and p are interpolated by cubics along the road, in every step alike: values kept
by material points and read between them would shake the tire as often as points pass. Of a tread that is the tire's own, the nodes lose what their elements have of it
(contact.tread.between_nodes), as stiff as it is at 1 kHz and without losses, since the tread's own motions are far above the modes.

Rubber of a loss factor tan d over a band has a storage modulus that rises with the power (2/pi) d of frequency (Kramers and Kronig);
`relaxation_of` fits a Prony series to

    E(f) = E (f/f_0)^a e^(i a pi/2) / cos(a pi/2),   a = (2/pi) arctan(tan d).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, signal

from tireroad.contact.patch import Patch
from tireroad.contact.tread.compliance import Influence
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.shear import GridTread, KernelShear
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

# Hz: relaxation of a constant loss factor. Between 40 and 2500 Hz loss and storage of 0.1 to 0.3 are within 7 and 2.5 % of the power law.
RATES, BAND = (30.0, 300.0, 3000.0), (40.0, 2500.0)
_FITTED = 60  # frequencies of the band
# Of creep behind the points: times of the slowest one; share of a point's own displacement; lengths of the grid.
LAGS, FELT, MOST_BEHIND = 4.0, 1e-3, 3


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


def relaxation_of(loss_factor: float, reference: float) -> tuple[float, Array, Array]:
    """(E_0 over E, shares, times in s) of rubber with the storage modulus E at `reference` Hz and a `loss_factor` from 40 to 2500 Hz.

    E_0 is the instantaneous modulus, as for `creep_of`.
    """
    frequency = np.geomspace(*BAND, _FITTED)
    power = 2 / np.pi * np.arctan(loss_factor)
    wanted = (1j * frequency / reference) ** power / np.cos(power * np.pi / 2)
    over = 1j * frequency[:, None] / np.array(RATES)
    parts = np.hstack([np.ones((_FITTED, 1)), over / (1 + over)]) / wanted[:, None]
    moduli, _ = optimize.nnls(np.vstack([parts.real, parts.imag]), np.repeat([1.0, 0.0], _FITTED))
    whole = float(moduli.sum())
    return whole, moduli[1:] / whole, 1 / (2 * np.pi * np.array(RATES))


def softened(creep: tuple[Array, Array], frequency: float) -> float:
    """E_0 over the storage modulus at a frequency, Hz."""
    size, lag = creep
    compliance = 1.0 + (size / (1.0 + 2j * np.pi * frequency * lag)).sum()
    return float(1.0 / (1.0 / compliance).real)


def steadily(creep: tuple[Array, Array], places: GridPlaces, speed: float, pressed: Array) -> Array:
    """p + sum_k c_k q_k (nx ny, ...) of a stationary pressure p (c, ...) at the `places` of a grid while the tread rolls at `speed` m/s."""
    size, lag = creep
    shape = places.shape
    field = np.zeros((shape[0] * shape[1], *pressed.shape[1:]))
    field[places.place] = pressed
    if speed == 0:
        whole: Array = (1.0 + size.sum()) * field
        return whole
    field = field.reshape(*shape, *pressed.shape[1:])
    past, rates = field.copy(), weights(lag, places.spacing[0] / speed)
    for c, e, old, new in zip(size, *rates, strict=True):
        # Material comes in at the front, the last row.
        past += c * signal.lfilter([new, old], [1.0, -e], field[::-1], axis=0)[::-1]
    return past.reshape(-1, *pressed.shape[1:])


def rows_behind(
    creep: tuple[Array, Array], patch: Patch, speed: float, influence: Influence
) -> int:
    """Rows of cells behind the grid of a patch that still creep and are felt where it touches: the tread's `influence` there is more
    than 1e-3 of that of a point on itself, and the slowest creep has not ended; at most three times as many as the grid has."""
    assert patch.places is not None, "creep is for a grid of points"
    (nx, ny), (dx, dy) = patch.places.shape, patch.places.spacing
    touching = patch.places.place[patch.force > 0] // ny
    margin = int(touching.min(initial=nx - 1))
    most = min(math.ceil(LAGS * speed * float(creep[1].max()) / dx), MOST_BEHIND * nx)
    at = dx * np.concatenate([[0.0], margin + 1.0 + np.arange(most)])
    felt = np.abs(influence(at, np.zeros(len(at)), *np.full((2, len(at)), 0.5) * [[dx], [dy]]))
    return int(np.flatnonzero(felt > FELT * felt[0])[-1])


class WholeGrid:
    """The tread between all cells of the grid of a patch, under whose c points it is read.

    `influence` of the tread, and `shear` if it deforms in shear (contact.tread.shear). What has passed beyond the points presses, too,
    over the grid and as many rows `behind` it. `places` of the points on all of it.
    """

    def __init__(
        self,
        places: GridPlaces,
        influence: Influence,
        shear: Influence | None = None,
        behind: int = 0,
    ) -> None:
        self.shape = places.shape[0] + behind, places.shape[1]
        self.place = (
            places.place + behind * places.shape[1]
        )  # the first row is the last of the tread
        self.places = GridPlaces(self.shape, places.spacing, self.place)
        self.parts = 1 if shear is None else 3
        grid = GridPlaces(self.shape, places.spacing, np.arange(np.prod(self.shape)))
        tread = KernelTread(grid, influence)
        if shear is None:
            self._moved = lambda pressed: tread.apply(pressed[0])[None]
        else:
            whole = GridTread(tread, KernelShear(grid, shear))
            self._moved = whole.inside(whole.box)

    def __call__(self, pressed: Array) -> Array:
        """Displacements (parts, c) m of the points under forces (parts, nx ny) N on the cells."""
        return self._moved(pressed).take(self.place, axis=1)  # in rows


class TreadMemory:
    """The memory of a viscoelastic tread under c points of a regular grid that rolls over the road.

    `creep` (c_k, l_k); `tread` at its instantaneous modulus; `spacing` m of the points along, `speed` m/s, `step` s. `predict`
    returns the displacements (1, c) m at the end of a step due to past pressure, or (3, c) of a tread that shears, z
    before x and y. `advance` takes the change of the forces (c,) or (3 c,) N relative to the static
    ones. `at_once` is the factor of C~ for new forces.
    """

    def __init__(
        self,
        creep: tuple[Array, Array],
        tread: WholeGrid,
        spacing: float,
        speed: float,
        step: float,
    ) -> None:
        self._size, lag = creep
        self._decay, self._old, self._new = weights(lag, step)
        self.at_once = 1.0 + float(self._size @ self._new)
        self._tread = tread
        way = speed * step / spacing
        jump = int(way)
        self._taps = [
            (jump + beside, weight)
            for beside, weight in zip((-1, 0, 1, 2), cubic(way - jump), strict=True)
            if weight
        ]
        self._kept = np.zeros((len(lag), tread.parts, *tread.shape))
        self._force = np.zeros((tread.parts, *tread.shape))

    def predict(self) -> Array:
        """Displacements (1 or 3, c) m at the end of the next step without a new force."""
        self._ahead = self._carried(
            _each(self._decay) * self._kept + _each(self._old) * self._force
        )
        field: Array = np.asarray(np.tensordot(self._size, self._ahead, 1), dtype=float)
        return self._tread(field.reshape(len(field), -1))

    def _carried(self, field: Array) -> Array:
        """The field (..., nx, ny) with the material moved by a step towards -x; zero enters."""
        out, n = np.zeros_like(field), field.shape[-2]
        for jump, weight in self._taps:
            low, high = max(-jump, 0), max(min(n - jump, n), 0)
            out[..., low:high, :] += weight * field[..., low + jump : high + jump, :]
        return out

    def advance(self, change: Array) -> None:
        """Set the change (c,) or (3 c,) N of the forces at the end of the step; after `predict`.

        Components beyond those of the memory are ignored.
        """
        place, parts = self._tread.place, len(self._force)
        force = np.zeros((parts, self._force[0].size))
        force[:, place] = change.reshape(-1, len(place))[:parts]
        self._force = force.reshape(self._force.shape)
        self._kept = self._ahead + _each(self._new) * self._force

    def state(self) -> dict[str, Array]:
        """The state that a checkpoint keeps."""
        return {"creep": self._kept, "creep_force": self._force}

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from `state`."""
        self._kept, self._force = state["creep"], state["creep_force"]


def cubic(at: float) -> tuple[float, float, float, float]:
    """Weights of values at -1, 0, 1, 2 for the cubic through them at a place from 0 to 1."""
    before, after = 1.0 - at, 2.0 - at
    return (
        -at * before * after / 6,
        (1 - at * at) * after / 2,
        at * (1 + at) * after / 2,
        -at * (1 - at * at) / 6,
    )


def _each(factor: Array) -> Array:
    """Factors (k,) for fields (k, parts, nx, ny)."""
    return factor[:, None, None, None]
