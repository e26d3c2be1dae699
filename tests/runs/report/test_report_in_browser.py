"""The report in a browser: no error, nothing asked for, nothing wider than the screen, every figure drawn."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html import escape, unescape
from pathlib import Path

import pytest
from synthetic_results import write_results

from tireroad.runs.report.page import write_report

BROWSER = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
WIDTHS = 390, 768, 1280
QUIET = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--hide-scrollbars",
]
EARLY = """<script>window.wrong = [];
addEventListener("error", e => wrong.push(String(e.message)));
console.error = (...a) => wrong.push(a.map(String).join(" "));</script>"""
LATE = """<script>addEventListener("load", async () => {
  const wait = t => new Promise(done => setTimeout(done, t)), root = document.documentElement;
  // What comes into sight draws itself; without a screen nothing does, so it is asked to.
  for (const f of document.querySelectorAll("figure")) { enliven(f); await wait(20); }
  await wait(100);
  const first = document.querySelector("figure").getBoundingClientRect();
  const figures = [...document.querySelectorAll("figure")];
  parent.document.documentElement.dataset["w" + innerWidth] = JSON.stringify({
    wrong, scroll: root.scrollWidth, client: root.clientWidth,
    first: first.top + scrollY,
    asked: performance.getEntriesByType("resource").map(r => r.name).filter(n => !n.startsWith("data:")),
    live: figures.filter(f => f.querySelector("script")).length,
    drawn: figures.filter(f => f.dataset.drawn).length,
    aside: [...document.querySelectorAll("figure, figure *")].filter(e => e.scrollWidth > e.clientWidth + 1
      && getComputedStyle(e).overflowX != "visible").length,
    widest: Math.max(...figures.map(f => f.querySelector("img").naturalWidth)),
    blank: figures.filter(f => !f.querySelector("img").naturalWidth).length,
    canvases: document.querySelectorAll(".live canvas").length,
  });
});</script>"""

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = write_results(tmp_path_factory.mktemp("browser") / "run")
    text = write_report(directory).read_text(encoding="utf-8")
    path = directory / "measured.html"
    path.write_text(text.replace("<title>", EARLY + "<title>").replace("</body>", LATE + "</body>"))
    return path


def browse(tmp_path: Path, *arguments: str) -> str:
    command = [str(BROWSER), *QUIET, f"--user-data-dir={tmp_path / 'profile'}", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout


@pytest.fixture(scope="module")
def measured(page: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[int, dict]:
    """What the page says of itself in frames of three widths; a window of its own is never narrower than 500."""
    text = escape(page.read_text(encoding="utf-8"))
    style = "height: 844px; border: 0; display: block; width:"
    frames = [f'<iframe style="{style} {width}px" srcdoc="{text}"></iframe>' for width in WIDTHS]
    path = page.with_name("frames.html")
    path.write_text('<body style="margin: 0">' + "".join(frames), encoding="utf-8")
    arguments = "--window-size=1400,2600", "--virtual-time-budget=8000", "--dump-dom"
    shown = browse(tmp_path_factory.mktemp("profile"), *arguments, path.as_uri())
    found = re.findall(r'data-w(\d+)="([^"]*)"', shown)
    return {int(width): json.loads(unescape(told)) for width, told in found}


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
def test_the_page_is_drawn_and_fits(measured: dict[int, dict], width: int) -> None:
    """The first figure is on the second screen (844 px high on a phone) at the latest."""
    found = measured[width]
    assert found["wrong"] == []
    assert found["asked"] == []
    assert found["scroll"] == found["client"] == width
    assert found["blank"] == 0
    # Whole at any width, and drawn for no more than 6.3 inches at 130 dots, so that a phone leaves letters to read.
    assert found["aside"] == 0 and found["widest"] <= 820
    assert found["drawn"] == found["live"] >= 5
    assert found["canvases"] >= found["live"]
    assert found["first"] < 2 * 844


@pytest.mark.slow
def test_the_page_prints(page: Path, tmp_path: Path) -> None:
    paper = tmp_path / "page.pdf"
    browse(tmp_path, "--virtual-time-budget=4000", f"--print-to-pdf={paper}", page.as_uri())
    assert paper.read_bytes().startswith(b"%PDF")
    assert (
        4
        <= paper.read_bytes().count(b"/Type /Page\n") + paper.read_bytes().count(b"/Type /Page ")
        <= 30
    )
