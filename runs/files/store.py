"""Result files: provenance, hash of the inputs, and the datasets that a product declares.

A file is written under a temporary name and renamed, so that an existing one is complete. Only the
root process writes; callers gather the arrays. Every HDF5 file carries the resolved scene, the hash
of its inputs, program and library versions, the number of processes, and a checksum that `opened`
verifies before the file is read. The program's sources and the libraries are part of every stage's
hash, so that no result is reused after one of them has changed.
"""

import functools
import hashlib
import io
import json
import re
import shutil
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from importlib import metadata
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import BLOCK, NoChecksum, is_whole, replacing, seal
from tireroad.runs.version import PROGRAM, RESULT_FORMAT, VERSION

ROOT = Path(__file__).resolve().parents[2]

# Imports go one way, so a stage is computed by its own package and those below it. A later stage
# includes all packages of an earlier one: whatever changes an earlier result changes its hash too.
# Damping affects the static state of a rolling tire; with a moving axle, the modes depend on the
# time loop.
_TIRE = ("fem", "runs/scene/physics.py", "runs/stages", "modal")
_ALL = (*_TIRE, "greens", "contact")
PACKAGES: Mapping[str, tuple[str, ...]] = {"static": _TIRE}
"""Sources that a stage depends on; all that compute if it is not listed here."""

WHEEL = "dolfinx-solver-real"  # dolfinx, PETSc and SLEPc without distributions of their own
LIBRARIES = {
    "dolfinx": ("fenics-dolfinx", WHEEL),
    "basix": ("fenics-basix",),
    "ffcx": ("fenics-ffcx",),
    "ufl": ("fenics-ufl",),
    "PETSc": ("petsc4py", WHEEL),
    "SLEPc": ("slepc4py", WHEEL),
    "numpy": ("numpy",),
    "scipy": ("scipy",),
}
"""Libraries whose version can change a result, with the distributions that may hold them."""

LOADED = ("mpi4py", "h5py")
"""Libraries named in result files besides those in `identity`."""

AGAIN = "run its scene again, which computes it anew"


@dataclass(frozen=True)
class Identity:
    """`code`: SHA-256 of the sources; `libraries`: versions by name."""

    code: str
    libraries: Mapping[str, str]

    def differs(self, code: str, libraries: Mapping[str, str]) -> str:
        """Changes since a result was computed by `code` with `libraries`; "" if none."""
        if code != self.code:
            return "the program's code has changed since"
        changed = [
            f"{name} {libraries.get(name, 'unknown')} -> {version}"
            for name, version in self.libraries.items()
            if libraries.get(name) != version
        ]
        return f"libraries have changed since: {', '.join(changed)}" if changed else ""


def identity(stage: str) -> Identity:
    """The identity of a stage in this process. Reads the sources once per process, about 10 ms."""
    return Identity(_code(PACKAGES.get(stage, _ALL)), libraries())


@functools.cache
def _code(folders: tuple[str, ...]) -> str:
    digest = hashlib.sha256()
    for folder in folders:
        place = ROOT / folder
        inside = (path for path in place.rglob("*") if path.suffix in (".py", ".c", ".h"))
        for path in [place] if place.is_file() else sorted(inside):
            digest.update(f"{path.relative_to(ROOT)}\0".encode())
            digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()


@functools.cache
def libraries() -> dict[str, str]:
    """Versions by name. The first call needs PETSc loaded."""
    versions = {name: _version(holders) for name, holders in LIBRARIES.items()}
    return {**versions, "MUMPS": _mumps()}


def _version(holders: tuple[str, ...]) -> str:
    """The version of the first distribution that is installed, with its name if that is WHEEL."""
    for name in holders:
        try:
            version = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
        return f"in {WHEEL} {version}" if name == WHEEL else version
    return "unknown"


def _mumps() -> str:
    """MUMPS's version, from the name of the loaded library: no interface gives it. Needs PETSc."""
    try:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return "unknown"
    match = re.search(r"/libdmumps[^/\n]*?(\d+(?:\.\d+)+)", maps)
    return match.group(1) if match else _version((WHEEL,))


class Disk(io.RawIOBase):
    """The file under HDF5. The first write error is raised; later writes are dropped.

    HDF5's own file driver cannot close a file on a full disk: it retries until the process ends
    with a segmentation fault (seen with 1.10.8). Dropping writes lets it close; the file is then
    removed.
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
        """The value of `call`; None once the disk has failed."""
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


@dataclass(frozen=True)
class Provenance:
    """The origin of a result file."""

    scene_name: str
    scene_text: str
    stage: str
    input_hash: str
    processes: int

    def attributes(self) -> dict[str, Any]:
        """The attributes of the file, including library versions."""
        computed = identity(self.stage)
        loaded = {
            name: str(getattr(sys.modules[name], "__version__", "unknown"))
            for name in LOADED
            if name in sys.modules
        }
        return {
            "program": PROGRAM,
            "version": VERSION,
            "format": RESULT_FORMAT,
            "libraries": json.dumps({**computed.libraries, **loaded}, sort_keys=True),
            "code": computed.code,
            "processes": self.processes,
            "scene_name": self.scene_name,
            "scene": self.scene_text,
            "stage": self.stage,
            "input_hash": self.input_hash,
        }


@contextmanager
def writing(path: Path, provenance: Provenance, begin: Path | None = None) -> Iterator[h5py.File]:
    """An HDF5 file open for writing; it is moved to `path` when the block ends without error.

    Initially empty, or a copy of the file `begin`. Root process only. Raises InputError if the disk
    is full or the folder not writable.
    """
    with replacing(path) as part:
        if begin is not None:
            shutil.copyfile(begin, part)
        disk = Disk(part.open("r+b" if begin else "w+b", buffering=0))
        try:
            block = {} if begin else {"userblock_size": BLOCK}
            file = h5py.File(disk, "r+" if begin else "w", **block)
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
        seal(part)


@contextmanager
def sealed(path: Path) -> Iterator[h5py.File]:
    """A new HDF5 file with a checksum but no provenance, e.g. one gathered from results."""
    with h5py.File(path, "w", userblock_size=BLOCK) as file:
        yield file
    seal(path)


def put(file: h5py.Group, name: str, array: Any, unit: str, **attributes: Any) -> h5py.Dataset:
    """Write a dataset of numbers or texts with its unit, creating groups as needed."""
    values = np.asarray(array)
    kind = h5py.string_dtype() if values.dtype.kind in "OU" else None
    dataset = file.create_dataset(name, data=values, dtype=kind)
    dataset.attrs["unit"] = unit
    for key, value in attributes.items():
        dataset.attrs[key] = value
    return dataset


def dataset(unit: str, name: str = "", **given: Any) -> Any:
    """A field of a product, stored as a dataset with its `unit`: `name` in the file, or the field's own."""
    return field(metadata={"dataset": name, "unit": unit}, **given)


def attribute(name: str = "", **given: Any) -> Any:
    """A field of a product, a number or a text, stored as an attribute of its file."""
    return field(metadata={"attribute": name}, **given)


def write_fields(file: h5py.Group, product: Any) -> None:
    """Write the fields of a product that are a `dataset` or an `attribute`; none for those that are None."""
    for item in fields(product):
        value, meant = getattr(product, item.name), item.metadata
        if "dataset" in meant and value is not None:
            put(file, meant["dataset"] or item.name, value, meant["unit"])
        elif "attribute" in meant:
            file.attrs[meant["attribute"] or item.name] = value


def read_fields(file: h5py.Group, kind: type) -> dict[str, Any]:
    """The same fields of a product of class `kind`, by name; without datasets that the file lacks."""
    values: dict[str, Any] = {}
    for item in fields(kind):
        meant = item.metadata
        if "dataset" in meant and (meant["dataset"] or item.name) in file:
            values[item.name] = file[meant["dataset"] or item.name][()]
        elif "attribute" in meant:
            value = file.attrs[meant["attribute"] or item.name]
            values[item.name] = value.item() if isinstance(value, np.generic) else value
    return values


def stage_hash(inputs: Mapping[str, Any]) -> str:
    """SHA-256 of the canonical JSON of a stage's inputs (numbers by their exact repr)."""
    text = json.dumps(inputs, sort_keys=True, separators=(",", ":"), default=plain)
    return hashlib.sha256(text.encode()).hexdigest()


def file_hash(path: str | Path) -> str:
    """SHA-256 of a file's content, as the input of a stage that reads it."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def wanted_hash(stage: str, inputs: Mapping[str, Any]) -> str:
    """The hash of a stage: its name, its inputs, and the code and libraries that compute it."""
    computed = identity(stage)
    return stage_hash(
        {"stage": stage, "code": computed.code, "libraries": computed.libraries, **inputs}
    )


def why_not(path: Path, expected: str, stage: str) -> str:
    """Why a stage's file cannot be reused; "" if it can, "absent" if it does not exist.

    `expected`: hash of the stage's present inputs.
    """
    if not path.exists():
        return "absent"
    try:
        with opened(path) as file:
            attributes = dict(file.attrs)
    except InputError:
        return "it is damaged"
    if attributes.get("input_hash") == expected:
        return ""
    return _changed(attributes, identity(stage))


def _changed(before: Mapping[str, Any], now: Identity) -> str:
    """Changes since a file with these attributes was written."""
    if "code" not in before:
        return "it is of an earlier version"
    libraries = json.loads(before["libraries"])
    return now.differs(before["code"], libraries) or "the inputs have changed since"


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """A result file opened for reading after its checksum is verified. Not collective.

    Raises InputError if it is absent, unreadable or damaged.
    """
    verify(path)
    with h5py.File(path, "r") as file:
        yield file


def verify(path: Path, foreign: bool = False) -> None:
    """Raise InputError if a result file is absent, unreadable or not as it was written.

    `foreign`: accept an HDF5 file without a checksum, written by another program.
    """
    try:
        if not is_whole(path):
            raise InputError(f"{path} is damaged: it is not what was written (checksum); {AGAIN}")
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from None
    except NoChecksum:
        if foreign:
            return
        raise InputError(
            f"{path} has no checksum: an earlier version wrote it, or another program; {AGAIN}"
        ) from None


def plain(value: Any) -> Any:
    """Convert numpy values, paths and dataclasses for JSON."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "__dataclass_fields__"):
        return {name: getattr(value, name) for name in value.__dataclass_fields__}
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")
