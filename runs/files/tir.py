"""The form of .tir files, that of MF-Tyre/MF-Swift: sections in brackets, `KEY = value $ comment`, SI units."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from tireroad.fem.errors import InputError

_LINE = re.compile(r"^\s*([A-Za-z_]\w*)\s*=\s*('[^']*'|\"[^\"]*\"|[^$!]*)")
UNITS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "LENGTH": ("meter", ("m", "meter", "metre", "meters", "metres")),
    "FORCE": ("newton", ("n", "newton", "newtons")),
    "TIME": ("second", ("s", "sec", "second", "seconds")),
    "MASS": ("kg", ("kg", "kilogram", "kilograms", "kilo")),
    "ANGLE": ("radians", ("rad", "radian", "radians")),
    "PRESSURE": ("pascal", ("pa", "pascal", "pascals")),
}
"""SI units as they are written, and other names of theirs that are read."""


@dataclass(frozen=True)
class Tir:
    """A .tir file: `units` and `values` by key in capitals as written, with their lines, and rows of numbers by section."""

    path: Path
    units: Mapping[str, tuple[str, int]]
    values: Mapping[str, tuple[str, int]]
    tables: Mapping[str, list[tuple[str, int]]]

    def number(self, key: str) -> float | None:
        """The value of a key; None where it is absent. InputError for one that is no finite number."""
        if key not in self.values:
            return None
        text, line = self.values[key]
        value = finite(text)
        if value is None:
            told = f"{key} = {text} is not a number{hint(text)}" if text else f"{key} has no value"
            raise InputError(f"{self.path}, line {line}: {told}")
        return value

    def unit(self, key: str) -> str | None:
        """The unit as written if it is not that of SI."""
        text = self.units.get(key, ("", 0))[0]
        return text if text and text.lower() not in UNITS[key][1] else None


def finite(text: str) -> float | None:
    """A number as C or Fortran writes it; None if it is none or not finite."""
    try:
        value = float(text.replace("D", "e").replace("d", "e"))
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def hint(text: str) -> str:
    """Advice for a number that is written with a decimal comma; else nothing."""
    return f": write {text.replace(',', '.')}" if re.fullmatch(r"[-+\d,eE]+", text) else ""


def parsed(text: str, path: Path, used: Collection[str] = ()) -> Tir:
    """The content of a .tir file; comments begin with $ or !.

    InputError for a key of those `used` that has two values, or none.
    """
    units: dict[str, tuple[str, int]] = {}
    values: dict[str, tuple[str, int]] = {}
    tables: dict[str, list[tuple[str, int]]] = {}
    section = ""
    for number, line in enumerate(text.replace("\x1a", "").splitlines(), 1):
        plain = line.strip()
        if not plain or plain.startswith(("$", "!", "{")):
            continue
        if plain.startswith("["):
            section = plain[1:].partition("]")[0].strip().upper()
            continue
        if not (match := _LINE.match(line)):
            word = re.match(r"\w+", plain)
            if word and word[0].upper() in used:
                raise InputError(
                    f"{path}, line {number}: {plain[:40]!r} is not {word[0].upper()} = number"
                )
            tables.setdefault(section, []).append((re.split(r"[$!]", plain)[0].strip(), number))
            continue
        key, value = match[1].upper(), match[2].strip().strip("'\"").strip()
        # Without sections MASS is a unit by its text.
        of_units = section == "UNITS" or (not section and key in UNITS and not value[:1].isdigit())
        into = units if of_units else values
        if key in into and into[key][0] != value and key in used:
            raise InputError(
                f"{path}, line {number}: {key} = {value}, and {into[key][0]} in line {into[key][1]}: which is right?"
            )
        into.setdefault(key, (value, number))
    return Tir(path, units, values, tables)
