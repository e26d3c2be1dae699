"""OpenCRG files: four formats, damage, what is refused by name, and real roads where they are."""

import os
from pathlib import Path

import numpy as np
import pytest

from tireroad.contact.roads.opencrg import read_opencrg
from tireroad.contact.roads.road import ROADS as KINDS
from tireroad.contact.roads.road import make_road
from tireroad.fem.errors import InputError

ROADS = Path(os.environ.get("TIREROAD_ROADS", Path(__file__).parents[4] / "shared" / "roads"))
needs_roads = pytest.mark.skipif(
    not (ROADS / "belgian_block.crg").is_file(),
    reason="the measured roads are data of others: set TIREROAD_ROADS to their folder",
)
FORMATS = ("LRFI", "LDFI", "KRBI", "KDBI")
# Numbers every format holds exactly enough: 1e-6 m in ten characters.
Z = np.round(np.random.default_rng(6).uniform(-0.03, 0.03, (9, 11)), 6)


def crg(
    code: str,
    z: np.ndarray,
    *,
    parameters: str = "",
    channels: str | None = None,
    blocks: str = "",
    end: bool = True,
) -> bytes:
    """An OpenCRG file with rows z; channels default to numbered long sections every 0.25 m."""
    if channels is None:
        channels = "".join(f"D:long section {i + 1},m ! note\n" for i in range(z.shape[1]))
    header = "$CT\nmade by a test\n$\n$ROAD_CRG\n"
    if "REFERENCE_LINE_INCREMENT" not in parameters:
        header += "REFERENCE_LINE_INCREMENT = 0.5 ! comment\n"
    if end:
        header += f"reference_line_start_u = 3.0\nreference_line_end_u = {3 + 0.5 * (len(z) - 1)}\n"
    if "LONG_SECTION_V" not in parameters:
        header += "LONG_SECTION_V_INCREMENT = 2.5e-1\n"
    header += f"{parameters}{blocks}"
    header += f"* a comment\n$KD_DEFINITION\n#:{code}\n{channels}$\n$$$$\n"
    return header.encode("latin-1") + payload(code, z)


def payload(code: str, z: np.ndarray) -> bytes:
    if code in ("KRBI", "KDBI"):
        kind = np.dtype(">f4" if code == "KRBI" else ">f8")
        per = 80 // kind.itemsize
        flat = np.concatenate((z.ravel(), np.full(-z.size % per, np.nan)))
        return flat.astype(kind).tobytes()
    width, per = (10, 8) if code == "LRFI" else (20, 4)
    lines = []
    for row in z:
        fields = ["*missing*".rjust(width) if np.isnan(v) else f"{v:{width}.7f}" for v in row]
        lines += ["".join(fields[k : k + per]) for k in range(0, len(fields), per)]
    return ("\n".join(lines) + "\n").encode()


def heights(file: Path, **keys: str) -> np.ndarray:
    """z at the grid's points."""
    road = read_opencrg(file, **keys)
    (x0, x1), (y0, y1) = road.extent
    x, y = np.meshgrid(np.arange(x0, x1 + 0.1, 0.5), np.arange(y0, y1 + 0.1, 0.25), indexing="ij")
    return road.height(x.ravel(), y.ravel()).reshape(x.shape)


@pytest.mark.parametrize("end", [True, False])
@pytest.mark.parametrize("code", FORMATS)
def test_formats_hold_the_same_road(tmp_path: Path, code: str, end: bool) -> None:
    file = tmp_path / "road.crg"
    file.write_bytes(crg(code, Z, end=end))
    road = read_opencrg(file)
    assert road.extent == ((0.0, 4.0), (-1.25, 1.25))
    assert np.allclose(heights(file), Z, atol=1e-8)


@pytest.mark.parametrize("code", FORMATS)
def test_narrow_binary_rows_lose_no_row_to_padding(tmp_path: Path, code: str) -> None:
    file, z = tmp_path / "road.crg", Z[:, :3]
    file.write_bytes(crg(code, z, end=False))
    assert np.allclose(heights(file), z, atol=1e-8)


@pytest.mark.parametrize("code", FORMATS)
def test_holes_survive(tmp_path: Path, code: str) -> None:
    file, z = tmp_path / "road.crg", Z.copy()
    z[4, :2] = np.nan
    file.write_bytes(crg(code, z))
    with pytest.raises(InputError, match=r"2 heights .* at x = 2 m and y = -1.25 m"):
        read_opencrg(file).prepare(0.0, 4.0, -1.25, 1.0)
    assert read_opencrg(file, holes="fill").prepare(0.0, 4.0, -1.25, 1.0).filled == 2


def test_sections_at_positions_may_come_unsorted_and_uneven(tmp_path: Path) -> None:
    file, v = tmp_path / "road.crg", [1.0, -1.0, 0.25]
    channels = "".join(f"D:long section at v = {p:.3f},m\n" for p in v)
    file.write_bytes(crg("LDFI", Z[:, :3], channels=channels))
    road = read_opencrg(file)
    assert road.extent[1] == (-1.0, 1.0)
    assert np.allclose(road.height(np.full(3, 1.0), np.array(v)), Z[2, :3], atol=1e-8)


@pytest.mark.parametrize("code", FORMATS)
@pytest.mark.parametrize("share", [0.1, 0.5, 0.7, 0.97])
@pytest.mark.parametrize("end", [True, False])
def test_truncated_files_are_refused_by_name(
    tmp_path: Path, code: str, share: float, end: bool
) -> None:
    file, data = tmp_path / "cut.crg", crg(code, Z, end=end)
    file.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=r"cut\.crg"):
        read_opencrg(file).prepare(0.0, 4.0, -1.0, 1.0)


def test_longer_than_announced_is_refused(tmp_path: Path) -> None:
    (tmp_path / "long.crg").write_bytes(crg("KRBI", Z) + bytes(80))
    with pytest.raises(InputError, match="longer than its header"):
        read_opencrg(tmp_path / "long.crg")


def test_bad_number_is_named_by_line_and_column(tmp_path: Path) -> None:
    data = crg("LRFI", Z)
    line = data[: data.index(b"$$$$")].count(b"\n") + 2
    start = data.index(b"\n", data.index(b"$$$$")) + 1
    (tmp_path / "bad.crg").write_bytes(data[: start + 10] + b"     zebra" + data[start + 20 :])
    with pytest.raises(InputError, match=f"line {line}, column 11: 'zebra'"):
        read_opencrg(tmp_path / "bad.crg")


PHI = "D:reference line phi,rad\n" + "".join(f"D:long section {i + 1},m\n" for i in range(3))


def curved(radius: float) -> np.ndarray:
    phi = np.r_[np.nan, np.pi - 0.1 + 0.5 / radius * np.arange(8)]
    return np.column_stack((np.arctan2(np.sin(phi), np.cos(phi)), Z[:, :3]))


def test_gentle_curve_is_followed_and_sharp_one_refused(tmp_path: Path) -> None:
    file = tmp_path / "curve.crg"
    file.write_bytes(crg("KDBI", curved(25.0), channels=PHI))
    assert np.allclose(heights(file), Z[:, :3], atol=1e-8)
    file.write_bytes(crg("KDBI", curved(15.0), channels=PHI))
    with pytest.raises(InputError, match="radius of 15 m"):
        read_opencrg(file)


SLOPE = PHI.replace("phi,rad", "slope,m/m")


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"parameters": "REFERENCE_LINE_START_S = 0.01\n"}, "slope is not supported"),
        ({"parameters": "REFERENCE_LINE_START_B = 0.01\n"}, "banking is not supported"),
        ({"parameters": "REFERENCE_LINE_END_Z = 1.0\n"}, "slope is not supported"),
        (
            {"parameters": "LONG_SECTION_V_INCREMENT = 1\nLONG_SECTION_V_LEFT = 9.0\n"},
            "LONG_SECTION_V_LEFT = 9",
        ),
        ({"parameters": "LONG_SECTION_V_RIGHT = -1\n"}, "V_INCREMENT is missing"),
        ({"parameters": "* REFERENCE_LINE_INCREMENT\n"}, "INCREMENT is missing"),
        ({"channels": f"U:reference line u,m,0,0.1\n{PHI}"}, "step 0.1 m, but"),
        ({"parameters": "REFERENCE_LINE_INCREMENT = 0.0\n"}, "INCREMENT = 0"),
        ({"parameters": "REFERENCE_LINE_END_U = 1e300\n"}, "not a whole number"),
        ({"parameters": "LONG_SECTION_V_RIGHT = one\n"}, "line 8: .*KEY = number"),
        ({"blocks": "$ROAD_CRG_MODS\nSCALE_CURVATURE = 2.0\n"}, "SCALE_CURVATURE = 2"),
        ({"blocks": "$ROAD_CRG_MODS\nSCALE_WIDTH = 0.0\n"}, "SCALE_WIDTH = 0 leaves no road"),
        ({"blocks": "$ROAD_CRG_FILE\nother.crg\n"}, "has a road of its own"),
        ({"code": "XRFI"}, "'XRFI'"),
        ({"channels": "D:long section 1,m\n"}, "at least 2"),
        ({"channels": "D:long section 1,m\nD:long section 3,m\n"}, "numbered 1 to 2"),
        ({"channels": "D:long section 1,m\nD:long section at v = 3,m\n"}, "at once"),
        ({"channels": "D:long section 1,mm\nD:long section 2,m\n"}, "'mm'"),
        ({"channels": SLOPE}, "reference line slope is not zero"),
    ],
)
def test_what_is_not_honoured_is_refused_by_name(tmp_path: Path, keys: dict, message: str) -> None:
    keys = {"code": "KDBI", **keys}
    width = keys.get("channels", PHI).count("D:")
    (tmp_path / "road.crg").write_bytes(crg(keys.pop("code"), Z[:, :width], **keys))
    with pytest.raises(InputError, match=message):
        read_opencrg(tmp_path / "road.crg")


def test_steps_are_taken_from_the_virtual_channel_and_the_borders(tmp_path: Path) -> None:
    channels = "U:reference line u,m,3.0,0.5\n"
    channels += "".join(f"D:long section {i + 1},m\n" for i in range(11))
    parameters = "* REFERENCE_LINE_INCREMENT\n"
    parameters += "LONG_SECTION_V_RIGHT = -1.25\nLONG_SECTION_V_LEFT = 1.25\n"
    (tmp_path / "road.crg").write_bytes(crg("KDBI", Z, parameters=parameters, channels=channels))
    assert np.allclose(heights(tmp_path / "road.crg"), Z, atol=1e-8)


def test_blocks_without_effect_on_heights_are_accepted(tmp_path: Path) -> None:
    blocks = "$ROAD_CRG_MODS\nREFLINE_OFFSET_X = 100\nSCALE_WIDTH = 1\n"
    blocks += "$ROAD_CRG_OPTS\nCHECK_EPS = 1e-5\n$\n"
    (tmp_path / "road.crg").write_bytes(crg("KDBI", Z, blocks=blocks))
    assert np.allclose(heights(tmp_path / "road.crg"), Z, atol=1e-8)


@pytest.mark.parametrize(
    "option",
    ["BORDER_MODE_U = 2", "BORDER_OFFSET_V = 0.1", "REFLINE_CONTINUATION = 1", "GRID_NAN_MODE = 2"],
)
def test_options_that_act_beyond_the_road_are_said_and_not_used(
    tmp_path: Path, option: str
) -> None:
    block = "MODS" if option.startswith("GRID") else "OPTS"
    (tmp_path / "road.crg").write_bytes(crg("KDBI", Z, blocks=f"$ROAD_CRG_{block}\n{option}\n$\n"))
    assert option in read_opencrg(tmp_path / "road.crg").notes[0]
    assert np.allclose(heights(tmp_path / "road.crg"), Z, atol=1e-8)


def test_a_rounded_step_gives_way_to_the_key(tmp_path: Path) -> None:
    """The format's writer prints three decimals of the increment in the line of the channel."""
    channels = "U:reference line u,m,0.000,0.001\n" + "".join(
        f"D:long section {i + 1},m\n" for i in range(11)
    )
    parameters = f"REFERENCE_LINE_INCREMENT = 0.0005\nREFERENCE_LINE_START_U = 0\nREFERENCE_LINE_END_U = {0.0005 * (len(Z) - 1)}\n"
    parameters += "LONG_SECTION_V_RIGHT = -1.25\nLONG_SECTION_V_LEFT = 1.25\n"
    (tmp_path / "road.crg").write_bytes(crg("KDBI", Z, parameters=parameters, channels=channels))
    assert read_opencrg(tmp_path / "road.crg").steps[0] == pytest.approx(0.0005)


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "noise.crg").write_bytes(np.random.default_rng(0).bytes(5000))
    with pytest.raises(InputError, match=r"noise\.crg"):
        read_opencrg(tmp_path / "noise.crg")
    (tmp_path / "empty.crg").write_bytes(b"")
    with pytest.raises(InputError, match=r"empty\.crg"):
        read_opencrg(tmp_path / "empty.crg")


@needs_roads
def test_handmade_roads_are_the_ones_their_comments_describe() -> None:
    straight = read_opencrg(ROADS / "handmade_straight.crg", holes="fill")
    minimal = read_opencrg(ROADS / "handmade_straight_minimalist.crg", holes="fill")
    curved_one = read_opencrg(ROADS / "handmade_curved.crg", holes="fill")
    assert straight.extent == minimal.extent == curved_one.extent == ((0.0, 22.0), (-1.5, 1.5))
    strip = (0.0, 22.0, -1.5, 1.5)
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0, 22, 300), rng.uniform(-1.5, 1.5, 300)
    assert straight.prepare(*strip).filled == 3
    assert np.array_equal(
        straight.prepare(*strip).height(x, y), minimal.prepare(*strip).height(x, y)
    )
    assert straight.height(np.array([19.0]), np.array([0.0]))[0] == pytest.approx(0.0333333)


@needs_roads
def test_belgian_block_is_driven_in_the_middle_and_has_holes_at_its_side() -> None:
    road = make_road(kind="crg", file=ROADS / "belgian_block.crg")
    assert road.road.extent == ((0.0, pytest.approx(10.0)), (-1.7, pytest.approx(1.7)))
    middle = road.prepare(0.1, 9.5, -0.1, 0.1)
    x, y = np.random.default_rng(2).uniform([0.2, -0.1], [9.5, 0.1], (2000, 2)).T
    z = middle.height(x, y)
    assert middle.filled == 0 and np.all(np.abs(z) < 0.08) and 5e-3 < z.std() < 5e-2
    with pytest.raises(InputError, match="heights are missing"):
        make_road(kind="crg", file=ROADS / "belgian_block.crg", lateral=-1.5).prepare(
            0.1, 9.5, -0.1, 0.1
        )


@needs_roads
@pytest.mark.parametrize("share", [0.003, 0.5, 0.999])
def test_belgian_block_truncated(tmp_path: Path, share: float) -> None:
    data = (ROADS / "belgian_block.crg").read_bytes()
    (tmp_path / "cut.crg").write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=r"cut\.crg"):
        read_opencrg(tmp_path / "cut.crg")


REFERENCE = "$CT\nreference\n$ROAD_CRG_FILE   ! reference\n  {}  ! path\n$ROAD_CRG_MODS\n{}$\n"


@pytest.mark.parametrize(
    "name", ["sub/other.crg", "sub\\other.crg", "'sub/other.crg'", "sub/again.crg"]
)
def test_a_reference_is_followed_with_its_modifiers(tmp_path: Path, name: str) -> None:
    """The road is that of the other file: twice as high, half as long, three times as wide; its own modifiers hold, too."""
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "other.crg").write_bytes(
        crg("LRFI", Z, blocks="$ROAD_CRG_MODS\nSCALE_WIDTH = 3\n")
    )
    (tmp_path / "sub" / "again.crg").write_text(REFERENCE.format("other.crg", ""))
    (tmp_path / "road.crg").write_text(
        REFERENCE.format(name, "scale_z_grid = 2.0\nSCALE_LENGTH = 0.5\n")
    )
    road = read_opencrg(tmp_path / "road.crg")
    assert road.extent_of_file == pytest.approx((2.0, 7.5))
    x, y = np.meshgrid(0.25 * np.arange(9), 0.75 * (np.arange(11) - 5), indexing="ij")
    np.testing.assert_allclose(road.height(x, y), 2 * Z, atol=1e-7)
    assert any("refers to" in note for note in road.notes)
    surface = KINDS.make("crg", file=str(tmp_path / "road.crg"))
    assert len(surface.files) == (3 if "again" in name else 2)


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        (REFERENCE.format("none.crg", ""), "", "line 4: refers to none.crg, and there is no file"),
        (REFERENCE.format("b.crg", ""), REFERENCE.format("a.crg", ""), "refers to itself"),
        (REFERENCE.format("a.crg", ""), "", "refers to itself"),
        (
            REFERENCE.format("b.crg", "SCALE_WIDTH = 2\n"),
            REFERENCE.format("c.crg", "SCALE_WIDTH = 3\n"),
            "SCALE_WIDTH = 3, and 2 in a file that refers to it",
        ),
        (REFERENCE.format("b.crg\nc.crg", ""), "", "names 2 files"),
    ],
)
def test_a_reference_that_leads_nowhere(
    tmp_path: Path, first: str, second: str, message: str
) -> None:
    (tmp_path / "a.crg").write_text(first)
    (tmp_path / "b.crg").write_text(second)
    (tmp_path / "c.crg").write_bytes(crg("LRFI", Z))
    with pytest.raises(InputError, match=message):
        read_opencrg(tmp_path / "a.crg")


def test_codes_in_an_opencrg_file(tmp_path: Path) -> None:
    z = np.random.default_rng(3).normal(0, 2e-3, (30, 11))
    z[5:8, 3:6] = -9.999
    (tmp_path / "road.crg").write_bytes(crg("KDBI", z))
    with pytest.raises(
        InputError, match=r"exactly -9.999 \(9, the first at .*missing = \[-9.999\]"
    ):
        read_opencrg(tmp_path / "road.crg")
    road = read_opencrg(tmp_path / "road.crg", holes="fill", missing=(-9.999,))
    assert road.prepare(0, 14.5, -1.25, 1.25).filled == 9
    assert read_opencrg(tmp_path / "road.crg", missing=()).lowest(0, 14.5, -1, 1) == pytest.approx(
        -9.999
    )


@pytest.mark.parametrize("unit", ["mm", "cm", "in", "rad"])
def test_a_reference_line_in_another_unit_is_refused(tmp_path: Path, unit: str) -> None:
    """Its unit was passed over: a road of 1.2 m was read, whatever it said."""
    sections = "".join(f"D:long section {i + 1},m\n" for i in range(Z.shape[1]))
    file = tmp_path / "road.crg"
    file.write_bytes(crg("LRFI", Z, channels=f"U:reference line u,{unit},3,0.5\n{sections}"))
    with pytest.raises(InputError, match=f"reference line u is in '{unit}'"):
        read_opencrg(file)
    file.write_bytes(crg("LRFI", Z, channels=f"U:reference line u,m,3,0.5\n{sections}"))
    assert read_opencrg(file).steps[0] == 0.5


def test_a_modifier_among_the_options_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "road.crg"
    file.write_bytes(crg("LRFI", Z, blocks="$ROAD_CRG_OPTS\nscale_z_grid = 2\n"))
    with pytest.raises(InputError, match="ROAD_CRG_OPTS SCALE_Z_GRID = 2 is not supported"):
        read_opencrg(file)
