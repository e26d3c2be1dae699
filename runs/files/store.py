"""Result files: written to a temporary name and renamed, so that a file that exists is whole.

Only the root process calls what writes; arrays are gathered by the caller. Every HDF5 file carries
the resolved scene, the hash of what it was computed from, program, library versions, process count.
"""

import hashlib
import io
import json
import shutil
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tireroad.runs.files.disk import replacing
from tireroad.runs.version import PROGRAM, RESULT_FORMAT, VERSION

LIBRARIES = ("dolfinx", "petsc4py", "slepc4py", "mpi4py", "h5py", "numpy", "scipy")


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


class _Disk(io.RawIOBase):
    """The file under HDF5. The first refused write is raised; later ones are taken and dropped.

    HDF5's own file driver cannot close a file on a full disk: it tries again until the process ends
    with a segmentation fault (seen with 1.10.8). Dropped writes let it close; the file is removed.
    """

    def __init__(self, file: io.FileIO) -> None:
        self._file = file
        self.error: OSError | None = None

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        count = self._file.readinto(view)
        view[count:] = bytes(len(view) - count)
        return len(view)

    def write(self, data: Any) -> int:
        view = memoryview(data).cast("B")
        written = 0
        while written < len(view):
            written += self._attempt(self._file.write, view[written:]) or len(view)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        self._attempt(self._file.truncate, size)
        return self._file.seek(0, io.SEEK_END) if size is None else size

    def _attempt(self, call: Any, argument: Any) -> int | None:
        """What `call` returns; None once the disk has refused."""
        if self.error is not None:
            return None
        try:
            return call(argument)
        except OSError as error:
            self.error = error
            raise

    def close(self) -> None:
        self._file.close()
        super().close()


@contextmanager
def writing(path: Path, provenance: Provenance, begin: Path | None = None) -> Iterator[h5py.File]:
    """An HDF5 file open for writing; it appears as `path`, whole, when the block ends well.

    It is empty at first, or a copy of the file `begin`.
    Root process only. Raises InputError when the disk is full or the folder not writable.
    """
    with replacing(path) as part:
        if begin is not None:
            shutil.copyfile(begin, part)
        disk = _Disk(part.open("r+b" if begin else "w+b", buffering=0))
        try:
            file = h5py.File(disk, "r+" if begin else "w")
            try:
                for name, value in provenance.attributes().items():
                    file.attrs[name] = value
                yield file
            finally:
                file.close()
        finally:
            disk.close()
        if disk.error is not None:
            raise disk.error


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


def file_hash(path: str | Path) -> str:
    """SHA-256 of a file's content: what a stage that reads it depends on."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


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
