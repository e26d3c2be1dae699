"""What of the members' folders is gathered: results of finished runs of the present scenes."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from tireroad.runs.files.disk import signed, write_text
from tireroad.runs.files.folder import Summary
from tireroad.runs.files.trials import Trial
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.search.journal import SearchJournal
from tireroad.runs.search.settings import Ladders, applied
from tireroad.runs.sweep.definition import Sweep, read
from tireroad.runs.sweep.page import gather, write

BASE = "[static]\nload = 300.0\n[rotation]\nspeed = {speed}\n"
FAMILY = 'scene = "base.toml"\n[[axis]]\nkey = "static.load"\nvalues = [300.0, 500.0]\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "family.toml").write_text(FAMILY)
    return tmp_path


def family(folder: Path, speed: float) -> Sweep:
    (folder / "base.toml").write_text(BASE.format(speed=speed))
    return read(folder / "family.toml")


def begin(sweep: Sweep, folder: Path) -> list[Summary]:
    """The members' folders as runs.pipeline begins a run."""
    found = []
    for member in sweep.members:
        own, text = folder / "members" / member.name, dumps(sweep.load(member))
        own.mkdir(parents=True, exist_ok=True)
        found.append(Summary(own, member.name, 1, text))
        write_text(own / "scene.toml", signed(text))
    return found


def finish(summary: Summary, skipped: bool = False, bands: tuple[float, ...] = (100.0,)) -> None:
    summary.record("static", "computed", headline={"load": (300.0, "N")})
    summary.record("spectra", "skipped" if skipped else "computed")
    summary.record("report", "computed")
    if not skipped:
        with h5py.File(summary.path.parent / "spectra.h5", "w") as file:
            file["third_octave/centre"] = np.array(bands)
            file["third_octave/level"] = np.array([[1.0, 2.0, 3.0]] * len(bands))


def test_results_of_an_earlier_base_are_not_gathered(folder: Path) -> None:
    before = family(folder, 40.0)
    for one in begin(before, folder):
        finish(one)
    assert gather(before, folder).missing == ()
    after = family(folder, 2000.0)
    names = tuple(member.name for member in after.members)
    table = gather(after, folder)
    assert table.missing == names and table.columns == ()


@pytest.mark.parametrize("stages", [0, 1])
def test_results_beside_a_failed_run_are_not_gathered(folder: Path, stages: int) -> None:
    """It fails in its first stage, with the summary of the run before; or later, with its own."""
    for one in begin(family(folder, 40.0), folder):
        finish(one)
    after = family(folder, 2000.0)
    for one in begin(after, folder)[:stages]:
        one.record("static", "reused")
    table = gather(after, folder)
    assert len(table.missing) == 2 and table.columns == ()


def test_spectra_of_a_run_that_has_none_are_not_gathered(folder: Path) -> None:
    for one in begin(family(folder, 40.0), folder):
        finish(one)
    after = family(folder, 0.0)
    for one in begin(after, folder):
        finish(one, skipped=True)
    table = gather(after, folder)
    assert table.missing == () and [c.name for c in table.columns] == ["static: load"]


def test_a_search_leaves_the_scene_that_it_chose(folder: Path) -> None:
    """With the settings of one of its trials in place of those of the scene."""
    text = BASE.format(speed=40.0) + "[contact]\n[road]\nkind = 'cobblestones'\n"
    text += "[time]\nduration = 0.1\n[accuracy]\ntarget = 0.1\nup_to = 200.0\n"
    (folder / "base.toml").write_text(text)
    sweep = read(folder / "family.toml")
    for member, summary in zip(sweep.members, begin(sweep, folder), strict=True):
        scene, own = sweep.load(member), folder / "members" / member.name
        settings = Ladders.of(scene).first()
        SearchJournal(own, scene).add(Trial(settings, {}, 1.0, failed="no error bars"))
        chosen = dumps(applied(scene, settings))
        finish(Summary(own, member.name, 1, chosen))
        if summary.path.parent.name == sweep.members[0].name:  # the other misses its target
            write_text(own / "scene.toml", signed(chosen))
    assert gather(sweep, folder).missing == ()


def test_a_level_of_nothing_is_not_gathered(folder: Path) -> None:
    """A force that is constant across the road had -3076.5 dB in the table."""
    before = family(folder, 40.0)
    for one in begin(before, folder):
        finish(one)
        with h5py.File(one.path.parent / "spectra.h5", "a") as file:
            file["third_octave/level"][0, 1] = -3076.5
    names = [column.name for column in gather(before, folder).columns]
    assert "axle force x, 100 Hz" in names and "axle force y, 100 Hz" not in names


def test_bands_are_in_ascending_order(folder: Path) -> None:
    """Members may have different ones: a short run lacks the lower."""
    sweep = family(folder, 40.0)
    for one, bands in zip(begin(sweep, folder), ((125.0, 160.0), (100.0, 125.0)), strict=True):
        finish(one, bands=bands)
    names = [c.name for c in gather(sweep, folder).columns if "force z" in c.name]
    assert names == [f"axle force z, {band} Hz" for band in (100, 125, 160)]


def test_what_a_member_does_not_set_has_its_value_in_the_scene(folder: Path) -> None:
    text = "".join(
        f'[[member]]\nname = "{name}"\nset = {{ "{key}" = {value} }}\n'
        for name, key, value in (
            ("heavy", "static.load", 500.0),
            ("few", "modal.count", 8),
            ("plain", "rotation.speed", 40.0),
            ("worn", "rotation.campbell.to", 80.0),
        )
    )
    (folder / "family.toml").write_text('scene = "base.toml"\n' + text)
    sweep = family(folder, 40.0)
    table = gather(sweep, folder)
    assert table.settings["static.load"] == (500.0, 300.0, 300.0, 300.0)
    assert table.settings["modal.count"] == (500, 8, 500, 500)
    write(table, folder)
    with h5py.File(folder / "sweep.h5") as file:
        assert file["axis/modal.count"][:].tolist() == [500, 8, 500, 500]
        assert np.isnan(file["axis/rotation.campbell.to"][:]).tolist() == [True] * 3 + [False]
    assert "heavy,500.0,500,40.0,\n" in (folder / "sweep.csv").read_text()
