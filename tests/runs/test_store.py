"""Result files are whole or not there; what they were computed from is in them."""

import json
import resource
import signal
from pathlib import Path

import h5py
import numpy as np
import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.store import Provenance, put, stage_hash, stored_hash, writing
from tireroad.runs.version import VERSION

ORIGIN = Provenance("scene", 'name = "scene"\n', "static", "abc", 2)


def leftovers(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_file_carries_data_units_and_origin(tmp_path: Path) -> None:
    path = tmp_path / "static.h5"
    with writing(path, ORIGIN) as file:
        put(file, "contact/force", np.arange(6.0).reshape(2, 3), "N", frame="axle")
    with h5py.File(path) as file:
        assert file["contact/force"].attrs["unit"] == "N"
        assert file["contact/force"].attrs["frame"] == "axle"
        np.testing.assert_array_equal(file["contact/force"][1], [3, 4, 5])
        assert file.attrs["version"] == VERSION and file.attrs["processes"] == 2
        assert file.attrs["scene"] == 'name = "scene"\n' and file.attrs["stage"] == "static"
        assert "numpy" in json.loads(file.attrs["libraries"])
    assert stored_hash(path) == "abc"
    assert leftovers(tmp_path) == ["static.h5"]


def test_failure_keeps_the_earlier_file(tmp_path: Path) -> None:
    path = tmp_path / "static.h5"
    with writing(path, ORIGIN) as file:
        put(file, "a", [1.0], "m")
    before = path.read_bytes()
    with pytest.raises(ZeroDivisionError), writing(path, ORIGIN) as file:
        put(file, "a", [2.0], "m")
        assert 1 / 0
    assert path.read_bytes() == before
    assert leftovers(tmp_path) == ["static.h5"]


def test_full_disk_is_one_clear_error(tmp_path: Path) -> None:
    """A limit on the size of files stands for the full disk: the same call fails the same way."""
    path = tmp_path / "static.h5"
    with writing(path, ORIGIN) as file:
        put(file, "a", [1.0], "m")
    before = path.read_bytes()
    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, old[1]))
    try:
        with pytest.raises(InputError, match="disk is full"), writing(path, ORIGIN) as file:
            put(file, "a", np.random.default_rng(0).random(100_000), "m")
        with pytest.raises(InputError, match="disk is full"):
            write_text(tmp_path / "summary.json", "x" * 200_000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, old)
        signal.signal(signal.SIGXFSZ, handler)
    assert path.read_bytes() == before
    assert leftovers(tmp_path) == ["static.h5"]


def test_missing_folder_is_not_hidden(tmp_path: Path) -> None:
    with pytest.raises(OSError), writing(tmp_path / "none" / "static.h5", ORIGIN):
        pass


def test_hash_depends_on_values_only() -> None:
    one = stage_hash({"a": 1.0, "b": {"c": np.float64(0.1), "d": (1, 2)}})
    same = stage_hash({"b": {"d": [1, 2], "c": 0.1}, "a": 1.0})
    other = stage_hash({"a": 1.0, "b": {"c": np.nextafter(0.1, 1), "d": (1, 2)}})
    assert one == same and one != other


def test_no_hash_where_there_is_no_result(tmp_path: Path) -> None:
    assert stored_hash(tmp_path / "none.h5") is None
    damaged = tmp_path / "damaged.h5"
    damaged.write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 100)
    assert stored_hash(damaged) is None
    with h5py.File(tmp_path / "foreign.h5", "w"):
        pass
    assert stored_hash(tmp_path / "foreign.h5") is None
