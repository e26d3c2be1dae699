"""The figures of a tire: mass, first modes, stiffness, footprint; from a TOML file or a .tir file, and as one.

A .tir file is that of MF-Tyre/MF-Swift: sections in brackets, `KEY = value $ comment`, SI units. Of it
belong here [DIMENSION], [OPERATING_CONDITIONS], [INERTIA], [VERTICAL], [STRUCTURAL] and [CONTACT_PATCH]. The footprint
of a load F is there, with the vertical stiffness C and the unloaded radius R,

    length = 2 R (Q_RA2 x + Q_RA1 sqrt(x)),  width = 2 w (Q_RB2 x + Q_RB1 x^(1/3)),  x = F / (C R)

with the section's width w (Besselink, Schmeitz, Pacejka, Vehicle System Dynamics 48 S1, 2010).
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.sections.construction import INFLATION
from tireroad.fem.sections.radial import radial, size


@dataclass(frozen=True)
class FigureKind:
    """A figure: unit, relative tolerance of a fit, range, key in a .tir file, and what it is."""

    unit: str
    tolerance: float
    least: float
    most: float
    tir: str
    doc: str


KINDS: Mapping[str, FigureKind] = {
    "mass": FigureKind("kg", 0.01, 1, 200, "MASS", "of the tire"),
    "lateral_frequency": FigureKind("Hz", 0.02, 5, 500, "FREQ_LAT", "sidewise, rim held, no road"),
    "yaw_frequency": FigureKind("Hz", 0.02, 5, 500, "FREQ_YAW", "yaw and tilt of the belt"),
    "windup_frequency": FigureKind(
        "Hz", 0.02, 5, 500, "FREQ_WINDUP", "belt against rim about the axle"
    ),
    "vertical_frequency": FigureKind("Hz", 0.02, 5, 500, "FREQ_LONG", "vertical and fore-aft"),
    "lateral_damping": FigureKind("-", 0.2, 1e-4, 1, "DAMP_LAT", "damping ratio of these modes"),
    "yaw_damping": FigureKind("-", 0.2, 1e-4, 1, "DAMP_YAW", "damping ratio"),
    "windup_damping": FigureKind("-", 0.2, 1e-4, 1, "DAMP_WINDUP", "damping ratio"),
    "vertical_damping": FigureKind("-", 0.2, 1e-4, 1, "DAMP_LONG", "damping ratio"),
    "vertical_stiffness": FigureKind(
        "N/m", 0.04, 1e4, 1e7, "VERTICAL_STIFFNESS", "slope at the load"
    ),
    "longitudinal_stiffness": FigureKind(
        "N/m", 0.05, 1e4, 1e7, "LONGITUDINAL_STIFFNESS", "standing tire, at the load"
    ),
    "lateral_stiffness": FigureKind(
        "N/m", 0.05, 1e4, 1e7, "LATERAL_STIFFNESS", "standing tire, at the load"
    ),
    "torsional_stiffness": FigureKind(
        "N m/rad", 0.15, 100, 1e6, "YAW_STIFFNESS", "about the vertical axis, at the load"
    ),
    "footprint_length": FigureKind("m", 0.05, 0.01, 1, "", "at the load"),
    "footprint_width": FigureKind("m", 0.05, 0.01, 1, "", "at the load"),
}
LOADS = 0.03  # relative tolerance of the load at a deflection
MODES = "lateral", "yaw", "windup", "vertical"


@dataclass(frozen=True, kw_only=True)
class FitFigures:
    """`size`, `inflation` Pa, the `load` N at which stiffness and footprint hold, `values` by KINDS, and
    `loads`: pairs of deflection m and load N.
    """

    size: str
    inflation: float
    load: float
    values: Mapping[str, float] = field(default_factory=dict)
    loads: tuple[tuple[float, float], ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def pressed(self) -> bool:
        """Whether there are figures of the tire on the road."""
        modal = {"mass", *(f"{mode}_{what}" for mode in MODES for what in ("frequency", "damping"))}
        return bool(self.loads or set(self.values) - modal)


def read(path: Path, changes: Sequence[str] = ()) -> FitFigures:
    """The figures in a file, with `changes` as key=value. Raises InputError with the key for what is no figure."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None
    notes: list[str] = []
    if path.suffix.lower() == ".tir":
        sized = any(change.partition("=")[0].strip() == "size" for change in changes)
        table = _of_tir(text, path, notes, sized)
    elif path.suffix.lower() == ".toml":
        table = _parsed(text, path)
    else:
        raise InputError(f"{path}: figures are read from .toml or .tir")
    for change in changes:
        key, equals, value = change.partition("=")
        if not equals:
            raise InputError(f"--set {change}: is key=value, as in inflation=2.4e5")
        plain = value.strip() if key.strip() != "size" else f'"{value.strip()}"'
        table |= _parsed(f"{key} = {plain}", Path(f"--set {change}"))
    return _from_table(table, path, notes)


def _parsed(text: str, path: Path) -> dict:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: {error}") from None


def _from_table(table: dict, path: Path, notes: list[str]) -> FitFigures:
    known = {"size", "inflation", "load", "loads", *KINDS}
    wrong = sorted(set(table) - known)
    if wrong:
        raise InputError(f"{path}: unknown key {wrong[0]}; valid: {', '.join(sorted(known))}")
    for key in ("size", "inflation"):
        if key not in table:
            raise InputError(f"{path}: {key} is missing, as in {key} = {_EXAMPLE[key]}")
    if not isinstance(table["size"], str):
        raise InputError(f"{path}: size must be a text, as in size = {_EXAMPLE['size']}")
    values = {key: _checked(path, key, table[key]) for key in KINDS if key in table}
    loads = []
    for pair in table.get("loads", []):
        if not (isinstance(pair, list) and len(pair) == 2):
            raise InputError(f"{path}: loads is a list of pairs, [[deflection m, load N], ...]")
        deflection = _number(path, "loads", pair[0], 1e-4, 0.5)
        loads.append((deflection, _number(path, "loads", pair[1], 1, 1e6)))
    try:
        radial(table["size"])
    except InputError as error:
        raise InputError(f"{path}: {str(error).removeprefix('tire.')}") from None
    if not values and not loads:
        raise InputError(f"{path}: no figure to fit to; there are: {', '.join(KINDS)}, loads")
    load = table.get("load")
    if load is None:
        load = loads[-1][1] if loads else 4000.0
        if any(name.endswith("stiffness") for name in values):
            notes.append(f"load = {load:g} N taken for the load at which stiffness holds")
    return FitFigures(
        size=table["size"],
        inflation=_number(path, "inflation", table["inflation"], 1e4, 2e6, "Pa"),
        load=_number(path, "load", load, 10, 1e6, "N"),
        values=values,
        loads=tuple(sorted(loads)),
        notes=tuple(notes),
    )


_EXAMPLE = {"size": '"205/55 R16"', "inflation": "2.4e5   # Pa"}


def _number(
    path: Path, key: str, value: object, least: float, most: float, unit: str = ""
) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise InputError(f"{path}: {key} must be a number, not {str(value)[:40]!r}")
    if not least <= value <= most:
        raise InputError(f"{path}: {key} = {value:g} {unit} must be from {least:g} to {most:g}")
    return float(value)


def _checked(path: Path, key: str, value: object) -> float:
    kind = KINDS[key]
    return _number(path, key, value, kind.least, kind.most, kind.unit)


_LINE = re.compile(r"^\s*([A-Za-z_]\w*)\s*=\s*('[^']*'|\"[^\"]*\"|[^$!]*)")


def tir_values(text: str) -> dict[str, str]:
    """Values as written by key in capitals; comments begin with $ or !."""
    found: dict[str, str] = {}
    for line in text.splitlines():
        match = None if line.lstrip().startswith(("$", "!", "[", "{")) else _LINE.match(line)
        if match:
            found.setdefault(match[1].upper(), match[2].strip().strip("'\""))
    return found


def _of_tir(text: str, path: Path, notes: list[str], sized: bool) -> dict[str, Any]:
    """The figures of a .tir file by the keys of a TOML file; `sized`: the size is given otherwise."""
    given = tir_values(text)
    for key, unit in (("LENGTH", "meter"), ("FORCE", "newton"), ("TIME", "second")):
        if given.get(key, unit).lower().rstrip("s") not in (unit, unit[:1], "metre", "m"):
            raise InputError(
                f"{path}: {key} = {given[key]}: files in SI units are read ({key} = '{unit}')"
            )

    def value(key: str) -> float | None:
        try:
            return float(given[key].replace("D", "e").replace("d", "e")) if key in given else None
        except ValueError:
            return None  # MASS is a unit, too

    masses = re.findall(r"(?im)^\s*MASS\s*=\s*(\d+\.?\d*(?:e[-+]?\d+)?)\s*(?:[$!]|$)", text)
    named, off = ("", 0.0) if sized else _size(path, value)
    if abs(off) > 0.02:
        notes.append(
            f"size {named}: its radius is {100 * off:+.1f} % off the file's UNLOADED_RADIUS"
        )
    values: dict[str, float] = {}
    for key, kind in KINDS.items():
        found = (
            float(masses[0]) if key == "mass" and masses else value(kind.tir) if kind.tir else None
        )
        if found is None or (found == 0 and key != "mass"):
            continue
        values[key] = _checked(path, key, found)
    load, radius, stiffness = (
        value("FNOMIN"),
        value("UNLOADED_RADIUS"),
        values.get("vertical_stiffness"),
    )
    if load and radius and stiffness:
        x = load / (stiffness * radius)
        q = [value(f"Q_R{which}") or 0.0 for which in ("A1", "A2", "B1", "B2")]
        sizes = {
            "footprint_length": 2 * radius * (q[1] * x + q[0] * math.sqrt(x)),
            "footprint_width": 2 * (value("WIDTH") or 0.0) * (q[3] * x + q[2] * np.cbrt(x)),
        }
        values |= {key: _checked(path, key, float(one)) for key, one in sizes.items() if one > 0}
    table = values | {"size": named} | ({"load": load} if load else {})
    inflation = value("INFLPRES") or value("IP") or value("NOMPRES")
    if inflation is not None:
        return table | {"inflation": inflation}
    notes.append(
        f"no INFLPRES in the file: inflation = {INFLATION:g} Pa taken (--set inflation=...)"
    )
    return table | {"inflation": INFLATION}


def _size(path: Path, value: Callable[[str], float | None]) -> tuple[str, float]:
    """The nearest size of passenger tires, and how far its radius is off, relative."""
    width, rim = value("WIDTH"), value("RIM_RADIUS")
    radius, ratio = value("UNLOADED_RADIUS"), value("ASPECT_RATIO")
    if not width or not rim:
        raise InputError(
            f'{path}: no size: WIDTH and RIM_RADIUS of [DIMENSION] are needed, or --set size="205/60 R15"'
        )
    ratio = ratio / 100 if ratio and ratio > 2 else ratio  # some write per cent
    if not ratio:
        if not radius:
            raise InputError(
                f"{path}: no size: UNLOADED_RADIUS or ASPECT_RATIO of [DIMENSION] is needed"
            )
        ratio = (radius - rim) / width
    across = 10 * round((1e3 * width - 5) / 10) + 5
    named = f"{across}/{5 * round(20 * ratio)} R{round(2 * rim / 0.0254)}"
    try:
        made = size(named)
    except InputError as error:
        raise InputError(f"{path}: {str(error).removeprefix('tire.')}") from None
    return named, (made.rim + made.height) / radius - 1 if radius else 0.0
