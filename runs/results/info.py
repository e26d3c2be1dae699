"""Describes the contents of a result file."""

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np

from tireroad.fem.errors import InputError
from tireroad.runs.files import disk
from tireroad.runs.files.store import verify
from tireroad.runs.results.datasets import declared
from tireroad.runs.scene.parts import in_lines, listed

LONG = 96  # longest attribute text printed in full


def describe(file: Path, as_json: bool = False) -> str:
    """The contents of an HDF5 file as text or JSON.

    Provenance, attributes, and datasets with shape, type, unit and stored size. A result file's
    checksum is verified first, which reads all of it: about a second per GB. Other HDF5 files are
    described too. Control characters are shown as escapes. Not collective. Raises InputError if the
    file is absent, not HDF5, or damaged.
    """
    if file.is_dir():
        raise InputError(f"{file} is a folder: {_candidates(file)}")
    if not file.is_file():
        raise InputError(
            f"{file}: {'is not a data file' if file.exists() else 'there is no such file'}"
        )
    try:
        whole = "right" if disk.is_whole(file) else "wrong"
    except disk.NoChecksum:
        whole = "none (not written by this version of tireroad)"
    except OSError as error:
        raise InputError(f"{file} cannot be read ({error.strerror})") from None
    if whole == "wrong" and not h5py.is_hdf5(file):
        raise InputError(
            f"{file} is not an HDF5 file, or is damaged: give a result file of a run, such as static.h5"
        )
    if whole == "wrong":
        verify(file)
    try:
        with h5py.File(file, "r") as opened:
            if as_json:
                return json.dumps(_held(file, opened, whole), indent=1)
            lines = (
                *_head(file, opened, whole),
                *_attributes(opened),
                *_tire(opened),
                *_datasets(opened, file.name),
            )
            return "\n".join(_printable(line) for line in lines)
    except Exception as error:  # HDF5 and h5py raise all kinds of errors on a damaged foreign file
        raise InputError(f"{file} is damaged: {type(error).__name__}: {error}") from error


def _candidates(folder: Path) -> str:
    """Files of a folder that can be given instead of it."""
    candidates = [str(file) for file in sorted(folder.glob("*.h5"))]
    if not candidates:
        return "it holds no .h5 file; give a result file of a run, such as static.h5"
    return (
        f"give a file in it, {candidates[0]}"
        if not candidates[1:]
        else f"give one of {', '.join(candidates)}"
    )


def _held(path: Path, file: h5py.File, checksum_is: str) -> dict:
    """The text form's contents, multi-line texts in full, sizes in bytes; NaN and infinity null."""
    datasets: dict[str, dict] = {}

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset):
            datasets[name] = {
                "shape": None if item.shape is None else list(item.shape),
                "type": _kind(item),
                "unit": _unit(item),
                "meaning": _meaning(path.name, name),
                "stored": item.id.get_storage_size(),
                "compression": item.compression,
            }

    file.visititems(visit)
    return {
        "file": str(path),
        "size": path.stat().st_size,
        "checksum": checksum_is,
        "attributes": {name: _plain(value) for name, value in file.attrs.items()},
        "datasets": datasets,
    }


def _plain(value: object) -> object:
    """An attribute as a JSON value; other types as text."""
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, list):
        return [_plain(part) for part in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value if isinstance(value, (str, int, float, bool)) else str(value)


def _printable(line: str) -> str:
    """A line with control characters, which a terminal would interpret, written as escapes."""
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode()
        for c in line
    )


def _head(path: Path, file: h5py.File, checksum_is: str) -> Iterator[str]:
    stage = file.attrs.get("stage")
    origin = f": stage {stage}" if isinstance(stage, str) else ""
    yield f"{path} ({_size(path.stat().st_size)}){origin}; checksum: {checksum_is}"


def _attributes(file: h5py.File) -> Iterator[str]:
    """Provenance and results stored as attributes, one per line; long texts are summarised."""
    if not len(file.attrs):
        return
    yield ""
    yield "attributes"
    width = max(len(name) for name in file.attrs)
    for name in file.attrs:
        yield f"  {name:<{width}}  {_value(name, file.attrs[name])}"


def _tire(file: h5py.File) -> Iterator[str]:
    """Compounds and cords of the tire, where the scene of the run has them all."""
    text = file.attrs.get("scene")
    try:
        tables = tomllib.loads(text) if isinstance(text, str) else {}
        lines = in_lines(listed(tables.get("tire", {})))
    except (InputError, KeyError, TypeError, ValueError):
        return  # a scene of another version, or damaged
    if lines:
        yield ""
        yield from lines


def _value(name: str, value: object) -> str:
    if isinstance(value, bytes):
        value = value.decode(errors="replace")
    if name == "scene" and isinstance(value, str) and "\n" in value:
        return _scene(value)
    if name == "libraries" and isinstance(value, str):
        try:
            return ", ".join(f"{key} {version}" for key, version in json.loads(value).items())
        except (ValueError, AttributeError):
            return value
    if isinstance(value, (float, np.floating)):
        return f"{value:.10g}"
    text = " ".join(str(value).split())
    return text if len(text) <= LONG else f"{text[:LONG]}… ({len(text)} characters)"


def _scene(text: str) -> str:
    """Name and tables of the resolved scene, which is about 100 lines long."""
    lines = len(text.splitlines())
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return f"{lines} lines that are not TOML"
    names = ", ".join(key for key, value in tables.items() if isinstance(value, (dict, list)))
    return f"{tables.get('name', 'without a name')}, {lines} lines ({names})"


def _datasets(file: h5py.File, name_of_file: str) -> Iterator[str]:
    listed: list[tuple[str, ...]] = []

    def visit(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset):
            cells = _shape(item), _kind(item), _unit(item), _stored(item)
            listed.append((name, *cells, _meaning(name_of_file, name)))

    file.visititems(visit)
    yield ""
    if not listed:
        yield "no datasets"
        return
    rows = [("dataset", "shape", "type", "unit", "stored", "meaning"), *listed]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        cells = (f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True))
        yield "  ".join(cells).rstrip()


def _meaning(file: str, name: str) -> str:
    known = declared(file, name)
    return known.meaning if known else ""


def _shape(dataset: h5py.Dataset) -> str:
    if dataset.shape is None:
        return "empty"
    return f"({', '.join(str(size) for size in dataset.shape)})"


def _kind(dataset: h5py.Dataset) -> str:
    kind = h5py.check_string_dtype(dataset.dtype)
    return "text" if kind is not None else str(dataset.dtype)


def _unit(dataset: h5py.Dataset) -> str:
    unit = dataset.attrs.get("unit", "none given")
    return unit.decode(errors="replace") if isinstance(unit, bytes) else str(unit)


def _stored(dataset: h5py.Dataset) -> str:
    packing = f", {dataset.compression}" if dataset.compression else ""
    return _size(dataset.id.get_storage_size()) + packing


def _size(size: float) -> str:
    for unit in ("B", "kB", "MB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.4g} GB"
