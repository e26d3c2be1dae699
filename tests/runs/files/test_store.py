"""Result files are whole or not there; what they were computed from is in them."""

import ast
import json
import resource
import shutil
import signal
import time
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.files import disk, store
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.store import (
    Provenance,
    opened,
    put,
    stage_hash,
    wanted_hash,
    why_not,
    writing,
)
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
    assert why_not(path, "abc", "static") == ""
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


def test_a_file_is_used_only_when_it_is_what_would_be_computed(tmp_path: Path) -> None:
    path = tmp_path / "static.h5"
    assert why_not(path, "abc", "static") == "absent"
    with writing(path, ORIGIN):
        pass
    assert why_not(path, "abc", "static") == ""
    assert why_not(path, "abd", "static") == "the inputs have changed since"


@pytest.mark.parametrize(
    ("stage", "folder", "changed"),
    [("static", "fem", "equilibrium.py"), ("static", "fem", "products.h")],
)
def test_code_and_libraries_are_part_of_what_a_stage_is_computed_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stage: str, folder: str, changed: str
) -> None:
    """Half the shear stiffness in the sources, a kernel in C, or another SciPy, and nothing is reused."""
    path, inputs = tmp_path / f"{stage}.h5", {"load": 1.0}
    written = wanted_hash(stage, inputs)
    with writing(path, replace(ORIGIN, input_hash=written)):
        pass
    assert why_not(path, wanted_hash(stage, inputs), stage) == ""
    libraries = store.libraries()
    monkeypatch.setattr(store, "libraries", lambda: libraries | {"scipy": "0.1"})
    now = wanted_hash(stage, inputs)
    assert now != written
    assert "scipy" in why_not(path, now, stage) and "-> 0.1" in why_not(path, now, stage)
    monkeypatch.undo()
    copy = tmp_path / "program"
    for part in ("fem", "runs/stages", "runs/scene"):
        shutil.copytree(store.ROOT / part, copy / part)
    source = next((copy / folder).rglob(changed))
    source.write_text(source.read_text() + "FACTOR = 0.5\n")
    monkeypatch.setattr(store, "ROOT", copy)
    store._code.cache_clear()
    now = wanted_hash(stage, inputs)
    assert now != written
    assert why_not(path, now, stage) == "the program's code has changed since"
    store._code.cache_clear()


def test_identity_is_cheap() -> None:
    """In processor time: the machine may be busy."""
    store.identity("contact")
    store._code.cache_clear()
    store.libraries.cache_clear()
    began = time.process_time()
    store.identity("contact")
    assert time.process_time() - began < 0.1


@pytest.mark.parametrize("stage", [*store.PACKAGES, "contact"])
def test_a_stage_imports_only_what_its_hash_covers(stage: str) -> None:
    """By the import statements of its module and of all that these lead to, functions' own included."""
    covered = store.PACKAGES.get(stage, store._ALL)
    passive = ("runs/files", "runs/process", "runs/scene", "runs/report", "runs/version.py")
    seen, left = set(), [store.ROOT / "runs" / "stages" / f"{stage}.py"]
    while left:
        path = left.pop()
        name = path.relative_to(store.ROOT).as_posix()
        if path in seen or name.startswith(passive):
            continue
        seen.add(path)
        assert name.startswith(covered), f"{stage} depends on {name}"
        left += _imported(path)
    assert len(seen) > 3


def _imported(path: Path) -> list[Path]:
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith("tireroad."):
            continue
        base = store.ROOT / Path(*node.module.split(".")[1:])
        places = [base, *(base / alias.name for alias in node.names)]
        found += [file for p in places if (file := p.with_suffix(".py")).is_file()]
    return found


def _sealed(path: Path) -> bytes:
    with writing(path, ORIGIN) as file:
        put(file, "a", np.arange(300.0), "m")
    return path.read_bytes()


@pytest.mark.parametrize("seed", range(20))
def test_any_damage_is_found(tmp_path: Path, seed: int) -> None:
    """One bit, a block of zeros, or a part that is missing: never opened by HDF5."""
    path = tmp_path / "static.h5"
    whole = bytearray(_sealed(path))
    rng = np.random.default_rng(seed)
    place = int(rng.integers(len(whole)))
    if seed % 3 == 0:
        whole[place] ^= 1 << int(rng.integers(8))
    elif seed % 3 == 1:
        whole[place // 512 * 512 : place // 512 * 512 + 512] = b"\1" * 512
    else:
        del whole[place:]
    path.write_bytes(bytes(whole))
    assert why_not(path, "abc", "static") == "it is damaged"
    with pytest.raises(InputError, match=r"static\.h5"), opened(path):
        pass


def test_what_is_no_result_is_not_used(tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.h5"
    damaged.write_bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 100)
    assert why_not(damaged, "abc", "static") == "it is damaged"
    with h5py.File(tmp_path / "foreign.h5", "w"):
        pass
    assert why_not(tmp_path / "foreign.h5", "abc", "static") == "it is damaged"
    with pytest.raises(InputError, match="no checksum"), opened(tmp_path / "foreign.h5"):
        pass


def test_signed_texts_tell_a_change() -> None:
    text = disk.signed("load = 300.0\n# [road] absent\n")
    assert disk.is_as_signed(text)
    assert not disk.is_as_signed(text.replace("300", "700"))
    assert not any(disk.is_as_signed(text[:end]) for end in range(len(text) - 1)), "cut short"
    table = disk.signed_table({"stages": {"static": {"seconds": 1.5}}})
    read = json.loads(json.dumps(table))
    assert disk.is_table_as_signed(read)
    read["stages"]["static"]["seconds"] = 1.25
    assert not disk.is_table_as_signed(read)


def test_libraries_in_a_wheel_have_its_version(monkeypatch: pytest.MonkeyPatch) -> None:
    """The wheel holds dolfinx, PETSc and SLEPc without distributions of their own: they were unknown, and
    what another wheel had computed was reused."""
    installed = {store.WHEEL: "0.11.0", "numpy": "2.5"}

    def version(name: str) -> str:
        if name not in installed:
            raise store.metadata.PackageNotFoundError(name)
        return installed[name]

    monkeypatch.setattr(store.metadata, "version", version)
    found = store.libraries.__wrapped__()
    assert found["numpy"] == "2.5" and found["scipy"] == "unknown"
    for name in ("dolfinx", "PETSc", "SLEPc"):
        assert found[name] == f"in {store.WHEEL} 0.11.0"
