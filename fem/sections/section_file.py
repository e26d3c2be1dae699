"""Reader of section files, constructions in TOML (docs/section-file.md). Executes nothing."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.sections.construction import (
    RADII,
    Construction,
    CordLine,
    Layer,
    Outline,
    Part,
    arcs,
)

UNITS = {"m": 1.0, "mm": 1e-3}
LARGEST = 1_000_000  # bytes
_TABLES = {"name", "unit", "tread", "held", "outline", "layer", "part", "cords", "compound"}
_COMPOUND: dict[str, float | None] = {
    "youngs_modulus": None,
    "poisson_ratio": 0.49,
    "density": None,
    "dynamic": 1.0,
    "loss_factor": 0.0,
    "exponent": 0.0,
}

# As those of [tire.material] and [[tire.region]], but for densities in g/cm3, and of [[tire.cords]].
COMPOUND_RANGES = {
    "youngs_modulus": (1e3, 1e13),
    "poisson_ratio": (-0.99, 0.4999),
    "density": (100.0, 3e4),
    "dynamic": (0.01, 100.0),
    "loss_factor": (0.0, 2.0),
    "exponent": (0.0, 0.5),
}
CORD_RANGES = {
    "youngs_modulus": (1e3, 1e13),
    "area": (1e-12, 1e-3),
    "spacing": (1e-6, 0.1),
    "density": (0.0, 3e4),
    "compression": (0.0, 1.0),
}
_CORDS: dict[str, float | None] = {
    "youngs_modulus": None,
    "area": None,
    "spacing": None,
    "density": 0.0,
    "compression": 1.0,
}


def read(path: Path | str) -> Construction:
    """The construction in a file. Raises InputError, with its name, for undocumented content."""
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if len(data) > LARGEST:
        raise InputError(f"{path}: not a section file: more than {LARGEST / 1e6:g} MB")
    try:
        raw = tomllib.loads(data.decode("utf-8-sig"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None
    try:
        return _construction(raw)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _construction(raw: dict[str, Any]) -> Construction:
    _known(raw, _TABLES, "the file")
    unit = raw.get("unit", "m")
    if unit not in UNITS:
        raise InputError(f'unit = "{unit}": must be "m" or "mm"')
    scale = UNITS[unit]
    layers = [_layer(layer, scale) for layer in _tables(raw, "layer", least=1)]
    if twice := _twice(layers):
        raise InputError(f"layer {twice!r}: the name of two layers; parts and cords refer to one")
    cords = [_cords(cords, scale) for cords in _tables(raw, "cords")]
    if twice := _twice(cords):
        raise InputError(f"cords {twice!r}: the name of two lines; results have one of each name")
    held = scale * _number(raw, "held", "the file") if "held" in raw else None
    return Construction(
        outline=_outline(_table(raw, "outline"), scale),
        layers=layers,
        parts=[_part(part, scale) for part in _tables(raw, "part")],
        cords=cords,
        compounds={
            name: _compound(name, compound) for name, compound in _table(raw, "compound").items()
        },
        tread=scale * _number(raw, "tread", "the file"),
        held=held,
    )


def _twice(named: Sequence[Layer | CordLine]) -> str | None:
    """The first name that two of them have; None if each has its own."""
    names = [name.name for name in named]
    return next((name for name in names if names.count(name) > 1), None)


def _outline(table: dict[str, Any], scale: float) -> Outline:
    _known(table, {"spline", "arcs"}, "[outline]")
    if len(table) != 1:
        raise InputError("[outline] has either spline = [[r, y], …] or arcs = [[r, y], …]")
    kind, points = next(iter(table.items()))
    points = scale * _pairs(points, f"outline.{kind}")
    if points.min(axis=0)[0] <= 0:
        raise InputError(f"outline.{kind}: r must be above 0 everywhere: points are [r, y]")
    low, high = RADII
    if not low <= (outer := float(points[:, 0].max())) <= high:
        raise InputError(
            f"outline.{kind}: r reaches {outer:.4g} m; {low:g} to {high:g} m is a tire: is unit (m or mm) that "
            "of the drawing?"
        )
    return Outline(arcs(points) if kind == "arcs" else points)


def _layer(table: dict[str, Any], scale: float) -> Layer:
    _known(table, {"name", "compound", "thickness"}, "[[layer]]")
    name, thickness = _text(table, "name", "[[layer]]"), table.get("thickness")
    constant = not isinstance(thickness, list)
    pairs = [[0.0, _number(table, "thickness", f"layer {name!r}")]] if constant else thickness
    values = scale * _pairs(pairs, f"layer {name!r}: thickness")
    return Layer(
        name, _text(table, "compound", f"layer {name!r}"), tuple(map(tuple, values.tolist()))
    )


def _part(table: dict[str, Any], scale: float) -> Part:
    _known(table, {"layer", "compound", "along"}, "[[part]]")
    low, high = scale * _pairs([table.get("along")], "part: along")[0]
    if not 0 <= low < high:
        raise InputError("[[part]]: along = [from, to] must ascend from 0 at the crown")
    layer, compound = (_text(table, key, "[[part]]") for key in ("layer", "compound"))
    return Part(layer, compound, (float(low), float(high)))


def _cords(table: dict[str, Any], scale: float) -> CordLine:
    """Area in m2 and spacing in m whatever the unit of the drawing, as in [[tire.cords]]."""
    _known(table, {"name", "under", "to", "angle", *_CORDS}, "[[cords]]")
    name = _text(table, "name", "[[cords]]")
    angle = _number(table, "angle", f"cords {name!r}")
    if not -90.0 <= angle <= 90.0:
        raise InputError(f"cords {name!r}: angle = {angle:g} deg must lie between -90 and 90")
    numbers = _numbers(table, _CORDS, CORD_RANGES, f"cords {name!r}")
    return CordLine(
        name=name,
        under=_text(table, "under", f"cords {name!r}"),
        to=scale * _number(table, "to", f"cords {name!r}"),
        angle=float(np.radians(angle)),
        **numbers,
    )


def _compound(name: str, table: Any) -> dict[str, float]:
    where = f"[compound.{name}]"
    if not isinstance(table, dict):
        raise InputError(f"{where} must be a table")
    _known(table, set(_COMPOUND), where)
    return _numbers(table, _COMPOUND, COMPOUND_RANGES, where)


def _numbers(
    table: dict[str, Any],
    defaults: Mapping[str, float | None],
    ranges: Mapping[str, tuple[float, float]],
    where: str,
) -> dict[str, float]:
    """The numbers of a table by key, within their ranges."""
    numbers = {key: _number(table, key, where, default) for key, default in defaults.items()}
    for key, (least, most) in ranges.items():
        if not least <= numbers[key] <= most:
            raise InputError(
                f"{where}: {key} = {numbers[key]:g} must lie from {least:g} to {most:g}"
            )
    return numbers


def _known(table: dict[str, Any], keys: set[str], where: str) -> None:
    for key in table:
        if key not in keys:
            raise InputError(f"{where}: unknown key {key!r}; there are {', '.join(sorted(keys))}")


def _table(raw: dict[str, Any], key: str) -> dict[str, Any]:
    if not isinstance(raw.get(key), dict):
        raise InputError(f"a table [{key}] is needed")
    return raw[key]


def _tables(raw: dict[str, Any], key: str, least: int = 0) -> list[dict[str, Any]]:
    value = raw.get(key, [])
    if not isinstance(value, list) or not all(isinstance(table, dict) for table in value):
        raise InputError(f"{key} must be written [[{key}]], one for each")
    if len(value) < least:
        raise InputError(f"a [[{key}]] is needed")
    return value


def _number(table: dict[str, Any], key: str, where: str, default: float | None = None) -> float:
    value: Any = table.get(key, default)
    right = isinstance(value, int | float) and not isinstance(value, bool)
    if not right or not np.isfinite(value):
        raise InputError(
            f"{where}: {key} must be a number" + (", not " + str(value)[:40] if value else "")
        )
    return float(value)


def _text(table: dict[str, Any], key: str, where: str) -> str:
    value = table.get(key)
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{where}: {key} must be a text")
    return value


def _pairs(value: Any, where: str) -> np.ndarray:
    try:
        pairs = np.array(value, dtype=float)
    except (TypeError, ValueError):
        pairs = np.zeros(0)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.isfinite(pairs).all():
        raise InputError(f"{where} must be pairs of numbers, [[a, b], …]")
    return pairs
