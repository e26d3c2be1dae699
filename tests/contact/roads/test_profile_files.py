"""Profiles as other programs write them: separators, commas, headings, codes for missing heights, units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tireroad.contact.roads.profile_file import ProfileKeys, read_profile
from tireroad.contact.roads.road import ROADS
from tireroad.fem.errors import InputError

X = 0.5 * np.arange(400)
Z = np.round(np.random.default_rng(4).standard_normal(400).cumsum() * 0.05 - 3, 3)


def lines(form: str, comma: bool = False) -> list[str]:
    found = [
        form.format(x=f"{x:.3f}", z=f"{z:.3f}", n=n)
        for n, (x, z) in enumerate(zip(X, Z, strict=True), 1)
    ]
    return [line.replace(".", ",") for line in found] if comma else found


def read(path: Path, text: str | bytes, **more):
    file = path / "line.csv"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_profile(file, "road.file line.csv", ProfileKeys(**more))


@pytest.mark.parametrize(
    "text",
    [
        "\n".join(lines("{x},{z}")),
        "\r\n".join(lines("{x};{z};")),
        "\r".join(lines("{x}\t{z}")),
        "\n".join(lines("  {x}   {z}")),
        "\n".join(lines("{x};{z}", comma=True)),
        "\n".join(lines("{x} {z}", comma=True)),
        "# measured\nx,z\nmm,mm\n" + "\n".join(lines("{x},{z}")),
        "Road\tX1\nDate\t11/10/2021\nPoint\tDistance (mm)\tDepth (mm)\n"
        + "\n".join(lines("{n}.000\t{x}\t{z}")),
        "z;Abstand;n\n" + "\n".join(lines("{z};{x};{n}")),
        "\n".join(lines("{n} {x} {z}")),
        "\n".join(reversed(lines("{x},{z}"))),
        "\n".join([*lines("{x},{z}")[:7], lines("{x},{z}")[6], *lines("{x},{z}")[7:]]),
        "Abstand [mm];Höhe [µm]\n".encode("cp1252") + "\n".join(lines("{x};{z}", comma=True)).encode(),
        "\n".join(lines("{x},{z}")).encode("utf-16"),
    ],
    ids=[
        "commas", "semicolons", "tabs", "spaces", "semicolons-comma", "spaces-comma", "units", "three-named",
        "height-first", "counted", "descending", "twice", "cp1252", "utf-16",
    ],
)  # fmt: skip
def test_the_same_profile_in_other_words(tmp_path: Path, text: str | bytes) -> None:
    found = read(tmp_path, text)
    np.testing.assert_allclose(found.x, 1e-3 * X)
    np.testing.assert_allclose(found.heights, (1e-6 if "µ" in str(found.readings) else 1e-3) * Z)


def test_one_column_with_decimal_commas(tmp_path: Path) -> None:
    found = read(tmp_path, "\n".join(lines("{z}", comma=True)))
    assert found.x is None
    np.testing.assert_allclose(found.heights, 1e-3 * Z)
    with pytest.raises(InputError, match="decimal comma or two"):
        read(tmp_path, "\n".join(f"{k},{500 + k}" for k in range(100)))


@pytest.mark.parametrize(
    "word", ["nan", "", "1.#QNAN", "-1.#IND", "1.#INF", "NA", "null", "-", "NaN(0x8)", "inf"]
)
def test_words_for_a_missing_height(tmp_path: Path, word: str) -> None:
    text = lines("{x},{z}")
    for k in (10, 11, 200):
        text[k] = f"{X[k]:.3f},{word}"
    found = read(tmp_path, "\n".join(text))
    assert np.flatnonzero(np.isnan(found.heights)).tolist() == [10, 11, 200]


@pytest.mark.parametrize("code", ["-9999", "0", "99.99", "-32768"])
def test_codes_for_missing_heights_are_named_and_taken(tmp_path: Path, code: str) -> None:
    text = lines("{x},{z}")
    for k in (*range(10, 14), *range(100, 103), *range(300, 305)):
        text[k] = f"{X[k]:.3f},{code}"
    with pytest.raises(InputError, match=rf"exactly {code} .*line 11.*road.missing = \[{code}\]"):
        read(tmp_path, "\n".join(text))
    found = read(tmp_path, "\n".join(text), missing=[float(code)])
    assert np.isnan(found.heights).sum() == 12


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,1\n0.5,2\n1.0,3\n1.5,abc\n2,4\n", "line 4: 'abc' is not a number"),
        ("0,1\n0.5,2\n1.0,3\n1.5,4,5\n2,4\n", "line 4: 3 values where"),
        ("a,b,c\n1,2,3\n2,5,6\n7,8,9\n", "headings that name one column"),
        ("nan\nnan\nnan\nnan\n", "none of the 4 heights"),
        ("words\nand words\n", "too few"),
        (b"\0\1\2\3" * 100, "not a text file"),
        (b"\xff\xfe\x00", "not a text file"),
    ],
)
def test_what_is_none_is_refused_with_its_line(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)


def road(path: Path, text: str, **more):
    file = path / "line.csv"
    file.write_text(text)
    return ROADS.make("laser", file=str(file), across="ruts", **more).make()


def test_units_that_no_road_has(tmp_path: Path) -> None:
    """Micrometres and metres read as millimetres; said aloud they are taken."""
    for factor, unit in ((1e3, "um"), (1e-3, "m")):
        text = "\n".join(f"{x},{z * factor:.9g}" for x, z in zip(X, Z, strict=True))
        with pytest.raises(InputError, match=f'height_unit = "{unit}"'):
            road(tmp_path, text)
        assert road(tmp_path, text, height_unit=unit)
        assert road(tmp_path, text, height_unit="mm", outlier=1e6)


@pytest.mark.parametrize(
    "said",
    [
        "# Sampling interval 0.25 mm",
        "# pitch [mm]: 0.25",
        "dx = 250 um",
        "Abtastabstand: 0,025 cm",
        "# step 1/4",
    ],
)
def test_the_distance_that_a_file_states(tmp_path: Path, said: str) -> None:
    """It goes before 0.04 mm; road.pitch must not contradict it; without a unit that is known it is refused."""
    text = f"{said}\n# heights in mm\n" + "\n".join(f"{z:.3f}" for z in Z)
    if "1/4" in said:
        with pytest.raises(InputError, match="may state the distance between heights"):
            road(tmp_path, text)
        assert road(tmp_path, text, pitch=2.5e-4).extent_of_file[0] == pytest.approx(
            0.09975, abs=3e-4
        )
        return
    made = road(tmp_path, text)
    assert made.extent_of_file[0] == pytest.approx(0.09975, abs=3e-4)
    assert not any("assumed" in note for note in made.notes)
    with pytest.raises(InputError, match=r"every 0.25 mm by line 1, and road.pitch = 0.001 m"):
        road(tmp_path, text, pitch=1e-3)


@pytest.mark.parametrize(
    ("head", "row", "message"),
    [
        ("x [mm],z [s]", "{x},{z}", "heights are in s .*which is a time"),
        ("t [s];z [mm]", "{x};{z}", "is a time, and no column holds the distance"),
        ("sample,height [mm]", "{n},{z}", "counts the heights.*road.pitch"),
        (
            "x [furlong],z [mm]",
            "{x},{z}",
            '"furlong" in the heading .* is no unit that is known.*road.length_unit',
        ),
        ("x [mm],z", "{x},{z}", "a unit stands beside one column.*road.height_unit"),
        ("# scale: 10\nx [mm],z [mm]", "{x},{z}", "scale: 10.*may state units or a factor"),
        ("# units: mm\nx [cm],z [cm]\nmm,mm", "{x},{z}", "cm and mm"),
        ("distance, height [mm], height [mm]", "{x},{z},{z}", "under 'distance'"),
    ],
)
def test_what_a_file_leaves_open_is_refused(
    tmp_path: Path, head: str, row: str, message: str
) -> None:
    rows = [
        row.format(x=f"{x:.3f}", z=f"{z:.3f}", n=n)
        for n, (x, z) in enumerate(zip(X, Z, strict=True))
    ]
    with pytest.raises(InputError, match=message):
        road(tmp_path, "\n".join([head, *rows]))


def test_a_statement_below_the_first_number_is_refused(tmp_path: Path) -> None:
    text = "x [mm],z [mm]\n" + "\n".join(lines("{x},{z}"))
    for said in ("# units: cm", "# scale = 10", "# z [um]", "# NODATA_value -9999"):
        with pytest.raises(InputError, match="among the numbers"):
            road(tmp_path, f"{text}\n{said}\n")
    assert road(tmp_path, f"{text}\n# end of file\n")


def test_a_key_that_contradicts_the_file_is_refused_with_both(tmp_path: Path) -> None:
    text = "x [mm],z [mm]\n" + "\n".join(lines("{x},{z}"))
    with pytest.raises(
        InputError, match=r'x are in mm .heading "x \[mm\]"., and road.length_unit = "cm"'
    ):
        road(tmp_path, text, length_unit="cm")
    assert road(tmp_path, text, length_unit="mm", height_unit="mm")


def test_rounded_places_are_even(tmp_path: Path) -> None:
    """Every 0.05 mm, written to 0.1 mm; the step is that of the ends."""
    text = "\n".join(f"{k * 5e-5:.4f},{z}" for k, z in enumerate(np.tile(Z, 5)))
    made = road(tmp_path, text, length_unit="m")
    assert any("rounded" in note for note in made.notes)
    with pytest.raises(InputError, match="line 205: x must ascend in even steps"):
        rows = text.split("\n")
        road(tmp_path, "\n".join(rows[:204] + rows[280:]), length_unit="m")


def test_steep_stones_are_no_outliers(tmp_path: Path) -> None:
    """Flanks of 60 deg and tips of 2 mm every 1 mm stay; a spike of 5 mm goes."""
    x = np.arange(3000.0)
    z = 1.5 * np.abs((x / 4) % 2 - 1) * ((x // 40) % 2)
    spiked = z.copy()
    spiked[1502] += 5.0
    for heights, count in ((z, "0 outliers"), (spiked, "1 outliers")):
        made = road(tmp_path, "\n".join(f"{a},{b:.4f}" for a, b in zip(x, heights, strict=True)))
        assert any(count in note for note in made.notes)


def test_points_that_part_thousands_are_refused(tmp_path: Path) -> None:
    """5.003 among 512 is 5003: it was read as 5."""
    z = np.round(2500 * np.sin(np.arange(200) / 9)).astype(int)
    rows = [f"{k};{one:,}".replace(",", ".") for k, one in enumerate(z)]
    (tmp_path / "road.csv").write_text("x [mm];z [um]\n" + "\n".join(rows))
    with pytest.raises(InputError, match="part thousands"):
        read_profile(tmp_path / "road.csv", "F")
    for digits in (3, 4):  # as programs that drop trailing zeros write them
        rows = [f"{k};{round(one / 7, digits):g}" for k, one in enumerate(z)]
        (tmp_path / "road.csv").write_text("x [mm];z [um]\n" + "\n".join(rows))
        assert len(read_profile(tmp_path / "road.csv", "F").heights) == 200
