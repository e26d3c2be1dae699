"""Rows packed beside the loop are what HDF5 itself reads back."""

import h5py
import numpy as np
import pytest

from tireroad.runs.stages.contact_file import Packer, create


@pytest.mark.parametrize("shape", [(3,), (5, 2)])
@pytest.mark.parametrize("blocks", [(8, 8, 8), (3, 5, 8, 16), (20, 1), (8, 3, 8)])
def test_rows_come_back_whatever_the_blocks(tmp_path, shape, blocks) -> None:
    rng = np.random.default_rng(0)
    parts = [rng.normal(size=(n, *shape)) * (rng.random((n, *shape)) < 0.5) for n in blocks]
    whole = np.concatenate(parts).astype("f4")
    with h5py.File(tmp_path / "rows.h5", "w") as file:
        dataset, packer = create(file, "rows", 8, shape), Packer()
        for part in parts:
            packer.append(dataset, part)
        packer.wait()
        packer.close()
    with h5py.File(tmp_path / "rows.h5") as file:
        assert np.array_equal(file["rows"][:], whole)


def test_thread_and_hdf5_make_the_same_bytes(tmp_path) -> None:
    values = np.random.default_rng(0).normal(size=(16, 4))
    values[::2] = 0.0
    with h5py.File(tmp_path / "rows.h5", "w") as file:
        own, packed = create(file, "own", 16, (4,)), create(file, "packed", 16, (4,))
        own.resize(16, axis=0)
        own[:] = values
        packer = Packer()
        packer.append(packed, values)
        packer.wait()
        packer.close()
        file.flush()
        assert own.id.read_direct_chunk((0, 0)) == packed.id.read_direct_chunk((0, 0))
