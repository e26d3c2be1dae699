"""Compounds and cords of a tire: what a scene states, merged into what its section is built of.

A [[tire.region]] or [[tire.cords]] changes what it states; the rest stays that of the compound or line
of its name, or of the wall of a torus. For sections that are built in, [tire.scale] then multiplies
quantities by name, and all parts are written back in full: the scene that is read is the tire that is
computed. The merge is of tables as in TOML, because only these tell what was given.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import keys
from tireroad.fem.tire.material import MATERIALS, MaterialLaw, shore_a
from tireroad.runs.scene.schema import Path_, Source
from tireroad.runs.scene.tables.tire import (
    CordsTable,
    MaterialTable,
    Parts,
    Raw,
    RegionTable,
    TireTable,
)

# One of these states all that the others state, and takes their place.
_WAYS = ({"prony_shares", "prony_times"}, {"dynamic", "loss_factor", "exponent"}, {"master_curve"})
BELTS = "belt"  # in [tire.scale]: all lines whose names begin so
_OF_COMPOUND = ("modulus", "poisson ratio", "density", "dynamic", "loss factor", "exponent")
_OF_CORDS = ("modulus", "angle", "area", "spacing", "density", "compression")
Listing = tuple[str, tuple[str, ...], list[tuple[str, ...]]]  # title, heads, rows

_COMPOUND_HEAD = (
    "compound",
    "law",
    "E, MPa",
    "Poisson's ratio",
    "density, kg/m³",
    "dynamic over static",
    "loss factor",
    "exponent",
)
_CORDS_HEAD = (
    "cords",
    "angle, deg",
    "E, GPa",
    "area, mm²",
    "spacing, mm",
    "density, kg/m³",
    "compression over tension",
)


def with_parts(
    tire: TireTable,
    raw: Mapping[str, Any],
    read: Callable[[Raw], TireTable],
    source: Source,
    say: Callable[[str], object],
) -> TireTable:
    """The tire with its compounds and cords merged and scaled; `raw`: [tire] as given.

    `read` makes the table of a merged one. Problems are noted in `source`.
    """
    built = tire.shape.parts(tire)
    regions, cords = (raw.get(key, []) for key in ("region", "cords"))
    merged = dict(raw) | {
        "region": _regions(built, regions, source),
        "cords": _cords(built, cords),
    }
    for key, factor in (raw.get("scale") or {}).items():
        for change in _scale(merged, built, key, factor, source):
            say(f"tire.scale: {change}")
    if source.broken() & {"tire"}:
        return tire
    table = read(merged)
    if not built.whole:
        return table
    if source.broken() & {"tire"}:
        return table
    regions = {region.name: region for region in table.region}
    lines = {line.name: line for line in table.cords}
    return replace(
        table,
        region=tuple(regions[name] for name in built.compounds),
        cords=tuple(replace(lines[name], depth=None, arc=None) for name in built.cords),
        shape=table.shape.as_scaled(),
    )


def scaled(tire: TireTable, scale: Mapping[str, float]) -> TireTable:
    """A built-in tire, of which nothing is stated, with [tire.scale]. Raises InputError for a name that is none."""
    built, source = tire.shape.parts(tire), Source(Path("tire"), "")
    merged = {"region": _regions(built, [], source), "cords": _cords(built, [])}
    for key, factor in scale.items():
        for _ in _scale(merged, built, key, factor, source):
            pass
    if source.problems:
        raise InputError(source.problems[0][1].removeprefix("tire: "))
    regions = (_region_table(region) for region in merged["region"])
    cords = (CordsTable(**line) for line in merged["cords"])
    return replace(tire, region=tuple(regions), cords=tuple(cords), shape=tire.shape.as_scaled())


def _region_table(raw: Raw) -> RegionTable:
    material = dict(raw["material"])
    model, density = material.pop("model"), material.pop("density")
    law = MATERIALS.make(model, **material)
    return RegionTable(**{**raw, "material": MaterialTable(model=model, law=law, density=density)})


def compound_table(
    name: str, law: MaterialLaw, model: str, density: float | None, small: Raw
) -> Raw:
    """The [[tire.region]] of a compound; `small`: its keys of small motions."""
    return {"name": name, "material": material_table(law, model, density), **small}


def material_table(law: MaterialLaw, model: str, density: float | None) -> Raw:
    """The table of a material, without a density that is None."""
    values = {item.name: getattr(law, item.name) for item, _ in keys(type(law))}
    own = {} if density is None else {"density": density}
    return {"model": model, **values, **own}


def _regions(built: Parts, given: Sequence[Raw], source: Source) -> list[Raw]:
    """Each given region over what it changes; of a built-in section also the compounds not given."""
    everywhere = next(
        ((n, region) for n, region in enumerate(given) if built.whole and "name" not in region),
        None,
    )

    def over(place: int | None, one: Raw, base: Raw) -> Raw:
        if everywhere:
            base = _over(everywhere[1], base, ("tire", "region", str(everywhere[0])), source)
        return _over(one, base, ("tire", "region", str(place)), source)

    merged, seen = [], set()
    for place, one in enumerate(given):
        name = _spelt(one.get("name"), built.compounds)
        seen.add(name)
        if everywhere and place == everywhere[0]:
            merged.append(one)
        elif name in built.compounds:
            merged.append({**over(place, one, built.compounds[name]), "name": name})
        else:
            merged.append(over(place, one, built.region_elsewhere))
    rest = built.compounds if built.whole else {}
    return merged + [over(None, {}, region) for name, region in rest.items() if name not in seen]


def _cords(built: Parts, given: Sequence[Raw]) -> list[Raw]:
    """Each given line over what it changes; of a built-in section also the lines not given."""
    merged, seen = [], set()
    for one in given:
        name = _spelt(one.get("name"), built.cords)
        seen.add(name)
        base = built.cords.get(name, built.cords_elsewhere)
        merged.append({**base, **one} | ({"name": name} if name in built.cords else {}))
    rest = built.cords if built.whole else {}
    return merged + [dict(line) for name, line in rest.items() if name not in seen]


def _spelt(name: str | None, known: Mapping[str, Raw]) -> str:
    """A name as the section spells it."""
    return next((own for own in known if name and own.upper() == name.upper()), name or "")


def _over(stated: Raw, base: Raw, path: Path_, source: Source) -> Raw:
    """A region's table with what it leaves out from another."""
    rest = dict(base)
    way = next((way for way in _WAYS if way & stated.keys()), None)
    if way is not None:
        others = set().union(*_WAYS) - way
        rest = {key: value for key, value in rest.items() if key not in others}
    result = rest | stated
    if "material" in stated and "material" in base:
        result["material"] = _material(
            stated["material"], base["material"], (*path, "material"), source
        )
    if "hardness" in stated:
        _harden(result, stated, path, source)
    return result


def _harden(region: Raw, stated: Raw, path: Path_, source: Source) -> None:
    """Write a hardness (Shore A) back as the moduli of the region's material."""
    hardness = region.pop("hardness")
    fits = isinstance(hardness, int | float) and 20 <= hardness <= 95
    if not fits or not isinstance(stated.get("material", {}), dict):
        region["hardness"] = hardness  # refused where the table is read
        return
    material = dict(region["material"])
    values = {key: value for key, value in material.items() if key not in ("model", "density")}
    pascals = {item.name for item, key in keys(MATERIALS[material["model"]]) if key.unit == "Pa"}
    if both := pascals & stated.get("material", {}).keys():
        source.add((*path, "hardness"), f"and material.{min(both)} exclude each other")
        return
    factor = shore_a(hardness) / MATERIALS.make(material["model"], **values).youngs
    region["material"] = material | {
        key: _times(value, factor) for key, value in values.items() if key in pascals
    }


def _material(stated: Raw, base: Raw, path: Path_, source: Source) -> Raw:
    """A material's table over another.

    Under another law the moduli of small strain stay, as far as it has parameters that are these; its
    coefficients cannot follow from them and must be given.
    """
    default = MaterialTable().model
    own = _names(base["model"])
    same = stated.keys() - {"density", "model"} <= own
    model = stated.get("model", base["model"] if same else default)
    if model == base["model"]:
        return base | stated
    law = MATERIALS.make(base["model"], **{key: base[key] for key in own if key in base})
    moduli = {
        "youngs_modulus": law.youngs,
        "poisson_ratio": law.poisson,
        "bulk_modulus": law.bulk,
    }
    known = moduli | base
    stays = {key: known[key] for key in _names(model) | {"density"} if key in known}
    result = stays | stated | {"model": model}
    missing = [
        item.name
        for item, key in keys(MATERIALS[model])
        if item.name not in result and key.unit == "Pa" and item.default
    ]
    if missing:
        text = f'is missing: model = "{model}" is another law than "{base["model"]}", from which it cannot follow'
        source.add((*path, missing[0]), text)
    return result


def _names(model: str) -> set[str]:
    """The parameters of a law."""
    return {item.name for item, _ in keys(MATERIALS[model])}


def _scale(merged: Raw, built: Parts, key: str, factor: float, source: Source) -> Iterator[str]:
    """Multiply a quantity of the parts of a name, in place; yields each change in words."""
    path = ("tire", "scale", key)
    groups = _groups(built)
    words = " ".join(key.replace("_", " ").split()).lower()
    fitting = [name for name in groups if f"{words} ".startswith(f"{name.lower()} ")]
    if not fitting:
        near = difflib.get_close_matches(words, list(groups), 1, 0.6)
        hint = f"did you mean {near[0]}? " if near else ""
        known = ", ".join(groups)
        source.add(path, f"begins with no name of a compound or of a line of cords: {hint}{known}")
        return
    name = max(fitting, key=len)
    table, members = groups[name]
    quantity = words[len(name) :].strip() or "modulus"
    possible = _OF_COMPOUND if table == "region" else _OF_CORDS
    if quantity not in possible:
        source.add(
            path, f'has no quantity "{quantity}" of {name}: take one of {", ".join(possible)}'
        )
        return
    for part in merged[table]:
        if part.get("name") in members:
            yield from _multiplied(part, quantity, factor, path, source)


def _groups(built: Parts) -> dict[str, tuple[str, list[str]]]:
    """(table, names of its parts) that a name in [tire.scale] stands for."""
    belts = [name for name in built.cords if name.startswith(f"{BELTS} ")]
    groups = {name: ("region", [name]) for name in built.compounds}
    groups |= {name: ("cords", [name]) for name in built.cords}
    groups |= {BELTS: ("cords", belts)} if belts else {}
    return groups | {
        "compounds": ("region", list(built.compounds)),
        "cords": ("cords", list(built.cords)),
    }


def _multiplied(
    part: Raw, quantity: str, factor: float, path: Path_, source: Source
) -> Iterator[str]:
    """Multiply one quantity of a part's table."""
    material = part.get("material")
    if quantity == "modulus" and material is not None:
        pascals = [
            item.name for item, key in keys(MATERIALS[material["model"]]) if key.unit == "Pa"
        ]
        holder, names = material, pascals
    else:
        key = {"modulus": "youngs_modulus"}.get(quantity, quantity.replace(" ", "_"))
        holder = material if material is not None and key in material else part
        names = [key]
    changed = dict(holder)
    for name in names:
        if name not in holder:
            text = f"multiplies {name}, which {part['name']} has not: it is given by another law or a Prony series"
            source.add(path, text)
            return
        changed[name] = _times(holder[name], factor)
        yield f"{part['name']}: {name} = {_shown(changed[name])}, {factor:g} times {_shown(holder[name])}"
    if holder is material:
        part["material"] = changed
    else:
        part.update(changed)


def _times(value: Any, factor: float) -> Any:
    return (
        [factor * number for number in value] if isinstance(value, list | tuple) else factor * value
    )


def _shown(value: Any) -> str:
    return (
        ", ".join(f"{number:.6g}" for number in value)
        if isinstance(value, list | tuple)
        else f"{value:.6g}"
    )


def listed(tire: Mapping[str, Any]) -> list[Listing]:
    """Tables of the compounds and the cords of a resolved [tire] whose parts are all in it, as in TOML.

    Moduli at zero strain. Empty for other tires.
    """
    if tire.get("section") != "radial":
        return []
    regions, lines = tire.get("region", []), tire.get("cords", [])
    compounds = [_compound_row(region) for region in regions if "material" in region]
    cords: list[tuple[str, ...]] = [
        (
            str(line["name"]),
            f"{line['angle']:.4g}",
            f"{1e-9 * line['youngs_modulus']:.4g}",
            f"{1e6 * line['area']:.4g}",
            f"{1e3 * line['spacing']:.4g}",
            f"{line['density']:.4g}",
            f"{line['compression']:.4g}",
        )
        for line in lines
    ]
    return [
        ("compounds of the tire", _COMPOUND_HEAD, compounds),
        ("cords of the tire", _CORDS_HEAD, cords),
    ]


def _compound_row(region: Mapping[str, Any]) -> tuple[str, ...]:
    material = dict(region["material"])
    model, density = material.pop("model"), material.pop("density")
    law = MATERIALS.make(model, **material)
    whole = {"prony_shares": "Prony series", "master_curve": "master curve"}
    given = next((words for key, words in whole.items() if region.get(key)), "")
    small = (
        (given, "", "")
        if given
        else tuple(f"{region.get(key, 0.0):.4g}" for key in ("dynamic", "loss_factor", "exponent"))
    )
    moduli = f"{1e-6 * law.youngs:.4g}", f"{law.poisson:.4g}"
    return (str(region["name"]), model, *moduli, f"{density:.4g}", *small)


def in_lines(tables: Sequence[Listing]) -> list[str]:
    """The tables as aligned text."""
    lines = []
    for title, head, rows in tables:
        widths = [max(len(row[k]) for row in (head, *rows)) for k in range(len(head))]
        lines.append(title)
        for row in (head, *rows):
            cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
            lines.append(f"  {'  '.join(cells)}".rstrip())
    return lines
