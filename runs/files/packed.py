"""Rows of compressed datasets, packed by a thread while the loop goes on.

HDF5's own filters hold Python's lock while they deflate, zlib does not: what it makes of whole chunks
is put in the file as it is. HDF5 itself is only called from the caller's thread.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import h5py
import numpy as np

LEVEL = 1  # higher ones take several times as long for a few percent


def create(file: h5py.File, name: str, rows: int, width: tuple[int, ...]) -> h5py.Dataset:
    """An empty dataset (0, *width) that grows, in compressed chunks of `rows` rows.

    In single precision, 1e-7 of a value: half of the bytes.
    """
    return file.create_dataset(
        name,
        (0, *width),
        dtype="f4",
        maxshape=(None, *width),
        chunks=(rows, *width),
        compression="gzip",
        compression_opts=LEVEL,
        shuffle=True,
    )


class Packer:
    """Writes rows at the end of datasets that `create` made; `wait` before the file is read, and `close`
    in the end."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1)
        self._put: list[tuple[Callable, tuple[int, ...], Future]] = []

    def append(self, dataset: h5py.Dataset, values: np.ndarray) -> None:
        """Add rows: whole chunks at a chunk's beginning by the thread, others by HDF5 at once."""
        first, chunk = len(dataset), dataset.chunks[0]
        dataset.resize(first + len(values), axis=0)
        whole = 0 if first % chunk else len(values) - len(values) % chunk
        for start in range(0, whole, chunk):
            rows = values[start : start + chunk]
            packed = self._thread.submit(_packed, rows, dataset.dtype)
            offset = (first + start, *[0] * (values.ndim - 1))
            self._put.append((dataset.id.write_direct_chunk, offset, packed))
        if whole < len(values):
            dataset[first + whole :] = values[whole:]

    def wait(self) -> None:
        """Put what the thread has packed into the file."""
        for write, offset, packed in self._put:
            write(offset, packed.result())
        self._put.clear()

    def close(self) -> None:
        """End the thread; what was not waited for is lost."""
        self._thread.shutdown(cancel_futures=True)


def _packed(values: np.ndarray, kind: np.dtype) -> bytes:
    """HDF5's shuffle (first bytes of all values, then second ones, ...) and deflate."""
    octets = np.ascontiguousarray(values, kind).view(np.uint8).reshape(-1, kind.itemsize)
    return zlib.compress(np.ascontiguousarray(octets.T).data, LEVEL)
