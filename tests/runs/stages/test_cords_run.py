"""A belted tire of lossy compounds through all stages: its files, its headline and its report."""

import h5py
import numpy as np
import pytest

SCENE = """
name = "belted"
[tire]
segments = 12
elements_arc = 6
loss_factor = 0.2
dynamic = 1.5
[tire.material]
youngs_modulus = 6e6
[[tire.cords]]
name = "ply"
depth = 0.012
arc = [-120.0, 120.0]
angle = 90.0
youngs_modulus = 9.87e9
area = 4.21e-7
spacing = 1e-3
[[tire.cords]]
name = "belt"
angle = 0.0
density = 7850.0
compression = 0.05
[static]
load = 1500.0
error_estimate = false
[rotation]
speed = 60.0
[modal]
count = 20
[greens]
residual = "attachment"
[contact]
tread = "none"
[road]
kind = "flat"
[time]
duration = 0.01
step = 2e-4
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory, ran):
    folder = tmp_path_factory.mktemp("belted")

    def started(*options):
        scene = folder / "belted.toml"
        scene.write_text(SCENE)
        return folder / "out", ran(scene, folder / "out", *options)[1]

    return started


@pytest.mark.long
def test_a_belted_tire_of_lossy_compounds(run):
    """Units, shapes and bounds of what the files hold; a run again takes the same state from them."""
    folder, stages = run()
    with h5py.File(folder / "static.h5") as file:
        force, points = file["cords/belt/force"], file["cords/belt/points"]
        assert force.attrs["unit"] == "N"
        assert points.shape == (*force.shape, 3)
        assert force.shape[0] == 24  # two Gauss points in each of 12 segments
        # The hoop tension of the inflated crown, shared with the rubber and the sidewalls: of its size.
        assert 0.2 < np.median(force) / (2e5 * 0.32 * 1.16e-3) < 1.0
        ply = file["cords/ply/force"][:]
        assert (np.median(ply) > 0) and file.attrs["mass"] > 5.0
        largest = max(force[:].max(), ply.max())
    headline = {name: part["value"] for name, part in stages["static"]["headline"].items()}
    assert headline["largest cord force"] == pytest.approx(largest, rel=1e-5)
    assert 0.0 <= headline["compressed cords"] < 50.0
    with h5py.File(folder / "modes.h5") as file:
        losses, squares = (file[f"projected/{name}"][:] for name in ("losses", "squares"))
        eta = np.diag(losses) / np.sqrt(squares)
        np.testing.assert_allclose(file["loss_factor"][:], eta[:20], rtol=1e-12)
        np.testing.assert_allclose(losses, losses.T, atol=1e-12 * losses.max())
        assert len(eta) == 20 + len(file["turning/shape"])
    # The rubber's 0.2, less what inflation and cords store.
    assert ((eta > 0.005) & (eta < 0.2)).all()
    assert "modal strain energy" in stages["modes"]["headline"]["damping"]["value"]
    with h5py.File(folder / "rotating.h5") as file:
        s = np.concatenate([file["eigenvalue"][:], file["turning/eigenvalue"][:]])
        assert len(file["eigenvalue"]) == 20 < len(s)
    assert (s.real < 0).all()
    assert s.real.sum() == pytest.approx(-np.trace(losses) / 2, rel=1e-6)
    page = (folder / "report.html").read_text()
    assert "tension positive" in page
    _, again = run("--set", "time.duration=0.005")
    assert again["static"]["status"] == again["modes"]["status"] == "reused"


@pytest.mark.long
def test_damping_in_proportion_where_the_scene_gives_it(run):
    folder, stages = run("--set", "damping.mass=100.0", "--until", "rotating")
    assert "the loss factors are not used" in stages["modes"]["headline"]["damping"]["value"]
    with h5py.File(folder / "rotating.h5") as file:
        s = np.concatenate([file["eigenvalue"][:], file["turning/eigenvalue"][:]])
    with h5py.File(folder / "modes.h5") as file:
        assert len(file["loss_factor"][:]) == 20
    assert s.real.sum() == pytest.approx(-len(s) * 50.0, rel=1e-6)
