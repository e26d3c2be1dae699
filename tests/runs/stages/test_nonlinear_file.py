"""nonlinear.h5: what is read back evaluates as what was written, with units and provenance."""

import numpy as np
import pytest
from mpi4py import MPI
from nonlinear_tire import pressed, smooth

from tireroad.fem.matrices.compliance import multiply
from tireroad.fem.nonlinear.cells import cell_forms
from tireroad.fem.nonlinear.reduced import at_nodes, reduced_force
from tireroad.fem.nonlinear.training import Trained, Training
from tireroad.runs.files.store import Provenance, opened, read_fields, write_fields, writing
from tireroad.runs.stages.nonlinear import Nonlinear, stored

ORIGIN = Provenance("scene", 'name = "scene"\n', "nonlinear", "abc", 2)


@pytest.mark.mpi
def test_a_stored_force_is_the_same_on_any_number_of_processes(tmp_path_factory):
    force, _ = pressed(MPI.COMM_WORLD)
    comm = force.body.comm
    vectors, motion = smooth(force, 0.1), smooth(force, 3e-3)[:, :1]
    number = np.sort(np.concatenate(comm.allgather(cell_forms(force.body, force.work, 1).number)))
    cells, weights = number[5:40:3], np.linspace(0.5, 4.0, len(number[5:40:3]))
    made = reduced_force(force, vectors, cells, weights)
    training = Training(
        force=made,
        vectors=vectors,
        record=[Trained("rise of 5 mm", 2, 0.4, 0.02, "reduced")],
        states=4,
        left=0.02,
        error=0.01,
        tangents=0,
        evaluations=7,
        singular=np.ones(3),
    )
    path = comm.bcast(tmp_path_factory.mktemp("stored") / "nonlinear.h5" if not comm.rank else None)
    kept = stored(training, force)
    if not comm.rank:
        with writing(path, ORIGIN) as file:
            write_fields(file, kept)
    comm.Barrier()
    with opened(path) as file:
        assert file.attrs["input_hash"] == "abc"
        assert all(file[name].attrs["unit"] for name in ("shape", "load", "cells", "weight"))
        assert file["load"].attrs["unit"] == "N J^-1/2"
        again = Nonlinear(**read_fields(file, Nonlinear))
    assert again.states == 4
    assert again.how.astype(str).tolist() == ["reduced"] or again.how[0] in ("reduced", b"reduced")
    other = again.force(force)
    here = at_nodes(force, motion, made.nodes)[:, 0]
    assert np.array_equal(other.nodes, made.nodes)
    assert np.array_equal(other.evaluate(here), made.evaluate(here))
    # The loads are the stiffness times the shapes.
    own = force.operators.restrict(again.load[force.body.ids])
    wanted = multiply(force.operators.stiffness, vectors)
    assert np.allclose(own, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())
