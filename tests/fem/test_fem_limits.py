"""Static states at and beyond the limits: each ends converged, or refused with its last state in balance."""

import h5py
import numpy as np
import pytest

from tireroad.fem.static.state import StaticState
from tireroad.tests.validation import stability
from tireroad.tests.validation.stability import Attempt, EndedRun, attempts, result

pytestmark = pytest.mark.slow


def ended(**asked) -> EndedRun:
    """What came of it; whatever that is, the state in the end is one of equilibrium."""
    found = result(Attempt("", **asked))
    assert found.balanced, (found.residual, found.steps)
    assert found.state.force.min() >= 0
    if found.state.road_height is not None:
        held = found.state.force > 0
        assert np.abs(found.state.gap[held]).max(initial=0) < 1e-9
        assert found.state.gap.min() > -1e-9
    return found


def converged(**asked) -> StaticState:
    """The state that was asked for."""
    found = ended(**asked)
    assert found.message == ""
    return found.state


@pytest.mark.long
def test_deflection_until_the_section_folds():
    """Half again the section's height: the crown passes the beads' level, and the tire carries as a solid."""
    state = converged(inflation=2e4, deflection=0.15, youngs_modulus=4.8e6, mesh=(8, 6, 2))
    assert -state.displacement[:, 2].min() < 0.3
    assert state.displacement[:, 2].max() > 0.14
    assert 4e3 < state.load < 12e3


@pytest.mark.long
def test_inflation_beyond_the_limit_point():
    """A neo-Hookean membrane of E = 1 MPa holds no more than some hundredths of a MPa."""
    found = ended(inflation=5e6, youngs_modulus=1e6, mesh=(8, 6, 2))
    assert "inflation stops at" in found.message
    reached = float(found.message.partition("stops at ")[2].split()[0])
    assert found.state.inflation == pytest.approx(reached, rel=1e-4)
    assert 2e4 < reached < 8e4


@pytest.mark.parametrize("share", [1e-2, 0.1, 1.0, 10.0, 100.0])
def test_four_decades_of_stiffness(share):
    """Pressure and load in proportion to the modulus: one shape."""
    state = converged(youngs_modulus=48e6 * share, inflation=2e5 * share, load=300.0 * share)
    assert state.load == pytest.approx(300.0 * share, rel=1e-6)
    one = converged(load=300.0)
    size = np.abs(one.displacement).max()
    np.testing.assert_allclose(state.displacement, one.displacement, atol=1e-6 * size)


@pytest.mark.parametrize("ratio", [-0.5, 0.0, 0.499, 0.4995])
def test_all_of_poissons_ratio(ratio):
    state = converged(load=300.0, poisson_ratio=ratio)
    assert state.load == pytest.approx(300.0, rel=1e-6)


@pytest.mark.parametrize("load", [0.1, 10.0])
def test_a_single_contact_node(load):
    state = converged(load=load)
    assert (state.force > 0).sum() == 1
    assert state.load == pytest.approx(load, rel=1e-6)


@pytest.mark.long
def test_many_contact_nodes():
    state = converged(load=4e3, mesh=(40, 12, 2), size=0.1)
    assert (state.force > 0).sum() > 100
    assert state.load == pytest.approx(4e3, rel=1e-6)


@pytest.mark.long
def test_hundreds_of_contact_nodes():
    state = converged(
        inflation=4e4, deflection=0.05, youngs_modulus=4.8e6, mesh=(70, 28, 1), size=0.1
    )
    assert (state.force > 0).sum() > 200
    assert state.gap.min() == 0.0


@pytest.mark.long
def test_a_load_out_of_reach_is_refused():
    found = ended(inflation=2e4, load=1e7, youngs_modulus=4.8e6, mesh=(8, 4, 2))
    assert "deflection stops at" in found.message or "out of reach" in found.message
    assert 0 < found.state.load < 1e7


def test_a_road_above_the_rim_is_refused():
    """The wheel is in the way, and is no part of the model."""
    found = ended(inflation=2e4, deflection=0.16, youngs_modulus=4.8e6, mesh=(8, 4, 2))
    assert "at 0.1529 m" in found.message and "the road is at the rim" in found.message
    assert found.state.road_height is None


def test_a_speed_beyond_what_the_wall_holds():
    """Centrifugal forces alone burst a soft tire: nothing was reached."""
    found = result(Attempt("", speed=900.0, youngs_modulus=2e6))
    assert "inflation stops at 0 Pa" in found.message
    assert found.state.inflation == 0.0 and not found.state.displacement.any()
    assert stability.outcome(found)[0] == "stopped at once: nothing converged"


def test_a_state_out_of_balance_is_caught():
    """A row of the table tells of a state that is none, whatever the solver said."""
    asked = next(one for one in attempts() if one.name.startswith("one contact node"))
    good = result(asked)
    assert stability.outcome(good)[1] == "needs no catching"
    for wrong in (
        EndedRun(good.state, "", 1e-3, 2),
        EndedRun(good.state, "static: stops", 1e-12, 1),
    ):
        assert stability.outcome(wrong)[1] == "not caught"


@pytest.mark.long
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
        reached = float(done.stderr.partition("stops at ")[2].split()[0])
        assert file.attrs["inflation"] == pytest.approx(reached, rel=1e-4)
        assert np.isfinite(file["displacement"][:]).all()
