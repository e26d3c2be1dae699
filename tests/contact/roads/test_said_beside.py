"""What stands beside the numbers in rarer words: units, factors, directions, axes and masks; read right, or refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from tireroad.contact.roads.grid_file import read_grid
from tireroad.contact.roads.meaning import unit_of
from tireroad.contact.roads.missing import codes
from tireroad.contact.roads.profile_file import Profile, ProfileKeys, read_profile
from tireroad.fem.errors import InputError

X = 1e-3 * np.arange(120)
Z = 1e-3 * np.sin(X / 0.003) + 1e-6 * np.arange(120)  # m
UNITS = {
    "10^-6 m": 1e-6, "10⁻⁶ m": 1e-6, "1/100 mm": 1e-5, "x0.1mm": 1e-4, "tenths of mm": 1e-4, "milli-meter": 1e-3,
    "hundredths of an inch": 2.54e-4, "thou": 2.54e-5, "0,1 mm": 1e-4,
}  # fmt: skip


def profile(path: Path, head: str, x: float = 1e-3, z: float = 1e-3, **given: Any) -> Profile:
    """The profile X, Z in units of x and z m under lines of text."""
    rows = "".join(f"{a / x:.9g};{b / z:.9g}\n" for a, b in zip(X, Z, strict=True))
    (path / "road.csv").write_text(head + rows, encoding="utf-8")
    return read_profile(path / "road.csv", "F", ProfileKeys(**given))


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("form", ["z [{}]", "z ({})", "z / {}", "z_{}", "z in {}"])
def test_units_with_a_factor(tmp_path: Path, unit: str, form: str) -> None:
    found = profile(tmp_path, f"x [mm];{form.format(unit)}\n", z=UNITS[unit])
    np.testing.assert_allclose(found.heights, Z, atol=1e-9)
    np.testing.assert_allclose(found.x, X, atol=1e-9)


@pytest.mark.parametrize("unit", ["e-3 m", "10-6 m", "mm x 10", "mm/10", "furlong", "per mm"])
@pytest.mark.parametrize("form", ["z [{}]", "z / {}", "z_{}", "z in {}"])
def test_half_a_unit_is_none(tmp_path: Path, unit: str, form: str) -> None:
    with pytest.raises(InputError, match="unit"):
        profile(tmp_path, f"x [mm];{form.format(unit)}\n")


@pytest.mark.parametrize(
    "head",
    [
        "# z: um\nx [mm];z [mm]\n", "# x: mm; z: um\nx [mm];z [mm]\n", "mm;um\nx [mm];z [mm]\n", "# Units: um\nx [mm];z [mm]\n",
        "# all values in um\nx [mm];z [mm]\n", "# measured in millimeters and micrometers\nx;z\n", "Ordinate [um]\nx [mm];z [mm]\n",
        "# LSB = 0.1 um\nx [mm];z [mm]\n", "1 digit = 0.1 mm\nx [mm];z [mm]\n", "# multiply by 0.1\nx [mm];z [mm]\n",
        "# divide by 10 for mm\nx [mm];z [mm]\n", "# z = value * 0.1 mm\nx [mm];z [mm]\n", "x [mm];z*1000 [mm]\n",
        "x [mm];Height (x 10) [mm]\n", "# Intensity unit: um\nx;z\n",
    ],
)  # fmt: skip
def test_what_contradicts_or_multiplies_is_refused(tmp_path: Path, head: str) -> None:
    with pytest.raises(InputError, match="which is right|may state units or a factor|unit"):
        profile(tmp_path, head)


@pytest.mark.parametrize(
    "head",
    [
        "# depth positive downwards\nx [mm];z [mm]\n", "# z axis points down\nx;z\n", "Positive direction: down\nx [mm];z [mm]\n",
        "# heights inverted\nx [mm];z [mm]\n", "x [mm];z [mm] (down)\n", "x [mm];distance to surface [mm]\n",
        "x [mm];stand-off [mm]\n", "# distance from sensor to road\nx [mm];z [mm]\n",
    ],
)  # fmt: skip
def test_heights_counted_downwards_are_refused(tmp_path: Path, head: str) -> None:
    with pytest.raises(InputError, match="downwards|2 numbers under"):
        profile(tmp_path, head)


def test_a_depth_is_taken_upwards_with_a_word(tmp_path: Path) -> None:
    found = profile(tmp_path, "x [mm];Depth [mm]\n")
    assert any("taken upwards: assumed" in note for note in found.notes)


@pytest.mark.parametrize(
    "head", ["Speed: 80 km/h\nLength: 1 m\n", "Resolution: 0.1 um\n", "Count: 120\n"]
)
def test_lines_about_something_else(tmp_path: Path, head: str) -> None:
    np.testing.assert_allclose(profile(tmp_path, head + "x [mm];z [mm]\n").heights, Z, atol=1e-9)


@pytest.mark.parametrize("name", ["Sample #", "SeqNo", "Zähler", "OID", "pulse", "rownames", "n°"])
@pytest.mark.parametrize("first", [0, 1, 100])
def test_a_column_that_counts_by_any_name(tmp_path: Path, name: str, first: int) -> None:
    rows = "".join(f"{k + first};{1e3 * z:.6f}\n" for k, z in enumerate(Z))
    (tmp_path / "road.csv").write_text(f"{name};z [mm]\n{rows}", encoding="utf-8")
    with pytest.raises(InputError, match=r"road\.pitch"):
        read_profile(tmp_path / "road.csv", "F")
    found = read_profile(tmp_path / "road.csv", "F", ProfileKeys(pitch=1e-3))
    assert found.x is None
    np.testing.assert_allclose(found.heights, Z, atol=1e-9)


def test_no_rows_of_numbers_are_told_with_the_word(tmp_path: Path) -> None:
    rows = "".join(f"{1e3 * a:.1f} mm;{1e3 * b:.3f} mm\n" for a, b in zip(X, Z, strict=True))
    (tmp_path / "road.csv").write_text(rows)
    with pytest.raises(InputError, match="line 120 .* is no number"):
        read_profile(tmp_path / "road.csv", "F")


Y = 0.02 * (np.arange(6) - 2)
G = 1e-3 * np.sin(X[:, None] / 0.004 + 9 * Y)  # m


def matrix(path: Path, corner: str, above: str = "") -> Path:
    lines = [";".join([corner, *(f"{1e3 * y:.1f}" for y in Y)])]
    lines += [
        ";".join(f"{1e3 * one:.6f}" for one in (x, *row)) for x, row in zip(X, G, strict=True)
    ]
    file = path / "road.csv"
    file.write_text(above + "\n".join(lines) + "\n", encoding="utf-8")
    return file


@pytest.mark.parametrize("corner", ["x [mm]", "x/y [mm]", "x (mm)", "x\\y [mm]", "x_mm"])
def test_the_unit_in_a_corner_is_read(tmp_path: Path, corner: str) -> None:
    file = matrix(tmp_path, corner)
    with pytest.raises(InputError, match=r"not beside the heights: say road\.height_unit"):
        read_grid(file)
    grid = read_grid(file, height_unit="mm")
    assert grid.extent_of_file == pytest.approx((X[-1], Y[-1] - Y[0]))
    every = read_grid(matrix(tmp_path, "x,y,z [mm]"))
    assert [reading.unit[:2] for reading in every.readings] == ["mm"] * 3


@pytest.mark.parametrize(
    "corner", ["y", "y/x", "y\\x", "lateral", "y [mm]", "x->", "x across", "t", "t [s]"]
)
def test_a_corner_that_puts_y_or_time_down_is_refused(tmp_path: Path, corner: str) -> None:
    with pytest.raises(InputError, match="by the corner"):
        read_grid(matrix(tmp_path, corner), length_unit="mm", height_unit="mm")


def store(path: Path, z: np.ndarray, attributes: dict[str, Any], **more: Any) -> Path:
    file = path / f"road{len(list(path.iterdir()))}.h5"
    with h5py.File(file, "w") as out:
        out["x"], out["y"], out["z"] = X, Y, z
        out["z"].attrs.update(attributes)
        for name, value in more.items():
            out[name] = value
    return file


@pytest.mark.parametrize(
    "name", ["unit_z", "uom", "Unit of z", "DIMENSION_UNITS", "z-units", "Units"]
)
def test_attributes_that_name_a_unit(tmp_path: Path, name: str) -> None:
    grid = read_grid(store(tmp_path, 10 * G, {name: "dm"}))
    assert grid.readings[2].unit.startswith("dm")
    with pytest.raises(InputError, match="no unit that is known"):
        read_grid(store(tmp_path, G, {name: "furlong"}))


@pytest.mark.parametrize(
    "attributes",
    [{"long_name": "height in cm"}, {"comment": "heights [cm]"}, {"positive": "-z"}, {"lsb": 0.5}, {"offset": 0.1},
     {"long_name": "depth below datum"}, {"conversion": 2.0}],
)  # fmt: skip
def test_attributes_that_may_change_heights(tmp_path: Path, attributes: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="unit|neither up nor down|may be|downwards"):
        read_grid(store(tmp_path, G, attributes))


def test_a_mask_by_another_name_is_refused(tmp_path: Path) -> None:
    for name in ("valid", "quality", "nodata_mask"):
        with pytest.raises(InputError, match="name it mask"):
            read_grid(store(tmp_path, G, {}, **{name: G > 0}))
        np.savez(tmp_path / "road.npz", x=X, y=Y, z=G, **{name: G > 0})
        with pytest.raises(InputError, match="name it mask"):
            read_grid(tmp_path / "road.npz")


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("kind", [int, float])
def test_positions_that_count_are_refused_in_every_format(
    tmp_path: Path, kind: type, first: int
) -> None:
    """0, 1, 2, ... is an index as much as a metre; with a unit, or as another ramp, it is a length."""
    x = (first + np.arange(120)).astype(kind)
    np.savez(tmp_path / "road.npz", x=x, y=Y, z=G)
    with pytest.raises(InputError, match=r"may count the heights.*road\.length_unit"):
        read_grid(tmp_path / "road.npz")
    assert read_grid(tmp_path / "road.npz", length_unit="m", height_unit="m").steps[0] == 1.0
    with h5py.File(tmp_path / "road.h5", "w") as out:
        out["x"], out["y"], out["z"] = x, Y, G
        for name in "xyz":
            out[name].attrs["units"] = "m"
    assert read_grid(tmp_path / "road.h5").steps[0] == 1.0
    for ramp in (x + 5, x - 60, 0.5 * x, 2 * x):
        np.savez(tmp_path / "road.npz", x=ramp, y=Y, z=G)
        grid = read_grid(tmp_path / "road.npz")
        assert grid.measured == (ramp[0], ramp[-1])
        assert any("in m: assumed" in note for note in grid.notes)


@pytest.mark.parametrize("code", [-999.0, -99.0, 888.8, -999.25, 99.99, -9.99])
@pytest.mark.parametrize("share", [0.33, 0.6])
def test_codes_that_many_heights_have(code: float, share: float) -> None:
    """A third of all heights was the ground of a road, 999 m below it."""
    rng = np.random.default_rng(1)
    z = 1e-3 * rng.standard_normal((60, 40))
    z[rng.random(z.shape) < share] = code
    assert codes(z, 1.0) == [code]


def test_one_height_far_away() -> None:
    """An outlier of a profile; on a grid nothing removes it."""
    z = 1e-3 * np.random.default_rng(1).standard_normal((60, 40))
    z[20, 10] = -9.99
    assert codes(z, 1.0, single=True) == [-9.99]
    assert codes(z, 1.0) == []


def test_powers_and_parts_are_units() -> None:
    for text, metres in UNITS.items():
        found = unit_of(text)
        assert found is not None and found.metres == pytest.approx(metres), text
    assert unit_of("25 mm") is None and unit_of("10-6 m") is None


@pytest.mark.parametrize(
    ("unit", "metres"),
    [("millimètres", 1e-3), ("centimètres", 1e-2), ("milímetros", 1e-3), ("Zentimeter", 1e-2), ("decimetri", 0.1),
     ("mikrometr", 1e-6), ("Kilometers", 1e3), ("milli-metres", 1e-3), ("Fuß", 0.3048), ("′", 0.3048), ("″", 0.0254)],
)  # fmt: skip
@pytest.mark.parametrize("form", ["z [{}]", "z «{}»", "z [[{}]]", "z / {}"])
def test_units_in_the_languages_of_europe(
    tmp_path: Path, unit: str, metres: float, form: str
) -> None:
    found = profile(tmp_path, f"x [mm];{form.format(unit)}\n", z=metres)
    np.testing.assert_allclose(found.heights, Z, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize(
    "title",
    ["cm Profile", "Profile.cm", "profilecm", "Profilecentimetres", "m. Profile", 
     "Profile [cm] x 10", "Profile~cm", "Profile 0.1 [cm x 10]"],
)  # fmt: skip
def test_a_unit_in_an_unusual_place_is_refused(tmp_path: Path, title: str) -> None:
    with pytest.raises(InputError, match="may be their unit|no unit that is known"):
        profile(tmp_path, f"x [mm];{title}\n", z=1e-2)


def test_titles_are_not_shifted(tmp_path: Path) -> None:
    """A last column without a title; a unit alone that takes the place of a title."""
    rows = [f"{1e3 * b:.6f}|{1e3 * a:.1f}|{k}" for k, (a, b) in enumerate(zip(X, Z, strict=True))]
    (tmp_path / "road.csv").write_text('"Height [mm]"|"Weg [mm]"|""\n' + "\n".join(rows))
    np.testing.assert_allclose(read_profile(tmp_path / "road.csv", "F").heights, Z, atol=1e-9)
    rows = [
        f"{k} {1e3 * a:.1f} {1e3 * b:.6f} 0.1" for k, (a, b) in enumerate(zip(X, Z, strict=True))
    ]
    (tmp_path / "road.csv").write_text(" Distance Texture accel [m/s2]\n" + "\n".join(rows))
    with pytest.raises(InputError, match="headings|columns"):
        read_profile(tmp_path / "road.csv", "F")


@pytest.mark.parametrize(
    "name", ["z_err", "std_z", "height uncertainty [um]", "sigma", "height error"]
)
def test_how_exact_heights_are_is_no_height(tmp_path: Path, name: str) -> None:
    rows = "".join(f"{1e3 * a:.1f};{1e3 * b:.6f};0.5\n" for a, b in zip(X, Z, strict=True))
    (tmp_path / "road.csv").write_text(f"x [mm];Macrotexture [mm];{name}\n{rows}")
    np.testing.assert_allclose(read_profile(tmp_path / "road.csv", "F").heights, Z, atol=1e-9)


def test_a_column_of_flags_is_refused_where_it_changes(tmp_path: Path) -> None:
    for flags in (np.ones(120), np.arange(120) % 7 > 0):
        rows = "".join(
            f"{1e3 * a:.1f};{1e3 * b:.6f};{int(c)}\n" for a, b, c in zip(X, Z, flags, strict=True)
        )
        (tmp_path / "road.csv").write_text(f"x [mm];z [mm];valid\n{rows}")
        if flags.all():
            np.testing.assert_allclose(
                read_profile(tmp_path / "road.csv", "F").heights, Z, atol=1e-9
            )
        else:
            with pytest.raises(InputError, match='"valid" may say which heights are missing'):
                read_profile(tmp_path / "road.csv", "F")


@pytest.mark.parametrize("word", ["", "#N/A", "#WERT!", "#DIV/0!"])
def test_a_height_that_is_missing_in_a_single_column(tmp_path: Path, word: str) -> None:
    """Empty lines and words that begin like a comment were left out, which moved all heights behind them."""
    rows = [f"{1e3 * z:.6f}" for z in Z]
    rows[40:43] = [word] * 3
    (tmp_path / "road.csv").write_text("z [mm]\n" + "\n".join(rows) + "\n\n")
    if not word:
        with pytest.raises(InputError, match="line 4[1-4]: is empty"):
            read_profile(tmp_path / "road.csv", "F", ProfileKeys(pitch=1e-3))
        (tmp_path / "road.csv").write_text("z [mm]\n\n" + "\n\n".join(rows[:40]) + "\n\n")
        assert len(read_profile(tmp_path / "road.csv", "F", ProfileKeys(pitch=1e-3)).heights) == 40
        return
    found = read_profile(tmp_path / "road.csv", "F", ProfileKeys(pitch=1e-3)).heights
    assert np.flatnonzero(np.isnan(found)).tolist() == [40, 41, 42]


def test_a_pitch_that_contradicts_x_is_refused(tmp_path: Path) -> None:
    assert profile(tmp_path, "x [mm];z [mm]\n", pitch=1e-3).x is not None
    with pytest.raises(InputError, match=r"heights are every 1 mm .* road\.pitch = 0\.002 m"):
        profile(tmp_path, "x [mm];z [mm]\n", pitch=2e-3)


@pytest.mark.parametrize(
    "line",
    [
        "first row x, first column y",
        "rows: y, columns: x",
        "x across, y down",
        "rows = y, columns = x",
    ],
)
def test_a_line_that_puts_y_down_is_refused(tmp_path: Path, line: str) -> None:
    with pytest.raises(InputError, match="the first column is y"):
        read_grid(matrix(tmp_path, "", f"# {line}\n"), length_unit="mm", height_unit="mm")
    for fine in ("first column x, first row y", "rows: x, columns: y", "x down, y across"):
        read_grid(matrix(tmp_path, "", f"# {fine}\n"), length_unit="mm", height_unit="mm")


@pytest.mark.parametrize("corner", ["x y z / mm mm um", "x/y [mm] z [um]", "x [mm] z [foo]"])
def test_a_corner_of_two_units_is_refused(tmp_path: Path, corner: str) -> None:
    with pytest.raises(InputError, match="more than one unit"):
        read_grid(matrix(tmp_path, corner))


@pytest.mark.parametrize(
    ("titles", "order"),
    [("transverse position;vzdálenost;hauteur", "yxz"), ("No;Distance;width;výška", "kxyz"), ("lateral distance;x;z", "yxz")],
)  # fmt: skip
def test_points_under_other_names(tmp_path: Path, titles: str, order: str) -> None:
    """One name that is not known is what is left over; a list with an index was read as a matrix."""
    rows = []
    for x, row in zip(X, G, strict=True):
        for y, z in zip(Y, row, strict=True):
            of = {"k": f"{len(rows)}", "x": f"{x:.4f}", "y": f"{y:.3f}", "z": f"{z:.9f}"}
            rows.append(";".join(of[one] for one in order))
    (tmp_path / "road.csv").write_text("\n".join([titles, *rows]), encoding="utf-8")
    grid = read_grid(tmp_path / "road.csv")
    np.testing.assert_allclose(grid.height(X[:, None] + 0 * Y, Y + 0 * X[:, None]), G, atol=1e-9)
    (tmp_path / "road.csv").write_text("\n".join(rows))
    if order == "kxyz":
        with pytest.raises(InputError, match="name them"):
            read_grid(tmp_path / "road.csv")


@pytest.mark.parametrize(
    "beside",
    [{"meta": '{"units": {"x": "mm", "z": "um"}}'}, {"meta": '{"x_unit": "millim\\u00e8tres"}'}, {"readme": "all lengths in mm"},
     {"labels": ["x (mm)", "y (mm)", "z (um)"]}, {"m_per_unit_x": 0.001}, {"to_metres": [1e-3, 1e-3, 1e-6]}, {"zero_level": 0.01},
     {"orientation": "down"}, {"sign": "inverted"}, {"calibration": 0.01}, {"dimension": "cm"}],
)  # fmt: skip
def test_entries_that_may_change_lengths_or_heights(tmp_path: Path, beside: dict[str, Any]) -> None:
    np.savez(tmp_path / "road.npz", x=X, y=Y, z=G, **beside)
    with pytest.raises(InputError, match="unit|may be|downwards"):
        read_grid(tmp_path / "road.npz")
    with h5py.File(tmp_path / "road.h5", "w") as out:  # as datasets beside z
        out["x"], out["y"], out["z"] = X, Y, G
        for name, value in beside.items():
            out[name] = value
    with pytest.raises(InputError, match="unit|may be|downwards"):
        read_grid(tmp_path / "road.h5")


def test_units_of_three_arrays_in_one_entry(tmp_path: Path) -> None:
    np.savez(tmp_path / "road.npz", x=1e2 * X, y=1e2 * Y, z=1e3 * G, units=["cm", "cm", "mm"])
    grid = read_grid(tmp_path / "road.npz")
    np.testing.assert_allclose(grid.height(X[:, None] + 0 * Y, Y + 0 * X[:, None]), G, atol=1e-9)
    np.savez(
        tmp_path / "road.npz",
        x=X,
        y=Y,
        z=1e3 * G,
        lateral_unit="m",
        vertical_unit="mm",
        speed_unit="m/s",
    )
    grid = read_grid(tmp_path / "road.npz")
    np.testing.assert_allclose(grid.height(X[:, None] + 0 * Y, Y + 0 * X[:, None]), G, atol=1e-9)


def test_whole_numbers_with_a_factor_that_is_not_known(tmp_path: Path) -> None:
    counts = np.round(G / 1e-7).astype(np.int16)
    with pytest.raises(InputError, match="whole numbers, and z_per_bit of z|may be a factor"):
        read_grid(store(tmp_path, counts, {"z_per_bit": 1e-7}))
    with pytest.raises(
        InputError, match="whole numbers, and height_of_one of z = 1e-07 may be their factor"
    ):
        read_grid(store(tmp_path, counts, {"height_of_one": 1e-7}))
    counts[40:43, 2] = -32768
    with pytest.raises(InputError, match="-32768"):
        read_grid(store(tmp_path, counts, {"scale_factor": 1e-7}))
    assert read_grid(
        store(tmp_path, counts, {"scale_factor": 1e-7, "bad_value": -32768}), holes="fill"
    )
