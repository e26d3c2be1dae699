"""What a search accepts, what it says before it begins, and what counts as its result."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from wanted_scene import SCENE

from tireroad.fem.errors import ConvergenceError, InputError, UnsuitedSettings
from tireroad.runs.check import explain
from tireroad.runs.files.disk import Refused
from tireroad.runs.files.trials import ErrorsByCause, worst
from tireroad.runs.process import console
from tireroad.runs.scene.load import load
from tireroad.runs.search import search
from tireroad.runs.search.journal import SearchJournal
from tireroad.runs.search.search import Search
from tireroad.runs.search.settings import CAUSES, Ladders


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "wanted.toml"
    path.write_text(SCENE)
    return path


def test_what_is_no_fault_of_the_settings_ends_the_search_and_is_not_kept(file, monkeypatch):
    raised: Exception = InputError("0.02 GB of disk")

    def failing(*args, **options):
        raise raised

    monkeypatch.setattr(search, "run_scene", failing)
    out = file.parent / "out"
    out.mkdir()
    for raised in (InputError("0.02 GB of disk"), Refused("the disk is full")):
        with console.quiet(), pytest.raises(type(raised), match="disk"):
            Search(load(file), out, MPI.COMM_SELF, []).run()
        assert SearchJournal(out, load(file)).trials == []
    for number, raised in enumerate((UnsuitedSettings("grid"), ConvergenceError("static"))):
        sets = ["accuracy.trials=1", f"road.amplitude={2 + number}e-4"]
        with console.quiet(), pytest.raises(ConvergenceError, match=f"no trial .*{raised}"):
            Search(load(file, sets), out, MPI.COMM_SELF, []).run()
        assert [one.failed for one in SearchJournal(out, load(file, sets)).trials] == [str(raised)]


def test_bands_count_each_by_itself(file) -> None:
    wanted = load(file, ["accuracy.target=", "accuracy.target_db=1"]).accuracy
    level = {cause: (0.1, 0.2) for cause in CAUSES} | {"mesh": (0.1, 3.0)}
    found = ErrorsByCause({}, {}, (50.0, 63.1), level)
    assert worst(found.over(wanted)) == (pytest.approx(np.sqrt(9.12)), 1)
    assert (
        worst(replace(found, centre=(), level=dict.fromkeys(CAUSES, ())).over(wanted))[0] == np.inf
    )


def test_check_tells_of_the_search_and_its_bounds(file) -> None:
    text = explain(load(file))
    assert "search for settings with 5 % of the axle force up to 100 Hz" in text
    assert "from  16 x 8" in text and "12 trials" in text
    assert "search for settings with" not in explain(load(file, ["accuracy.search=false"]))


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        (["accuracy.estimate=false"], "accuracy.estimate = true"),
        (["output.axle_force=false"], "output.axle_force = true"),
        (["accuracy.up_to=20"], "four periods"),
        (["accuracy.target=2"], "accuracy.target"),
        (["contact.brush_stiffness=2e4"], "take brush_stiffness_per_area"),
        (
            ['contact.tread="none"', "contact.youngs_modulus="],
            "works on the nodes of the mesh only",
        ),
    ],
)
def test_a_target_that_cannot_be_is_refused(file, sets, said) -> None:
    with pytest.raises(InputError, match=said):
        load(file, sets)


@pytest.mark.parametrize(
    "sets",
    [["contact.brush_stiffness=2e4"], ['contact.tread="none"', "contact.youngs_modulus="]],
)
def test_contact_on_the_nodes_may_be_judged_against_a_target(file, sets) -> None:
    assert load(file, [*sets, "accuracy.search=false"]).accuracy.aimed


@pytest.mark.parametrize(("cords", "wanted"), [(True, "attachment"), (False, "static")])
def test_residual_of_rolling_belts(file, cords: bool, wanted: str) -> None:
    belt = (
        '{ name = "belt", depth = 0.006, arc = [-30.0, 30.0], angle = 0.0, youngs_modulus = 2e9 }'
    )
    given = [f"tire.cords=[{belt if cords else ''}]"]
    assert Ladders.of(load(file, given)).first().residual == wanted
