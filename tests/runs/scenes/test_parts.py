"""Compounds and cords of the built-in tire: what is stated is used, and what is not stays as built."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from tireroad.fem.errors import InputError
from tireroad.fem.sections.radial import COMPOUNDS, GROOVE, radial
from tireroad.runs.check import explain
from tireroad.runs.scene.load import load
from tireroad.runs.scene.resolved import dumps

RADIAL = '[tire]\nsection = "radial"\n'
MATERIAL = ("youngs_modulus", "poisson_ratio", "density")
SMALL = ("dynamic", "loss_factor", "exponent")
CORDS = ("angle", "youngs_modulus", "area", "spacing", "density", "compression")
LINES = tuple(line.name for line in radial("205/60 R15").cords)


@pytest.fixture
def scene(tmp_path):
    def read(text, *overrides):
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return load(path, overrides)

    return read


def used(scene) -> dict:
    """(part, quantity): number, of the scene written back."""
    tire = tomllib.loads(dumps(scene))["tire"]
    regions, cords = tire["region"], tire["cords"]
    assert [one["name"] for one in regions] == list(COMPOUNDS)
    assert [one["name"] for one in cords] == list(LINES)
    found = {(one["name"], key): one["material"][key] for one in regions for key in MATERIAL}
    found |= {(one["name"], key): one[key] for one in regions for key in SMALL}
    return found | {(f"{one['name']} cords", key): one[key] for one in cords for key in CORDS}


def in_the_elements(scene) -> dict:
    """(part, quantity): number, of what the finite elements are given, grooves undone."""
    tire = scene.tire
    shape, found = tire.shape, {}
    for name, one in shape.in_layers(tire).items():
        share = 1 - GROOVE * shape.grooves if name == "tread" else 1.0
        values = {
            "youngs_modulus": one.law.youngs / share,
            "poisson_ratio": one.law.poisson,
            "density": one.density / share,
            "dynamic": one.dynamic,
            "loss_factor": one.loss_factor,
            "exponent": one.spectrum.exponent,
        }
        found |= {(name, key): value for key, value in values.items()}
    for line in shape.cords(tire):
        values = {key: getattr(line, key) for key in CORDS}
        values["angle"] = np.degrees(line.angle)
        found |= {(f"{line.name} cords", key): value for key, value in values.items()}
    return found


NUMBERS = [
    *((name, key) for name in COMPOUNDS for key in (*MATERIAL, *SMALL)),
    *((f"{name} cords", key) for name in LINES for key in CORDS),
]


def stated(part: str, key: str, value: float) -> str:
    name = part.removesuffix(" cords")
    if part.endswith(" cords"):
        return f'[[tire.cords]]\nname = "{name}"\n{key} = {value!r}\n'
    place = "[tire.region.material]\n" if key in MATERIAL else ""
    return f'[[tire.region]]\nname = "{name}"\n{place}{key} = {value!r}\n'


@pytest.mark.parametrize(("part", "key"), NUMBERS, ids=lambda value: value)
def test_one_number_changes_that_number_alone(scene, part, key):
    """A density alone made 480 MPa rubber of a compound; a number that a table has by default was not taken."""
    before = used(scene(RADIAL))
    wanted = {
        "poisson_ratio": 0.45,
        "density": 1200.0 if part not in ("apex", "skim") else 1234.0,
        "dynamic": 1.0 if part != "bead" else 1.3,
        "loss_factor": 0.0,
        "exponent": 0.0 if part != "bead" else 0.05,
        "compression": 1.0 if part == "carcass cords" else 0.5,
        "angle": 20.0,
    }.get(key, 1.1 * before[part, key])
    found = scene(RADIAL + stated(part, key, wanted))
    after = used(found)
    assert {k for k in before if before[k] != after[k]} == {(part, key)}
    assert after[part, key] == wanted
    assert in_the_elements(found) == pytest.approx(after, rel=1e-12)


def test_numbers_of_the_documentation_are_those_to_write(scene):
    """4.4 MPa and 1110 kg/m³ are the tread between its grooves: stating them changes nothing."""
    text = stated("tread", "youngs_modulus", 4.4e6) + "density = 1110\npoisson_ratio = 0.49\n"
    plain, same = scene(RADIAL), scene(RADIAL + text)
    assert used(same) == used(plain) and same.tire == plain.tire
    assert in_the_elements(plain)["tread", "youngs_modulus"] == pytest.approx(4.4e6)
    layer = plain.tire.shape.in_layers(plain.tire)["tread"]
    assert layer.law.youngs == pytest.approx(0.72 * 4.4e6)


@pytest.mark.parametrize(
    ("key", "changed"),
    [
        ("tread", {("tread", "youngs_modulus")}),
        ("tread modulus", {("tread", "youngs_modulus")}),
        ("Tread density", {("tread", "density")}),
        ("sidewall loss_factor", {("sidewall", "loss_factor")}),
        ("ply dynamic", {("ply", "dynamic")}),
        ("belt angle", {("belt 1 cords", "angle"), ("belt 2 cords", "angle")}),
        ("belt 1 angle", {("belt 1 cords", "angle")}),
        ("cap ply", {("cap ply cords", "youngs_modulus")}),
        ("carcass spacing", {("carcass cords", "spacing")}),
        ("compounds density", {(name, "density") for name in COMPOUNDS}),
    ],
)
def test_scale(scene, key, changed):
    before, said = used(scene(RADIAL)), []
    path_text = f'{RADIAL}[tire.scale]\n"{key}" = 1.1\n'
    found = scene(path_text)
    after = used(found)
    assert {k for k in before if before[k] != after[k]} == changed
    for one in changed:
        assert after[one] == pytest.approx(1.1 * before[one])
    again = scene(dumps(found))
    assert again.tire == found.tire, "written back it is not scaled twice"
    assert not said


def test_scale_multiplies_what_is_stated(scene):
    text = stated("skim", "youngs_modulus", 10e6) + "[tire.scale]\nskim = 1.2\n"
    assert used(scene(RADIAL + text))["skim", "youngs_modulus"] == pytest.approx(12e6)
    assert used(scene(RADIAL, "tire.scale.skim=1.2"))["skim", "youngs_modulus"] == pytest.approx(
        1.2 * 11.7e6
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[tire.scale]\ntred = 1.1", r"tire\.scale\.tred .*did you mean tread"),
        ('[tire.scale]\n"tread angle" = 1.1', r'no quantity "angle" of tread: take one of modulus'),
        ("[tire.scale]\ntread = 0", r'tire\.scale "tread" must be ≥ 0\.01'),
        ('[tire.scale]\ntread = "much"', r'"tread" must be a number'),
        ('[tire.scale]\n"bead poisson ratio" = 1.5', r"poisson_ratio must be .* ≤ 0\.4999"),
        ("dynamic = 1.2", r"line 3: tire\.dynamic is for a torus or a file"),
        (
            '[[tire.region]]\nname = "ply"\nmaterial = { model = "yeoh" }',
            r'tire\.region\.0\.material\.c10 is missing: model = "yeoh" is another law',
        ),
        (
            '[[tire.region]]\nname = "ply"\ndynamic = 1.2\nprony_shares = [0.3]\nprony_times = [1e-3]',
            r"tire\.region\.0\.dynamic and prony_shares exclude each other",
        ),
        ("rim_width = 0.3", r"line 3: tire\.rim_width = 0\.3 m: rims for a section of 205 mm"),
    ],
)
def test_what_is_wrong_is_told(scene, text, message):
    with pytest.raises(InputError, match=message):
        scene(f"{RADIAL}{text}\n")


def test_scale_is_for_a_radial_tire(scene):
    with pytest.raises(InputError, match="scale is only valid for section = radial"):
        scene("[tire.scale]\ntread = 1.1\n")


def test_another_law_keeps_the_moduli_that_it_has(scene):
    """Hooke's of the same E and ν; Yeoh's bulk modulus and density, its coefficients as given."""
    text = '[[tire.region]]\nname = "ply"\nmaterial = { model = "linear" }\n'
    text += '[[tire.region]]\nname = "skim"\nmaterial = { model = "yeoh", c10 = 2e6 }\n'
    tire = scene(RADIAL + text).tire
    plain = scene(RADIAL).tire
    own, before = tire.shape.rubbers(tire), plain.shape.rubbers(plain)
    assert (own["ply"].law.youngs_modulus, own["ply"].density) == (7e6, 1150)
    assert own["skim"].law.bulk == pytest.approx(before["skim"].law.bulk)
    assert (own["skim"].law.c10, own["skim"].density) == (2e6, 1200)
    assert own["skim"].loss_factor == before["skim"].loss_factor


def test_a_prony_series_takes_the_place_of_the_power_law(scene):
    text = '[[tire.region]]\nname = "tread"\nprony_shares = [0.4]\nprony_times = [1e-3]\n'
    tire = scene(RADIAL + text).tire
    assert tire.shape.rubbers(tire)["tread"].spectrum.exponent == 0
    assert len(tire.shape.rubbers(tire)["tread"].spectrum.frequency) > 1
    again = scene(dumps(scene(RADIAL + text))).tire
    assert again == tire
    with pytest.raises(InputError, match="multiplies dynamic, which tread has not"):
        scene(RADIAL + text + '[tire.scale]\n"tread dynamic" = 1.1\n')


def test_a_torus_and_its_regions_keep_what_is_not_stated(scene):
    """A region of 5 MPa rubber that states its density alone had 480 MPa, and ν = 0.45."""
    wall = "[tire.material]\nyoungs_modulus = 5e6\npoisson_ratio = 0.49\ndensity = 1100.0\n"
    region = "[[tire.region]]\ndynamic = 1.0\nmaterial = { density = 1000 }\n"
    tire = scene(f"[tire]\ndynamic = 1.3\n{wall}{region}").tire
    own, crown = tire.shape.rubbers(tire).values()
    assert crown == replace(own, density=1000, dynamic=1.0)
    assert own.dynamic == 1.3


def test_check_prints_compounds_and_cords(scene):
    text = explain(scene(RADIAL + stated("skim", "density", 1234.0)))
    skim = next(line.split() for line in text.splitlines() if line.startswith("  skim"))
    assert skim == ["skim", "neo-hookean", "11.7", "0.49", "1234", "1.2", "0.2", "0.08"]
    belt = next(line.split() for line in text.splitlines() if line.startswith("  belt 1 "))
    assert belt == ["belt", "1", "22", "190", "0.246", "1.25", "7850", "1"]
    assert "material" not in tomllib.loads(dumps(scene(RADIAL)))["tire"], "none of a torus"


CONTACT = """[static]
load = 4000.0
[contact]
[road]
kind = "flat"
[time]
duration = 0.01
"""


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("", 1e7),
        ("[tire.scale]\ntread = 1.3\n", 1.3e7),
        ('[tire.scale]\n"tread dynamic" = 0.9\n', 0.9e7),
        (stated("tread", "youngs_modulus", 8.8e6), 2e7),
    ],
)
def test_the_rubber_of_the_contact_is_the_tire_s(scene, text, wanted):
    """Where the scene leaves it open; a modulus that is stated is used as it is."""
    found = scene(RADIAL + text + CONTACT)
    assert found.contact.law.youngs_modulus == pytest.approx(wanted)
    said = scene(
        RADIAL + text + CONTACT.replace("[contact]\n", "[contact]\nyoungs_modulus = 6e6\n")
    )
    assert said.contact.law.youngs_modulus == 6e6
    assert scene(dumps(found)) == found


def test_a_sweep_needs_nothing_restated(tmp_path, scene):
    """Over a compound and over a line of cords by [tire.scale]."""
    from tireroad.runs.sweep.definition import read

    (tmp_path / "scene.toml").write_text(RADIAL)
    axes = '[[axis]]\nkey = "tire.scale.tread"\nvalues = [1.0, 1.1]\n'
    axes += '[[axis]]\nkey = "tire.scale.belt angle"\nvalues = [0.9, 1.0]\n'
    (tmp_path / "sweep.toml").write_text(f'scene = "scene.toml"\n{axes}')
    sweep = read(tmp_path / "sweep.toml")
    found = [used(sweep.load(member)) for member in sweep.members]
    pairs = [(one["tread", "youngs_modulus"], one["belt 1 cords", "angle"]) for one in found]
    assert pairs == [
        pytest.approx(pair) for pair in ((4.4e6, 19.8), (4.4e6, 22), (4.84e6, 19.8), (4.84e6, 22))
    ]
