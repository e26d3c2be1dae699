"""The elements a scene has by default, and a radial tire by its size."""

from dataclasses import replace

import numpy as np
import pytest

from tireroad.fem.errors import InputError
from tireroad.runs.scene.load import load
from tireroad.runs.scene.resolved import dumps


def scene(tmp_path, text, *overrides):
    path = tmp_path / "scene.toml"
    path.write_text(text)
    return load(path, overrides)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ((), (3, 28, 16, 1.0)),
        (("tire.order=2",), (2, 100, 16, 1.0)),
        (("tire.segments=24",), (2, 24, 16, 1.0)),
        (("static.load=500",), (3, 28, 16, 0.2)),
        (("static.load=500", "tire.footprint_size=1"), (3, 28, 16, 1.0)),
        (('tire.section="radial"',), (2, 40, 26, 1.0)),
        (('tire.section="radial"', "static.load=4000"), (2, 40, 26, 0.2)),
    ],
)
def test_elements_where_the_scene_leaves_them_open(tmp_path, given, expected):
    found = scene(tmp_path, "", *given)
    tire = found.tire
    assert (tire.order, tire.segments, tire.shape.elements_arc, tire.footprint_size) == expected
    path = tmp_path / "again.toml"
    path.write_text(dumps(found))
    assert load(path).tire == tire


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("", "half-space"),
        ('tire.section = "torus"\n', "half-space"),
        ('tire.section = "radial"\n', "layer"),
        ('tire.section = "radial"\ncontact.tread = "half-space"\n', "half-space"),
        ('contact.tread = "winkler"\n', "winkler"),
    ],
)
def test_the_tread_where_the_scene_leaves_it_open(tmp_path, given, expected):
    """A tread on belts is thin; what is written back says so, and is read the same."""
    text = (
        'contact.points = "nodes"\nstatic.load = 4000\nroad.kind = "flat"\ntime.duration = 0.01\n'
    )
    found = scene(tmp_path, text + given)
    assert found.contact.tread == expected
    assert scene(tmp_path, dumps(found)).contact == found.contact


@pytest.mark.parametrize(
    "given", [(), ("tire.order=2", "tire.elements_thickness=2"), ('tire.section="radial"',)]
)
def test_unknowns_are_those_of_the_section(tmp_path, given):
    tire = scene(tmp_path, "", *given).tire
    ring = tire.ring()
    held = len(set(ring.section.side(ring.section.rim).ravel()))
    nodes = len(ring.section.nodes) - held
    assert tire.free_unknowns() == 3 * ring.segments * ring.order * nodes


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('section = "radial"\nsize = "foo"', "like"),
        ('section = "radial"\nthickness = 0.01', "is only valid for section = torus"),
        (
            'section = "radial"\n[[tire.cords]]\nname = "x"',
            "one of cap ply, belt 2, belt 1, carcass",
        ),
        ('section = "radial"\n[[tire.region]]\narc = [0, 9]', "name = one of tread, skim"),
        ('section = "radial"\n[[tire.region]]\narc = [0, 45]', "name = one of tread, skim"),
        ('section = "radial"\n[[tire.region]]\nside = "left"', "name = one of tread, skim"),
        ('section = "radial"\n[[tire.region]]\n[[tire.region]]', "second without a name"),
        (
            'section = "radial"\n[[tire.region]]\nname = "ply"\ndepth = [0, 0.5]',
            "follows from the size. Leave it out",
        ),
        (
            'section = "radial"\n[[tire.cords]]\nname = "belt 1"\ndepth = 0.007',
            "= 0.007 cannot be chosen.*Leave it out",
        ),
        ('section = "radial"\n[tire.material]\ndensity = 1.0', "follow from its size"),
        ('section = "radial"\norder = 1', "take 2 or 3"),
        ('size = "205/60 R15"', "is only valid for section = radial"),
        ("prony_shares = [0.3, 0.8]\nprony_times = [1e-3, 1e-2]", "prony_shares.*sum below 1"),
        ("[[tire.region]]\nprony_shares = [0.3]", "region.*prony_shares.*as many times"),
        ("exponent = 0.1\nprony_shares = [0.3]\nprony_times = [1e-3]", "exclude each other"),
    ],
)
def test_a_radial_tire_says_what_it_does_not_take(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        scene(tmp_path, f"[tire]\n{text}\n")


def test_a_radial_tire_of_other_compounds_and_cords(tmp_path):
    """By their names; all others stay the built-in ones, and the hash of the stage follows."""
    plain = scene(tmp_path, '[tire]\nsection = "radial"\n').tire
    text = """[tire]
section = "radial"
[[tire.region]]
name = "tread"
loss_factor = 0.4
[tire.region.material]
youngs_modulus = 6e6
[[tire.cords]]
name = "belt 1"
angle = 30.0
"""
    tire = scene(tmp_path, text).tire
    before, after = plain.shape.rubbers(plain), tire.shape.rubbers(tire)
    assert after["tread"].law.youngs_modulus == 6e6 and after["tread"].loss_factor == 0.4
    assert after["tread"].dynamic == before["tread"].dynamic
    assert {n for n in before if before[n] != after[n]} == {"tread"}
    one, other = ({c.name: c for c in t.shape.cords(t)} for t in (plain, tire))
    assert [n for n in one if one[n] != other[n]] == ["belt 1"]
    assert np.degrees(other["belt 1"].angle) == pytest.approx(30)
    assert tire.shape.angles(tire)["belt 1"] == 30


def test_a_region_without_a_name_changes_all_compounds(tmp_path):
    """A region with a name goes before it, in either order; what neither says stays built-in."""
    plain = scene(tmp_path, '[tire]\nsection = "radial"\n').tire
    everywhere = "[[tire.region]]\ndynamic = 1.4\nloss_factor = 0.1\n"
    tread = '[[tire.region]]\nname = "tread"\nloss_factor = 0.3\n'
    before = plain.shape.rubbers(plain)
    for regions in (everywhere + tread, tread + everywhere):
        found = scene(tmp_path, f'[tire]\nsection = "radial"\n{regions}')
        after = found.tire.shape.rubbers(found.tire)
        assert {name: one.loss_factor for name, one in after.items()} == {
            name: 0.3 if name == "tread" else 0.1 for name in before
        }
        assert {one.dynamic for one in after.values()} == {1.4}
        assert [one.law for one in after.values()] == [one.law for one in before.values()]
        assert scene(tmp_path, dumps(found)).tire == found.tire
    given = "[[tire.region]]\nmaterial = { youngs_modulus = 7e6, density = 1000 }\n"
    tire = scene(tmp_path, f'[tire]\nsection = "radial"\n{given}').tire
    after = tire.shape.rubbers(tire)
    assert {(one.law.youngs_modulus, one.density) for one in after.values()} == {(7e6, 1000)}
    assert {n: one.loss_factor for n, one in after.items()} == {
        n: one.loss_factor for n, one in before.items()
    }


def test_a_region_of_a_torus_without_an_arc_is_at_the_crown(tmp_path):
    soft, said = (
        scene(
            tmp_path, f"[[tire.region]]\n{arc}material = {{ youngs_modulus = 1e7 }}\n"
        ).tire.ring()
        for arc in ("", "arc = [0, 45]\n")
    )
    assert soft.section.regions == said.section.regions
    assert np.array_equal(soft.section.region, said.section.region)
    assert 0 < np.count_nonzero(soft.section.region) < len(soft.section.region)


def test_a_region_of_a_torus_has_the_rubber_of_the_tire_where_it_says_nothing(tmp_path):
    """Its own default was 480 MPa: a loss factor in the tread made the crown ten times stiffer."""
    wall = "[tire]\ndynamic = 1.3\nloss_factor = 0.1\n[tire.material]\nyoungs_modulus = 5e6\ndensity = 1100.0\n"
    given = f"{wall}[[tire.region]]\nloss_factor = 0.2\n[[tire.region]]\nside = 'left'\narc = [50, 60]\n"
    tire = scene(tmp_path, f"{given}[tire.region.material]\nyoungs_modulus = 9e6\n").tire
    rubbers = tire.shape.rubbers(tire)
    wall, crown, stiff = rubbers.values()
    assert crown == replace(wall, loss_factor=0.2)
    assert wall.law.youngs_modulus == 5e6 and stiff.law.youngs_modulus == 9e6
    assert (stiff.dynamic, stiff.loss_factor) == (1.3, 0.1)


def test_names_of_parts_are_matched_in_any_case(tmp_path):
    """Of a radial tire and of a file alike; results carry the section's own spelling."""
    (tmp_path / "section.toml").write_text(DRAWING)
    for kind, region, cords in (
        ('section = "radial"', "TREAD", "Belt 1"),
        ('file = "section.toml"\nsection = "file"', "RUBBER", "PLY"),
    ):
        text = f"""[tire]\n{kind}\n[[tire.region]]\nname = "{region}"\nloss_factor = 0.4
[[tire.cords]]\nname = "{cords}"\nangle = 30.0\n"""
        tire = scene(tmp_path, text).tire
        assert tire.shape.rubbers(tire)[region.lower()].loss_factor == 0.4
        found = {line.name: line.angle for line in tire.shape.cords(tire)}
        assert found[cords.lower()] == pytest.approx(np.radians(30))
        assert tire.shape.angles(tire)[cords.lower()] == 30.0


def test_the_ring_of_a_file_is_made_once(tmp_path, monkeypatch):
    """However often sizes are asked for; anew when the file, the order or the elements change."""
    from tireroad.runs.scene.sections import file

    made = []
    revolved = file._revolved
    monkeypatch.setattr(file, "_revolved", lambda *of: made.append(of) or revolved(*of))
    drawing = tmp_path / "section.toml"
    drawing.write_text(DRAWING)
    text = '[tire]\nsection = "file"\nfile = "section.toml"\n'
    tire = scene(tmp_path, text).tire
    for _ in range(3):
        tire.free_unknowns()
        tire.proportions()
    assert len(made) == 1
    scene(tmp_path, text, "tire.segments=20").tire.ring()
    assert len(made) == 2
    drawing.write_text(DRAWING.replace("thickness = 6", "thickness = 7"))
    assert tire.ring() is not scene(tmp_path, text, "tire.segments=20").tire.ring()


def test_a_section_file_is_a_tire(tmp_path):
    """Compounds and cords by name, of the order asked for; the hash changes with the drawing."""
    from tireroad.fem.sections.mesh2d import wall_thickness
    from tireroad.runs.scene.sections.file import fingerprint, own_cords, own_materials

    drawing = tmp_path / "section.toml"
    drawing.write_text(DRAWING)
    tire = scene(tmp_path, '[tire]\nsection = "file"\nfile = "section.toml"\norder = 3\n').tire
    ring = tire.ring()
    assert ring.order == 3
    assert wall_thickness(ring.section) == pytest.approx(0.009, rel=0.02)
    assert own_materials(tire)["rubber"].law.youngs_modulus == 5e6
    assert [(c.name, c.area) for c in own_cords(tire)] == [("ply", 4e-7)]
    before = fingerprint(tire)
    drawing.write_text(DRAWING.replace("thickness = 6", "thickness = 7"))
    assert fingerprint(tire) != before
    drawing.write_text(DRAWING.replace("rubber", "ruber", 1))
    with pytest.raises(InputError, match=r"section\.toml.*no compound 'ruber'"):
        scene(tmp_path, '[tire]\nsection = "file"\nfile = "section.toml"\n')


DRAWING = """
unit = "mm"
tread = 60.0
outline.arcs = [[320, 0], [290.71067811865476, 70.71067811865476], [220, 100], [183, 92.88], [170, 86.6]]
layer = [
    { name = "outer", compound = "rubber", thickness = 6 },
    { name = "inner", compound = "rubber", thickness = 3 },
]
cords = [
    { name = "ply", under = "outer", to = 500, angle = 90, youngs_modulus = 1e10, area = 4e-7, spacing = 1e-3 },
]
[compound.rubber]
youngs_modulus = 5e6
density = 1100
"""


@pytest.mark.parametrize(
    ("text", "share"),
    [
        ("", 1.0),
        ('[tire]\nsection = "radial"\n', 0.72),
        ('[tire]\nsection = "radial"\ngrooves = 0\n', 1.0),
    ],
)
def test_grooves_leave_a_share_of_the_tread(tmp_path, text, share):
    assert scene(tmp_path, text).tire.shape.land == pytest.approx(share)
