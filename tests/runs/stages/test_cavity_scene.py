"""A tire with air through all stages: what joins, what is reused, and what is refused."""

import h5py
import numpy as np
import pytest
from tires import soft_torus

from tireroad.fem.errors import InputError
from tireroad.runs.scene.load import load
from tireroad.runs.scene.tables.scene import has_air
from tireroad.runs.scene.tables.tire import CavityTable

SCENE = (
    soft_torus(20, 6)
    + """[tire.cavity]
[modal]
count = 120
[greens]
residual = "attachment"
[[force]]
direction = [0.3, 0.0, 1.0]
[output]
receptance = { to = 300.0, step = 100.0, direct = 2 }
"""
)


@pytest.fixture(scope="module")
def run(tmp_path_factory, ran):
    base = tmp_path_factory.mktemp("cavity")

    def started(name, text, *options):
        scene = base / f"{name}.toml"
        scene.write_text(f'name = "{name}"\n{text}')
        return base / name, ran(scene, base / name, *options)[1]

    return started


@pytest.mark.long
def test_standing_air_in_states_receptance_and_reuse(run):
    """Its resonances are told, the full matrices agree, and the air alone recomputes no static state."""
    folder, stages = run("standing", SCENE)
    with h5py.File(folder / "modes.h5") as file:
        rigid, modes = file["cavity/frequency"][:], len(file["frequency"])
    with h5py.File(folder / "greens.h5") as file:
        states, share = file["states/frequency"][:], file["states/air_share"][:]
    assert len(states) == modes + len(rigid)
    assert states[share > 0.5][:2] == pytest.approx(rigid[:2], rel=0.08)
    errors = stages["response"]["indicators"]
    told = [v["value"] for k, v in errors.items() if "full matrices" in k]
    assert told
    assert max(told) < 0.02
    _, again = run("standing", SCENE)
    assert {s["status"] for s in again.values()} <= {"reused", "skipped", "computed"}
    assert again["greens"]["status"] == "reused"
    assert again["response"]["status"] == "reused"
    _, warmer = run("standing", SCENE, "--set", "tire.cavity.temperature=320")
    assert warmer["static"]["status"] == "reused"
    assert warmer["modes"]["status"] == "computed"
    with h5py.File(folder / "modes.h5") as file:
        hot = file["cavity/frequency"][:]
    assert hot[:2] == pytest.approx(rigid[:2] * np.sqrt(320 / 293.15), rel=1e-9)
    page = (folder / "report.html").read_text()
    assert "modes of the air between rigid walls" in page


@pytest.mark.long
def test_rolling_splits_the_air_by_twice_the_speed(run):
    """The lowest pair: f -+ Omega / 2 pi, to the coupling with the wall."""
    folder, _ = run("rolling", SCENE + "[rotation]\nspeed = 60.0\n")
    with h5py.File(folder / "rotating.h5") as file:
        states, share = file["frequency"][:], file["air_share"][:]
    pair = np.sort(states[share > 0.5])[:2]
    assert np.diff(pair)[0] == pytest.approx(2 * 60 / (2 * np.pi), rel=0.06)


def test_torus_is_empty_and_other_sections_are_full_unless_told(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("")
    scene = load(path)
    assert not has_air(scene)
    path.write_text('[tire]\nsection = "radial"\n')
    assert has_air(load(path))
    path.write_text('[tire.cavity]\ngas = "none"\n')
    empty = load(path)
    assert empty.tire.cavity == CavityTable(gas="none")
    assert not has_air(empty)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('[rotation]\nspeed = 50.0\nmethod = "full"\n', "rotation.method"),
        ('[modal]\nrim = "free"\n[[force]]\n[time]\n', "greens.residual"),
        ("[tire.cavity]\ntemperature = 20.0\n", "tire.cavity.temperature"),
    ],
)
def test_what_is_not_computed_with_air_is_refused(tmp_path, text, named):
    path = tmp_path / "scene.toml"
    path.write_text(text if "cavity" in text else "[tire.cavity]\n" + text)
    with pytest.raises(InputError, match=named):
        load(path)
