"""A line measured by a laser is cleaned openly and widened by isotropy."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from tireroad.contact.roads.kinds.laser import LaserFile
from tireroad.contact.roads.random_texture import memory, widened
from tireroad.contact.roads.road import make_road
from tireroad.fem.errors import InputError

PITCH = 5e-4


def measured(tmp_path, spoil=lambda mm, rng: None, length=1.0):
    """A line of `length` m as a laser writes it, mm every 0.04 mm, with 3 um of noise; (file, heights in m)."""
    x = 4e-5 * np.arange(round(length / 4e-5))
    rng = np.random.default_rng(4)
    wave = 2 * np.pi / np.geomspace(0.004, 0.2, 60)
    z = (1e-4 * np.sin(x[:, None] * wave + rng.uniform(0, 6.28, 60))).sum(axis=1)
    mm = 1e3 * z + rng.normal(0, 3e-3, len(z))
    spoil(mm, rng)
    np.savetxt(tmp_path / "line.csv", mm, fmt="%.5f")
    return str(tmp_path / "line.csv"), x, z


def spoiled(mm, rng) -> None:
    mm[rng.integers(0, len(mm), 200)] += 5.0
    for begin in (5000, 12_000):
        mm[begin : begin + 80] = np.nan


def test_a_laser_profile_is_cleaned_openly(tmp_path) -> None:
    """Outliers and gaps are gone and counted; the line itself is the road's middle within its filter."""
    file, x, z = measured(tmp_path, spoiled)
    road = LaserFile(file=file, across="ruts", shortest_wave=5e-4).make()
    inner = (x > 0.01) & (x < 0.99)
    for begin in (5000, 12_000):  # nothing is known of the gaps
        inner[begin - 50 : begin + 130] = False
    assert np.abs(road.height(x, 0 * x) - z)[inner].max() < 1e-4
    told = next(note for note in road.notes if "outliers" in note)
    assert "160 missing" in told and any("ruts" in note for note in road.notes)
    assert "heights in mm: assumed" in road.notes
    assert "heights every 0.04 mm: assumed (road.pitch)" in road.notes
    outliers = int(told.split("and ")[1].split()[0])
    assert 180 <= outliers <= 230
    under = make_road(kind="laser", file=file, across="ruts").prepare(0.0, 0.5, -0.1, 0.1)
    assert any(note.startswith("laser profile of 25000 points") for note in under.notes)


def test_a_laser_profile_is_widened_by_isotropy(tmp_path) -> None:
    """The line in its middle, as rough beside it and across it."""
    file, x, z = measured(tmp_path, length=2.0)
    road = LaserFile(file=file, shortest_wave=4e-3, width=0.3).make()
    s = np.arange(0.02, 1.98, 1e-3)
    middle, lines = (
        road.height(s, 0 * s),
        [road.height(s, 0 * s + y) for y in np.linspace(-0.15, 0.15, 13)],
    )
    alike = LaserFile(file=file, shortest_wave=4e-3, across="ruts").make()
    assert np.abs(middle - alike.height(s, 0 * s)).max() < 1e-9
    assert np.mean([line.std() for line in lines]) == pytest.approx(middle.std(), rel=0.15)
    assert abs(np.corrcoef(lines[0], middle)[0, 1]) < 0.3
    # Slopes along and across: an isotropic surface has the same.
    y = np.arange(-0.14, 0.14, 1e-3)
    grid = road.height(*np.broadcast_arrays(s[:, None], y[None, :]))
    along, across = (np.diff(grid, axis=axis).std() for axis in (0, 1))
    assert across == pytest.approx(along, rel=0.1)


def test_memory_of_widening_is_foreseen() -> None:
    """Of numpy's arrays while the surface is made."""
    profile = 1e-3 * np.random.default_rng(0).standard_normal(3000)
    widened(profile[:100], 1e-3, 0.1, 0)  # what is imported does not count
    tracemalloc.start()
    try:
        widened(profile, 1e-3, 0.4, 0)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert 0.8 < most / memory(len(profile), 1e-3, 0.4) < 1.1


def all_lost(mm, rng) -> None:
    mm[:] = np.nan


def one_long_gap(mm, rng) -> None:
    mm[5000:5400] = np.nan


def much_lost(mm, rng) -> None:
    mm[::5] = np.nan


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (all_lost, "none of the 25000 heights is a number"),
        (one_long_gap, "longest_gap"),
        (much_lost, "too few valid heights"),
    ],
)
def test_profiles_of_no_use_are_refused(tmp_path, spoil, message) -> None:
    file, _, _ = measured(tmp_path, spoil)
    with pytest.raises(InputError, match=message):
        LaserFile(file=file).make()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("1,2,3\n" * 9, "3 numbers"),
        ("a\nb\nc\nd\n", "line.csv"),
        ("0.0,1\n1.0,1\n1.0,1\n4.0,1\n", "even steps"),
        ("", "line.csv"),
    ],
)
def test_files_that_are_no_line(tmp_path, content, message) -> None:
    (tmp_path / "line.csv").write_text(content)
    with pytest.raises(InputError, match=message):
        LaserFile(file=str(tmp_path / "line.csv")).make()
    with pytest.raises(InputError, match="file"):
        LaserFile()


def test_positions_in_the_file_are_those_of_the_road(tmp_path) -> None:
    x = 250.0 + 0.1 * np.arange(4000)  # mm
    z = np.exp(-(((x - 400.0) / 20.0) ** 2))
    np.savetxt(tmp_path / "line.csv", np.column_stack([x, z]), delimiter=",")
    road = LaserFile(file=str(tmp_path / "line.csv"), across="ruts").make()
    assert road.measured[0] == pytest.approx(0.25)
    along = np.linspace(0.26, 0.6, 1000)
    assert along[road.height(along, 0 * along).argmax()] == pytest.approx(0.4, abs=1e-3)


def test_a_measured_road_shorter_than_the_drum_is_refused(tmp_path) -> None:
    file, _, _ = measured(tmp_path, length=1.0)
    road = make_road(kind="laser", file=file, across="ruts", drum_radius=0.5)
    with pytest.raises(InputError, match="the run needs the road from x = 0 to 3.142 m"):
        road.prepare(0.0, 2.0, -0.1, 0.1)


def test_a_road_of_micrometres_is_refused_at_once(tmp_path: Path) -> None:
    """The filter of 2 mm had 10^8 points for a scan every 17 pm, which x in m is when it is read in mm."""
    x = 1.6655563e-8 * np.arange(3000)
    rows = "\n".join(f"{a:.7e} {1.3e-3 * (1 + np.sin(k)):.7e}" for k, a in enumerate(x))
    (tmp_path / "scan.txt").write_text(rows)
    with pytest.raises(InputError, match="too short a road"):
        LaserFile(file=str(tmp_path / "scan.txt"), length_unit="mm", height_unit="mm").make()
    with pytest.raises(InputError, match=r"x is read in mm.*road\.length_unit"):
        LaserFile(file=str(tmp_path / "scan.txt"), height_unit="mm").make()
