"""export --tir of a run, read again by fit."""

from __future__ import annotations

import json
import re
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic_results import sealed, write_results

from tireroad.fem.errors import InputError
from tireroad.runs.cli import main
from tireroad.runs.files.tir import parsed
from tireroad.runs.fit import read

SCENE = """[tire]
section = "radial"
segments = 12
elements_arc = 12
[static]
inflation = 2.2e5
load = 3000.0
error_estimate = false
[stiffness]
steps = 5
"""


def _values(text: str) -> dict[str, str]:
    """Values as written by key in capitals, without units."""
    return {key: value for key, (value, _) in parsed(text, Path("tir")).values.items()}


@pytest.mark.long
def test_there_and_back(tmp_path: Path) -> None:
    """Stiffness, footprint and mass are those of the run; modes those of its mesh; the curves follow their points."""
    (tmp_path / "scene.toml").write_text(SCENE)
    out = tmp_path / "out"
    assert (
        main(["run", str(tmp_path / "scene.toml"), "--out", str(out), "--until", "stiffness"]) == 0
    )
    assert main(["export", str(out), "--tir"]) == 0
    path = out / "export" / "tire.tir"
    heads = (out / "export" / "stiffness.csv").read_text().splitlines()
    assert heads[0].startswith('"deflection [m]"') and "load [N]" in heads[0] and len(heads) == 6
    found, values = read(path), _values(path.read_text())
    with h5py.File(out / "stiffness.h5") as file:
        for name in ("vertical", "longitudinal", "lateral", "torsional"):
            assert found.values[f"{name}_stiffness"] == pytest.approx(
                float(file[name][()]), rel=1e-6
            )
        curve = {name: file[f"curve/{name}"][:] for name in file["curve"]}
    assert (found.size, found.load) == ("205/60 R15", pytest.approx(3000, rel=1e-3))
    assert found.values["mass"] == pytest.approx(9.3, abs=0.2)
    assert found.values["lateral_frequency"] == pytest.approx(43, abs=3)
    d = curve["deflection"] / float(values["UNLOADED_RADIUS"])
    load = float(values["FNOMIN"]) * (float(values["Q_FZ1"]) * d + float(values["Q_FZ2"]) * d**2)
    np.testing.assert_allclose(load, curve["load"], rtol=0.1)
    at = np.interp(3000, curve["load"], curve["footprint_length"])
    assert found.values["footprint_length"] == pytest.approx(at, rel=0.15)
    assert 4 < float(values["BELT_MASS"]) < found.values["mass"]
    figures = json.loads((out / "summary.json").read_text())["stages"]["static"]["headline"]
    net = figures["mean contact pressure between grooves"]["value"]
    area = figures["footprint area"]["value"]
    assert net == pytest.approx(figures["load"]["value"] / (area * (1 - 4 * 0.07)))


def test_without_a_static_state(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    (tmp_path / "scene.toml").write_text("")
    assert main(["export", str(tmp_path), "--tir"]) == 2
    assert "static" in capsys.readouterr().err


TIR = """[UNITS]
LENGTH = {length}
FORCE = {force}
ANGLE = {angle}
MASS = {mass}
TIME = {time}
[DIMENSION]
UNLOADED_RADIUS = 0.3135  $ free
WIDTH = 0.205
RIM_RADIUS = 0.1905
ASPECT_RATIO = 0.60
[OPERATING_CONDITIONS]
INFLPRES = 220000
[INERTIA]
MASS = 9.0
[VERTICAL]
FNOMIN = 4000
VERTICAL_STIFFNESS = 200000
[STRUCTURAL]
FREQ_LAT = 42.4
YAW_STIFFNESS = 2400.0
"""
SI = {
    "length": "'meter'",
    "force": "'newton'",
    "angle": "'radians'",
    "mass": "'kg'",
    "time": "'second'",
}
OTHERS = {
    "length": ("'mm'", "'inch'", "'km'", "'ft'", "'feet'", "'s'"),
    "force": ("'kN'", "'pound_force'", "'kgf'", "'lbf'"),
    "angle": ("'degrees'", "'deg'", "'degree'"),
    "mass": ("'pound_mass'", "'g'", "'slug'", "'lbm'", "'tonne'"),
    "time": ("'ms'", "'millisecond'", "'minute'", "'hour'"),
}
SAME = {
    "length": ("'METER'", "m", "'metres'", '"meter"', "'meter' $ of [UNITS]"),
    "force": ("'N'", "newtons", "'NEWTON'"),
    "angle": ("'rad'", "'radian'", "'RADIANS'"),
    "mass": ("'kilogram'", "KG", "'KILO'"),
    "time": ("'s'", "sec", "'SEC'", "'seconds'"),
}


def tir(path: Path, text: str | bytes) -> Path:
    file = path / "tire.tir"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


@pytest.mark.parametrize(("key", "unit"), [(k, u) for k, units in SAME.items() for u in units])
def test_names_of_si_units(tmp_path: Path, key: str, unit: str) -> None:
    found = read(tir(tmp_path, TIR.format(**SI | {key: unit})))
    assert (found.values["mass"], found.values["lateral_frequency"]) == (9.0, 42.4)


@pytest.mark.parametrize(("key", "unit"), [(k, u) for k, units in OTHERS.items() for u in units])
def test_other_units_are_refused_by_name(tmp_path: Path, key: str, unit: str) -> None:
    """A mass of 19.84 pounds was 19.84 kg; ms passed as m."""
    with pytest.raises(InputError, match=f"{key.upper()} = {unit}: files in SI units"):
        read(tir(tmp_path, TIR.format(**SI | {key: unit})))


def test_units_of_what_is_not_in_the_file_do_not_matter(tmp_path: Path) -> None:
    text = TIR.format(**SI | {"angle": "'degrees'", "mass": "'pound_mass'"})
    text = text.replace("YAW_STIFFNESS = 2400.0\n", "").replace("MASS = 9.0\n", "")
    found = read(tir(tmp_path, text))
    assert set(found.values) == {"lateral_frequency", "vertical_stiffness"}
    assert sum("no figure that is read is in it" in note for note in found.notes) == 2
    assert (
        "no [UNITS] in the file: SI units assumed"
        in read(tir(tmp_path, TIR.format(**SI).partition("[DIMENSION]")[2])).notes
    )


@pytest.mark.parametrize(
    "key", ["FREQ_LAT", "YAW_STIFFNESS", "INFLPRES", "FNOMIN", "WIDTH", "VERTICAL_STIFFNESS"]
)
@pytest.mark.parametrize(
    "value", ["42,4", "1.2.3", "about 40", "''", "nan", "4 2", "0x10", "42.4 Hz"]
)
def test_values_that_are_no_numbers_are_named(tmp_path: Path, key: str, value: str) -> None:
    lines = TIR.format(**SI).splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith(key))
    lines[at] = f"{key} = {value}"
    with pytest.raises(
        InputError, match=rf"line {at + 1}: {key} (= .*is not a number|has no value)"
    ):
        read(tir(tmp_path, "\n".join(lines)))


def test_a_key_of_two_values_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="line 22: FREQ_LAT = 50, and 42.4 in line 20"):
        read(tir(tmp_path, TIR.format(**SI) + "FREQ_LAT = 50\n"))


CURVE = "[DEFLECTION_LOAD_CURVE]\n{pen fz}\n"


def test_the_curve_of_deflection_and_load(tmp_path: Path) -> None:
    text = TIR.format(**SI) + CURVE + "".join(f"{1e-3 * k} {150e3 * 1e-3 * k}\n" for k in range(60))
    found = read(tir(tmp_path, text))
    assert len(found.loads) == 3 and found.loads[0] == (pytest.approx(0.008), pytest.approx(1200))
    assert all(1200 <= load <= 6800 for _, load in found.loads)
    assert any("60 points; fitted: 1200 N at 8 mm" in note for note in found.notes)
    for wrong, message in (
        ("0.0 0.0\n0,010 1500,0\n", "line 25.*a deflection and a load"),
        ("0.0 0.0\n0.01 1500\n0.005 1600\n", "line 26.*must ascend"),
    ):
        with pytest.raises(InputError, match=message):
            read(tir(tmp_path, TIR.format(**SI) + CURVE + wrong))


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_encodings_and_the_end_mark_of_dos(tmp_path: Path, encoding: str) -> None:
    text = "$ Größe\n" + TIR.format(**SI).replace("\n", "\r\n") + "\x1a"
    assert read(tir(tmp_path, text.encode(encoding))).values["mass"] == 9.0


def test_what_can_be_is_written_and_the_rest_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """Without receptances nothing was written, the .tir neither; without [stiffness] it said nothing."""
    scene = SCENE.replace("[stiffness]\nsteps = 5\n", "[rotation]\nspeed = 70.0\n")
    write_results(tmp_path)
    (tmp_path / "scene.toml").write_text(scene)
    (tmp_path / "response.h5").unlink()
    with sealed(tmp_path / "static.h5", "a") as file:
        file.attrs.update(mass=9.2, load=3000.0, rolling_radius=0.306, inflation=2.2e5)
    assert main(["export", str(tmp_path), "--tir", "--uff"]) == 2
    told = capsys.readouterr()
    assert "modes.csv" in told.out and "tire.tir" in told.out and "response.uff" not in told.out
    assert "no response.uff" in told.err and "[output.receptance]" in told.err
    assert "tire.tir: VERTICAL_STIFFNESS" in told.err and "[stiffness]" in told.err
    text = (tmp_path / "export" / "tire.tir").read_text()
    sections = re.findall(r"^\[(\w+)\]$", text, re.MULTILINE)
    assert sections[:4] == ["MDI_HEADER", "UNITS", "MODEL", "DIMENSION"]
    values = _values(text)
    assert float(values["FNOMIN"]) == 3000.0
    assert float(values["LONGVL"]) == pytest.approx(70.0 * 0.306)
    assert values["TYRESIDE"] == "SYMMETRIC" and "VERTICAL_STIFFNESS" not in values
    assert read(tmp_path / "export" / "tire.tir").values["mass"] == pytest.approx(9.2)
    assert main(["export", str(tmp_path), "--tir"]) == 0


@pytest.mark.parametrize("line", ["MASS : 9.0", "MASS 9.0", "mass:9.0", "FREQ_LAT\t42.4"])
def test_a_key_without_its_equals_sign_is_refused(tmp_path: Path, line: str) -> None:
    """The mass was left out of the fit without a word."""
    key = line.replace(":", " ").split()[0].upper()
    text = re.sub(rf"^{key} = [\d.]+$", line, TIR.format(**SI), flags=re.M)
    with pytest.raises(InputError, match=f"line .* is not {key} = number"):
        read(tir(tmp_path, text))
