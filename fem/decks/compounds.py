"""Materials of decks as laws of the program, in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from tireroad.fem.decks.deck import DeckCompound, Place, number
from tireroad.fem.decks.rubber_tests import TESTS, Fit, fitted
from tireroad.fem.errors import InputError
from tireroad.fem.sections.construction import RADII
from tireroad.fem.tire.material import DYNAMIC_FREQUENCY, MATERIALS, Spectrum, prony

_SMALLEST, _LARGEST = RADII
_STIFF = 0.4999  # Poisson's ratio from which on a neo-Hookean law is taken for incompressible
INCOMPRESSIBLE = 0.49  # Poisson's ratio in place of 1/2: changes modes by under 0.3 %
_MODULUS = (1e4, 1e12)  # Pa; range of any material in a tire
_DENSITY = (100.0, 2e4)  # kg/m3
_TESTED = {"polynomial": {1: "mooney-rivlin", 2: "polynomial"}}


@dataclass(frozen=True)
class Units:
    """Factors to SI for lengths, stresses and densities; `words` names the system."""

    length: float
    stress: float
    density: float
    words: str


# Consistent with the second: tonne for mm, slinch (lbf s2/in) for inches.
SYSTEMS = {
    "m": Units(1.0, 1.0, 1.0, "m, kg, s, N, Pa"),
    "mm": Units(1e-3, 1e6, 1e12, "mm, t, s, N, MPa"),
    "in": Units(0.0254, 6894.757293, 1.0686896e7, "in, lbf s²/in, s, lbf, psi"),
}


def check_size(radius: float, unit: str, file: str) -> None:
    """Raise InputError with the unit that fits if the outer radius (deck's unit) is no tire's."""
    if _SMALLEST <= radius * SYSTEMS[unit].length <= _LARGEST:
        return
    fitting = [name for name, of in SYSTEMS.items() if _SMALLEST <= radius * of.length <= _LARGEST]
    fitting = fitting[:1] if radius < _LARGEST else [n for n in fitting if n == "mm"] or fitting
    shown = f"{radius * SYSTEMS[unit].length:.4g} m"
    if not fitting:
        raise InputError(f"{file}: the tire has an outer radius of {shown}; 0.1 to 2.5 m is a tire")
    raise InputError(
        f"{file}: the tire has an outer radius of {shown}: is this deck in {fitting[0]}? Then "
        f'tire.length_unit = "{fitting[0]}" reads it in {SYSTEMS[fitting[0]].words}'
    )


@dataclass(frozen=True)
class Series:
    """A Prony series: what is left of instantaneous moduli of shear and bulk after long times, the
    dynamic over the long-term modulus of shear, and the loss factor, with their spectrum.
    """

    shear: float = 1.0
    bulk: float = 1.0
    dynamic: float = 1.0
    loss: float = 0.0
    spectrum: Spectrum | None = None


def _series(parts: dict, notes: list[str]) -> Series:
    """The Prony series of a *VISCOELASTIC, TIME=PRONY; without one no energy is lost."""
    if "VISCOELASTIC" not in parts:
        return Series()
    given, table, place = parts["VISCOELASTIC"]
    if given.get("TIME", "").upper() != "PRONY":
        notes.append(f"*VISCOELASTIC other than TIME=PRONY: not used ({place})")
        return Series()
    terms = np.array([(*row, 0.0, 0.0, 0.0)[:3] for row in table]).reshape(-1, 3)
    share, of_bulk, times = terms.T
    for one in (share, of_bulk):
        if (one < 0).any() or one.sum() >= 1 or (times <= 0).any():
            raise place.error("a Prony series needs g and k ≥ 0 with sums below 1, and times > 0")
    dynamic, loss, spectrum = prony(share, times)
    notes.append(
        f"Prony series: at {DYNAMIC_FREQUENCY:g} Hz the dynamic modulus is {dynamic:.3g} times the long-term one, the "
        f"loss factor {loss:.3g}; modes have those at their own frequencies ({place})"
    )
    return Series(1 - share.sum(), 1 - of_bulk.sum(), dynamic, loss, spectrum)


@dataclass(frozen=True, kw_only=True)
class Rubber:
    """A compound: law of the long-term state and its coefficients by scene key, in SI units.

    `density` is None if the deck has none; `dynamic`, `loss_factor` and `spectrum` are those of a
    Prony series. `notes` list what was interpreted differently from what is written; `fit` is how
    the law follows test data.
    """

    name: str
    model: str
    coefficients: Mapping[str, Any]
    density: float | None = None
    dynamic: float = 1.0
    loss_factor: float = 0.0
    spectrum: Spectrum | None = None
    notes: tuple[str, ...] = ()
    fit: Fit | None = field(default=None, repr=False)


@dataclass(frozen=True)
class CordMaterial:
    """Young's modulus in Pa, density in kg/m3 (0 if not given), compression over tension."""

    youngs_modulus: float
    density: float
    compression: float = 1.0


@dataclass(frozen=True)
class _Law:
    """A law of the deck: coefficients by scene key in the deck's unit without those of the volume.

    `bulk` is 0 for an incompressible one. A neo-Hookean law has `shear` alone.
    """

    model: str
    values: dict[str, Any]
    bulk: float
    fit: Fit | None = None

    @property
    def shear(self) -> float:
        """Modulus of shear at zero strain."""
        if self.model == "neo-hookean":
            return self.values["shear"]
        law = MATERIALS[self.model]
        known = {item.name: self.values.get(item.name, 0.0) for item in fields(law)}
        modulus = cast("property", law.shear).fget
        assert modulus is not None
        return modulus(SimpleNamespace(**known))  # the law itself has limits in SI

    def si(self, series: Series, stress: float) -> tuple[dict[str, Any], bool]:
        """Coefficients in SI of the long-term law, and whether its volume was held before.

        A series lowers what makes shape and, by its own terms, what makes volume.
        """
        shear, bulk = (
            self.shear * series.shear * stress,
            self.bulk * series.bulk * stress,
        )
        plain = self.model == "neo-hookean"
        held = not bulk or (plain and _poisson(bulk, shear) > _STIFF)
        if held:
            bulk = shear * 2 * (1 + INCOMPRESSIBLE) / (3 * (1 - 2 * INCOMPRESSIBLE))
        if plain:
            poisson = _poisson(bulk, shear)
            return {"youngs_modulus": 2 * shear * (1 + poisson), "poisson_ratio": poisson}, held
        scaled = self.values | {"bulk_modulus": bulk}
        for key in self.values.keys() - {"locking_stretch", "powers"}:
            moduli = np.multiply(self.values[key], series.shear * stress).tolist()
            scaled[key] = tuple(moduli) if isinstance(moduli, list) else moduli
        return scaled, held


def _poisson(bulk: float, shear: float) -> float:
    return (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)


def rubber(compound: DeckCompound, units: Units) -> Rubber:
    """The compound of a solid section. Raises InputError for laws the program does not have."""
    parts = _parts(compound)
    notes: list[str] = []
    if "HYPERELASTIC" in parts:
        options, _, place = parts["HYPERELASTIC"]
        law = _hyperelastic(parts, compound, notes)
    elif "ELASTIC" in parts:
        options, numbers, place = _numbers(parts["ELASTIC"], compound, notes)
        law = _elastic(options, numbers, place, compound.name)
    else:
        other = next((name for name in parts if name.startswith("HYPER")), "")
        raise compound.place.error(
            f"material {compound.name} has no *HYPERELASTIC and no *ELASTIC that is read"
            + (f": *{other} is not among the laws" if other else "")
        )
    series = _series(parts, notes)
    instant = options.get("MODULI", "LONG TERM").upper() == "INSTANTANEOUS"
    series_kept = series if instant else replace(series, shear=1.0, bulk=1.0)
    if not law.shear > 0:
        raise place.error(
            f"material {compound.name}: its modulus of shear at zero strain, {law.shear:.4g}, must be > 0{_by_fit(law)}"
        )
    values, held = law.si(series_kept, units.stress)
    if held:
        notes.append(
            f"{compound.name}: incompressible in the deck, taken with ν = {INCOMPRESSIBLE}"
        )
    _check_modulus(3 * law.shear * series_kept.shear * units.stress, units, place, compound.name)
    try:
        MATERIALS.make(law.model, **values)
    except InputError as error:
        raise place.error(f"material {compound.name}: {error}{_by_fit(law)}") from None
    density = _density(parts, units, compound, notes)
    return Rubber(
        name=compound.name,
        model=law.model,
        coefficients=values,
        density=density,
        dynamic=series.dynamic,
        loss_factor=series.loss,
        spectrum=series.spectrum,
        notes=tuple(notes),
        fit=law.fit,
    )


def _by_fit(law: _Law) -> str:
    """The addition to an error whose constants the deck does not state: they were fitted."""
    if law.fit is None:
        return ""
    tests = " and ".join(f"*{curve.test}" for curve in law.fit.curves)
    return (
        f". The deck states no constants: those of {law.fit.model} were fitted to its {tests}, {100 * law.fit.error:.3g} % off. "
        "Are stress and strain in this order, nominal, with tension positive? Otherwise take another law, or give constants"
    )


def cord(compound: DeckCompound, units: Units) -> CordMaterial:
    """The material of a cord: its modulus at small strain."""
    parts = _parts(compound)
    for name in ("ELASTIC", "HYPERELASTIC"):
        if name not in parts:
            continue
        options, numbers, place = _numbers(parts[name], compound, [])
        if name == "ELASTIC":
            modulus = numbers[0] if numbers else 0.0
        elif "MARLOW" in options or "TEST DATA INPUT" in options:
            modulus = _slope(parts, compound)
        else:
            modulus = 3 * _hyperelastic(parts, compound, []).shear
        _check_modulus(modulus * units.stress, units, place, compound.name)
        slack = 0.01 if "NO COMPRESSION" in parts else 1.0
        density = _density(parts, units, compound, [])
        return CordMaterial(modulus * units.stress, density or 0.0, slack)
    raise compound.place.error(f"material {compound.name} of cords has no *ELASTIC")


def density_of(compound: DeckCompound, units: Units) -> float | None:
    """Density, kg/m3; None if it has none."""
    return _density(_parts(compound), units, compound, [])


def _parts(compound: DeckCompound) -> dict:
    return {keyword: (options, rows, place) for keyword, options, rows, place in compound.parts}


def _numbers(
    part: Any, compound: DeckCompound, notes: list[str], lines: int = 1
) -> tuple[Mapping[str, str], list[float], Place]:
    """Options, numbers of the first `lines` lines (the first temperature) and place."""
    options, table, place = part
    if not table and not {"MARLOW", "TEST DATA INPUT"} & set(options):
        raise place.error(f"material {compound.name}: no data; is the deck cut short?")
    if len(table) > lines:
        notes.append(f"{compound.name}: the first of {len(table)} lines of data is used ({place})")
    return options, [value for row in table[:lines] for value in row], place


def _hyperelastic(parts: dict, compound: DeckCompound, notes: list[str]) -> _Law:
    """The law of a *HYPERELASTIC: by its coefficients, or fitted to its test data."""
    options, _, place = parts["HYPERELASTIC"]
    form, order = _form(options, place, compound.name)
    if form == "marlow" or "TEST DATA INPUT" in options:
        return _tested(form, order, parts, compound, notes)
    names, bulks = _names(form, order)
    # Eight numbers to a line; the temperature comes last.
    lines = -(-(len(names) + bulks + 1) // 8)
    _, numbers, _ = _numbers(parts["HYPERELASTIC"], compound, notes, lines)
    padded = numbers + [0.0] * (len(names) + bulks - len(numbers))
    values = dict(zip(names, padded, strict=False))
    first = padded[len(names)]
    if first < 0:
        raise place.error(f"material {compound.name}: D1 must be ≥ 0, not {first:g}")
    bulk = 2 / first if first > 0 else 0.0
    if form == "ogden":
        moduli = tuple(values[f"mu{i}"] for i in range(1, order + 1))
        powers = tuple(values[f"alpha{i}"] for i in range(1, order + 1))
        return _Law("ogden", {"moduli": moduli, "powers": powers}, bulk)
    if form == "arruda-boyce":
        return _Law("arruda-boyce", values, bulk)
    return _simplest({key: value for key, value in values.items() if value}, bulk, place, compound)


def _simplest(values: dict[str, float], bulk: float, place: Place, compound: DeckCompound) -> _Law:
    """The simplest law that has these coefficients cij, none of them 0."""
    used = set(values)
    if values.get("c10", 0.0) + values.get("c01", 0.0) <= 0:
        raise place.error(f"material {compound.name}: C10 + C01 must be > 0")
    if used <= {"c10"}:
        return _Law("neo-hookean", {"shear": 2 * values["c10"]}, bulk)
    for model in ("mooney-rivlin", "yeoh", "polynomial", "reduced-polynomial"):
        names = {item.name for item in fields(MATERIALS[model])} - {"bulk_modulus"}
        if used <= names and not (model == "mooney-rivlin" and values.get("c01", 0.0) < 0):
            return _Law(model, {name: values.get(name, 0.0) for name in sorted(names)}, bulk)
    raise place.error(
        f"material {compound.name}: polynomials in both invariants are read to N=2, in I1 alone to N=6; give "
        f'[[tire.region]] name = "{compound.name}" a material of one of these'
    )


def _tested(form: str, order: int, parts: dict, compound: DeckCompound, notes: list[str]) -> _Law:
    """The law that follows the material's test data."""
    options, _, place = parts["HYPERELASTIC"]
    tests = {
        name: np.array([(*row, 0.0)[:2] for row in parts[name][1]]).reshape(-1, 2)
        for name in TESTS
        if name in parts
    }
    model = _TESTED.get(form, {}).get(order, form.replace(" ", "-"))
    if form == "polynomial" and order > 2:
        raise place.error(
            f"material {compound.name}: N={order} is not fitted to test data, 1 and 2 are"
        )
    fit = fitted(model, order, tests, lambda why: place.error(f"material {compound.name}: {why}"))
    notes.append(
        f"{compound.name}: fitted to {', '.join(name.split()[0].lower() for name in tests)} test data by least "
        f"squares in stress, {100 * fit.error:.2g} % of it off ({place})"
    )
    law = _Law(fit.model, dict(fit.coefficients), 0.0, fit)
    if fit.model == "reduced-polynomial" and len(fit.coefficients) <= 3:
        known = {"c10": 0.0, "c20": 0.0, "c30": 0.0} | dict(fit.coefficients)
        law = replace(law, model="yeoh", values=known)
    poisson = number(options.get("POISSON", "0"), place)
    if "VOLUMETRIC TEST DATA" in parts:  # pressure over volume ratio
        table = np.array([(*row, 1.0)[:2] for row in parts["VOLUMETRIC TEST DATA"][1]])
        less = 1 - table.reshape(-1, 2)[:, 1]
        law = replace(law, bulk=float(table.reshape(-1, 2)[:, 0] @ less / max(less @ less, 1e-300)))
    elif 0 < poisson < _STIFF:
        law = replace(law, bulk=2 * law.shear * (1 + poisson) / (3 * (1 - 2 * poisson)))
    return law


def _form(options: Mapping[str, str], place: Place, name: str) -> tuple[str, int]:
    """(form, order N) of a *HYPERELASTIC. The Abaqus default is POLYNOMIAL, N=1."""
    for fixed, found in {
        "NEO HOOKE": ("reduced polynomial", 1),
        "MOONEY-RIVLIN": ("polynomial", 1),
        "YEOH": ("reduced polynomial", 3),
        "ARRUDA-BOYCE": ("arruda-boyce", 1),
        "MARLOW": ("marlow", 1),
    }.items():
        if fixed in options:
            return found
    known = {"POLYNOMIAL": 3, "REDUCED POLYNOMIAL": 6, "OGDEN": 6}
    other = set(options) - {*known, "N", "MODULI", "TYPE", "TEST DATA INPUT", "POISSON"}
    if other:
        raise place.error(
            f"material {name}: *HYPERELASTIC, {sorted(other)[0]} is not among neo-Hooke, Mooney-Rivlin, Yeoh, "
            f'polynomials, Ogden, Arruda-Boyce and Marlow; give [[tire.region]] name = "{name}" a material'
        )
    form = next((one for one in known if one in options), "POLYNOMIAL")
    order = options.get("N", "1")
    if not (order.isascii() and order.isdigit() and 1 <= int(order) <= known[form]):
        raise place.error(f"material {name}: {form}, N={order}; 1 to {known[form]} are read")
    return form.lower(), int(order)


def _names(form: str, order: int) -> tuple[list[str], int]:
    """Names of the coefficients in the manual's order, and the number of Di that follow."""
    if form == "arruda-boyce":
        return ["mu", "locking_stretch"], 1
    if form == "ogden":
        return [f"{what}{i}" for i in range(1, order + 1) for what in ("mu", "alpha")], order
    if form == "reduced polynomial":
        return [f"c{i}0" for i in range(1, order + 1)], order
    names = [f"c{total - j}{j}" for total in range(1, order + 1) for j in range(total + 1)]
    return names, order


def _elastic(options: Mapping[str, str], numbers: list[float], place: Place, name: str) -> _Law:
    if options.get("TYPE", "ISOTROPIC").upper() not in ("ISOTROPIC", "ISO"):
        raise place.error(
            f"material {name}: *ELASTIC with TYPE={options['TYPE']}: isotropic is read"
        )
    modulus, poisson = (numbers + [0.0, 0.0])[:2]
    if modulus <= 0 or not -1 < poisson <= 0.5:
        raise place.error(f"material {name}: E must be > 0 and ν above -1 and at most 0.5")
    bulk = modulus / (3 * (1 - 2 * poisson)) if poisson <= _STIFF else 0.0
    return _Law("neo-hookean", {"shear": modulus / (2 * (1 + poisson))}, bulk)


def _slope(parts: dict, compound: DeckCompound) -> float:
    """Slope at zero strain of *UNIAXIAL TEST DATA (stress, strain), from its smallest strain."""
    for _, table, _ in (parts["UNIAXIAL TEST DATA"],) if "UNIAXIAL TEST DATA" in parts else ():
        points = sorted((row[1], row[0]) for row in table if len(row) > 1 and row[1] > 0)
        if points:
            return points[0][1] / points[0][0]
    raise compound.place.error(f"material {compound.name} of cords has no *UNIAXIAL TEST DATA")


def _density(parts: dict, units: Units, compound: DeckCompound, notes: list[str]) -> float | None:
    if "DENSITY" not in parts:
        return None
    _, numbers, place = _numbers(parts["DENSITY"], compound, notes)
    density = numbers[0] * units.density if numbers else 0.0
    if not _DENSITY[0] <= density <= _DENSITY[1]:
        raise place.error(
            f"material {compound.name}: density {density:.4g} kg/m³ when the deck is read in "
            f"{units.words}; 100 to 20000 is likely. Is it in other units? See tire.length_unit"
        )
    return density


def _check_modulus(modulus: float, units: Units, place: Place, name: str) -> None:
    if not _MODULUS[0] <= modulus <= _MODULUS[1]:
        raise place.error(
            f"material {name}: Young's modulus {modulus:.4g} Pa when the deck is read in {units.words}; "
            "1e4 to 1e12 is likely. Is it in other units? See tire.length_unit"
        )
