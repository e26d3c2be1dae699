"""Units of a deck: Abaqus has none, so a length unit stands for a consistent system.

Dynamic modulus and loss factor from a Prony series.

Materials of decks as laws of the program, in SI units.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tireroad.fem.decks.deck import Compound, Place
from tireroad.fem.errors import InputError
from tireroad.fem.sections.construction import RADII

_SMALLEST, _LARGEST = RADII


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


PRONY_FREQUENCY = 100.0  # Hz at which a series is evaluated


def prony(parts: dict, options: Mapping[str, str], notes: list[str]) -> tuple[float, float, float]:
    """(long-term fraction of the given moduli, dynamic over long-term modulus, loss factor)."""
    if "VISCOELASTIC" not in parts:
        return 1.0, 1.0, 0.0
    given, table, place = parts["VISCOELASTIC"]
    if given.get("TIME", "").upper() != "PRONY":
        notes.append(f"*VISCOELASTIC other than TIME=PRONY: not used ({place})")
        return 1.0, 1.0, 0.0
    terms = np.array([(*row, 0.0, 0.0, 0.0)[:3] for row in table]).reshape(-1, 3)
    share, times = terms[:, 0], terms[:, 2]
    if (share < 0).any() or share.sum() >= 1 or (times <= 0).any():
        raise place.error("a Prony series needs g ≥ 0 with a sum below 1, and times > 0")
    long_term = 1 - share.sum()
    turn = 2 * np.pi * PRONY_FREQUENCY * times
    storage = long_term + (share * turn**2 / (1 + turn**2)).sum()
    loss = (share * turn / (1 + turn**2)).sum()
    notes.append(
        f"Prony series read at {PRONY_FREQUENCY:g} Hz: dynamic modulus {storage / long_term:.3g} times the "
        f"long-term one, loss factor {loss / storage:.3g} ({place})"
    )
    instant = options.get("MODULI", "LONG TERM").upper() == "INSTANTANEOUS"
    return (long_term if instant else 1.0), storage / long_term, loss / storage


INCOMPRESSIBLE = 0.49  # Poisson's ratio in place of 1/2: changes modes by under 0.3 %
_MODULUS = (1e4, 1e12)  # Pa; range of any material in a tire
_DENSITY = (100.0, 2e4)  # kg/m3


@dataclass(frozen=True, kw_only=True)
class Rubber:
    """A compound: law of the long-term state and its coefficients by scene key, in SI units.

    `density` is None if the deck has none; `dynamic` and `loss_factor` are those of a Prony series
    at 100 Hz. `notes` list what was interpreted differently from what is written.
    """

    name: str
    model: str
    coefficients: Mapping[str, float]
    density: float | None = None
    dynamic: float = 1.0
    loss_factor: float = 0.0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class CordMaterial:
    """Young's modulus in Pa, density in kg/m3 (0 if not given), compression over tension."""

    youngs_modulus: float
    density: float
    compression: float = 1.0


def rubber(compound: Compound, units: Units) -> Rubber:
    """The compound of a solid section. Raises InputError for laws the program does not have."""
    parts = _parts(compound)
    notes: list[str] = []
    if "HYPERELASTIC" in parts:
        part = parts["HYPERELASTIC"]
        options, numbers, place = _numbers(part, compound, notes, _lines(part[0]))
        model, values = _hyperelastic(options, numbers, place, compound.name)
    elif "ELASTIC" in parts:
        options, numbers, place = _numbers(parts["ELASTIC"], compound, notes)
        model, values = _elastic(options, numbers, place, compound.name)
    else:
        raise compound.place.error(
            f"material {compound.name} has no *HYPERELASTIC and no *ELASTIC that is read"
        )
    share, dynamic, loss = prony(parts, options, notes)
    poisson = _incompressible(model, values, notes, compound.name)
    modular = {k: v * share * units.stress for k, v in values.items() if k != "poisson_ratio"}
    values = modular | ({"poisson_ratio": poisson} if model == "neo-hookean" else {})
    _check_modulus(_youngs(values), units, place, compound.name)
    return Rubber(
        name=compound.name,
        model=model,
        coefficients=values,
        density=_density(parts, units, compound),
        dynamic=dynamic,
        loss_factor=loss,
        notes=tuple(notes),
    )


def cord(compound: Compound, units: Units) -> CordMaterial:
    """The material of a cord: its modulus at small strain."""
    parts = _parts(compound)
    for name in ("ELASTIC", "HYPERELASTIC"):
        if name not in parts:
            continue
        options, numbers, place = _numbers(parts[name], compound, [], _lines(parts[name][0]))
        if name == "ELASTIC":
            modulus = numbers[0] if numbers else 0.0
        elif "MARLOW" in options or "TEST DATA INPUT" in options:
            modulus = _slope(parts, compound)
        else:
            _, values = _hyperelastic(options, numbers, place, compound.name)
            modulus = _youngs(values)
        _check_modulus(modulus * units.stress, units, place, compound.name)
        slack = 0.01 if "NO COMPRESSION" in parts else 1.0
        return CordMaterial(modulus * units.stress, _density(parts, units, compound) or 0.0, slack)
    raise compound.place.error(f"material {compound.name} of cords has no *ELASTIC")


def density_of(compound: Compound, units: Units) -> float | None:
    """Density, kg/m3; None if it has none."""
    return _density(_parts(compound), units, compound)


def _parts(compound: Compound) -> dict:
    return {keyword: (options, rows, place) for keyword, options, rows, place in compound.parts}


def _numbers(
    part: Any, compound: Compound, notes: list[str], lines: int = 1
) -> tuple[Mapping[str, str], list[float], Place]:
    """Options, numbers of the first `lines` lines (the first temperature) and place."""
    options, table, place = part
    if not table and not {"MARLOW", "TEST DATA INPUT"} & set(options):
        raise place.error(f"material {compound.name}: no data; is the deck cut short?")
    if len(table) > lines:
        notes.append(f"{compound.name}: the first of {len(table)} lines of data is used ({place})")
    return options, [value for row in table[:lines] for value in row], place


def _hyperelastic(
    options: Mapping[str, str], numbers: list[float], place: Place, name: str
) -> tuple[str, dict]:
    """(law, coefficients in the deck's units) from the forms of *HYPERELASTIC."""
    order, reduced = _form(options, place, name)
    names, count = _names(order, reduced)
    padded = numbers + [0.0] * (len(names) + count - len(numbers))
    values = dict(zip(names, padded, strict=False))
    first = padded[len(names)]
    if values["c10"] + values.get("c01", 0.0) <= 0:
        raise place.error(f"material {name}: C10 + C01 must be > 0")
    if first < 0:
        raise place.error(f"material {name}: D1 must be ≥ 0, not {first:g}")
    bulk = 2 / first if first > 0 else 0.0
    cross = [k for k, v in values.items() if v and k not in ("c10", "c01", "c20", "c30")]
    if cross or (values.get("c01") and (values.get("c20") or values.get("c30"))):
        raise place.error(
            f"material {name}: its polynomial is neither Mooney-Rivlin (C10, C01) nor Yeoh (C10, C20, "
            f'C30); give [[tire.region]] name = "{name}" a material of one of these'
        )
    return _law(values, bulk)


def _law(values: dict, bulk: float) -> tuple[str, dict]:
    if values.get("c20") or values.get("c30"):
        kept = {key: values.get(key, 0.0) for key in ("c10", "c20", "c30")}
        return "yeoh", kept | {"bulk_modulus": bulk}
    if values.get("c01"):
        return "mooney-rivlin", {"c10": values["c10"], "c01": values["c01"], "bulk_modulus": bulk}
    shear = 2 * values["c10"]
    if not bulk:
        return "neo-hookean", {"youngs_modulus": 3 * shear, "poisson_ratio": 0.5}
    poisson = (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)
    return "neo-hookean", {"youngs_modulus": 2 * shear * (1 + poisson), "poisson_ratio": poisson}


def _form(options: Mapping[str, str], place: Place, name: str) -> tuple[int, bool]:
    """(order N, of I1 only) of a polynomial form. The Abaqus default is POLYNOMIAL, N=1."""
    for fixed, form in {
        "NEO HOOKE": (1, True),
        "MOONEY-RIVLIN": (1, False),
        "YEOH": (3, True),
    }.items():
        if fixed in options:
            return form
    other = set(options) - {"POLYNOMIAL", "REDUCED POLYNOMIAL", "N", "MODULI", "TYPE"}
    if other:
        raise place.error(
            f"material {name}: *HYPERELASTIC, {sorted(other)[0]} is not among neo-Hooke, Mooney-Rivlin, "
            f'Yeoh and polynomials; give [[tire.region]] name = "{name}" a material of one of these'
        )
    order = options.get("N", "1")
    if order not in ("1", "2", "3"):
        raise place.error(f"material {name}: N={order}; 1, 2 and 3 are read")
    return int(order), "REDUCED POLYNOMIAL" in options


def _lines(options: Mapping[str, str]) -> int:
    """Number of lines with the coefficients of one temperature: 9 C and 3 D do not fit in one."""
    full = not {"NEO HOOKE", "MOONEY-RIVLIN", "YEOH", "REDUCED POLYNOMIAL"} & set(options)
    return 2 if full and options.get("N") == "3" else 1


def _names(order: int, reduced: bool) -> tuple[list[str], int]:
    """Names of the coefficients Cij in the manual's order, and the number of Di that follow."""
    if reduced:
        return [f"c{i}0" for i in range(1, order + 1)], order
    names = [f"c{total - j}{j}" for total in range(1, order + 1) for j in range(total + 1)]
    return names, order


def _elastic(
    options: Mapping[str, str], numbers: list[float], place: Place, name: str
) -> tuple[str, dict]:
    if options.get("TYPE", "ISOTROPIC").upper() not in ("ISOTROPIC", "ISO"):
        raise place.error(
            f"material {name}: *ELASTIC with TYPE={options['TYPE']}: isotropic is read"
        )
    modulus, poisson = (numbers + [0.0, 0.0])[:2]
    if modulus <= 0 or not -1 < poisson <= 0.5:
        raise place.error(f"material {name}: E must be > 0 and ν above -1 and at most 0.5")
    return "neo-hookean", {"youngs_modulus": modulus, "poisson_ratio": poisson}


def _incompressible(model: str, values: dict, notes: list[str], name: str) -> float:
    """Poisson's ratio, 0.49 if above 0.4999; sets a bulk modulus of 0 in `values` likewise."""
    said = f"{name}: incompressible in the deck, taken with ν = {INCOMPRESSIBLE}"
    if model == "neo-hookean":
        if values["poisson_ratio"] <= 0.4999:
            return values["poisson_ratio"]
        shear = values["youngs_modulus"] / (2 * (1 + values["poisson_ratio"]))
        values["youngs_modulus"] = 2 * shear * (1 + INCOMPRESSIBLE)
        notes.append(said)
        return INCOMPRESSIBLE
    if not values["bulk_modulus"]:
        shear = 2 * (values["c10"] + values.get("c01", 0.0))
        values["bulk_modulus"] = shear * 2 * (1 + INCOMPRESSIBLE) / (3 * (1 - 2 * INCOMPRESSIBLE))
        notes.append(said)
    return INCOMPRESSIBLE


def _youngs(values: Mapping[str, float]) -> float:
    """Young's modulus at small strain; if not given, that of the nearly incompressible law."""
    if "youngs_modulus" in values:
        return values["youngs_modulus"]
    return 6 * (values["c10"] + values.get("c01", 0.0))


def _slope(parts: dict, compound: Compound) -> float:
    """Slope at zero strain of *UNIAXIAL TEST DATA (stress, strain), from its smallest strain."""
    for _, table, _ in (parts["UNIAXIAL TEST DATA"],) if "UNIAXIAL TEST DATA" in parts else ():
        points = sorted((row[1], row[0]) for row in table if len(row) > 1 and row[1] > 0)
        if points:
            return points[0][1] / points[0][0]
    raise compound.place.error(f"material {compound.name} of cords has no *UNIAXIAL TEST DATA")


def _density(parts: dict, units: Units, compound: Compound) -> float | None:
    if "DENSITY" not in parts:
        return None
    _, numbers, place = _numbers(parts["DENSITY"], compound, [])
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
