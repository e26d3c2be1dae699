"""Scenes: what is refused and with which words, what is filled in, what is written back."""

from pathlib import Path

import pytest
from full_scene import FULL, refused

from tireroad.runs.scene.load import load
from tireroad.runs.scene.resolved import dumps
from tireroad.runs.scene.schema import walk
from tireroad.runs.scene.tables.scene import Scene


def test_empty_scene_has_every_default(scene_file) -> None:
    scene = load(scene_file("", "plain.toml"))
    assert scene.name == "plain"
    assert scene.tire.shape.outer_radius == 0.32 and scene.tire.material.law.youngs_modulus == 4.8e8
    assert (scene.static.load, scene.rotation, scene.contact, scene.road, scene.time) == (None,) * 5
    assert scene.force == () and scene.output.receptance is None


def test_defaults_are_within_their_own_ranges() -> None:
    seen = 0
    for name, _, item, key in walk(Scene):
        if item.default is not None:
            assert key.read(item.default) == item.default, name
            seen += 1
    assert seen > 90


def test_every_key_is_described() -> None:
    for name, _, _, key in walk(Scene):
        assert key.doc and key.unit and key.allowed, name


def test_integers_are_numbers(scene_file) -> None:
    scene = load(scene_file("[static]\nload = 500\n"))
    assert scene.static.load == 500.0 and isinstance(scene.static.load, float)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[static]\nlod = 3\n", ["line 2", "unknown key static.lod", "static.load"]),
        ("[statik]\nload = 3\n", ["line 1", "unknown key statik", "static"]),
        ("[time]\nwavelength = 3\n", ["time.wavelength", "road.wavelength"]),
        ("tire = { order = 2, odrer = 1 }\n", ["line 1", "tire.odrer", "tire.order"]),
        ("[tire]\nmaterial.densty = 3\n", ["line 2", "tire.material.density"]),
        ("[static]\nload = -1.0\n", ["line 2", "static.load", "≥ 0.001", "N", "-1"]),
        ("[static]\nload = nan\n", ["line 2", "static.load", "finite", "nan"]),
        ("[static]\nload = inf\n", ["static.load", "finite"]),
        (f"[static]\nload = 1{'0' * 400}\n", ["static.load", "too large"]),
        ("[static]\nload = true\n", ["static.load", "number", "true"]),
        ('[static]\nload = "500"\n', ["static.load", "number", '"500"']),
        ("[static]\nload = [1]\n", ["static.load", "number"]),
        ("static = 3\n", ["static", "table"]),
        ("[tire]\norder = 2.5\n", ["tire.order", "whole number", "2.5"]),
        ("[tire]\norder = true\n", ["tire.order", "whole number"]),
        ("[tire]\nsegments = 3\n", ["tire.segments", "≥ 8"]),
        ("[static]\nsteady_rolling = 1\n", ["steady_rolling", "true or false"]),
        ("[road]\nkind = 'wavy'\n", ["road.kind", "one of", "cobblestones", "wavy"]),
        ("[road]\nkind = 'flat'\nseed = 1\n", ["line 3", "road.seed", "cobblestones", "flat"]),
        ("[tire.material]\nc10 = 1e6\n", ["c10", "mooney-rivlin", "neo-hookean"]),
        ("[tire.material]\npoisson_ratio = 0.5\n", ["poisson_ratio", "≤ 0.4999"]),
        ("[road]\nkind = 'crg'\n", ["line 1", "crg", "file"]),
        ("[road]\nkind = 'crg'\nfile = 'no.crg'\n", ["line 3", "road.file", "no.crg"]),
        ("[road]\nkind = 'crg'\nfile = ''\n", ["road.file", "text"]),
        ("[force]\nangle = 1\n", ["force", "[[force]]"]),
        ("[[force]]\n[[force]]\nangel = 1\n[time]\n", ["line 3", "force.1.angel", "angle"]),
        ("[[force]]\ndirection = [1, 2]\n[time]\n", ["direction", "3 numbers"]),
        ("[[force]]\nspread = [1, -2]\n[time]\n", ["spread", "≥ 0"]),
        ("name = 'a/b'\n", ["name", "letters"]),
        ("name = '..'\n", ["name", "letters"]),
        ("[time]\nstep = 'fine'\n", ["time.step", "auto", "fine"]),
        ("[static\n", ["line 1"]),
        ("[static]\nload = 5 N\n", ["line 2"]),
        ("[static]\nload = 5\nload = 6\n", ["not a TOML file", "line 3"]),
    ],
)
def test_bad_values_are_named(scene_file, text: str, words: list[str]) -> None:
    message = refused(scene_file(text))
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["static.deflection=0.01"], ["deflection", "load"]),
        (["static.road_height=-0.3", "static.deflection=0.1", "static.load="], ["twice"]),
        (["modal.road=held"], ["modal.road", "[contact]"]),
        (["modal.rim=free"], ["modal.rim", "[contact]"]),
        (["output.velocity=true"], ["output.velocity was dropped", "derivative"]),
        (["time=", "output.fields=true"], ["output.fields", "[time]"]),
        (["time=", "accuracy.target=0.1"], ["accuracy.target", "[time]"]),
        (["output.receptance={to=1.0,step=2.0}"], ["receptance.step", "1 Hz"]),
        (["force.0.direction=[0,0,0]"], ["direction", "zeros"]),
        (["force.0.arc=130"], ["arc", "bead", "120"]),
        (["tire.section=car"], ["tire.section", "one of file, radial, torus"]),
        (["tire.thickness=0.1"], ["tire.thickness", "minor_radius"]),
        (["tire.minor_radius=0.4"], ["minor_radius", "outer_radius"]),
        (["tire.half_angle=170", "tire.minor_radius=0.2"], ["half_angle", "axle"]),
        (["modal.count=90000"], ["modal.count", "free unknowns"]),
        (["road.joint_width=0.2"], ["joint_width", "block_length"]),
        (["time.step=1.0"], ["time.step", "duration"]),
        (["time.duration=1", "time.step=1e-9"], ["time.step", "1e8"]),
        (["output.receptance={to=1e6,step=1e-4}"], ["receptance.step", "1e+10 frequencies"]),
        (["rotation.campbell={to=200,step=1e-3}"], ["campbell.step", "2e+05 speeds"]),
        (["road.edge_radius=0.2"], ["road.edge_radius", "half a block"]),
        (["road.height_scatter=0.003"], ["road.height_scatter", "joint_depth"]),
    ],
)
def test_contradictions_are_named(scene_file, overrides: list[str], words: list[str]) -> None:
    message = refused(scene_file(FULL), *overrides)
    for word in words:
        assert word in message


def test_contradictions_need_both_sides(scene_file) -> None:
    path = scene_file(FULL)
    assert load(path).static.load == 500
    still = load(path, ["damping.stiffness=1e-5", "rotation.speed=0"])
    assert still.damping.stiffness == 1e-5
    assert load(path, ["static.load=", "static.deflection=0.01"]).static.deflection == 0.01


@pytest.mark.parametrize(
    ("item", "words"),
    [
        ("static.lod=3", ["--set static.lod", "static.load"]),
        ("static.load=-3", ["--set static.load", "≥ 0.001"]),
        ("tire.cords.0.angle=3", ["--set tire.cords.0.angle", "[[tire.cords]] in the scene"]),
        ("force.1.angle=2", ["force.1.angle", "0 to 0"]),
        ("force.x.angle=2", ["force.x.angle", "0 to 0"]),
        ("name.first=2", ["name", "not a table"]),
        ("static.load", ["table.key=value"]),
        ("=3", ["table.key=value"]),
    ],
)
def test_bad_overrides_are_named(scene_file, item: str, words: list[str]) -> None:
    message = refused(scene_file("name = 'x'\n" + FULL), item)
    for word in words:
        assert word in message


def test_overrides_lie_over_the_scene(scene_file) -> None:
    scene = load(
        scene_file(FULL),
        [
            "force.0.amplitude=7",
            "road.kind=flat",
            "name=other",
            "damping.mass=1e3",
            "force.0.arc=5",
        ],
    )
    assert scene.force[0].amplitude == 7 and scene.force[0].arc == 5
    assert (scene.road.kind, scene.name, scene.damping.mass) == ("flat", "other", 1000)


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["road.kind=sine", "road.phase=30", "road.motion.kind=ramp"],
        ["force=", "contact=", "road=", "time=", "rotation="],
        ["tire.material.model=yeoh", "tire.material.c20=-1e5"],
        ["tire.material.model=mooney-rivlin"],
        ["output.receptance={to=100,step=0.1}", "time.step=1e-5", "contact.reach=0.012"],
        ["road.kind=grid", 'road.file=odd \\" name é.csv', "road.holes=fill"],
    ],
)
def test_resolved_scene_reads_back_equal(scene_file, tmp_path: Path, overrides) -> None:
    (tmp_path / 'odd \\" name é.csv').write_text("x,y,z\n")
    scene = load(scene_file(FULL), overrides)
    again = load(scene_file(dumps(scene), "resolved.toml"))
    assert again == scene
    assert dumps(again) == dumps(scene)


def test_road_file_is_relative_to_the_scene(scene_file, tmp_path, monkeypatch) -> None:
    (tmp_path / "road.crg").write_text("")
    path = scene_file("[road]\nkind = 'crg'\nfile = 'road.crg'\n")
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    assert load(path).road.file == str(tmp_path / "road.crg")
    (elsewhere / "near.crg").write_text("")
    assert load(path, ["road.file=near.crg"]).road.file == str(elsewhere / "near.crg")


def test_unreadable_files_are_named(tmp_path: Path) -> None:
    assert "no such scene" in refused(tmp_path / "none.toml")
    assert "cannot be read" in refused(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"name = 'x'\n\xff\xfe")
    assert "line 2" in refused(binary) and "UTF-8" in refused(binary)
    huge = tmp_path / "huge.toml"
    huge.write_bytes(b"#" * 1_000_001)
    assert "1 MB" in refused(huge)
    deep = tmp_path / "deep.toml"
    deep.write_text("a = " + "[" * 100_000)
    assert str(deep) in refused(deep)


def test_a_windows_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "windows.toml"
    path.write_bytes("\ufeff[static]\r\nload = 3\r\n".encode())
    assert load(path).static.load == 3


@pytest.mark.parametrize(
    "name", ["quickstart", "torus", "point_force", "flat_rest", "measured_road", "corner"]
)
def test_shipped_scenes_are_valid(root: Path, name: str) -> None:
    scene = load(root / "runs" / "scenes" / f"{name}.toml")
    assert scene.name == name.replace("_", "-")


def test_measured_road_scene_takes_a_road(root: Path, roads: Path) -> None:
    road = roads / "belgian_block.crg"
    scene = load(
        root / "runs" / "scenes" / "measured_road.toml", ["road.kind=crg", f"road.file={road}"]
    )
    assert scene.road.file == str(road.resolve()) and scene.contact is not None


@pytest.mark.slow
def test_a_road_that_the_run_does_not_meet_may_be_missing_or_short(
    tmp_path: Path, launch, root: Path
) -> None:
    """Up to the states of the rotating tire no stage reads the road's heights."""
    scene, road = tmp_path / "scene.toml", root / "runs" / "scenes" / "measured_road.npz"
    text = (
        "[static]\nload = 300\n[rotation]\nspeed = 50\n[contact]\n[time]\nduration = 20\n"
        '[road]\nkind = "grid"\nfile = "{}"\n'
    )
    for file, why in (("none.npz", "names no file"), (str(road), "the run needs the road")):
        scene.write_text(text.format(file))
        for until, stops in (("rotating", False), ("contact", True)):
            done = launch("-m", "runs", "check", scene, "--until", until, cwd=root)
            assert done.returncode == 2 * stops, done.stderr
            assert (why in done.stderr) == stops
