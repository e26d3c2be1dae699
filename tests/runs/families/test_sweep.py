"""Families of runs: what a sweep file says, and what is gathered of its members."""

from __future__ import annotations

import csv
import tomllib
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from tires import soft_torus

from tireroad.fem.errors import InputError
from tireroad.runs.files.folder import held
from tireroad.runs.scene.resolved import literal
from tireroad.runs.scene.schema import Pitch
from tireroad.runs.sweep.command import sweep as run_sweep
from tireroad.runs.sweep.definition import _absolute, read

pytestmark = pytest.mark.slow

SCENE = (
    """
name = "base"
"""
    + soft_torus(12, 4)
    + """[static]
load = 300.0
error_estimate = false
[modal]
count = 8
"""
)


LOADS = '[[axis]]\nkey = "static.load"\nvalues = [1.0]\n'
MANY = '[[axis]]\nkey = "{}"\nrange = [1.0, 9.0]\ncount = 10000\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "base.toml").write_text(SCENE)
    return tmp_path


def sweep_of(folder: Path, text: str):
    path = folder / "family.toml"
    path.write_text('scene = "base.toml"\n' + text)
    return read(path)


def test_a_grid_is_every_combination(folder: Path) -> None:
    text = '[[axis]]\nkey = "static.load"\nvalues = [100.0, 200.0]\n'
    text += '[[axis]]\nkey = "modal.count"\nvalues = [4, 5, 6]\n'
    sweep = sweep_of(folder, text)
    assert sweep.axes == ("static.load", "modal.count")
    found = {tuple(member.settings.values()) for member in sweep.members}
    assert found == {(load, count) for load in (100.0, 200.0) for count in (4, 5, 6)}
    names = [member.name for member in sweep.members]
    assert names[0] == "1_load-100_count-4" and len(set(names)) == 6
    scene = sweep.load(sweep.members[-1])
    assert (scene.static.load, scene.modal.count, scene.name) == (200.0, 6, names[-1])


def test_file_names_are_relative_to_the_sweep_file(tmp_path: Path) -> None:
    keys = "road.file", "tire.file", "tire.mesh", "pattern.file"
    given = {key: "a.npz" for key in keys} | {"static.load": 300.0, "road.kind": "crg"}
    found = _absolute(given, tmp_path)
    assert found == given | {key: str(tmp_path / "a.npz") for key in keys}


def test_a_range_with_a_count(folder: Path) -> None:
    sweep = sweep_of(folder, '[[axis]]\nkey = "static.load"\nrange = [100.0, 300.0]\ncount = 3\n')
    assert [member.settings["static.load"] for member in sweep.members] == [100.0, 200.0, 300.0]


def test_a_range_of_whole_numbers_suits_a_count(folder: Path) -> None:
    sweep = sweep_of(folder, '[[axis]]\nkey = "modal.count"\nrange = [12, 16]\ncount = 3\n')
    assert [sweep.load(member).modal.count for member in sweep.members] == [12, 14, 16]
    sweep = sweep_of(folder, '[[axis]]\nkey = "static.load"\nrange = [100, 101]\ncount = 3\n')
    assert [member.settings["static.load"] for member in sweep.members] == [100, 100.5, 101]


@pytest.mark.parametrize(
    "text",
    ['plan = "latin-hypercube"\nsamples = 24\n{}', "{}count = 4\n"],
)
def test_a_range_of_whole_numbers_is_whole_for_a_count(folder: Path, text: str) -> None:
    axis = '[[axis]]\nkey = "modal.count"\nrange = [3, 8]\n'
    found = [m.settings["modal.count"] for m in sweep_of(folder, text.format(axis)).members]
    assert all(isinstance(count, int) for count in found) and (min(found), max(found)) == (3, 8)
    assert found.count(5) == len(found) // 6 or len(found) == 4
    loads = text.format('[[axis]]\nkey = "static.load"\nrange = [100, 102]\n')
    real = [m.settings["static.load"] for m in sweep_of(folder, loads).members]
    assert len(set(real)) == len(real)


def test_tables_and_lists_vary(folder: Path) -> None:
    text = '[[axis]]\nkey = "contact.points"\nvalues = ["nodes", { dx = 0.01, dy = 0.02 }]\n'
    with (folder / "base.toml").open("a") as file:
        file.write(
            "[rotation]\nspeed = 40.0\n[contact]\n[road]\nkind = 'sine'\n[time]\nduration = 0.1\n"
        )
    sweep = sweep_of(folder, text)
    assert [m.name for m in sweep.members] == ["1_points-nodes", "2_points-dx0.01dy0.02"]
    assert sweep.load(sweep.members[1]).contact.points == Pitch(0.01, 0.02)
    given = {"a": [True, 1, 1.0, "x"], "b c": {"d": [float("inf")]}}
    assert tomllib.loads(f"v = {literal(given)}")["v"] == given


def test_a_byte_order_mark_is_read(folder: Path) -> None:
    path = folder / "family.toml"
    path.write_text(f'scene = "base.toml"\n{LOADS}', encoding="utf-8-sig")
    assert len(read(path).members) == 1


def test_a_latin_hypercube_has_one_sample_in_every_layer(folder: Path) -> None:
    text = 'plan = "latin-hypercube"\nsamples = 8\nseed = 3\n'
    text += '[[axis]]\nkey = "static.load"\nrange = [100.0, 300.0]\n'
    text += '[[axis]]\nkey = "static.inflation"\nrange = [1e5, 3e5]\n'
    sweep = sweep_of(folder, text)
    loads = np.sort([member.settings["static.load"] for member in sweep.members])
    assert np.array_equal(np.floor((loads - 100) / 25), np.arange(8))
    assert [m.settings for m in sweep.members] == [
        m.settings for m in sweep_of(folder, text).members
    ]


def test_a_list_names_its_members(folder: Path) -> None:
    text = '[[member]]\nname = "soft"\nset = { "tire.material.youngs_modulus" = 30e6 }\n'
    text += '[[member]]\nname = "heavy"\nset = { "static.load" = 400.0 }\n'
    sweep = sweep_of(folder, text)
    assert [member.name for member in sweep.members] == ["soft", "heavy"]
    assert sweep.axes == ("tire.material.youngs_modulus", "static.load")
    assert sweep.load(sweep.members[0]).tire.material.law.youngs_modulus == 30e6


@pytest.mark.parametrize("key", ['"static.load"', "static.load"])
def test_a_key_without_quotes_leaves_the_rest_of_its_table(folder: Path, key: str) -> None:
    """To TOML it is a table; the scene's other keys in it became defaults, without a word."""
    sweep = sweep_of(
        folder, f'[[member]]\nname = "a"\n[member.set]\n{key} = 400.0\n"modal.count" = 5\n'
    )
    base = sweep_of(folder, '[[member]]\nname = "a"\nset = { "modal.count" = 5 }\n')
    found, plain = (one.load(one.members[0]).static for one in (sweep, base))
    assert sweep.axes == ("static.load", "modal.count")
    assert found == replace(plain, load=400.0)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (
            '[[member]]\n[member.set]\n"static.load" = 1.0\nstatic.load = 2.0\n',
            "load is given twice",
        ),
        (
            '[[member]]\n[member.set]\n"static" = 3\n"static.load" = 1.0\n',
            "static holds static.load",
        ),
        ('[[axis]]\nkey = "static.lod"\nvalues = [1.0]\n', "static.load"),
        ('[[axis]]\nkey = "static.load"\nvalues = [-1.0]\n', "1_load--1"),
        ('[[axis]]\nkey = "static.load"\nvalues = []\n', "must be a list"),
        ('[[axis]]\nkey = "static.load"\nrange = [3.0, 1.0]\ncount = 2\n', "range"),
        ('plan = "random"\n', "plan must be one of"),
        ('plan = "list"\n', "[[member]]"),
        ("", "[[axis]]"),
        ("axes = 1\n", "unknown key axes"),
        ('[[member]]\nname = "a/b"\n', "member name"),
        ('[[member]]\nname = "a"\n[[member]]\nname = "a"\n', "unique"),
        ('[member]\nname = "a"\n', "[[member]]"),
        ('member = "a"\n', "[[member]]"),
        ('axis = ["key"]\n', "[[axis]]"),
        ('plan = ["grid"]\n', "plan must be one of"),
        ('[[member]]\nset = "a"\n', "set must be a table"),
        ('[[member]]\nsets = { "static.load" = 1.0 }\n', "unknown key sets"),
        (LOADS + "value = 3\n", "unknown key value"),
        (LOADS + "count = 3\n", "not values and count"),
        (LOADS + "range = [1.0, 2.0]\n", "not values and range"),
        (LOADS + '[[member]]\nname = "a"\n', "axis belongs to plan"),
        ("samples = 3\n" + LOADS, "samples belongs to plan = latin-hypercube"),
        ('plan = "latin-hypercube"\nsamples = 3\n' + LOADS, "unknown key values"),
        ('[[axis]]\nkey = "static.load"\nrange = [0.0, inf]\ncount = 2\n', "finite number"),
        ('[[axis]]\nkey = "static.load"\nvalues = [nan]\n', "finite number, not nan"),
        ('[[axis]]\nkey = "modal.count"\nrange = [4, 6]\ncount = 4\n', "fewer whole numbers"),
        (MANY.format("static.load") + MANY.format("static.inflation"), "100000000 members"),
    ],
)
def test_mistakes_are_named(folder: Path, text: str, wanted: str) -> None:
    with pytest.raises(InputError) as caught:
        sweep_of(folder, text)
    assert wanted in str(caught.value)


@pytest.mark.long
def test_a_second_sweep_into_the_same_folder_is_refused(folder: Path) -> None:
    sweep_of(folder, '[[axis]]\nkey = "static.load"\nvalues = [100.0]\n')
    with held(folder / "out"), pytest.raises(InputError, match="another run is writing here"):
        run_sweep(folder / "family.toml", folder / "out", at_once=1, batch=False, only_gather=False)
    assert list((folder / "out").iterdir()) == []


def test_a_sweep_runs_gathers_and_shares(folder: Path, launch) -> None:
    path = folder / "family.toml"
    members = {"light": "2e5", "same": "2e5", "burst": "1e8", "again": "1e8"}
    text = "".join(
        f'[[member]]\nname = "{name}"\nset = {{ "static.inflation" = {pressure}, "damping.mass" = {k}.0 }}\n'
        for k, (name, pressure) in enumerate(members.items())
    )
    path.write_text('scene = "base.toml"\n' + text)
    out = folder / "out"
    done = launch("-m", "runs", "sweep", path, "--out", out, "--local", 1)
    # A pressure that the tire does not hold fails; the others are kept, and the failure is named.
    assert done.returncode == 3 and "light: done" in done.stdout
    assert "burst: a solver gave up" in done.stdout
    # Nor is a failure computed twice: the second says whose it is.
    assert "again: a solver gave up" in done.stdout and "(as in burst, which failed" in done.stdout
    assert not list(out.glob("failures-*"))
    with (out / "sweep.csv").open() as file:
        rows = {row["member"]: row for row in csv.DictReader(file)}
    # Viscous damping takes no part in the state of a standing tire, computed once for both; modes.h5 has its ratios.
    assert rows["light"]["modes: lowest mode (Hz)"] == rows["same"]["modes: lowest mode (Hz)"] != ""
    assert rows["burst"]["modes: lowest mode (Hz)"] == ""
    logs = {name: (out / "logs" / f"{name}.txt").read_text() for name in members}
    assert "inflation" in logs["burst"] and "  inflation" not in logs["again"]
    assert "static    done" in logs["light"] and "static    reused" in logs["same"]
    with h5py.File(out / "sweep.h5") as file:
        assert file["axis/static.inflation"][:].tolist() == [2e5, 2e5, 1e8, 1e8]
    assert (out / "sweep.html").read_text().count("did not end well") == 1
