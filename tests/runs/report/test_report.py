"""The report: complete, self-contained, honest about what is missing, and quick."""

import json
import re
import resource
import subprocess
import sys
from base64 import b64decode
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic_results import sealed, write_results, write_rotating
from written_page import page

from tireroad.contact.results.spectra import nominal
from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import signed_table
from tireroad.runs.report import figures, surface_figures
from tireroad.runs.report.page import parameters, render, write_report

pytestmark = pytest.mark.slow

TITLES = {
    "static.h5": "Loaded tire and footprint",
    "contact.h5": "Rolling contact",
    "spectra.h5": "Spectra of the axle force",
    "response.h5": "Point forces",
    "modes.h5": "Modes of the loaded tire",
    "rotating.h5": "Modes of the rolling tire",
}
PICTURES = 11  # of a folder with every file


@pytest.fixture
def blank(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures stay unpainted, which is 9/10 of the time: for tests of what the page says."""
    for module in (figures, surface_figures):
        monkeypatch.setattr(module, "encode", lambda *_, **__: "data:image/png;base64,iVBORw0KGgo=")


def titles(text: str) -> list[str]:
    return [unescape(title) for title in re.findall(r"<h2>(.*?)</h2>", text)]


class Balance(HTMLParser):
    """Fails on a tag that is closed out of turn; collects what the page would load."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loaded: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loaded += [value or "" for key, value in attrs if key in ("src", "href", "srcset")]
        if tag not in ("meta", "img", "br", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_every_section_is_there_and_the_page_loads_nothing(results: Path) -> None:
    text = page(results)
    assert [title for title in titles(text) if title in TITLES.values()] == list(TITLES.values())
    parser = Balance()
    parser.feed(text)
    assert parser.open == []
    assert len(parser.loaded) == PICTURES
    assert all(source.startswith("data:image/") for source in parser.loaded)
    assert "@import" not in text
    assert "url(" not in text
    for source in parser.loaded:
        kind, data = source.split(";base64,")
        start = b"\x89PNG" if kind.endswith("png") else b"<?xml"
        assert b64decode(data).startswith(start)


@pytest.mark.usefixtures("blank")
def test_the_answer_comes_first_then_warnings_and_they_are_escaped(results: Path) -> None:
    text = page(results)
    warning = "in 12 steps the tire left the road &amp; the load was &lt;zero&gt;"
    assert text.count(warning) == 1
    assert text.index("500 N") < text.index(warning) < text.index("<h2>")


@pytest.mark.usefixtures("blank")
def test_numbers_carry_units(results: Path) -> None:
    text = page(results)
    for shown in (">500 N<", ">15 mm<", ">316 mm<", ">200 kPa<", ">48 MPa<", ">50 rad/s<"):
        assert shown in text, shown
    assert f">{3.6 * 50 * 0.316:.4g} km/h<" in text
    assert "of [[force]]" not in text
    assert "the scene has no [stiffness] table" in text
    assert "same mesh, load and material as before" in text


@pytest.mark.usefixtures("blank")
def test_modes_have_names_and_the_branches_of_one_mode_stand_in_one_row(results: Path) -> None:
    text = page(results)
    assert "<th>effective mass at the hub</th>" in text and "6 kg in x" in text
    assert "0.001 kg m² about y" in text
    assert '"R1: 79.29 Hz"' in text  # of the animated shapes
    with h5py.File(results / "rotating.h5") as file:
        frequency, name = file["frequency"][:], file["name"].asstr()[:]
    below, above = (frequency[(name == f"R3{way}") & (frequency > 0)][0] for way in "-+")
    row = re.search(r"<tr><td>R3</td>.*?</tr>", text[text.index("Modes of the rolling tire") :])
    assert row is not None
    cells = re.findall(r"<td>(.*?)</td>", row[0])
    assert [cells[k] for k in (1, 5, 6)] == ["–", "3", "in plane, symmetric"]
    assert cells[2].startswith(f"{below:.4g} Hz, ") and cells[3].startswith(f"{above:.4g} Hz, ")
    assert cells[2].endswith(" %") and cells[4] == f"{above - below:.4g} Hz"


@pytest.mark.parametrize("name", TITLES)
@pytest.mark.usefixtures("blank")
def test_an_absent_file_leaves_out_its_section_only(results: Path, name: str) -> None:
    (results / name).unlink()
    shown = titles(text := page(results))
    assert TITLES[name] not in shown
    assert [title for key, title in TITLES.items() if key != name] == [
        title for title in shown if title in TITLES.values()
    ]
    assert f"section of {name}" in text


@pytest.mark.parametrize("name", TITLES)
@pytest.mark.usefixtures("blank")
def test_a_truncated_file_is_a_warning(results: Path, name: str) -> None:
    whole = (results / name).read_bytes()
    (results / name).write_bytes(whole[: len(whole) // 2])
    text = page(results)
    assert f"{name} is damaged and left out" in text
    left = [title for title in titles(text) if title in TITLES.values()]
    assert left == [title for key, title in TITLES.items() if key != name]


@pytest.mark.parametrize(("name", "content"), [("summary.json", "{"), ("scene.toml", "a = = 1")])
@pytest.mark.usefixtures("blank")
def test_an_unreadable_or_absent_text_file_is_a_warning(
    results: Path, name: str, content: str
) -> None:
    (results / name).write_text(content)
    assert f"{name} cannot be read" in page(results)
    (results / name).unlink()
    assert f"There is no {name}" in page(results)


@pytest.mark.usefixtures("blank")
def test_a_summary_of_strange_content_is_a_warning(results: Path) -> None:
    for content in (
        "[]",
        '{"stages": {"static": 3}}',
        '{"stages": {"static": {"cost": {"a": "b"}}}}',
        '{"stages": {"static": {"headline": {"load": {}}}}}',
    ):
        (results / "summary.json").write_text(content)
        assert "summary.json cannot be read" in page(results), content


@pytest.mark.usefixtures("blank")
def test_a_missing_dataset_is_named(results: Path) -> None:
    with sealed(results / "contact.h5", "a") as file:
        del file["total_force"]
    assert "contact.h5 holds no dataset total_force" in page(results)


@pytest.mark.usefixtures("blank")
def test_an_unstable_tire_is_a_warning_at_the_top(results: Path) -> None:
    write_rotating(results / "rotating.h5", 10, unstable=True)
    text = page(results)
    assert text.index("The rolling tire is unstable: 2 eigenvalues") < text.index("<h2>")
    assert "The rolling tire is unstable" not in page(write_results(results.parent / "stable"))


def test_a_tire_without_a_road(results: Path) -> None:
    with sealed(results / "static.h5", "a") as file:
        del file["contact"]
        del file.attrs["road_height"]
    assert "there is no footprint" in page(results)


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_short_runs(tmp_path: Path, steps: int) -> None:
    assert TITLES["contact.h5"] in titles(page(write_results(tmp_path / "run", steps=steps)))


def test_not_a_number_in_a_result_does_not_stop_the_report(results: Path) -> None:
    with sealed(results / "contact.h5", "a") as file:
        file["normal_force"][5] = np.nan
    with sealed(results / "spectra.h5", "a") as file:
        file["axle_force"][7] = np.nan
        file["third_octave/level"][3] = -np.inf
    shown = titles(page(results))
    assert {TITLES["contact.h5"], TITLES["spectra.h5"]} <= set(shown)


@pytest.mark.long
def test_an_earlier_report_is_replaced_whole(results: Path) -> None:
    first = page(results)
    assert page(results) == first, "the same results give the same page"
    assert sorted(path.name for path in results.glob("*report*")) == ["report.html"]


@pytest.mark.parametrize("name", ["nowhere", "empty"])
def test_a_folder_without_results_is_an_input_error(tmp_path: Path, name: str) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="give the result folder of a run"):
        write_report(tmp_path / name)
    assert list((tmp_path / "empty").iterdir()) == []


@pytest.mark.long
def test_a_typical_run_takes_seconds_and_a_small_page_without_dolfinx(tmp_path: Path) -> None:
    directory = write_results(tmp_path / "run", around=120, across=33, steps=10000, modes=60)
    program = (
        "import sys; from pathlib import Path; from tireroad.runs.report.page import write_report;"
        f"write_report(Path({str(directory)!r}));"
        "sys.exit(any(m.split('.')[0] in ('dolfinx', 'petsc4py', 'pyplot') for m in sys.modules))"
    )
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    root = Path(__file__).parents[3]
    subprocess.run([sys.executable, "-c", program], check=True, cwd=root)
    spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    assert spent < 10.0, "2.6 s where this was written and 4 s is the aim; machines differ"
    assert (directory / "report.html").stat().st_size < 3e6


@pytest.mark.usefixtures("blank")
def test_stages_come_in_the_order_they_ran(results: Path) -> None:
    summary = json.loads((results / "summary.json").read_text())
    summary["stages"] = dict(reversed(summary["stages"].items()))
    (results / "summary.json").write_text(json.dumps(summary))
    text = page(results)
    order = [text.index(f"<tr><td>{name}</td><td>") for name in ("static", "modes", "contact")]
    assert order == sorted(order)


def test_few_bands_are_numbers_and_no_chart(results: Path) -> None:
    """One bar in a chart of blank axes tells less than its number."""
    with sealed(results / "spectra.h5", "a") as file:
        group = file["third_octave"]
        for name in list(group):
            values = group[name][()]
            unit = group[name].attrs["unit"]
            del group[name]
            group.create_dataset(name, data=values[:2]).attrs["unit"] = unit
        group["level"][0, 1] = -3076.5
        first, level = nominal(group["centre"][:1])[0], group["level"][0]
    text = page(results).replace("−", "-")
    assert f"axle force, third octave {first:g} Hz, dB re 1 N" in text
    assert f"x {level[0]:.1f} (error unknown), y none, z {level[2]:.1f} (error unknown)" in text
    assert "Third-octave bands of the axle force" not in text


@pytest.mark.usefixtures("blank")
def test_a_spectrum_of_one_line_is_a_number_and_no_chart(results: Path) -> None:
    with sealed(results / "spectra.h5", "a") as file:
        for name in ("frequency", "axle_force", "contact_force"):
            values, unit = file[name][:2], file[name].attrs["unit"]
            del file[name]
            file.create_dataset(name, data=values).attrs["unit"] = unit
    text = page(results)
    assert "axle force, amplitude at 4 Hz" in text and "Amplitude spectrum." not in text


@pytest.mark.usefixtures("blank")
def test_a_run_too_short_says_so_above_everything_else(results: Path) -> None:
    """Among the warnings it was folded away behind the first three; it stands there once."""
    told = "the run is too short for third octaves from 63 Hz on, and has none: take time.duration = 0.3 s"
    with sealed(results / "spectra.h5", "a") as file:
        file.attrs["too_short"] = told
    summary = json.loads((results / "summary.json").read_text())
    summary["stages"]["spectra"]["warnings"] = [told]
    (results / "summary.json").write_text(json.dumps(summary))
    text = page(results)
    assert text.count(told[1:]) == 1
    assert text.index("</header>") < text.index(f"T{told[1:]}.") < text.index('<dl class="facts')


@pytest.mark.usefixtures("blank")
def test_the_power_of_few_bands_is_a_number(results: Path) -> None:
    (results / "summary.json").unlink()  # without it every file counts
    with sealed(results / "vibration.h5") as file:
        file["frequency"] = np.array([95.0, 100.0, 105.0])
        file["mean_square_velocity"] = np.full(3, 1e-6)
        file["third_octave/centre"] = np.array([100.0])
        file["third_octave/radiated_power_level"] = np.array([70.25])
        file["third_octave/radiated_power_level_a_weighted"] = np.array([51.75])
    text = page(results)
    assert "radiated power, third octave 100 Hz" in text
    assert "70.2 dB, 51.8 dB(A) re 1 pW" in text
    assert "Equivalent radiated power in third-octave bands" not in text


@pytest.mark.usefixtures("blank")
def test_what_was_read_of_files_stands_in_a_table(results: Path) -> None:
    """Of a road's columns, units and gaps the page had nothing; points of contact had no unit."""
    path = results / "summary.json"
    rows = [["road.csv", "height", "column 3 <z>", "mm", "7 of 7750 missing"]]
    path.write_text(
        json.dumps(
            signed_table(
                {k: v for k, v in json.loads(path.read_text()).items() if k != "checksum"}
                | {"files": rows}
            )
        )
    )
    page = render(results)
    assert "Files: what was read as what" in page
    assert "<td>column 3 &lt;z&gt;</td>" in page and "<td>7 of 7750 missing</td>" in page
    for damaged in ([["road.csv"]], ["road.csv"], 3):
        path.write_text(
            json.dumps(
                signed_table(
                    {k: v for k, v in json.loads(path.read_text()).items() if k != "checksum"}
                    | {"files": damaged}
                )
            )
        )
        assert "Files: what was read as what" not in render(results)
    points = {
        "contact": {"points": {"dx": 0.01, "dy": 0.02}, "brush": "rolling"},
        "time": {"step": "auto"},
    }
    found = dict(parameters(points))
    assert found["contact.points"] == [("dx", "10 mm"), ("dy", "20 mm")]
    assert found["time"] == [("step", "auto")]
