"""All that is wrong with a scene is said at once, short, with what to do."""

import pytest
from full_scene import FULL, refused

from tireroad.runs.scene.load import load

CORDS = """
[[tire.cords]]
name = "ply"
depth = 0.0
arc = [-120.0, 120.0]
angle = 90.0
[[tire.cords]]
name = "belt"
"""


def test_cords_are_read_and_kept_inside_the_wall(scene_file):
    belt = load(scene_file(CORDS)).tire.cords[1]
    assert (belt.depth, belt.arc, belt.angle) == (0.006, (-45.0, 45.0), 20.0)
    assert "at most tire.thickness = 0.012 m" in refused(scene_file(CORDS + "depth = 0.013"))
    assert "beyond the beads" in refused(scene_file(CORDS + "arc = [-121.0, 10.0]"))
    assert "must ascend" in refused(scene_file(CORDS + "arc = [10.0, -10.0]"))
    assert "of an earlier line" in refused(scene_file(CORDS.replace('"belt"', '"ply"')))
    assert 'must hold no "/"' in refused(scene_file(CORDS.replace('"belt"', '"a/b"')))


def test_all_that_is_wrong_is_said_at_once(scene_file) -> None:
    text = """
    [tire]
    segments = 3
    odrer = 2
    [static]
    lod = 500
    [contact]
    tread = "jelly"
    [road]
    kind = "sine"
    seed = 1
    amplitude = "high"
    [time]
    duration = 0.1
    step = 1.0
    """
    message = refused(scene_file(text), "damping.mass=-1")
    wrong = ("tire.segments", "tire.odrer", "static.lod", "contact.tread", "road.seed")
    for key in (*wrong, "road.amplitude", "time.step", "damping.mass"):
        assert message.count(f"{key} ") + message.count(f"{key};") >= 1, (key, message)
    assert message.startswith("8 errors in the scene\n")
    assert len(message.splitlines()) == 9


def test_what_was_dropped_says_what_to_take(scene_file) -> None:
    text = '[greens]\nresidual = "second-order"\nchoice = "frequency"\n'
    message = refused(scene_file(text))
    assert 'dropped: take "attachment"' in message
    assert "greens.choice was dropped: greens.dynamic takes the states" in message


def test_consequences_are_not_said(scene_file) -> None:
    """One mistake, one message: what other rules would say of a table that is wrong is left out."""
    broken = "[contact]\n[road]\nkind = 'wavy'\nseed = 3\n[static]\nload = 1\n[time]\n"
    assert refused(scene_file(broken)).count("\n") == 0
    no_load = refused(scene_file(FULL), "force=", "output.fields=true", "static.load=-1")
    assert no_load.count("\n") == 0 and "static.load" in no_load
    assert "known here: " in refused(scene_file("[road]\nkind = 'flat'\nzzz = 3\n"))


def test_endless_keys_are_cut(scene_file) -> None:
    message = refused(scene_file(f"{'k' * 20000} = 1\n"))
    assert len(message) < 500 and "kkk..." in message


def test_points_say_which_pitch(scene_file) -> None:
    message = refused(scene_file(FULL), "contact.points={dx=0.001,dy=nan}")
    assert "contact.points dy must be a finite number" in message
    message = refused(scene_file(FULL), "contact.points={dx=1e-300,dy=0.001}")
    assert "dx must be ≥ 1e-05" in message


def test_the_built_in_tire_loses_by_its_compounds(scene_file) -> None:
    """Not by the thesis's 500 1/s: a radial tire comes with loss factors."""
    assert load(scene_file('[tire]\nsection = "radial"\n')).damping is None
    assert load(scene_file("")).damping is not None


def test_a_name_that_no_file_can_have_is_a_wrong_value(scene_file) -> None:
    """Longer than the file system's names: said by the key, and briefly."""
    message = refused(scene_file(FULL), f"pattern.file={'x' * 5000}")
    assert "pattern.file" in message and "names no file: xxx" in message and len(message) < 400
    message = refused(scene_file(FULL), "pattern.file=~no-such-user-here/tread.png")
    assert "pattern.file" in message and "names no file: ~no-such-user-here" in message


def test_each_output_that_is_not_available_is_said(scene_file) -> None:
    """A rule went no further than its first error: one more of them at each attempt."""
    message = refused(
        scene_file(FULL + "[output]\nvibration = true\nreceptance = { to = 1.0, step = 2.0 }\n"),
        "output.spectra=false",
    )
    assert message.startswith("2 errors in the scene\n")
    for key, reason in (
        ("receptance.step", "must not be more than"),
        ("vibration", "needs output.spectra"),
    ):
        assert any(f"output.{key} " in line and reason in line for line in message.splitlines()), (
            key
        )


def test_each_thing_that_is_missing_is_said(scene_file) -> None:
    message = refused(scene_file("[output]\nvibration = true\nfields = true\n"))
    assert message.count("needs forces in time") == 2
    message = refused(
        scene_file(FULL + "[[force]]\ndirection = [0.0, 0.0, 0.0]\n"), "force.0.arc=170"
    )
    assert "force.0.arc = 170 deg" in message and "force.1.direction must" in message


def test_a_spread_force_that_reaches_beyond_the_bead_names_the_key(scene_file) -> None:
    """It ran until the Green's functions, which then asked for a lower speed."""
    force = "[[force]]\narc = {arc}\nspread = [12.0, 11.0]\n"
    assert "force.0.spread" in (said := refused(scene_file(force.format(arc=110.0))))
    assert "10 at most" in said
    assert load(scene_file(force.format(arc=-109.0))).force[0].spread == (12.0, 11.0)


@pytest.mark.parametrize(
    "table", ["road", "tire", "static", "axle", "contact", "road.motion", "tire.material"]
)
def test_a_table_written_as_a_list_is_said_with_its_line(scene_file, table: str) -> None:
    """It said "must be a table, not [{..." and of the first level no line."""
    message = refused(scene_file(f"name = 'a'\n\n[[{table}]]\n"))
    assert f", line 3: {table} must be written [{table}] in the scene" in message
    assert message.count("\n") == 0


def test_a_list_written_as_a_table_is_said_with_its_line(scene_file) -> None:
    message = refused(scene_file("name = 'a'\n\n[force]\n"))
    assert ", line 3: force must be written [[force]] in the scene" in message
    inner = "[[tire.region]]\n[[tire.region.material]]\n"
    assert "must be written [tire.region.material]" in refused(scene_file(inner))


@pytest.mark.parametrize("table", ["[sweep]\na = 1", "[[axis]]\nkey = 'static.load'"])
def test_a_sweep_s_tables_in_a_scene_name_its_own_file(scene_file, table: str) -> None:
    message = refused(scene_file(table))
    assert "a file of its own" in message and "./tireroad sweep" in message
    assert message.count("\n") == 0
