"""Static states at and beyond the limits: each ends converged or clearly refused, never in a NaN."""

import h5py
import numpy as np
import pytest

from tireroad.fem.static.state import StaticState
from tireroad.runs.validation.stress_fem import Attempt, result


def attempt(**asked) -> tuple[StaticState, str]:
    """The state in the end, and the advice if it is not the wanted one."""
    state, advice = result(Attempt("", **asked))
    assert advice == "" or advice.startswith("static:")
    assert np.isfinite(state.displacement).all()
    assert state.force.min() >= 0
    return state, advice


def test_deflection_until_the_section_folds():
    state, advice = attempt(inflation=2e4, deflection=0.15, youngs_modulus=4.8e6, mesh=(8, 6, 2))
    assert advice == "" or "fold" in advice
    assert state.load > 100


def test_inflation_beyond_the_limit_point():
    """A neo-Hookean membrane of E = 1 MPa holds no more than some tenths of a MPa."""
    state, advice = attempt(inflation=5e6, youngs_modulus=1e6)
    assert "inflation stops at" in advice
    assert abs(state.displacement).max() > 0.001


@pytest.mark.parametrize("modulus", [4.8e5, 4.8e6, 4.8e7, 4.8e8, 4.8e9])
def test_four_decades_of_stiffness(modulus):
    state, advice = attempt(load=300.0, youngs_modulus=modulus)
    if modulus >= 4.8e7:
        assert advice == ""
    if not advice:
        assert state.load == pytest.approx(300.0, rel=1e-6)


@pytest.mark.parametrize("ratio", [-0.5, 0.0, 0.499, 0.4995])
def test_all_of_poissons_ratio(ratio):
    state, advice = attempt(load=300.0, poisson_ratio=ratio)
    assert advice == ""
    assert state.load == pytest.approx(300.0, rel=1e-6)


@pytest.mark.parametrize("load", [0.1, 10.0])
def test_a_single_contact_node(load):
    state, advice = attempt(load=load)
    assert advice == ""
    assert (state.force > 0).sum() == 1
    assert state.load == pytest.approx(load, rel=1e-6)


def test_many_contact_nodes():
    state, advice = attempt(load=4e3, mesh=(40, 12, 2), size=0.1)
    assert advice == ""
    assert (state.force > 0).sum() > 100
    assert state.load == pytest.approx(4e3, rel=1e-6)


def test_more_than_a_thousand_contact_nodes():
    state, advice = attempt(
        inflation=4e4, deflection=0.05, youngs_modulus=4.8e6, mesh=(150, 56, 1), size=0.1
    )
    assert advice == ""
    assert (state.force > 0).sum() > 1000
    assert state.gap.min() == 0.0


def test_a_load_out_of_reach_is_refused():
    _, advice = attempt(inflation=2e4, load=1e7, youngs_modulus=4.8e6, mesh=(8, 4, 2))
    assert advice != ""


def test_a_speed_beyond_what_the_wall_holds():
    """Centrifugal forces alone burst a soft tire."""
    _, advice = attempt(speed=900.0, youngs_modulus=2e6)
    assert "stops at" in advice


def test_the_last_good_state_is_kept(tmp_path, launch):
    scene = tmp_path / "burst.toml"
    scene.write_text(
        "[tire]\nsegments = 12\nelements_arc = 6\n[tire.material]\nyoungs_modulus = 1e6\n"
        "[static]\ninflation = 5e6\n"
    )
    done = launch("-m", "runs", "run", scene, "--out", tmp_path / "out", "--until", "static")
    assert done.returncode == 3
    assert "static_last.h5" in done.stderr
    assert not (tmp_path / "out" / "static.h5").exists()
    with h5py.File(tmp_path / "out" / "static_last.h5") as file:
        assert 0 < file.attrs["inflation"] < 5e6
        assert np.isfinite(file["displacement"][:]).all()
