"""Road heights in HDF5 files, whose datasets stay in their file until they are needed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.rows import Rows, check_count
from tireroad.fem.errors import InputError

if TYPE_CHECKING:  # imported where a file is read; checking a scene does not need it
    import h5py

Array = NDArray[np.float64]

MAX_CHUNK = 256_000_000  # bytes: HDF5 unpacks a chunk as a whole


class Hdf5Rows:
    """Rows of a dataset that stays in its file."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._dataset, self.shape = dataset, dataset.shape

    def __reduce__(self) -> tuple[Callable[[str, str], Hdf5Rows], tuple[str, str]]:
        """Another process reopens the file."""
        return _opened, (self._dataset.file.filename, self._dataset.name)

    def read(self, i0: int, i1: int) -> Array:
        """Rows i0 to i1."""
        return np.asarray(self._dataset[i0:i1], dtype=float)


def _opened(file: str, name: str) -> Hdf5Rows:
    import h5py

    return Hdf5Rows(h5py.File(file, "r")[name])


def read_hdf5(file: Path) -> tuple[Array, Array, Rows]:
    """The datasets x (nx,), y (ny,) and z (nx, ny) in the root of the file.

    Only data of this file are read: links to other files, external and virtual datasets are refused
    (InputError).
    """
    import h5py  # needed for this format only

    store = h5py.File(file, "r")
    datasets = {}
    for name in "xyz":
        if isinstance(store.get(name, getlink=True), h5py.ExternalLink):
            raise InputError(
                f"road.file {file}: {name} is a link to another file; copy it into this"
            )
        datasets[name] = store.get(name)
    missing = [name for name, found in datasets.items() if not isinstance(found, h5py.Dataset)]
    if missing:
        raise InputError(
            f"road.file {file}: no dataset {', '.join(missing)}; x, y and z are needed"
        )
    for name, dataset in datasets.items():
        _check(file, name, dataset)
    try:
        x, y = (np.asarray(datasets[name][()], dtype=float) for name in "xy")
    except (ValueError, TypeError) as error:
        raise InputError(f"road.file {file}: x, y and z must hold numbers ({error})") from error
    return x, y, Hdf5Rows(datasets["z"])


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
