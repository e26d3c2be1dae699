"""Arrays of numbers in NumPy archives (.npz), read as data; sizes are checked before allocation."""

import zipfile
import zlib
from typing import IO, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
