"""The page of three runs in a browser: every run is seen, whatever a cell holds, with charts of the sound."""

from __future__ import annotations

import json
import re
from html import escape, unescape
from pathlib import Path

import h5py
import numpy as np
import pytest
from synthetic_results import put, sealed, write_results
from test_report_in_browser import BROWSER, browse

from tireroad.runs.report.compare import compare
from tireroad.runs.report.levels import SOUND

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed"),
]
WIDTHS = 390, 1400
LONG = "an upper bound, of the stiffness at the present speed: with modes to 0.7 of the highest it was "
LATE = """<script>addEventListener("load", () => {
  const root = document.documentElement;
  document.querySelectorAll("details").forEach(d => d.open = true);
  const heads = [...document.querySelectorAll("table")].map(t => [...t.rows[0].cells].map(c => c.getBoundingClientRect()));
  const images = [...document.querySelectorAll("figure img")];
  parent.document.documentElement.dataset["w" + innerWidth] = JSON.stringify({
    scroll: root.scrollWidth, tables: heads.length,
    columns: Math.min(...heads.map(h => h.length)), right: Math.max(...heads.map(h => h[h.length - 1].right)),
    narrowest: Math.min(...heads.flatMap(h => h.map(c => c.width))),
    cut: [...document.querySelectorAll("td, th")].filter(c => c.scrollWidth > c.clientWidth + 1).length,
    // A point of 9 pt in a figure of so many inches, in pixels of the screen.
    letters: Math.min(...images.map(i => 9 / 72 * i.getBoundingClientRect().width / (i.currentSrc.includes("svg") ? i.naturalWidth / 96 : i.naturalWidth / 130))),
    captions: images.map(i => i.alt),
  });
});</script>"""


def write(folder: Path, number: int) -> Path:
    """A run with sound at two microphones and a long text among its figures."""
    write_results(folder, modes=6, steps=64)
    told = json.loads((folder / "summary.json").read_text())
    told["stages"]["rotating"]["headline"]["bound on the critical speed"] = {
        "value": f"{LONG} {180 + number} rad/s, and more modes lower it further",
        "unit": "-",
    }
    told["stages"]["sound"] = told["stages"]["spectra"]
    (folder / "summary.json").write_text(json.dumps(told))
    with sealed(folder / "sound.h5") as file:
        centre = 1000.0 * 10.0 ** (np.arange(-10, 0) / 10.0)
        level = 60.0 + 3 * number + np.arange(10.0)
        put(file, "third_octave/centre", centre, "Hz")
        put(file, "third_octave/level_a", np.stack([level, level - 20]), "dB(A) re 20 uPa")
        put(file, "power", level + 6, "dB re 1 pW")
        file.attrs["microphone_names"] = np.array(["cpx front", "pass-by"], h5py.string_dtype())
    return folder


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[int, dict]:
    folder = tmp_path_factory.mktemp("compared")
    names = ("as built", "a-road-with-a-long-name-of-its-own", "inflated")
    runs = [write(folder / name, k) for k, name in enumerate(names)]
    text = compare(runs, folder / "out").read_text(encoding="utf-8")
    frames = [
        f'<iframe style="height: 844px; border: 0; width: {width}px" '
        f'srcdoc="{escape(text.replace("</body>", LATE + "</body>"))}"></iframe>'
        for width in WIDTHS
    ]
    path = folder / "frames.html"
    path.write_text('<body style="margin: 0">' + "".join(frames), encoding="utf-8")
    arguments = "--window-size=1500,1800", "--virtual-time-budget=6000", "--dump-dom"
    shown = browse(tmp_path_factory.mktemp("profile"), *arguments, path.as_uri())
    found = re.findall(r'data-w(\d+)="([^"]*)"', shown)
    return {int(width): json.loads(unescape(told)) for width, told in found}


@pytest.mark.parametrize("width", WIDTHS)
def test_all_runs_are_seen(measured: dict[int, dict], width: int) -> None:
    """One long text had pushed all runs but the first off the page, at any width."""
    found = measured[width]
    assert found["tables"] >= 4 and found["columns"] == 4
    assert found["scroll"] <= width and found["right"] <= width
    assert found["narrowest"] > 70 and found["cut"] == 0
    assert found["letters"] > 9  # px
    for name in (f"{SOUND}cpx front", f"{SOUND}pass-by", "sound power level", "axle force z"):
        assert any(told.startswith(f"Third octaves: {name}.") for told in found["captions"])
