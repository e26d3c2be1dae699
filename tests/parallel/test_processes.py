"""The whole program on 1, 2 and 3 processes: one answer."""

import h5py
import numpy as np
import pytest
from tires import soft_torus

pytestmark = pytest.mark.slow

SCENE = (
    """
name = "small"
"""
    + soft_torus(20, 6, footprint_size=0.4)
    + """[static]
load = 400.0
[modal]
count = 30
[rotation]
speed = 40.0
[contact]
[road]
kind = "cobblestones"
run_in = 0.05
height_scatter = 0.0005
[time]
duration = 0.02
"""
)


@pytest.fixture(scope="module")
def folders(tmp_path_factory, launch):
    """The same scene run on 1, 2 and 3 processes."""
    base = tmp_path_factory.mktemp("processes")
    (base / "small.toml").write_text(SCENE)
    out = {}
    for processes in (1, 2, 3):
        out[processes] = base / str(processes)
        arguments = ("-m", "runs", "run", base / "small.toml", "--out", out[processes])
        done = launch(*arguments, processes=processes)
        assert done.returncode == 0, done.stderr + done.stdout
    return out


def values(folder, file, name):
    with h5py.File(folder / file) as stored:
        return stored[name][:]


@pytest.mark.long
@pytest.mark.parametrize("processes", [2, 3])
@pytest.mark.parametrize(
    ("file", "name", "tolerance"),
    [
        ("static.h5", "displacement", 1e-8),
        ("static.h5", "contact/force", 1e-8),
        ("modes.h5", "frequency", 1e-8),
        ("modes.h5", "surface/shape", 1e-6),  # signs and order too
        ("rotating.h5", "eigenvalue", 1e-6),
        ("greens.h5", "contact/static_flexibility", 1e-6),
        # Rounding may end a turn of friction earlier or later, at a residual of 1e-3 of the bound.
        ("contact.h5", "normal_force", 2e-4),
        ("contact.h5", "displacement", 2e-4),
        ("contact.h5", "axle_force", 2e-4),
        ("spectra.h5", "axle_force", 2e-4),
    ],
)
def test_results_do_not_depend_on_the_number_of_processes(
    folders, processes, file, name, tolerance
):
    one, many = values(folders[1], file, name), values(folders[processes], file, name)
    if name == "eigenvalue":  # conjugate-free, but in no particular order
        one, many = np.sort_complex(one), np.sort_complex(many)
    assert many.shape == one.shape
    assert np.abs(many - one).max() <= tolerance * np.abs(one).max()


@pytest.mark.long
def test_the_road_is_felt(folders):
    """What is compared above must not be a tire that never met its road."""
    load = values(folders[1], "contact.h5", "total_force")[:, 2]
    assert load.std() > 1.0
    force, gap = (values(folders[1], "contact.h5", n) for n in ("normal_force", "gap"))
    assert force.min() >= 0.0
    assert gap.min() >= -1e-15
    assert np.abs(force * gap).max() <= 1e-12
