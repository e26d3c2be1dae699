"""Reading the result files of one folder, and numbers with units for readers."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError
from tireroad.runs.files import store
from tireroad.runs.files.folder import left_out

SYMBOLS = {"-": "", "1": "", "us": "µs", "deg": "°", "m2": "m²", "m3": "m³", "kg^-1/2": "kg^(−1/2)"}
PREFIXES = {
    "m": ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm")),
    "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs")),
    "N": ((1e4, "kN", 1e3), (1.0, "N"), (1e-3, "mN")),
    "Pa": ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa"), (1.0, "Pa")),
    "Hz": ((1e4, "kHz", 1e3), (1e-2, "Hz", 1.0)),
}


def quantity(value: object, unit: str = "") -> str:
    """`value` with its unit: 0.0123 "m" gives "12.3 mm"; flags in words, texts as they are."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "–"
    if isinstance(value, (list, tuple)):
        return ", ".join(quantity(part, unit) for part in value) or "–"
    if not isinstance(value, (int, float)):
        text = str(value)  # with the unit of the numbers in it; "auto" has none
        return f"{text} {shown_unit(unit)}".rstrip() if any(map(str.isdigit, text)) else text
    factor, symbol = _prefix(value, unit)
    return f"{digits(value / factor)} {symbol}".rstrip()


def bounded(value: float, error: float | None, unit: str) -> str:
    """`value` and its `error` to two digits in the value's own unit: "60.37 ± 0.67 N"."""
    if not error:
        return quantity(value, unit)
    factor, symbol = _prefix(value, unit)
    return f"{digits(value / factor)} ± {digits(float(f'{error / factor:.2g}'))} {symbol}".rstrip()


def shown_unit(unit: str) -> str:
    """A unit of a file as pages write it."""
    return SYMBOLS.get(unit, unit).replace("uPa", "µPa").replace("/m2", "/m²")


def about(error: float) -> str:
    """An estimated error in dB with its sign, "unknown" where it is NaN; never of 0.0."""
    if not np.isfinite(error):
        return "unknown"
    return f"± {error:.1f}" if error >= 0.05 else f"± {error:.1g}"


def _prefix(value: float, unit: str) -> tuple[float, str]:
    """The unit with a prefix that suits `value`, and how many of `unit` it has."""
    for threshold, name, *factor in PREFIXES.get(unit, ()):
        if isfinite(value) and abs(value) >= threshold:
            return (factor[0] if factor else threshold), name
    return 1.0, shown_unit(unit)


def digits(value: float) -> str:
    """4 significant digits; integers in full up to a million; powers of ten as 3.1·10⁻¹²."""
    if float(value).is_integer() and abs(value) < 1e6:
        return f"{int(value):,}".replace(",", "\u202f").replace("-", "−")
    text = f"{value:.4g}"
    mantissa, _, exponent = text.partition("e")
    if exponent:
        raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        text = f"{float(mantissa):.3g}·10{raised}"
    return text.replace("-", "−")


@dataclass
class TextTable:
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]


@dataclass
class Picture:
    """A picture as a data URI, its caption, and the `live` chart for it (runs.report.live)."""

    image: str
    caption: str
    live: dict | None = None


@dataclass
class Section:
    title: str
    lead: str = ""
    facts: list[tuple[str, str]] = field(default_factory=list)
    figures: list[Picture] = field(default_factory=list)
    table: TextTable | None = None
    sounds: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    listing: tuple[str, str] | None = None  # a title, and lines that are shown on request

    def show(self, image: str, caption: str, live: dict | None = None) -> None:
        """Add a picture."""
        self.figures.append(Picture(image, caption, live))


class Absent(LookupError):
    """A required file or dataset does not exist; the message names it."""


class Results:
    """The result files of one folder, opened on first use; a context manager."""

    def __init__(self, directory: Path, scene: Mapping) -> None:
        self.directory, self.scene = directory, scene
        self.left_out = left_out(directory)
        self._open: dict[str, h5py.File] = {}

    def __enter__(self) -> "Results":
        return self

    def __exit__(self, *_: object) -> None:
        for file in self._open.values():
            file.close()

    def file(self, name: str) -> h5py.File:
        """The open HDF5 file. Raises InputError if it is damaged.

        Raises Absent if it does not exist, or is of an earlier run.
        """
        if name not in self._open:
            path = self.directory / name
            if name in self.left_out:
                raise Absent(self.left_out[name])
            if not path.is_file():
                raise Absent(f"there is no {name}")
            store.verify(path)
            self._open[name] = h5py.File(path, "r")
        return self._open[name]

    def dataset(self, name: str, path: str) -> h5py.Dataset:
        found = self.file(name).get(path)
        if not isinstance(found, h5py.Dataset):
            raise Absent(f"{name} holds no dataset {path}")
        return found

    def array(self, name: str, path: str) -> NDArray:
        """Numbers, or texts."""
        data = self.dataset(name, path)
        return data.asstr()[()] if h5py.check_string_dtype(data.dtype) else data[()]

    def optional(self, name: str, path: str) -> NDArray | None:
        try:
            return self.array(name, path)
        except Absent:
            return None

    def borrowed(self, name: str, path: str) -> NDArray | None:
        """An optional array of another section's file; that section reports any damage."""
        try:
            return self.optional(name, path)
        except InputError:
            return None

    def attribute(self, name: str, key: str) -> float | str | None:
        value = self.file(name).attrs.get(key)
        return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else value


def attributes(results: Results, name: str, wanted: tuple[tuple[str, str], ...]) -> list:
    """Facts from those attributes (key, unit) that the file has."""
    found = [(key, unit, results.attribute(name, key)) for key, unit in wanted]
    return [(key.replace("_", " "), quantity(v, unit)) for key, unit, v in found if v is not None]


def without_friction(results: Results) -> bool:
    """Whether the loop of a run had no friction, so that its horizontal forces come from the road's slope alone."""
    try:
        return float(results.attribute("contact.h5", "friction")) == 0.0
    except (Absent, InputError, TypeError):  # a file that is damaged is told of by its own section
        return False
