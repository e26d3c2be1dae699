"""A rubber: strain energy, density, and dynamic properties for small motions.

A `MaterialLaw` gives the strain energy. A new law is one file in fem.tire.laws, or a class in a user's script, with its parameters (unit and
range), the energy, and the two moduli at zero strain. The scene's keys, `check`, the key reference
and the range tests follow from it.

The storage modulus of a filled rubber grows by a third to two thirds from 10 Hz to 1 kHz, its loss
factor by less. A `Spectrum` gives both relative to those at DYNAMIC_FREQUENCY: a power law (a
fractional element, E* ~ (i w)^b, whose own loss factor is tan(pi b / 2)), a measured master curve, or a Prony series

    E*(w) / E_0 = 1 - sum g_k + sum g_k i w t_k / (1 + i w t_k).

At another temperature the rubber has at a frequency f the moduli that it has at a_T f where they were given, at
REFERENCE (time-temperature superposition), with the shift of Williams, Landel and Ferry (J. Am. Chem. Soc. 77 (1955)
3701) about the glass transition T_g,

    log10 a_T = C(T) - C(T_ref),   C(T) = -17.44 (T - T_g) / (51.6 + T - T_g).

The static state is loaded at the rate of LOADING and follows the same law. That rubber gets stiffer in proportion
to its absolute temperature (14 % from 20 to 60 degrees C) is left out. The air that inflates the tire follows the gas law (`warmed`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Parameters, Registry, keys, plain

if TYPE_CHECKING:
    from ufl.core.expr import Expr

DYNAMIC_FREQUENCY = (
    100.0  # Hz, at which `dynamic` and `loss_factor` hold, in the middle of 10 Hz to 1 kHz
)
ATMOSPHERE = 101325.0  # Pa; inflation is measured above it
KELVIN = 273.15  # K at 0 degrees C
REFERENCE = 20.0  # degrees C, at which compounds are given
LOADING = 0.1  # Hz, of a load that comes in seconds
GLASS = (
    -50.0
)  # degrees C: rubbers of tires have transitions from -70 (natural rubber) to -20 (wet grip)
COLDEST = GLASS + 20.0  # degrees C; the shift does not hold near the transition
_SAMPLED = 1e-4, 1e7, 20  # Hz, Hz, samples in a decade of a Prony series
_DYNAMIC = np.array([DYNAMIC_FREQUENCY])
_TURNS, _SETTLED = 50, 1e-12  # of the own frequencies; relative change of their squares


class MaterialLaw(Parameters):
    """Base of hyperelastic laws, each a function of the right Cauchy-Green tensor C alone.

    `coefficients` names the attributes that `energy` takes, in order. They become fields on the
    mesh, so that other values need no recompilation.
    """

    owner = "material"
    coefficients: ClassVar[tuple[str, ...]]

    @property
    def shear(self) -> float:
        """Shear modulus at zero strain, Pa."""
        raise NotImplementedError

    @property
    def bulk(self) -> float:
        """Bulk modulus at zero strain, Pa."""
        raise NotImplementedError

    @property
    def youngs(self) -> float:
        """Young's modulus at zero strain, Pa: 9 K G / (3 K + G)."""
        return 9 * self.bulk * self.shear / (3 * self.bulk + self.shear)

    @property
    def poisson(self) -> float:
        """Poisson's ratio at zero strain: (3 K - 2 G) / (6 K + 2 G)."""
        return (3 * self.bulk - 2 * self.shear) / (6 * self.bulk + 2 * self.shear)

    def times(self, factor: float) -> Self:
        """The law of `factor` times the energy, which its parameters in Pa are multiplied by."""
        values = {
            item.name: getattr(self, item.name)
            for item, key in keys(type(self))
            if key.unit == "Pa"
        }
        return replace(
            self,
            **{
                name: tuple(factor * number for number in value)
                if isinstance(value, tuple)
                else factor * value
                for name, value in values.items()
            },
        )

    @staticmethod
    def energy(C: Expr, *coefficients: Expr) -> tuple[Expr, Expr]:
        """Energy per undeformed volume (J/m3) in UFL as (distortion, dilatation): the two are
        integrated with different quadrature rules (fem.static.virtual_work)."""
        raise NotImplementedError


MATERIALS: Registry[MaterialLaw] = Registry("material model", "tireroad.fem.tire.laws", MaterialLaw)
material_law = MATERIALS.register


@dataclass(frozen=True)
class Spectrum:
    """Storage modulus and loss factor of small motions over those at DYNAMIC_FREQUENCY.

    `frequency` (k,) Hz ascending, `storage` and `loss` (k,), -. Between them power laws; beyond the
    ends `exponent` goes on for the modulus, and the loss factor stays. `series`: shares g_k of the
    instantaneous modulus and relaxation times t_k, s, of a Prony series, whose samples the others
    are; empty if it is none.
    """

    frequency: tuple[float, ...] = (DYNAMIC_FREQUENCY,)
    storage: tuple[float, ...] = (1.0,)
    loss: tuple[float, ...] = (1.0,)
    exponent: float = 0.0
    series: tuple[tuple[float, float], ...] = ()

    def modulus(self, frequency: np.ndarray) -> np.ndarray:
        """Storage modulus over that at DYNAMIC_FREQUENCY, at frequencies in Hz; below LOADING that at LOADING."""
        return self._unbounded(np.maximum(frequency, LOADING))

    def _unbounded(self, frequency: np.ndarray) -> np.ndarray:
        inside = np.clip(frequency, self.frequency[0], self.frequency[-1])
        known = np.interp(np.log(inside), np.log(self.frequency), np.log(self.storage))
        return np.exp(known + self.exponent * np.log(frequency / inside))

    def loss_factor(self, frequency: np.ndarray) -> np.ndarray:
        """Loss factor over that at DYNAMIC_FREQUENCY, at frequencies in Hz."""
        inside = np.clip(frequency, self.frequency[0], self.frequency[-1])
        return np.interp(np.log(inside), np.log(self.frequency), self.loss)

    def stiffer(self, factor: float, frequency: float = DYNAMIC_FREQUENCY) -> float:
        """Storage modulus at `factor` times a frequency (Hz) over that there."""
        slow, fast = self._unbounded(frequency * np.array([1.0, factor]))
        return float(fast / slow)

    def shifted(self, factor: float) -> Spectrum:
        """The spectrum of the moduli at `factor` times the frequency, relative to those at DYNAMIC_FREQUENCY."""
        storage, loss = self.stiffer(factor), float(self.loss_factor(factor * _DYNAMIC)[0])
        return Spectrum(
            tuple(f / factor for f in self.frequency),
            tuple(g / storage for g in self.storage),
            tuple(part / (loss or 1.0) for part in self.loss),
            self.exponent,
            tuple((share, factor * time) for share, time in self.series),
        )

    def relaxing(self) -> tuple[float, dict[float, float]]:
        """Instantaneous modulus, and what of it relaxes by relaxation time (s), of a Prony series.

        Both over the storage modulus at DYNAMIC_FREQUENCY, E_0 / E' and g_k E_0 / E'. InputError if it is none.
        """
        if not self.series:
            raise InputError(
                "a rubber relaxes in time by a Prony series: give prony_shares and prony_times for every compound"
            )
        shares, times = np.array(self.series).T
        turned = (2 * np.pi * DYNAMIC_FREQUENCY * times) ** 2
        instant = 1 / (1 - float((shares / (1 + turned)).sum()))
        out: dict[float, float] = {}
        for share, time in self.series:
            out[time] = out.get(time, 0.0) + share * instant
        return instant, out


CONSTANT = Spectrum()


def power_law(exponent: float) -> Spectrum:
    """A modulus that grows with the frequency's power `exponent`, and a constant loss factor."""
    return Spectrum(exponent=exponent) if exponent else CONSTANT


def prony(
    shares: Sequence[float] | np.ndarray, times: Sequence[float] | np.ndarray
) -> tuple[float, float, Spectrum]:
    """Dynamic over long-term modulus, loss factor, both at DYNAMIC_FREQUENCY, and the spectrum.

    `shares` g_k of the instantaneous modulus that relax in the `times` t_k, s. InputError if they
    are not as many, or no series of a rubber.
    """
    g, t = np.array(shares, float), np.array(times, float)
    if len(g) != len(t) or (g < 0).any() or g.sum() >= 1 or (t <= 0).any():
        raise InputError("a Prony series needs as many times > 0 as shares ≥ 0 with a sum below 1")
    low, high, dense = _SAMPLED
    sampled = np.geomspace(low, high, round(dense * math.log10(high / low)) + 1)
    iw = 2j * np.pi * np.append(sampled, DYNAMIC_FREQUENCY)[:, None] * t
    modulus = 1 - g.sum() + (g * iw / (1 + iw)).sum(axis=1)
    storage, loss = modulus.real, modulus.imag / modulus.real
    there = loss[-1] if loss[-1] > 0 else 1.0
    spectrum = Spectrum(
        tuple(sampled.tolist()),
        tuple((storage[:-1] / storage[-1]).tolist()),
        tuple((loss[:-1] / there).tolist()),
        series=tuple(zip(g.tolist(), t.tolist(), strict=True)),
    )
    return float(storage[-1] / (1 - g.sum())), float(loss[-1]), spectrum


def measured(
    frequency: Sequence[float] | np.ndarray,
    storage: Sequence[float] | np.ndarray,
    loss: Sequence[float] | np.ndarray,
) -> tuple[float, float, Spectrum]:
    """Storage modulus (Pa) and loss factor at DYNAMIC_FREQUENCY, and the spectrum, of a master curve.

    `frequency` (k,) Hz ascending, with DYNAMIC_FREQUENCY among or between them; `storage` and `loss` (k,) Pa.
    Straight lines over the logarithm of the frequency between them, for the modulus of its logarithm; constant beyond.
    InputError for numbers that are none of a rubber.
    """
    f, stored, lost = (np.array(values, float) for values in (frequency, storage, loss))
    if not (len(f) >= 2 and f[0] > 0 and (np.diff(f) > 0).all()):
        raise InputError("a master curve needs two frequencies or more, above 0 Hz and ascending")
    if not ((stored > 0).all() and (lost >= 0).all() and (np.diff(stored) >= 0).all()):
        raise InputError(
            "a master curve needs storage moduli above 0 that do not fall with the frequency, and loss moduli of 0 or more"
        )
    if not f[0] <= DYNAMIC_FREQUENCY <= f[-1]:
        raise InputError(
            f"a master curve must have {DYNAMIC_FREQUENCY:g} Hz between its frequencies; it has {f[0]:g} to {f[-1]:g} Hz"
        )
    there, x = math.log(DYNAMIC_FREQUENCY), np.log(f)
    modulus = float(np.exp(np.interp(there, x, np.log(stored))))
    ratio = lost / stored
    eta = float(np.interp(there, x, ratio))
    storage_over, loss_over = (
        tuple(number.tolist()) for number in (stored / modulus, ratio / (eta or 1))
    )
    return modulus, eta, Spectrum(tuple(f.tolist()), storage_over, loss_over)


def wlf(temperature: float, glass: float = GLASS) -> float:
    """a_T at a temperature over that at REFERENCE, both in degrees C, of a rubber with its transition at `glass`.

    InputError below COLDEST, where it does not hold.
    """
    if not temperature >= COLDEST:
        raise InputError(
            f"temperature = {temperature:g} degrees C: the shift of moduli holds from {COLDEST:g} degrees C up"
        )
    at, known = (-17.44 * (T - glass) / (51.6 + T - glass) for T in (temperature, REFERENCE))
    return float(10 ** (at - known))


def shore_a(hardness: float) -> float:
    """Young's modulus, Pa, of a rubber of a hardness in Shore A.

    E = 0.0981 (56 + 7.62336 S) / (0.137505 (254 - 2.54 S)) MPa (A. N. Gent, Rubber Chem. Technol. 31 (1958) 896).
    """
    return 1e6 * 0.0981 * (56 + 7.62336 * hardness) / (0.137505 * (254 - 2.54 * hardness))


@dataclass(frozen=True, kw_only=True)
class Material:
    """A rubber with strain energy `law` and `density` (kg/m3).

    `dynamic`: ratio of the moduli for small motions at DYNAMIC_FREQUENCY and for the static state;
    `loss_factor` there, and the `spectrum` of both over frequency.
    """

    law: MaterialLaw
    density: float
    dynamic: float = 1.0
    loss_factor: float = 0.0
    spectrum: Spectrum = CONSTANT

    def __post_init__(self) -> None:
        if not (self.density > 0 and math.isfinite(self.density)):
            raise InputError(f"material: density = {self.density:g} kg/m3 must be above 0")

    def loss(self, frequency: float) -> float:
        """Loss factor at a frequency, Hz."""
        return self.loss_factor * float(self.spectrum.loss_factor(np.array([frequency]))[0])

    def at(self, temperature: float) -> Material:
        """The rubber at a temperature, degrees C; it is given at REFERENCE."""
        shift, spectrum = wlf(temperature), self.spectrum
        if shift == 1.0 or spectrum == CONSTANT:
            return self
        slow = spectrum.stiffer(shift, LOADING)
        return replace(
            self,
            law=self.law.times(slow),
            dynamic=self.dynamic * spectrum.stiffer(shift) / slow,
            loss_factor=self.loss_factor * float(spectrum.loss_factor(shift * _DYNAMIC)[0]),
            spectrum=spectrum.shifted(shift),
        )


def compound(
    model: str,
    density: float,
    *,
    dynamic: float = 1.0,
    loss_factor: float = 0.0,
    spectrum: Spectrum = CONSTANT,
    **parameters: Any,
) -> Material:
    """Material of law `model` (fem.tire.laws); `parameters` (Pa, -) not given at their defaults.

    Raises InputError for a value out of range or a parameter of another law.
    """
    law = MATERIALS[model]
    wrong = sorted(parameters.keys() - law.__dataclass_fields__.keys())
    if wrong:
        known = ", ".join(law.__dataclass_fields__)
        raise InputError(f"material {model}: unknown parameter {wrong[0]}; valid: {known}")
    return Material(
        law=law(**parameters),
        density=plain(density),
        dynamic=plain(dynamic),
        loss_factor=plain(loss_factor),
        spectrum=spectrum,
    )


class Kind(NamedTuple):
    """Compounds of one spectrum, one loss factor (at DYNAMIC_FREQUENCY), and one `static` modulus over that there."""

    spectrum: Spectrum
    loss_factor: float
    static: float = 1.0

    def modulus(self, frequency: float) -> complex:
        """Complex modulus over the storage modulus at DYNAMIC_FREQUENCY, at a frequency in Hz."""
        at = np.array([frequency])
        loss = self.loss_factor * self.spectrum.loss_factor(at)[0]
        return complex(self.spectrum.modulus(at)[0] * (1 + 1j * loss))

    def slow_modulus(self, frequency: np.ndarray, lowest: float) -> np.ndarray:
        """Storage modulus of motions slower than all modes over that at DYNAMIC_FREQUENCY, at frequencies in Hz.

        That of the spectrum, but not below that of the static state, which it has below LOADING. A static modulus above
        that at the frequency `lowest` of the modes (Hz), which no rubber has, counts as that.
        """
        floor = min(self.static, float(self.spectrum.modulus(np.array([lowest]))[0]))
        above: np.ndarray = np.maximum(self.spectrum.modulus(frequency), floor)
        return np.where(frequency < LOADING, floor, above)


def kinds(compounds: Sequence[tuple[Spectrum, float, float]]) -> dict[Kind, list[float]]:
    """Kinds of the compounds with the part of each compound's static modulus that is theirs.

    From spectrum, loss factor, dynamic over static modulus of each. Compounds without losses that are the
    same at all frequencies are left out. Those whose moduli are constant are one kind with a loss factor
    of 1 and the loss modulus in place of the storage modulus: nothing else is asked of them.
    """
    shares: dict[Kind, list[float]] = {}
    for number, (spectrum, loss, dynamic) in enumerate(compounds):
        constant = spectrum == CONSTANT
        if constant and not loss:
            continue
        kind = Kind(CONSTANT, 1.0) if constant else Kind(spectrum, loss, 1 / dynamic)
        share = shares.setdefault(kind, [0.0] * len(compounds))
        share[number] = dynamic * (loss if constant else 1.0)
    return shares


def own_moduli(
    squares: np.ndarray, stored: np.ndarray, kinds: Sequence[Kind], at: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The addition of moduli at their own frequencies to the `squares` (m,) 1/s2 of modes, and their loss factors.

    `stored` (c, m) 1/s2: phi_k . K_c phi_k of the kinds' part of the stiffness, for unit modal mass.

        w_k^2 = squares_k + sum_c (g_c(w_k) - 1) stored_ck,
        eta_k = sum_c eta_c(w_k) g_c(w_k) stored_ck / w_k^2,

    of first order in the change of the moduli g_c: coupling of modes by it is left out. With the built-in
    tire's compounds frequencies up to 1 kHz are within 0.1 % of those of K(w_k), within 0.4 % where
    modes are close. `at`: a frequency (Hz) of all in place of their own. Rigid motions neither gain nor
    lose.
    """
    own = squares.copy()
    for _ in range(_TURNS):
        frequency = (
            np.sqrt(np.maximum(own, 0.0)) / (2 * np.pi) if at is None else np.full(len(own), at)
        )
        before, growth = own, [c.spectrum.modulus(frequency) for c in kinds]
        rise = sum((g - 1) * part for g, part in zip(growth, stored, strict=True))
        own = np.where(squares > 0, squares + rise, squares)
        if np.abs(own - before).max(initial=0.0) <= _SETTLED * np.abs(own).max(initial=0.0):
            break
    lost = sum(
        c.loss_factor * c.spectrum.loss_factor(frequency) * g * part
        for c, g, part in zip(kinds, growth, stored, strict=True)
    )
    return own - squares, np.divide(lost, own, out=np.zeros(len(own)), where=own > 0)


def warmed(inflation: float, before: float, temperature: float) -> float:
    """Inflation (Pa above the atmosphere) at a `temperature` of a tire inflated at another, degrees C, of the same volume.

        p + p_0 = (p_before + p_0) T / T_before

    A tire without inflation is open and stays without; none gets emptier than that.
    """
    if not inflation:
        return inflation
    ratio = (temperature + KELVIN) / (before + KELVIN)
    return max(ratio * (inflation + ATMOSPHERE) - ATMOSPHERE, 0.0)
