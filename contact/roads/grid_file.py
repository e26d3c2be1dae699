"""Files of heights on a grid, .npz, text, .h5 and .nc: read in pieces and checked for plausibility."""

from __future__ import annotations

import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.grid import (
    MAX_POINTS,
    PIECE,
    ArrayRows,
    Coding,
    Decoded,
    FileRows,
    Grid,
    Packed,
    Rows,
    Spool,
    check_count,
    pieces,
)
from tireroad.contact.roads.grid_text import Found, Keys, read_csv
from tireroad.contact.roads.meaning import (
    UNITS,
    Column,
    ReadAs,
    Stated,
    counts_down,
    downwards_note,
    mentions_unit,
    role_of,
    unit_of,
)
from tireroad.contact.roads.missing import CodeSearch, refused
from tireroad.fem.errors import InputError

if TYPE_CHECKING:
    import h5py


Array = NDArray[np.float64]

WIDEST = 50.0  # m: a measured road across; a texture of 300 mm is 300 m wide when read as metres
# Median of |dz|/dx or |dz|/dy between neighbours, the larger: ruts and steps have but one of them.
# Measured: 0.03 on Belgian block every 10 mm, about 0.2 on a texture of 0.5 mm rms every 0.5 mm.
# Millimetres read as metres give a thousand times that.
STEEPEST = 5.0
# Median over the rows of their relief over the width: a kerb of 0.15 m on 0.3 m has 0.5.
ROUGHEST = 2.0
HIGHEST = 1e4  # m above sea level; larger values are damage
SAMPLES = 64  # rows inspected

# Exceptions of the standard library, numpy and h5py for damaged files; NotImplementedError and
# RuntimeError are zipfile's for damaged version numbers and flags, KeyError is h5py's.
UNREADABLE = (
    OSError,
    EOFError,
    KeyError,
    zipfile.BadZipFile,
    zlib.error,
    NotImplementedError,
    RuntimeError,
)
# Names under which a unit stands: units, x_unit, unit_of_z, height units, UoM; and whose it is by the rest of the name.
_UNIT_NAME = re.compile(
    r"(?P<before>.*?)[_ .-]*(?:units?|uom|einheit)(?:[_ -]*(?:of[_ ])?(?P<after>.*))?",
    re.IGNORECASE,
)
_WHOSE = {
    "": "xyz", "xy": "xy", "length": "xy", "lengths": "xy", "lateral": "xy", "horizontal": "xy", "planar": "xy", "vertical": "z",
    "measure": "xyz", "measurement": "xyz", "physical": "xyz", "axis": "xyz", "quantity": "xyz", "data": "xyz", "si": "xyz",
    "symbol": "xyz", "name": "xyz", "long_name": "xyz", "base": "xyz", "coordinate": "xyz", "coordinates": "xyz",
}  # fmt: skip
_MISSING_NAME = re.compile(
    r"_?(?:[xyz]_)?(?:(?:fill|missing|bad|null|invalid|void|undef(?:ined)?|dummy|nan|blank)[_ -]?(?:value|data|code|flag|height|"
    r"number|marker)?s?|no_?(?:data|height|value)(?:[_ -]?value)?|(?:error|none)[_ -]?(?:value|code))",
    re.IGNORECASE,
)
_FACTORS = re.compile(
    r"scale|scaling|factor|gain|multiplier|slope|\blsb|conv(?:ersion)?\b|quant(?:um|isation|ization)|calib|(?:^|_)per_|"
    r"(?:^|_)to_m",
    re.IGNORECASE,
)
_OFFSETS = re.compile(r"offset|intercept|\bbias|shift|datum|zero|\bz0", re.IGNORECASE)
# Beside heights alone: a resolution of the file can be that of x.
_FACTORS_OF_Z = re.compile(r"resolution|step|increment", re.IGNORECASE)
_OFFSETS_OF_Z = re.compile(r"base|reference", re.IGNORECASE)
_MASKS = "mask", "z_mask"
_OTHER_MASKS = re.compile(
    r"mask|valid|nodata|no_data|missing|flag|quality|holes|is_?nan", re.IGNORECASE
)
_DIRECTION = re.compile(r"direction|orientation|sign|positive|polarity", re.IGNORECASE)
_DOWN = re.compile(r"down|inver|neg|flip|-", re.IGNORECASE)
_OF_FILE = re.compile(
    r"history|source|conventions|references|institution|creator|author|_nc.*|dimension_labels|name",
    re.IGNORECASE,
)
MAX_CHUNK = 256_000_000  # bytes: HDF5 unpacks a chunk as a whole
ASSUMED = "m"
COUNTED = 10_000_000  # heights of a file of which the missing ones are counted for the log


def check_plausible(
    extent: tuple[float, float],
    steps: tuple[float, float],
    rows: Rows,
    source: str,
    *,
    lengths: bool = True,
    heights: str | None = "m",
) -> None:
    """InputError if a road cannot be in the unit in which it was read.

    `extent` (m) along and across, `steps` (m) between points, `rows` of heights (m), of which 64
    are read. `lengths`: whether their unit was assumed rather than given; `heights`: the unit that
    was assumed for them, None: it was given. The message then names the keys that give it. Heights
    beyond 10 km are refused in any case.
    """
    if lengths and extent[1] > WIDEST:
        raise InputError(
            f"{source}: x and y were read as metres, and the road is {extent[1]:.4g} m wide, which is "
            f'more than {WIDEST:g} m: if the file is in millimetres say length_unit = "mm" in [road]; '
            'if it really is in metres say length_unit = "m"'
        )
    count = rows.shape[0]
    picked = np.unique(np.linspace(0, count - 1, min(SAMPLES, count)).astype(int))
    pairs = [rows.read(i, min(i + 2, count)) for i in picked]
    z = np.concatenate([pair[:1] for pair in pairs])
    with np.errstate(invalid="ignore", over="ignore"):
        largest = np.nanmax(np.abs(z), initial=0.0)
        differ = (
            _median(np.concatenate([np.diff(pair, axis=0) for pair in pairs])),
            _median(np.diff(z)),
        )
    slope, apart, height = max(
        (dz / step, step, dz) for dz, step in zip(differ, steps, strict=True)
    )
    if largest > HIGHEST:
        raise InputError(
            f"{source}: heights of {largest:.3g} m are implausible for a road: check height_unit"
        )
    relief = np.ptp(z[~np.isnan(z).any(axis=1)], axis=1)
    if heights and (slope > STEEPEST or _median(relief) > ROUGHEST * extent[1]):
        raise InputError(
            f"{source}: heights were read as {heights}, and in the median they differ by "
            f"{height:.3g} m between neighbours {apart:.3g} m apart, by "
            f"{_median(relief):.3g} m across the road's {extent[1]:.3g} m: say in [road] what they "
            f'are in, height_unit = "mm" or "um"; if they really are in {heights} say height_unit = "{heights}"'
        )


def _median(values: Array) -> float:
    """The median magnitude of the finite values; 0 if there are none."""
    known = np.abs(values[np.isfinite(values)])
    return float(np.median(known)) if known.size else 0.0


class Header(NamedTuple):
    """The header of an array in an archive."""

    shape: tuple[int, ...]
    by_columns: bool
    kind: np.dtype
    start: int


def read_header(stream: IO[bytes], info: zipfile.ZipInfo, name: str) -> Header:
    """The header of an array. ValueError if it has no numbers or does not fit the member's size."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0
    if version != (1, 0):
        read = np.lib.format.read_array_header_2_0
    try:
        shape, by_columns, kind = read(stream)
    # numpy parses it as Python text, and passes on any error of the parser.
    except Exception as problem:
        raise ValueError(f"the header of {name} is damaged: {problem}") from problem
    if kind.kind not in "iuf" or 0 in shape:
        raise ValueError(f"{name} is {kind} of shape {shape}")
    start, size = stream.tell(), kind.itemsize
    for length in shape:
        size *= length
    if size != info.file_size - start:
        raise ValueError(
            f"the header of {name} announces {size:,} bytes, the archive {info.file_size - start:,}"
        )
    return Header(shape, by_columns, kind, start)


def read_numbers(archive: zipfile.ZipFile, name: str, most: int) -> Array:
    """The whole array `name`. ValueError as in `read_header` or for more than `most` numbers.

    Also raises the exceptions UNREADABLE.
    """
    info = archive.getinfo(f"{name}.npy")
    if info.file_size > 8 * most + 20_000:
        raise ValueError(f"{name} has {info.file_size:,} bytes, more than {most:,} numbers")
    with archive.open(info) as stream:
        header = read_header(stream, info, name)
        if np.prod(header.shape, dtype=float) > most:
            raise ValueError(f"{name} has the shape {header.shape}, more than {most:,} numbers")
        numbers = np.frombuffer(stream.read(), header.kind)
    return numbers.reshape(header.shape, order="F" if header.by_columns else "C").astype(float)


@dataclass
class _Meaning:
    """Texts beside the arrays x, y and z of a file: units by role ("" for all) with their place, and codes by array."""

    units: dict[str, tuple[str, str]] = field(default_factory=dict)
    codes: dict[str, dict[str, Any]] = field(default_factory=lambda: {name: {} for name in "xyz"})
    down: bool = False  # heights are positive downwards
    texts: dict[str, tuple[str, str]] = field(default_factory=dict)  # that mention a unit
    notes: list[str] = field(default_factory=list)
    # Numbers that may be factors, by array.
    unread: dict[str, dict[str, float]] = field(default_factory=dict)

    def take(self, whose: str, name: str, value: Any, source: str) -> bool:
        """Take the attribute or entry `name` of the array `whose` ("" for all); False where it says nothing that is known."""
        plain = name.lower()
        numbers = np.asarray(value).ravel()
        where = f"{name} of {whose}" if whose else name
        if texts := _texts_of(value):
            return self._take_unit(whose, plain, texts, where, source) or self._take_text(
                whose, plain, " | ".join(texts), where, source
            )
        if numbers.dtype.kind not in "iuf" or not numbers.size:
            return False
        of = self.codes[whose or "z"]
        of_z = whose == "z" or plain.startswith(("z_", "height"))
        if _MISSING_NAME.fullmatch(plain):
            of["missing"] = (
                *of.get("missing", ()),
                *(float(number) for number in numbers if number == number),
            )
        elif plain == "scale_factor":
            of["scale"] = of.get("scale", 1.0) * float(numbers[0])
        elif plain == "add_offset":
            of["offset"] = float(numbers[0])
        elif plain == "valid_range" and len(numbers) == 2:
            of["valid"] = float(numbers[0]), float(numbers[1])
        elif plain == "valid_min":
            of["valid"] = float(numbers[0]), of.get("valid", (-np.inf, np.inf))[1]
        elif plain == "valid_max":
            of["valid"] = of.get("valid", (-np.inf, np.inf))[0], float(numbers[0])
        elif (_FACTORS.search(plain) or of_z and _FACTORS_OF_Z.search(plain)) and (
            numbers != 1.0
        ).any():
            raise InputError(
                f"{source}: {where} = {numbers[0]:g} may be a factor, and is not known: apply it, or name it scale_factor"
            )
        elif (_OFFSETS.search(plain) or of_z and _OFFSETS_OF_Z.search(plain)) and (
            numbers != 0.0
        ).any():
            raise InputError(
                f"{source}: {where} = {numbers[0]:g} may be added to heights, and is not known: apply it, or name it add_offset"
            )
        else:
            if numbers.size == 1 and numbers[0] % 1.0:
                self.unread.setdefault(whose, {})[where] = float(numbers[0])
            return False
        return True

    def _take_unit(self, whose: str, name: str, texts: list[str], where: str, source: str) -> bool:
        """Take a unit by the name under which it stands; False where the name says none."""
        match = _UNIT_NAME.fullmatch(name)
        if match is None or not all(text.strip() for text in texts):
            return False
        said = f"{match['before']}{match['after'] or ''}".strip("_ .-")
        roles = _WHOSE.get(said, role_of(said) if said else "")
        if whose and (roles == "xyz" or roles == ""):
            roles = whose
        if len(texts) == len(roles) == 3:
            for role, text in zip(roles, texts, strict=True):
                self.units.setdefault(role, (text, where))
            return True
        if len(texts) > 1 or (not whose and roles not in ("xyz", "xy", "x", "y", "z")):
            return False
        for role in roles:
            self.units.setdefault(role, (texts[0], where))
        return True

    def _take_text(self, whose: str, name: str, text: str, where: str, source: str) -> bool:
        """Take a text beside heights: their direction, and whether it mentions a unit. False where it says neither."""
        if _OF_FILE.fullmatch(name):
            return False
        text = re.sub(
            r"\\u([0-9a-f]{4})", lambda match: chr(int(match[1], 16)), text
        )  # as JSON writes è
        if name == "positive" and whose in ("", "z"):
            if not re.fullmatch(r"\s*(?:up|down)(?:wards?)?\s*", text, re.IGNORECASE):
                raise InputError(f'{source}: {where} = "{text}" is neither up nor down')
            self.down |= text.lower().strip().startswith("down")
            return True
        if whose in ("", "z"):
            if counts_down(text) or (_DIRECTION.search(name) and _DOWN.match(text.strip())):
                raise InputError(
                    f'{source}: {where} = "{text}": heights that are counted downwards; say positive = "down" beside them, or write '
                    "them upwards"
                )
            self.notes += downwards_note(text)
        known = unit_of(text)
        mentions = mentions_unit(text) or bool(known and known.metres) or "unit" in text.lower()
        if mentions:
            for role in whose or "xyz":
                self.texts.setdefault(role, (text[:60], where))
        return mentions

    def check_numbers(self, kind: np.dtype, source: str) -> None:
        """InputError where heights are whole numbers, and a number beside them that may be their factor is not read."""
        left = self.unread.get("z", {})
        if "scale" not in self.codes["z"]:
            left = {**left, **self.unread.get("", {})}
        if kind.kind in "iu" and left:
            name, value = next(iter(left.items()))
            raise InputError(
                f"{source}: heights are whole numbers, and {name} = {value:g} may be their factor: apply it, name it scale_factor, "
                "or leave it out"
            )

    def column(self, role: str) -> Column:
        """The unit of x, y or z."""
        text, where = self.units.get(role) or self.texts.get(role, ("", ""))
        text = re.sub(r"^\s*[\[(](.*)[\])]\s*$", r"\1", text)
        unit = unit_of(text) if role in self.units else None
        return Column(unit=unit, unclear="" if unit else text.strip(), said=where)

    def coding(self, role: str) -> Coding:
        """How the numbers of x, y or z are coded."""
        coding = Coding(**self.codes[role])
        if role == "z" and self.down:
            return replace(coding, scale=-coding.scale, offset=-coding.offset)
        return coding


def _texts_of(value: Any) -> list[str]:
    """The text of an attribute, or its few texts; empty where it is none."""
    array = np.asarray(value)
    if not 0 < array.size <= 9 or array.dtype.kind not in "USO":
        return []
    items = array.ravel().tolist()
    return [
        item.decode("utf-8", "replace") if isinstance(item, bytes) else str(item) for item in items
    ]


def _found(
    x: Array,
    y: Array,
    rows: Rows,
    meaning: _Meaning,
    keys: Keys,
    source: str,
    notes: tuple[str, ...],
    mask: Rows | None,
) -> Found:
    """The arrays of a file by what stands beside them."""
    scales = keys.scales([meaning.column(role) for role in "xyz"], Stated(), source)
    x, y = meaning.coding("x").numbers(x), meaning.coding("y").numbers(y)
    coding = meaning.coding("z")
    if coding.scale < 0 or coding.offset or abs(coding.scale) != 1.0:
        notes = (
            *notes,
            f"heights are {coding.scale:g} times the numbers of the file, plus {coding.offset:g}",
        )
    notes = (*notes, *meaning.notes)
    if rows.shape[0] == rows.shape[1]:
        notes = (*notes, "z is square: its rows are taken along x, its columns along y")
    return Found(x, y, rows, scales, coding, ("x", "y", "z"), notes, mask)


def read_npz(file: Path, keys: Keys) -> Found:
    """The arrays x (nx,), y (ny,) and z (nx, ny) of an archive; z stays in the file if possible.

    Beside them: units (or x_unit, ...), fill_value, scale_factor, add_offset, and a mask (nx, ny) whose true entries are
    no heights, as numpy's. InputError for missing arrays, arrays without numbers, and headers that announce other sizes
    than the archive holds.
    """
    source = f"road.file {file}"
    with zipfile.ZipFile(file) as archive:
        members = [member.filename.removesuffix(".npy") for member in archive.infolist()]
        names = {role: _named(members, role) for role in "xyz"}
        if missing := [role for role, name in names.items() if name is None]:
            shown = ", ".join(missing)
            raise InputError(f"{source}: no array {shown}; x, y and z are needed")
        meaning, mask, unused = _Meaning(), None, []
        try:
            x, y = (read_numbers(archive, names[role] or "", MAX_POINTS) for role in "xy")
            rows = _rows(file, archive, names["z"] or "")
            for name in members:
                if name in names.values():
                    continue
                if name.lower() in _MASKS:
                    mask = _mask(archive, name, rows.shape, source)
                elif _OTHER_MASKS.search(name) and _header(archive, name)[0] == rows.shape:
                    raise _unread_mask(name, source)
                elif not (value := _beside(archive, name)) or not meaning.take(
                    "", name, value[0], source
                ):
                    unused.append(name)
            meaning.check_numbers(_header(archive, names["z"] or "")[2], source)
        except InputError:
            raise
        except (ValueError, TypeError) as error:
            raise InputError(f"{source}: x, y and z must hold numbers ({error})") from error
    notes = (f"not used of the file: {', '.join(unused)}",) if unused else ()
    if rows.shape == (len(y), len(x)) != (len(x), len(y)) and mask is None:
        check_count(file, len(x) * len(y))
        rows = ArrayRows(rows.read(0, len(y)).T)
        notes = (*notes, "z is (y, x) in the file: transposed")
    return _found(x, y, rows, meaning, keys, source, notes, mask)


def _named(names: Iterable[str], role: str) -> str | None:
    """The name that is a role in any case."""
    found = [name for name in names if name == role] or [
        name for name in names if name.lower() == role
    ]
    return found[0] if len(found) == 1 else None


def _beside(archive: zipfile.ZipFile, name: str) -> tuple[Any] | None:
    """A small entry of an archive; None for what is large or no array of numbers or text."""
    try:
        info = archive.getinfo(f"{name}.npy")
        if info.file_size > 4096:
            return None
        with archive.open(info) as stream:
            return (np.lib.format.read_array(stream, allow_pickle=False),)
    except (KeyError, ValueError):
        return None


def _unread_mask(name: str, source: str) -> InputError:
    return InputError(
        f"{source}: {name} may say where heights are missing: name it mask, true where there is none, or leave it out"
    )


def _header(archive: zipfile.ZipFile, name: str) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, order and type of an array as its header announces them."""
    with archive.open(f"{name}.npy") as stream:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0
        return (read if version == (1, 0) else np.lib.format.read_array_header_2_0)(stream)


def _mask(archive: zipfile.ZipFile, name: str, shape: tuple[int, int], source: str) -> Rows:
    info = archive.getinfo(f"{name}.npy")
    if info.file_size > 8 * shape[0] * shape[1] + 20_000:
        raise InputError(f"{source}: {name} is larger than z")
    with archive.open(info) as stream:
        mask = np.lib.format.read_array(stream, allow_pickle=False)
    if mask.shape == ():  # no height is masked
        mask = np.full(shape, bool(mask))
    if mask.shape != shape or mask.dtype.kind not in "biu":
        raise InputError(f"{source}: {name} is {mask.dtype} of shape {mask.shape}, z has {shape}")
    return ArrayRows(mask)


def _rows(file: Path, archive: zipfile.ZipFile, name: str) -> Rows:
    """z by its name, left in the archive if it is not compressed; all of it is read once, as a check."""
    info = archive.getinfo(f"{name}.npy")
    with archive.open(info) as stream:
        header = read_header(stream, info, "z")
        if len(header.shape) != 2:
            raise ValueError(f"z has the shape {header.shape}")
        if header.by_columns:
            check_count(file, header.shape[0] * header.shape[1])
            numbers = np.frombuffer(stream.read(), header.kind)
            return ArrayRows(numbers.reshape(header.shape, order="F").astype(float))
        rows, width = header.shape
        packed = Packed(header.start, header.kind, (rows, width))
        stored = info.compress_type == zipfile.ZIP_STORED
        spool = Spool(f"road.file {file}", 0 if stored else rows * width)
        for block in _blocks(stream, packed):
            if not stored:
                spool.add(block)
    return _stored(file, info, packed) if stored else spool.rows()


def _blocks(stream: IO[bytes], packed: Packed) -> Iterator[Array]:
    """Blocks of rows in their order; reading past the last lets the archive verify its checksum."""
    (count, width), size = packed.shape, packed.kind.itemsize
    most = max(PIECE // width, 1)
    for first in range(0, count, most):
        wanted = min(most, count - first) * width * size
        data = stream.read(wanted)
        if len(data) < wanted:
            raise EOFError("z ends too early")
        yield np.frombuffer(data, packed.kind).reshape(-1, width).astype(float)
    stream.read(1)


def _stored(file: Path, info: zipfile.ZipInfo, packed: Packed) -> FileRows:
    """Rows of an uncompressed member of an archive.

    Its local header has the lengths of two variable fields at byte 26.
    """
    with file.open("rb") as stream:
        stream.seek(info.header_offset + 26)
        name, extra = struct.unpack("<HH", stream.read(4))
    start = info.header_offset + 30 + name + extra + packed.start
    return FileRows(file, packed._replace(start=start))


class Hdf5Rows:
    """Rows of a dataset that stays in its file; `turned`: its columns."""

    def __init__(self, dataset: h5py.Dataset, turned: bool = False) -> None:
        self._dataset, self._turned = dataset, turned
        self.shape = dataset.shape[::-1] if turned else dataset.shape

    def __reduce__(self) -> tuple[Callable[[str, str, bool], Hdf5Rows], tuple[str, str, bool]]:
        """Another process reopens the file."""
        return _opened, (self._dataset.file.filename, self._dataset.name, self._turned)

    def read(self, i0: int, i1: int) -> Array:
        """Rows i0 to i1."""
        if self._turned:
            return np.asarray(self._dataset[:, i0:i1], dtype=float).T
        return np.asarray(self._dataset[i0:i1], dtype=float)


def _opened(file: str, name: str, turned: bool) -> Hdf5Rows:
    import h5py

    return Hdf5Rows(h5py.File(file, "r")[name], turned)


def read_hdf5(file: Path, keys: Keys) -> Found:
    """The datasets x (nx,), y (ny,) and z (nx, ny) in the root of the file, which can be netCDF-4.

    Of their attributes and those of the root are read units, _FillValue, missing_value, valid_min, valid_max, valid_range,
    scale_factor, add_offset, positive; a dataset mask (nx, ny) is true where there is no height. Where dimensions have
    names (netCDF), they say which of z is x. Only data of this file are read: links to other files, external and virtual
    datasets are refused (InputError).
    """
    import h5py  # needed for this format only

    source = f"road.file {file}"
    store = h5py.File(file, "r")
    datasets: dict[str, Any] = {}
    for role in "xyz":
        name = _named(store, role) or role
        if isinstance(store.get(name, getlink=True), h5py.ExternalLink):
            raise InputError(f"{source}: {name} is a link to another file; copy it into this")
        datasets[role] = store.get(name)
    missing = [name for name, array in datasets.items() if not isinstance(array, h5py.Dataset)]
    if missing:
        raise InputError(f"{source}: no dataset {', '.join(missing)}; x, y and z are needed")
    meaning = _Meaning()
    for role, dataset in datasets.items():
        _check(file, role, dataset)
        unused = [
            name
            for name, value in dataset.attrs.items()
            if not meaning.take(role, name, value, source)
            and role == "z"
            and np.asarray(value).dtype.kind in "iuf"
        ]
    beside = {
        name: array[()]
        for name, array in store.items()
        if _is_small(array) and array not in datasets.values()
    }
    for name, value in {**store.attrs, **beside}.items():
        meaning.take("", name, value, source)
    z = datasets["z"]
    meaning.check_numbers(z.dtype, source)
    if z.fillvalue not in (0, None) and z.fillvalue == z.fillvalue:
        meaning.take("z", "_FillValue", z.fillvalue, source)
    try:
        x, y = (np.asarray(datasets[name][()], dtype=float) for name in "xy")
    except (ValueError, TypeError) as error:
        raise InputError(f"{source}: x, y and z must hold numbers ({error})") from error
    turned, notes = _turned(z, (len(x), len(y)))
    if unused:
        notes = (*notes, f"not used of z: {', '.join(unused)}")
    other = None
    for name in store:
        if name.lower() in _MASKS and isinstance(store.get(name), h5py.Dataset):
            other = store[name]
        elif _OTHER_MASKS.search(name) and getattr(store.get(name), "shape", None) == z.shape:
            raise _unread_mask(name, source)
    if other is not None and (other.shape != z.shape or other.dtype.kind not in "biu"):
        raise InputError(f"{source}: mask is {other.dtype} of shape {other.shape}, z has {z.shape}")
    mask = None if other is None else Hdf5Rows(other, turned)
    return _found(x, y, Hdf5Rows(z, turned), meaning, keys, source, notes, mask)


def _is_small(item: Any) -> bool:
    """Whether an object of an HDF5 file is a dataset of a few entries."""
    import h5py

    return isinstance(item, h5py.Dataset) and item.shape is not None and item.size <= 9


def _turned(z: h5py.Dataset, shape: tuple[int, int]) -> tuple[bool, tuple[str, ...]]:
    """Whether z is (y, x), by the names of its dimensions, else by its shape; and a note of it."""
    names = []
    for dimension in z.dims:
        scales = [scale.name for scale in dimension.values() if scale.name]
        names.append((scales[0].rpartition("/")[2] if scales else dimension.label).lower())
    by_name = names == ["y", "x"]
    if by_name or (names != ["x", "y"] and z.shape == shape[::-1] != shape):
        return True, (f"z is (y, x) by its {'dimensions' if by_name else 'shape'}: transposed",)
    return False, ()


def read_netcdf(file: Path, keys: Keys) -> Found:
    """The variables x, y and z of a netCDF file: HDF5, or the classic format, which is held in memory."""
    with file.open("rb") as stream:
        if stream.read(3) != b"CDF":
            return read_hdf5(file, keys)
    from scipy.io import netcdf_file

    source = f"road.file {file}"
    try:
        with netcdf_file(file, mmap=False) as store:
            names = {role: _named(store.variables, role) for role in "xyz"}
            if missing := [role for role, name in names.items() if name is None]:
                raise InputError(
                    f"{source}: no variable {', '.join(missing)}; x, y and z are needed"
                )
            meaning, arrays = _Meaning(), {}
            for role, name in names.items():
                variable = store.variables[name]
                check_count(file, int(np.prod(variable.shape)))
                arrays[role] = np.array(variable.data, dtype=float)
                for key, value in variable._attributes.items():
                    meaning.take(role, key, value, source)
            for key, value in store._attributes.items():
                meaning.take("", key, value, source)
            whole = store.variables[names["z"]].data
            meaning.check_numbers(whole.dtype, source)
            for name, variable in store.variables.items():
                if _OTHER_MASKS.search(name) and variable.shape == whole.shape:
                    raise _unread_mask(name, source)
            turned = [name.lower() for name in store.variables[names["z"]].dimensions] == ["y", "x"]
    except InputError:
        raise
    except (ValueError, TypeError, IndexError, AssertionError) as error:
        raise InputError(f"{source}: cannot be read ({error}); is it complete?") from error
    if arrays["z"].ndim != 2 or arrays["x"].ndim != 1 or arrays["y"].ndim != 1:
        raise InputError(f"{source}: x, y and z must hold numbers, z in rows and columns")
    z = arrays["z"].T if turned else arrays["z"]
    notes = ("z is (y, x) by its dimensions: transposed",) if turned else ()
    return _found(arrays["x"], arrays["y"], ArrayRows(z), meaning, keys, source, notes, None)


def _check(file: Path, name: str, dataset: h5py.Dataset) -> None:
    """Require numbers of the right shape, in this file, in chunks that fit into memory."""
    if dataset.external or dataset.is_virtual:
        raise InputError(
            f"road.file {file}: the numbers of {name} are in another file; copy them into this one"
        )
    if dataset.dtype.kind not in "iuf" or dataset.ndim != (2 if name == "z" else 1):
        raise InputError(f"road.file {file}: x, y and z must hold numbers, z in rows and columns")
    if name != "z":
        check_count(file, dataset.size)
    if dataset.chunks and np.prod(dataset.chunks, dtype=float) * dataset.dtype.itemsize > MAX_CHUNK:
        raise InputError(
            f"road.file {file}: {name} is in chunks of {dataset.chunks}, more than "
            f"{MAX_CHUNK // 1_000_000} MB each; write it in smaller ones"
        )


READERS: dict[str, Callable[[Path, Keys], Found]] = {
    ".npz": read_npz,
    **dict.fromkeys((".csv", ".txt", ".tsv", ".xyz"), read_csv),
    **dict.fromkeys((".h5", ".hdf5"), read_hdf5),
    ".nc": read_netcdf,
}


def read_grid(
    file: Path,
    holes: str = "refuse",
    end: str = "refuse",
    *,
    length_unit: str | None = None,
    height_unit: str | None = None,
    missing: tuple[float, ...] | None = None,
) -> Grid:
    """The road of a grid file: x (nx,) in rolling direction, y (ny,) to the left, z (nx, ny).

    .npz: arrays x, y, z. .h5, .hdf5, .nc: datasets x, y, z in the root. Text (.csv, .txt, .tsv, .xyz): under headings that
    name x, y and z, one point per line, every point of the grid once, in any order; otherwise a matrix whose first line
    holds a corner and then all y, and whose further lines hold one x and its heights. `nan` is a hole. InputError
    names the file and the place of an error.

    Units are those that the file states (headings, attributes). `length_unit` is that of x and y, `height_unit` that of z
    (one of UNITS) where it states none; one that it contradicts is an error. None of both: metres, and the
    sizes of the road must be plausible in metres (InputError), since a file in millimetres looks
    the same. A height unit of None is the length unit where that is given.

    `missing`: numbers of the file that mean "no height", beside those that it states. None: values that look like such are
    an error (contact.roads.missing); (): there are none.

    Heights stay in the file, and the part under the tire is read when needed: for .h5, and for .npz
    as written by numpy.savez. A text matrix or a compressed .npz is first converted to a temporary
    file (contact.roads.grid.Spool). Only a list of points is kept in memory, at most 10 million.
    """
    reader = READERS.get(file.suffix.lower())
    if reader is None:
        raise InputError(
            f"road.file {file}: the ending {file.suffix!r} is not {', '.join(READERS)}; for "
            'OpenCRG files take kind = "crg"'
        )
    if not file.is_file():
        raise InputError(f"road.file {file}: no such file")
    source = f"road.file {file}"
    for key, unit in (("length_unit", length_unit), ("height_unit", height_unit)):
        if unit is not None and unit not in UNITS:
            raise InputError(f'road: {key} = "{unit}" is unknown: take one of {", ".join(UNITS)}')
    try:
        content = reader(file, Keys(length_unit, height_unit, missing))
        grid = _grid(content, holes, end, missing, source)
    except UNREADABLE as error:
        raise InputError(f"{source}: cannot be read ({error}); is it complete?") from error
    return grid


def _grid(
    content: Found, holes: str, end: str, missing: tuple[float, ...] | None, source: str
) -> Grid:
    """The road of what was found in a file."""
    along, across, up = content.scales
    pairs = [(along, across, "x", "length_unit"), (across, along, "y", "length_unit")]
    pairs += [(up, along, "the heights", "height_unit"), (up, across, "the heights", "height_unit")]
    pairs += [(along, up, "x", "length_unit")] if content.text else []
    for mine, other, name, key in pairs:
        if mine is None and other is not None and other.stated:
            raise InputError(
                f"{source}: a unit stands beside others, {other.text}, and not beside {name}: say road.{key}"
            )
    height = up or (along and replace(along, text=f"{along.text}, as x"))
    for name, axis, scale in (("x", content.x, along), ("y", content.y, across)):
        if scale is None and counted(axis):
            raise InputError(
                f"{source}: {name} is {axis[0]:g}, {axis[1]:g}, {axis[2]:g}, … {axis[-1]:g}, which may count the heights: if it "
                'is a length, say road.length_unit = "m" or "mm"; otherwise write the positions in its place'
            )
    lengths = [scale.metres if scale else 1.0 for scale in (along, across)]
    metre = height.metres if height else 1.0
    coding = replace(content.coding, unit=metre, missing=_all_missing(content.coding, missing))
    rows: Rows = content.rows
    if coding != Coding() or content.mask is not None:
        rows = Decoded(rows, coding, content.mask)
    grid = Grid(
        lengths[0] * content.x, lengths[1] * content.y, rows, holes=holes, end=end, source=source
    )
    if missing is None or len(missing):
        if odd := [line for line in content.odd if line not in coding.missing]:
            raise refused(odd, 0, "written with other decimals than the heights", source)
        grid.search = CodeSearch(source, metre, coding.scale or 1.0, coding.offset)
        grid.look_for_codes()
    check_plausible(
        grid.extent_of_file,
        grid.steps,
        rows,
        source,
        lengths=along is None,
        heights=None if up else (height.text.split(" ")[0] if height else ASSUMED),
    )
    assumed = f"{ASSUMED}: assumed"
    grid.readings = tuple(
        ReadAs(name, place, scale.text if scale else assumed, remark)
        for name, place, scale, remark in zip(
            ("x", "y", "height"),
            content.places,
            (along, across, height),
            (
                "",
                "",
                _gaps(rows, coding.missing),
            ),
            strict=True,
        )
    )
    unsaid = [name for name, scale in (("x and y", along), ("heights", height)) if scale is None]
    grid.notes = (
        *content.notes,
        *([f"{' and '.join(unsaid)} in {ASSUMED}: assumed"] if unsaid else []),
    )
    return grid


def _gaps(rows: Rows, missing: tuple[float, ...]) -> str:
    """How many heights are missing, where they are few enough to be counted, and the numbers that say so."""
    named = f"no height: {', '.join(f'{code:g}' for code in missing)}" if missing else ""
    total = rows.shape[0] * rows.shape[1]
    if total > COUNTED:
        return named
    gone = sum(int(np.isnan(part).sum()) for _, part in pieces(rows))
    return (
        f"{gone} of {total} missing" + (f" ({named})" if named else "")
        if gone or named
        else "none missing"
    )


def counted(axis: Array) -> bool:
    """Whether positions are 0, 1, 2, … or 1, 2, 3, …, at least five of them."""
    steps = np.diff(axis)
    return len(axis) >= 5 and axis[0] in (0.0, 1.0) and bool((steps == 1.0).all())


def _all_missing(coding: Coding, missing: tuple[float, ...] | None) -> tuple[float, ...]:
    """Numbers of the file that it or the scene calls missing."""
    codes = missing or ()
    if (coding.scale, coding.offset) != (1.0, 0.0):
        codes = (*codes, *((code - coding.offset) / coding.scale for code in codes))
    return (*coding.missing, *codes)
