"""Compressed datasets whose rows a thread packs while the loop continues.

HDF5's own filters hold Python's lock while they deflate; zlib does not. Whole chunks are therefore
packed by zlib and written directly. HDF5 itself is only called from the caller's thread.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import h5py
import numpy as np

LEVEL = 1  # higher levels take several times as long for a few percent


def create(file: h5py.File, name: str, rows: int, width: tuple[int, ...]) -> h5py.Dataset:
    """An empty, growing dataset (0, *width) in compressed chunks of `rows` rows.

    Single precision, relative error 1e-7: half of the bytes.
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
    """Appends rows to datasets of `create`; `wait` before reading the file, `close` at the end."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1)
        self._put: list[tuple[Callable, tuple[int, ...], Future]] = []

    def append(self, dataset: h5py.Dataset, values: np.ndarray) -> None:
        """Append rows: whole chunks at a chunk boundary by the thread, others at once by HDF5."""
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
        """Write what the thread has packed."""
        for write, offset, packed in self._put:
            write(offset, packed.result())
        self._put.clear()

    def close(self) -> None:
        """End the thread; anything not waited for is lost."""
        self._thread.shutdown(cancel_futures=True)


def _packed(values: np.ndarray, kind: np.dtype) -> bytes:
    """HDF5's shuffle filter (first bytes of all values, then second ones, ...) and deflate."""
    octets = np.ascontiguousarray(values, kind).view(np.uint8).reshape(-1, kind.itemsize)
    return zlib.compress(np.ascontiguousarray(octets.T).data, LEVEL)
