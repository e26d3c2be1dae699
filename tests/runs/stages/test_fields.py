"""Modes on all unknowns that members of a family share: read as they were solved, on any number of processes."""

import os
import shutil
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

import tireroad
from tireroad.fem.model import SmallMotions
from tireroad.modal.standing import solved
from tireroad.runs.files.cache import Cache
from tireroad.runs.scene.load import load
from tireroad.runs.stages import modes as stages_modes
from tireroad.runs.stages.stage import Job

COMM = MPI.COMM_WORLD
SCENE = '[tire]\nsegments = 8\nelements_arc = 4\n[modal]\ncount = 6\nrim = "RIM"\n'


@pytest.fixture
def folder(tmp_path_factory):
    """One folder for all processes, gone afterwards."""
    made = str(tmp_path_factory.mktemp("fields")) if COMM.rank == 0 else ""
    yield Path(COMM.bcast(made))
    COMM.Barrier()
    if COMM.rank == 0:
        shutil.rmtree(made)


@pytest.mark.mpi
@pytest.mark.parametrize("rim", ["fixed", "free"])
def test_fields_come_back_as_they_were_solved(folder, rim: str, monkeypatch) -> None:
    if COMM.rank == 0:
        (folder / "scene.toml").write_text(SCENE.replace("RIM", rim))
    COMM.Barrier()
    job = Job(load(folder / "scene.toml"), folder, COMM, cache=Cache(folder / "cache"))
    tire = tireroad.torus(youngs_modulus=48e6, segments=8, elements_arc=4, order=2)
    operators = SmallMotions(tire, tireroad.press(tire, inflation=2e5), rim=rim).operators
    modes = solved(operators, count=6)
    own = SimpleNamespace(own=6)
    basis = SimpleNamespace(projection=own, shape=operators.trace(modes.vectors))
    assert stages_modes.kept(job, "a", operators, basis) is None
    stages_modes.keep(job, "a", operators, modes)
    again = stages_modes.kept(job, "a", operators, basis)
    for item in fields(modes):
        one, two = getattr(modes, item.name), getattr(again, item.name)
        if item.name == "vectors":  # a free rim's six unknowns come out of its nodes
            np.testing.assert_allclose(two, one, atol=1e-12 * np.abs(one).max())
        else:
            assert np.array_equal(one, two), item.name
    assert stages_modes.kept(job, "b", operators, basis) is None
    COMM.Barrier()
    left = sorted(os.listdir(folder))
    # What comes next brings files into the folder for a moment: none may begin before all have looked.
    COMM.Barrier()
    assert left == ["cache", "scene.toml"]
    other = SimpleNamespace(projection=own, shape=basis.shape * [1, 1, -1, 1, 1, 1])
    assert stages_modes.kept(job, "a", operators, other) is None  # modes.h5 of another solution
    monkeypatch.setattr(stages_modes, "LARGEST", 0.0)
    assert stages_modes.kept(job, "a", operators, basis) is None
