"""Result files: written to a temporary name and renamed, so that a file that exists is whole.

Only the root process calls what writes; arrays are gathered by the caller. Every HDF5 file carries
the resolved scene, the hash of what it was computed from, program, library versions, process count.
"""

import errno
import hashlib
import json
import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from fem.errors import InputError
from runs.version import PROGRAM, RESULT_FORMAT, VERSION

LIBRARIES = ("dolfinx", "petsc4py", "slepc4py", "mpi4py", "h5py", "numpy", "scipy")
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
REFUSED = {errno.EACCES, errno.EPERM, errno.EROFS, errno.ENOTDIR, errno.EISDIR, errno.ENAMETOOLONG}


@dataclass(frozen=True)
class Provenance:
    """Where a result file comes from."""

    scene_name: str
    scene_text: str
    stage: str
    input_hash: str
    processes: int

    def attributes(self) -> dict[str, Any]:
        """The attributes of the file, library versions of what is loaded included."""
        loaded = {
            name: str(getattr(sys.modules[name], "__version__", "unknown"))
            for name in LIBRARIES
            if name in sys.modules
        }
        return {
            "program": PROGRAM,
            "version": VERSION,
            "format": RESULT_FORMAT,
            "libraries": json.dumps(loaded, sort_keys=True),
            "processes": self.processes,
            "scene_name": self.scene_name,
            "scene": self.scene_text,
            "stage": self.stage,
            "input_hash": self.input_hash,
        }


def explained(error: BaseException, path: Path) -> InputError | None:
    """A full disk or a refused write as one message, or None when it is neither.

    HDF5 reports the operating system's error inside its own text, hence the search.
    """
    number = getattr(error, "errno", None)
    text = str(error)
    if number in FULL or any(f"errno = {code}," in text for code in FULL):
        reason = "the disk is full (or the file too large for it): free some space and run again"
    elif number in REFUSED or any(f"errno = {code}," in text for code in REFUSED):
        reason = "the folder is not writable: choose another with --out"
    else:
        return None
    return InputError(f"{path}: cannot be written, {reason}; what was there before is kept")


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A temporary name beside `path` that takes its place at the end, or vanishes on failure."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        _sync(part)
        os.replace(part, path)
        _sync(path.parent)
    except BaseException as error:
        with suppress(OSError):
            part.unlink()
        clear = explained(error, path) if isinstance(error, OSError | RuntimeError) else None
        if clear is not None:
            raise clear from error
        raise


@contextmanager
def writing(path: Path, provenance: Provenance) -> Iterator[h5py.File]:
    """An HDF5 file open for writing; it appears as `path`, whole, when the block ends well.

    Root process only. Raises InputError when the disk is full or the folder not writable.
    """
    with replacing(path) as part:
        file = h5py.File(part, "w")
        try:
            for name, value in provenance.attributes().items():
                file.attrs[name] = value
            yield file
            file.flush()
        finally:
            file.close()


def write_text(path: Path, text: str) -> None:
    """Write a small text file at once or not at all."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def put(file: h5py.Group, name: str, array: Any, unit: str, **attributes: Any) -> h5py.Dataset:
    """A dataset with its unit, groups on the way made as needed."""
    dataset = file.create_dataset(name, data=np.asarray(array))
    dataset.attrs["unit"] = unit
    for key, value in attributes.items():
        dataset.attrs[key] = value
    return dataset


def stage_hash(inputs: Mapping[str, Any]) -> str:
    """SHA-256 of the canonical JSON of what a stage depends on (numbers by their exact repr)."""
    text = json.dumps(inputs, sort_keys=True, separators=(",", ":"), default=plain)
    return hashlib.sha256(text.encode()).hexdigest()


def stored_hash(path: Path) -> str | None:
    """The input hash of a result file; None when it is absent or no readable result."""
    try:
        with h5py.File(path, "r") as file:
            value = file.attrs.get("input_hash")
    except OSError:
        return None
    return value if isinstance(value, str) else None


def plain(value: Any) -> Any:
    """numpy values, paths and dataclasses for JSON."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "__dataclass_fields__"):
        return {name: getattr(value, name) for name in value.__dataclass_fields__}
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
