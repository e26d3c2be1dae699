"""Road files as programs may write them: one road in many units, headings, forms, encodings, with an index and codes.

Each variant knows the road that it holds. A program that reads it must give that road, or refuse.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

UNITS = {
    "mm": 1e-3, "cm": 1e-2, "m": 1.0, "um": 1e-6, "µm": 1e-6, "in": 0.0254, "dm": 0.1, "0.1 mm": 1e-4, "MM": 1e-3,
    "inch": 0.0254, "Meter": 1.0, "microns": 1e-6, "1/10 mm": 1e-4, "millimetre": 1e-3, "millimètres": 1e-3,
    "Zentimeter": 1e-2, "ft": 0.3048, "furlong": 201.168,
}  # fmt: skip
KEYS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254}
NAMES = {
    "x": ("x", "X", "Distance", "distance", "Position", "Abstand", "station", "pos_x", "Weg", "x-axis", "Länge", "dist"),
    "y": ("y", "Y", "lateral", "pos_y", "Breite", "y-axis", "Lateral", "width", "Across", "quer", "y coordinate", "Y pos"),
    "z": ("z", "Z", "Height", "elevation", "Profile", "Höhe", "depth", "pos_z", "Tiefe", "z-axis", "HEIGHT", "Elevation"),
}  # fmt: skip
IN_HEADING: dict[str, str] = {
    "square": "{n} [{u}]", "round": "{n} ({u})", "tight": "{n}[{u}]", "comma": "{n}, {u}", "slash": "{n}/{u}",
    "spaced slash": "{n} / {u}", "underscore": "{n}_{u}", "in": "{n} in {u}", "space": "{n} {u}", "curly": "{n} {{{u}}}",
    "colon": "{n}: {u}", "quoted": '"{n} [{u}]"', "pointed": "{n} <{u}>", "before": "{n} [{u}] raw",
    "guillemets": "{n} «{u}»",
}  # fmt: skip
BESIDE = (
    "unit line", "bracketed unit line", "statement", "statements", "in words", "numbered", "none", "first alone",
)  # fmt: skip
SEPARATORS = {",": ",", ";": ";", "tab": "\t", "space": " ", "|": "|", ", ": ", ", "spaces": "   "}
ENCODINGS = "utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"
INDEX = (
    "",
    "index",
    "No",
    "#",
    "sample",
    "Unnamed: 0",
    "n",
    "Point",
    "Index",
    "id",
    "Zeile",
    "row",
)
CODES = ("-9999", "0", "99.99", "-32768", "9999", "-1", "-999.9", "1e30", "65535", "-99")
WORDS = ("nan", "NaN", "", "NA", "null", "1.#QNAN", "-")


@dataclass
class Variant:
    """A file: `suffix` and `write`; the road in it; the scene's `keys`; and what it is made of, for counts and messages."""

    suffix: str
    write: Callable[[Path], None]
    x: Array
    z: Array
    keys: dict[str, Any]
    traits: dict[str, str]
    y: Array | None = None
    shown: str = ""
    stated: bool = True
    missing: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))


def _text(value: float, unit: float, least: float, comma: bool) -> str:
    """A length (m) in a unit, rounded to a part of `least` m."""
    digits = max(int(np.ceil(-np.log10(least / unit))), 0)
    shown = f"{value / unit:.{digits}f}"
    return shown.replace(".", ",") if comma else shown


def _value(text: str, unit: str) -> float:
    """The length (m) that a text means; nan for no number."""
    try:
        return UNITS[unit] * float(text.replace(",", "."))
    except ValueError:
        return np.nan


def _roughness(rng: random.Random, count: int, seed: int) -> Array:
    """Heights (m) of a profile: a smooth random line of 1 mm rms."""
    noise = np.random.default_rng(seed).standard_normal(count + 8)
    z = np.convolve(noise, np.ones(9) / 9, "valid")[:count]
    return 1e-3 * z / z.std() + rng.choice((0.0, 0.02, -0.015))


@dataclass
class _Table:
    """Columns as text, and what stands above them."""

    rng: random.Random
    separator: str
    roles: tuple[str, ...]
    units: dict[str, str]
    form: str
    index: str | None
    order: list[str]
    language: int
    traits: dict[str, str]

    def title(self, role: str) -> str:
        """The heading of a column."""
        name = NAMES[role][self.language]
        form = self.form
        if form in IN_HEADING:
            shown = IN_HEADING[form].format(n=name, u=self.units[role])
            return (
                f'"{shown}"'
                if self.separator.strip() in shown and self.separator.strip() and '"' not in shown
                else shown
            )
        if form == "first alone" and role == self.order[0]:
            return f"{name} [{self.units[role]}]"
        return name

    def head(self) -> list[str]:
        """Lines above the numbers."""
        sep = self.separator
        titles = [self.title(role) for role in self.order]
        units = [self.units[role] for role in self.order]
        if self.index is not None:
            titles, units = [self.index, *titles], ["", *units]
        above, line, below = [], sep.join(titles), []
        if self.form == "unit line":
            below = [sep.join(units)]
        elif self.form == "bracketed unit line":
            below = [sep.join(f"[{unit}]" if unit else "" for unit in units)]
        elif self.form == "statement":  # one unit for all
            above = [f"# Units: {units[-1]}"]
        elif self.form == "statements":
            above = [f"# {role} unit: {self.units[role]}" for role in self.roles]
        elif self.form == "in words":
            above = [
                "# "
                + ", ".join(
                    f"{NAMES[role][self.language]} in {self.units[role]}" for role in self.roles
                )
            ]
        elif self.form == "numbered":
            names = ["No", *self.order] if self.index is not None else self.order
            return [
                f"# Column {k}: {NAMES[role][self.language]} [{self.units[role]}]"
                if role in self.units
                else f"# Column {k}: No"
                for k, role in enumerate(names, 1)
            ]
        how = self.rng.choice(("plain", "plain", "comment", "preamble"))
        self.traits["place"] = how
        if how == "comment":
            line, below = f"# {line}", [f"# {one}" for one in below]
        elif how == "preamble":
            above = ["Road survey, lane 2", "Date: 11/10/2021", *above]
        return [*above, line, *below]


def _form(rng: random.Random) -> str:
    return rng.choice((*IN_HEADING, *BESIDE))


def _units(
    rng: random.Random, form: str, roles: tuple[str, ...], default: str
) -> tuple[dict[str, str], bool]:
    """A unit for each role, and whether the file states them."""
    if form == "none":
        return dict.fromkeys(roles, default), False
    if form == "statement":
        return dict.fromkeys(roles, rng.choice(tuple(UNITS))), True
    units = {role: rng.choice(tuple(UNITS)) for role in roles}
    if form == "first alone":
        if "y" in units:
            units["y"] = units["x"]
        return units, False
    return units, True


def _encoded(text: str, encoding: str, ends: str) -> bytes:
    plain = text.replace("\n", ends)
    return plain.encode(encoding, errors="replace")


def _missing(
    rng: random.Random, z: Array, unit: str, fine: float, traits: dict[str, str]
) -> tuple[NDArray[np.bool_], str, bool]:
    """Where heights are missing, what stands there, and whether the scene names the code."""
    shape = z.shape
    gone = np.zeros(shape, bool)
    how = rng.choice(("none", "none", "word", "code", "code", "named code"))
    traits["missing"] = how
    if how == "none":
        return gone, "", False
    flat = gone.reshape(-1, shape[-1])
    for _ in range(rng.choice((3, 4, 5))):
        row, at = (
            rng.randrange(len(flat)),
            rng.randrange(4, shape[-1] - 5) if shape[-1] > 10 else rng.randrange(shape[-1]),
        )
        flat[row, at : at + rng.choice((2, 3, 4))] = True
    word = rng.choice(WORDS) if how == "word" else rng.choice(CODES)
    traits["code"] = word
    if (
        how == "code"
        and z.min() <= UNITS[unit] * float(word) <= z.max()
        and "." not in _text(1e-3, UNITS[unit], fine, False)
    ):
        # A whole number among heights in whole numbers: nobody can tell, unless the scene names it.
        traits["missing"] = how = "named code"
    return gone, word, how == "named code"


def profile(seed: int) -> Variant:
    """A profile along a line."""
    rng = random.Random(seed)
    count, step = rng.choice((160, 200, 240)), rng.choice((5e-4, 1e-3, 2e-3))
    x, z = step * np.arange(count), _roughness(rng, count, seed)
    form, name = _form(rng), rng.choice(tuple(SEPARATORS))
    units, stated = _units(rng, form, ("x", "z"), "mm")
    comma = rng.random() < 0.25 and name in (";", "tab", "space", "spaces", "|")
    order = ["z", "x"] if rng.random() < 0.25 else ["x", "z"]
    index = rng.choice(INDEX) if rng.random() < 0.3 and name not in ("space", "spaces") else None
    traits = {"kind": "profile", "form": form, "separator": name, "comma": str(comma), "index": str(index),
              "order": "".join(order), "unit x": units["x"], "unit z": units["z"]}  # fmt: skip
    fine = rng.choice((1e-6, 1e-5, 1e-4)) if units["z"] != "furlong" else 1e-7
    traits["rounding"] = str(fine)
    gone, word, named = _missing(rng, z, units["z"], fine, traits)
    table = _Table(
        rng, SEPARATORS[name], ("x", "z"), units, form, index, order, rng.randrange(12), traits
    )
    cells = {"x": [_text(one, UNITS[units["x"]], 1e-6, comma) for one in x]}
    cells["z"] = [
        (word.replace(".", ",") if comma and word not in WORDS else word)
        if lost
        else _text(one, UNITS[units["z"]], fine, comma)
        for one, lost in zip(z, gone, strict=True)
    ]
    headed = form != "none" or rng.random() < 0.7
    traits["headed"] = str(headed)
    return _written(
        rng, table, cells, count, headed, traits, x, z, gone, word if named else None, stated, fine
    )


def _written(
    rng, table, cells, count, headed, traits, x, z, gone, code, stated, fine, y=None
) -> Variant:
    lines = table.head() if headed else []
    begin = rng.choice((0, 1))
    for k in range(count):
        row = [cells[role][k] for role in table.order]
        if table.index is not None:
            row = [str(k + begin), *row]
        lines.append(table.separator.join(row))
    text = "\n".join(lines) + "\n"
    encoding, ends = rng.choice(ENCODINGS), rng.choice(("\n", "\r\n", "\r"))
    traits["encoding"] = encoding
    keys: dict[str, Any] = {}
    if code is not None:
        keys["missing"] = [float(code)]
    if (
        rng.random() < 0.2 and "furlong" not in table.units.values()
    ):  # the scene may say a unit, right or wrong
        key = rng.choice(("length_unit", "height_unit"))
        keys[key] = rng.choice(tuple(KEYS))
        traits["key"] = key
        role = "z" if key == "height_unit" else "x"
        if not (headed and stated):  # what only the scene says is right
            right = [one for one in KEYS if KEYS[one] == UNITS[table.units[role]]]
            keys = {**keys, key: right[0]} if right else {k: v for k, v in keys.items() if k != key}
    data = _encoded(text, encoding, ends)

    def write(path: Path) -> None:
        path.write_bytes(data)

    exact = np.array([_value(cells["z"][k], table.units["z"]) for k in range(count)]).reshape(
        z.shape
    )
    code = _value(traits.get("code", ""), table.units["z"])
    return Variant(
        ".csv", write, x, exact, keys, traits, y, text[:400], stated, gone | (exact == code)
    )


def points(seed: int) -> Variant:
    """A grid as a list of points."""
    rng = random.Random(seed)
    nx, ny = rng.choice(((20, 8), (30, 12), (16, 14)))
    x, y = 0.005 * np.arange(nx), 0.02 * (np.arange(ny) - 3)
    z = _roughness(rng, nx * ny, seed).reshape(nx, ny)
    form, name = _form(rng), rng.choice(tuple(SEPARATORS))
    units, stated = _units(rng, form, ("x", "y", "z"), "m")
    comma = rng.random() < 0.25 and name in (";", "tab", "space", "spaces", "|")
    order = rng.choice((["x", "y", "z"], ["x", "y", "z"], ["z", "x", "y"], ["y", "x", "z"]))
    index = rng.choice(INDEX) if rng.random() < 0.3 and name not in ("space", "spaces") else None
    headed = form != "none" or rng.random() < 0.5
    if not headed:
        order, index = ["x", "y", "z"], None
    traits = {"kind": "points", "form": form, "separator": name, "comma": str(comma), "index": str(index),
              "order": "".join(order), "unit x": units["x"], "unit z": units["z"], "headed": str(headed)}  # fmt: skip
    fine = rng.choice((1e-6, 1e-5, 1e-4)) if units["z"] != "furlong" else 1e-7
    traits["rounding"] = str(fine)
    gone, word, named = _missing(rng, z, units["z"], fine, traits)
    if word == "" and name in ("space", "spaces"):
        word = "nan"
    table = _Table(
        rng, SEPARATORS[name], ("x", "y", "z"), units, form, index, order, rng.randrange(12), traits
    )
    noise = rng.random() < 0.2
    spread = [1e-13 * (k % 2) if noise and units["x"] == "m" else 0.0 for k in range(nx * ny)]
    X, Y = np.meshgrid(x, y, indexing="ij")
    cells = {
        "x": [
            repr(a + d) if d and not comma else _text(a, UNITS[units["x"]], 1e-6, comma)
            for a, d in zip(X.ravel(), spread, strict=True)
        ],
        "y": [_text(one, UNITS[units["y"]], 1e-6, comma) for one in Y.ravel()],
        "z": [
            (word.replace(".", ",") if comma and word not in WORDS else word)
            if lost
            else _text(one, UNITS[units["z"]], fine, comma)
            for one, lost in zip(z.ravel(), gone.ravel(), strict=True)
        ],
    }
    return _written(
        rng,
        table,
        cells,
        nx * ny,
        headed,
        traits,
        x,
        z,
        gone,
        word if named else None,
        stated,
        fine,
        y,
    )


def matrix(seed: int) -> Variant:
    """A grid as a matrix: y in the first line, x in the first column."""
    rng = random.Random(seed)
    nx, ny = rng.choice(((20, 8), (30, 12), (16, 14)))
    x, y = 0.005 * np.arange(nx), 0.02 * (np.arange(ny) - 3)
    z = _roughness(rng, nx * ny, seed).reshape(nx, ny)
    name = rng.choice((",", ";", "tab", "|", ", "))
    sep = SEPARATORS[name]
    comma = rng.random() < 0.25 and name in (";", "tab", "|")
    how = rng.choice(
        (
            "",
            "x",
            "x/y",
            "x [{l}]",
            "x/y [{l}]",
            "z [{h}]",
            "[{h}]",
            "{l}",
            "comment",
            "statements",
            "corner 0",
        )
    )
    length = rng.choice(tuple(UNITS)) if "{l}" in how or how in ("comment", "statements") else "m"
    height = (
        rng.choice(tuple(UNITS))
        if "{h}" in how or how in ("comment", "statements")
        else length
        if "{l}" in how
        else "m"
    )
    if how in ("[{h}]", "{l}"):
        length = height
    traits = {
        "kind": "matrix",
        "corner": how,
        "separator": name,
        "comma": str(comma),
        "unit x": length,
        "unit z": height,
    }
    fine = rng.choice((1e-6, 1e-5, 1e-4)) if height != "furlong" else 1e-7
    gone, word, named = _missing(rng, z, height, fine, traits)
    corner = {"comment": "x", "statements": "", "corner 0": "0"}.get(
        how, how.format(l=length, h=height)
    )
    lines = []
    if how == "comment":
        lines = [f"# x in {length}, y in {length}, height in {height}"]
    elif how == "statements":
        lines = [f"# length unit: {length}", f"# height unit: {height}"]
    index = rng.random() < 0.15
    head = [corner, *(_text(one, UNITS[length], 1e-6, comma) for one in y)]
    lines.append(sep.join(["", head[0] or "x", *head[1:]] if index else head))
    for k in range(nx):
        row = [_text(x[k], UNITS[length], 1e-6, comma)]
        row += [
            (word.replace(".", ",") if comma and word not in WORDS else word)
            if lost
            else _text(one, UNITS[height], fine, comma)
            for one, lost in zip(z[k], gone[k], strict=True)
        ]
        lines.append(sep.join([str(k), *row] if index else row))
    traits["index"] = str(index)
    encoding, ends = rng.choice(ENCODINGS), rng.choice(("\n", "\r\n", "\r"))
    traits["encoding"] = encoding
    data = _encoded("\n".join(lines) + "\n", encoding, ends)
    keys: dict[str, Any] = {"missing": [float(word)]} if named else {}
    if rng.random() < 0.3 and length in KEYS and height in KEYS:
        keys |= {"length_unit": length, "height_unit": height}
    written = np.array(
        [_value(_text(one, UNITS[height], fine, False), height) for one in z.ravel()]
    )
    exact = written.reshape(z.shape)

    def write(path: Path) -> None:
        path.write_bytes(data)

    gone = gone | (exact == _value(traits.get("code", ""), height))
    return Variant(".csv", write, x, exact, keys, traits, y, "\n".join(lines)[:400], True, gone)


def arrays(seed: int) -> Variant:
    """A grid in .npz, .h5 or .nc, with attributes."""
    rng = random.Random(seed)
    nx, ny = rng.choice(((20, 8), (30, 12), (14, 14)))
    x, y = 0.005 * np.arange(nx), 0.02 * (np.arange(ny) - 3)
    z = _roughness(rng, nx * ny, seed).reshape(nx, ny)
    suffix = rng.choice((".npz", ".h5", ".nc"))
    says = rng.choice(("none", "z", "all", "root", "key"))
    length = (
        rng.choice(tuple(UNITS))
        if says in ("all", "root")
        else rng.choice(tuple(KEYS))
        if says == "key"
        else "m"
    )
    height = (
        length
        if says in ("root", "key")
        else rng.choice(tuple(UNITS))
        if says in ("z", "all")
        else "m"
    )
    word = rng.choice(("units", "unit", "Units", "UNITS"))
    coded = rng.choice(("float", "float", "float32", "packed"))
    missing = rng.choice(
        ("none", "nan", "_FillValue", "missing_value", "named", "undeclared", "mask", "valid")
    )
    turned = rng.random() < 0.25 and suffix != ".npz"
    positive = rng.random() < 0.1 and suffix != ".npz"
    traits = {"kind": "arrays", "suffix": suffix, "says": says, "coded": coded, "missing": missing, "word": word,
              "turned": str(turned), "unit x": length, "unit z": height}  # fmt: skip
    gone = np.zeros((nx, ny), bool)
    if missing != "none":
        gone[5:8, 2:5] = True
        gone[11, 4] = True
    numbers = z / UNITS[height]
    attributes: dict[str, Any] = {}
    code: float = (
        -9999.0 if missing != "undeclared" else rng.choice((-9999.0, -32768.0, 1e20, 99999.0))
    )
    if positive:
        numbers, attributes["positive"] = -numbers, "down"
    scale = float(np.abs(numbers).max()) / 30000
    if coded == "packed" and missing != "nan":
        offset = float(np.mean(numbers))
        packed = np.round((numbers - offset) / scale).astype(np.int32)
        numbers = packed * scale + offset
        stored: Array = packed
        attributes |= {"scale_factor": scale, "add_offset": offset}
        code = -99999.0
    else:
        stored = numbers.astype(np.float32) if coded == "float32" else numbers.copy()
    exact = (
        (-1 if positive else 1)
        * np.asarray(numbers if coded == "packed" else stored, float)
        * UNITS[height]
    )
    keys: dict[str, Any] = {}
    if missing == "nan":
        stored = np.where(gone, np.nan, stored)
    elif missing != "none":
        stored = np.where(gone, code, stored).astype(stored.dtype)
    if missing in ("_FillValue", "missing_value"):
        attributes[missing] = np.asarray(code, stored.dtype)
    elif missing == "named":
        keys["missing"] = [code]
    elif missing == "valid":
        attributes["valid_min"] = float(stored[~gone].min())
    if says == "key":
        keys["length_unit"] = length
    mask = gone if missing == "mask" else None

    def write(path: Path) -> None:
        lengths = {"x": x / UNITS[length], "y": y / UNITS[length]}
        if suffix == ".npz":
            more: dict[str, Any] = {
                key: value for key, value in attributes.items() if key != "positive"
            }
            if "_FillValue" in more:
                more["fill_value"] = more.pop("_FillValue")
            if says == "z":
                more["z_unit"] = height
            elif says == "all":
                more |= {"x_unit": length, "y_unit": length, "z_unit": height}
            elif says == "root":
                more["units"] = height
            if mask is not None:
                more["mask"] = mask
            np.savez(path, **lengths, z=stored, **more)
            return
        with h5py.File(path, "w") as file:
            for name, values in lengths.items():
                file[name] = values
            file["z"] = stored.T if turned else stored
            if turned or suffix == ".nc":
                for k, name in enumerate("yx" if turned else "xy"):
                    file[name].make_scale(name)
                    file["z"].dims[k].attach_scale(file[name])
            file["z"].attrs.update(attributes)
            if says in ("z", "all"):
                file["z"].attrs[word] = height
            if says == "all":
                file["x"].attrs[word] = file["y"].attrs[word] = length
            if says == "root":
                file.attrs[word] = height
            if mask is not None:
                file["mask"] = mask.T if turned else mask

    return Variant(
        suffix, write, x, exact, keys, traits, y, str(traits | attributes), says != "none", gone
    )


MAKERS = profile, points, matrix, arrays
