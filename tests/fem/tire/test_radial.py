"""Sections from layers: outlines, the built-in radial tire of many sizes, the section file."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tireroad.fem.errors import InputError
from tireroad.fem.sections.construction import Outline, arcs
from tireroad.fem.sections.radial import GROOVES, MOST_GROOVES, radial, size
from tireroad.fem.sections.section_file import read
from tireroad.runs.scene.schema import key_of
from tireroad.runs.scene.sections.radial import RadialSection

FILE = """
unit = "mm"
tread = 60.0
[outline]
arcs = [[320, 0], [290.71067811865476, 70.71067811865476], [220, 100], [183, 92.88], [170, 86.6]]
[[layer]]
name = "outer"
compound = "rubber"
thickness = [[0, 8], [100, 8], [150, 5]]
[[layer]]
name = "inner"
compound = "rubber"
thickness = 4
[[part]]
layer = "outer"
compound = "soft"
along = [50, 100]
[[cords]]
name = "belt"
under = "outer"
to = 50
angle = 20
youngs_modulus = 1.7e11
area = 2.1e-7
spacing = 1.2e-3
[compound.rubber]
youngs_modulus = 5e6
density = 1100
[compound.soft]
youngs_modulus = 2e6
density = 1000
loss_factor = 0.2
"""


def test_an_outline_of_arcs_is_a_circle():
    """Length, places and normals of a quarter of a circle of 0.1 m."""
    root = np.sqrt(0.5)
    outline = Outline(arcs([(0.32, 0.0), (0.22 + 0.1 * root, 0.1 * root), (0.22, 0.1)]))
    assert outline.length == pytest.approx(0.1 * np.pi / 2, rel=1e-6)
    s = np.array([-0.1, -0.03, 0.02, 0.11])
    circle = np.stack([0.22 + 0.1 * np.cos(s / 0.1), 0.1 * np.sin(s / 0.1)], axis=-1)
    np.testing.assert_allclose(outline.at(s), circle, atol=1e-6)
    np.testing.assert_allclose(outline.inwards(s), ([0.22, 0] - circle) / 0.1, atol=1e-3)


def test_a_section_file_is_built_as_drawn(tmp_path):
    path = tmp_path / "section.toml"
    path.write_text(FILE)
    built = read(path)
    mesh = built.section(20, 3)
    assert set(mesh.regions) == {"rubber", "soft"}
    belt = mesh.nodes[mesh.chain(mesh.plies["belt"])]
    np.testing.assert_allclose(np.hypot(belt[:, 0] - 0.22, belt[:, 1]), 0.092, atol=1e-5)
    assert abs(np.arctan2(belt[:, 1], belt[:, 0] - 0.22)).max() == pytest.approx(0.5, abs=1e-4)
    soft = mesh.nodes[np.unique(mesh.cells[mesh.region == mesh.regions.index("soft")])]
    angle = abs(np.arctan2(soft[:, 1], soft[:, 0] - 0.22))
    np.testing.assert_allclose([angle.min(), angle.max()], [0.5, 1.0], atol=1e-4)
    line = built.cords[0]
    assert (line.angle, line.area) == (pytest.approx(np.radians(20)), 2.1e-7)
    assert built.compounds["soft"]["loss_factor"] == 0.2


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unit = "mm"', 'unit = "inch"', "unit"),
        ('unit = "mm"', 'unit = "m"', "r reaches 320 m; .*is unit"),
        ("tread = 60.0", "", "tread must be a number"),
        ('name = "inner"', 'name = "outer"', "'outer': the name of two layers"),
        ("angle = 20", "angle = 240", "angle = 240 deg must lie between"),
        (
            "youngs_modulus = 1.7e11",
            "youngs_modulus = 170",
            "'belt': youngs_modulus = 170 must lie",
        ),
        ("area = 2.1e-7", "area = 0.21", "'belt': area = 0.21 must lie from 1e-12 to 0.001"),
        ("spacing = 1.2e-3", "spacing = 1.2", "'belt': spacing = 1.2 must lie from 1e-06 to 0.1"),
        (
            "spacing = 1.2e-3",
            "spacing = 1.2e-3\ncompression = 50",
            "compression = 50 must lie from 0",
        ),
        ("density = 1100", "density = 1.1", "density = 1.1 must lie from 100"),
        ('compound = "soft"', 'compound = "sof"', "no compound 'sof'"),
        ('under = "outer"', 'under = "middle"', "'middle'; there are outer, inner"),
        ("thickness = 4", "thickness = -4", "needs a thickness above 0"),
        ("thickness = 4", "thickness = 95", "element"),
        ("[320, 0]", "[320, 1]", "not at the crown"),
        ("angle = 20", "angel = 20", "unknown key 'angel'"),
        ("arcs = [", "arcs = [[1]", "TOML"),
        ("density = 1000", "density = 5e-324", "density = 4.94066e-324 must lie from 100"),
        ("loss_factor = 0.2", "loss_factor = -1", "loss_factor = -1 must lie from 0"),
        ("along = [50, 100]", "along = [100, 50]", "ascend"),
        ("tread = 60.0", "tread = 60.0\nheld = 50.0", "the rim holds the face from 0.05 m"),
    ],
)
def test_what_is_wrong_in_a_section_file_is_told(tmp_path, old, new, message):
    path = tmp_path / "section.toml"
    path.write_text(FILE.replace(old, new))
    with pytest.raises(InputError, match=message):
        read(path).section(12)


def test_two_lines_of_cords_of_one_name_are_refused(tmp_path):
    """Both were built, and results had one of them: half of the largest force."""
    path, first, second = tmp_path / "section.toml", FILE.index("[[cords]]"), FILE.index("[compound.rubber]")  # fmt: skip
    path.write_text(FILE[:second] + FILE[first:])
    with pytest.raises(InputError, match="'belt': the name of two lines"):
        read(path)


def test_ranges_are_those_of_a_scene():
    """But for the density of a compound, which a scene knows in kg/m3."""
    from tireroad.fem.sections.section_file import COMPOUND_RANGES, CORD_RANGES
    from tireroad.runs.scene.tables.tire import CordsTable

    keys = {name: key_of(item) for name, item in CordsTable.__dataclass_fields__.items()}
    for name, (least, most) in CORD_RANGES.items():
        assert (keys[name].limits.least, keys[name].limits.most) == (least, most), name
    assert COMPOUND_RANGES["youngs_modulus"] == CORD_RANGES["youngs_modulus"]


def test_the_documented_section_file_is_one(tmp_path):
    """Two of its compounds were missing."""
    page = Path(__file__).parents[3] / "docs/section-file.md"
    block = page.read_text().split("```toml\n")[1].split("```")[0]
    (tmp_path / "section.toml").write_text(block)
    mesh = read(tmp_path / "section.toml").section(20, 2)
    assert set(mesh.regions) == {"tread", "sidewall", "ply"}


@pytest.mark.parametrize(
    "text", ["175/65 R14", "205/60 R15", "205/55 R16", "225/45ZR17", "255/35 R20", "195/80R15"]
)
@pytest.mark.parametrize("order", [2, 3])
def test_sizes_build(text, order):
    """Height and width as the size says, every cord in, the same on both sides to rounding."""
    mesh, tire = radial(text).section(28, order), size(text)
    line = mesh.nodes[mesh.chain(mesh.outer)]
    assert line[:, 0].max() == pytest.approx(
        tire.rim + tire.height, rel=3e-4
    )  # maybe no node there
    assert np.ptp(line[:, 1]) == pytest.approx(tire.width, rel=0.01)
    assert set(mesh.plies) == {"cap ply", "belt 1", "belt 2", "carcass"}
    assert set(mesh.regions) == {"tread", "skim", "ply", "sidewall", "apex", "bead"}
    distance, image = cKDTree(mesh.nodes).query(mesh.nodes * [1, -1])
    assert distance.max() < 1e-14
    assert len(np.unique(image)) == len(image)


def test_the_flange_holds_the_outer_face_down_to_the_heel():
    """All of it from 16 mm above the rim, and nothing above; the bead behind it is part of the mass."""
    mesh = radial("205/60 R15").section(26)
    line = mesh.chain(mesh.outer)
    held = np.isin(line, mesh.side(mesh.rim))
    height = mesh.nodes[line, 0] - 0.1905
    assert height[held].max() == pytest.approx(0.016, abs=1e-4)
    assert height[~held].min() > 0.016
    assert held[0] and held[-1]


def test_a_section_too_low_for_the_flange_is_told():
    with pytest.raises(InputError, match=r"tire\.size = \"145/30 R14\": its section is 44 mm high"):
        radial("145/30 R14")


def test_grooves_take_their_share_of_the_tread():
    """Of its stiffness and mass, and of nothing else; the scene's key has the number and range of here."""
    slick, four = (radial("205/60 R15", grooves).compounds for grooves in (0, 4))
    for key in ("youngs_modulus", "density"):
        assert four["tread"][key] == pytest.approx(0.72 * slick["tread"][key])
    assert {k: v for k, v in four.items() if k != "tread"} == {
        k: v for k, v in slick.items() if k != "tread"
    }
    key = RadialSection.__dataclass_fields__["grooves"]
    assert (key.default, key_of(key).limits.most) == (GROOVES, MOST_GROOVES)
    with pytest.raises(InputError, match=r"tire\.grooves = 9: must lie from 0 to 8"):
        radial("205/60 R15", 9)


@pytest.mark.parametrize(
    ("text", "index"),
    [
        ("155/65 R14", 387),
        ("175/65 R14", 475),
        ("195/65 R15", 615),
        ("205/60 R15", 615),
        ("225/45 R17", 615),
        ("225/40 R18", 560),
        ("255/35 R20", 650),
    ],
)
def test_the_size_says_its_rated_load(text, index):
    """Kilograms of the load indices of standard tires (75, 82, 91, 91, 91, 88, 93)."""
    tire = size(text)
    assert tire.rated_load() == pytest.approx(9.81 * index, rel=0.045)
    assert tire.rated_load(2.0e5) == pytest.approx(0.8**0.8 * tire.rated_load())
    assert tire.inflation_for(tire.rated_load(2.0e5)) == pytest.approx(2.0e5)
    assert tire.inflation_for(2 * tire.rated_load()) == 2.5e5


@pytest.mark.parametrize(
    ("text", "inches", "width"),
    [
        ("155/65 R14", 4.5, 157),
        ("175/65 R14", 5.0, 177),
        ("185/60 R14", 5.5, 189),
        ("195/65 R15", 6.0, 201),
        ("205/60 R15", 6.0, 209),
        ("205/55 R16", 6.5, 214),
        ("225/45 R17", 7.5, 225),
        ("225/40 R18", 8.0, 230),
        ("255/40 R17", 9.0, 260),
        ("275/35 R20", 9.5, 278),
        ("LT245/75R16", 7.0, 248),
    ],
)
def test_the_size_says_its_measuring_rim_and_width(text, inches, width):
    """Measuring rims and design section widths (mm) as makers list them: rims exactly, widths within 2 %."""
    tire = size(text)
    assert tire.measuring_rim == pytest.approx(0.0254 * inches)
    assert 1e3 * tire.width == pytest.approx(width, rel=0.02)


@pytest.mark.parametrize("wider", [-0.0127, 0.0, 0.0127])
def test_the_rim_that_is_given_holds_the_beads(wider):
    """Its heels lie at half its width; the section is wider by 0.4 of what the rim is wider."""
    tire = size("255/40 R17")
    rim = tire.measuring_rim + wider
    mesh = radial("255/40 R17", rim_width=rim).section(26)
    line = mesh.nodes[mesh.chain(mesh.outer)]
    assert np.abs(line[[0, -1], 1]) == pytest.approx(rim / 2)
    assert np.ptp(line[:, 1]) == pytest.approx(tire.width + 0.4 * wider, rel=0.01)
    own = radial("255/40 R17").section(26)
    assert (wider == 0) == np.array_equal(own.nodes, mesh.nodes)


def test_a_rim_that_does_not_fit_is_told():
    with pytest.raises(InputError, match=r"tire\.rim_width = 0\.1 m: rims for a section of 205 mm"):
        radial("205/60 R15", rim_width=0.1)


@pytest.mark.parametrize(
    ("text", "same", "index", "symbol", "newton"),
    [
        ("P205/60R15 91V", "205/60 R15", 91, "V", 615 * 9.81),
        ("205/60R15 91V XL", "205/60 R15", 91, "V", 615 * 9.81),
        ("205/60 ZR 15", "205/60 R15", None, None, None),
        ("205/60VR15", "205/60 R15", None, "V", None),
        ("p205/60r15 91h M+S", "205/60 R15", 91, "H", 615 * 9.81),
        ("255/40 ZR17 (98W) XL", "255/40 R17", 98, "W", 750 * 9.81),
        ("LT245/75R16", "245/75 R16", None, None, None),
        ("LT245/75R16 120/116S", "245/75 R16", 120, "S", 1400 * 9.81),
        ("LT245/75R16 120/116S E", "245/75 R16", 120, "S", 1400 * 9.81),
        ("195/75 R16C 107/105R", "195/75 R16", 107, "R", 975 * 9.81),
    ],
)
def test_sizes_as_people_write_them(text, same, index, symbol, newton):
    """The same tire; load index and speed symbol are taken, of single tires."""
    tire, plain = size(text), size(same)
    assert (tire.width, tire.height, tire.rim) == (plain.width, plain.height, plain.rim)
    assert (tire.index, tire.symbol) == (index, symbol)
    assert tire.rated_load() == pytest.approx(newton or plain.rated_load())


def test_an_index_beyond_a_standard_tire_s_is_a_reinforced_tire_s():
    """98 for 94: at 290 kPa, and less below; the speed of W is 270 km/h."""
    tire = size("255/40 R17 98W")
    assert tire.rated_pressure == 2.9e5 and size("255/40 R17 94W").rated_pressure == 2.5e5
    assert tire.rated_load(2.5e5) == pytest.approx((2.5 / 2.9) ** 0.8 * 750 * 9.81)
    assert 3.6 * tire.speed == pytest.approx(270)
    assert size("LT245/75R16 120/116S").rated_pressure is None


@pytest.mark.parametrize(
    "text",
    [
        "",
        "205",
        "205/60 15",
        "999/99 R99",
        "205/60 R15 extra",
        "205/60 R15 91X",
        "205/60 R15 300V",
        "205/60 R1591V5",
    ],
)
def test_no_size_is_told(text):
    with pytest.raises(InputError, match=r"tire\.size"):
        size(text)
