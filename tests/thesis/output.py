"""Writes reproduce.html, reproduce.json and reproduce.csv, for people and for programs."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tireroad.runs.files.disk import write_text
from tireroad.runs.report.kit import page_of
from tireroad.runs.report.read import quantity
from tireroad.runs.version import PROGRAM, VERSION
from tireroad.tests.thesis.claim import Claim
from tireroad.tests.thesis.figure import Figure, Reproduced

_COLUMNS = (
    "figure", "what", "unit", "thesis", "source", "relation", "tolerance", "found", "verdict", "because",
    "right", "by", "is_right",
)  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """A figure, its seconds, and what was `found`, with its picture; or how it `failed`."""

    figure: Figure
    seconds: float
    found: Reproduced | None = None
    picture: str = ""
    failed: str = ""

    @property
    def verdict(self) -> str:
        """Verdict on the figure."""
        return self.found.verdict if self.found else "not computed"


def write(entries: Sequence[Entry], directory: Path, seconds: float, processes: int) -> Path:
    """Write the three files; returns the page. Root process only."""
    head = {"program": PROGRAM, "version": VERSION, "processes": processes, "seconds": seconds}
    data = head | {"figures": [_plain(entry) for entry in entries]}
    write_text(directory / "reproduce.json", json.dumps(data, indent=1, ensure_ascii=False) + "\n")
    write_text(directory / "reproduce.csv", _table(entries))
    page = directory / "reproduce.html"
    write_text(page, _page(entries, seconds, processes))
    return page


def _plain(entry: Entry) -> dict[str, Any]:
    """An entry without its picture."""
    one = entry.figure
    return {
        "name": one.name,
        "title": one.title,
        "verdict": entry.verdict,
        "seconds": entry.seconds,
        "thesis": one.thesis,
        "shows": entry.found.shows if entry.found else entry.failed,
        "claims": [_of_claim(claim) for claim in (entry.found.claims if entry.found else ())],
    }


def _of_claim(claim: Claim) -> dict[str, Any]:
    known = vars(claim) | {
        "found": claim.found if math.isfinite(claim.found) else None,
        "verdict": "agrees" if claim.agrees else "differs",
        "because": "" if claim.agrees else claim.because,
        "is_right": claim.is_right,
    }
    return {name: known[name] for name in _COLUMNS[1:]}


def _table(entries: Sequence[Entry]) -> str:
    """The CSV, one row per claim."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    for entry in entries:
        for claim in entry.found.claims if entry.found else ():
            writer.writerow({"figure": entry.figure.name} | _of_claim(claim))
    return stream.getvalue()


def _page(entries: Sequence[Entry], seconds: float, processes: int) -> str:
    claims = [claim for entry in entries if entry.found for claim in entry.found.claims]
    return page_of(
        "reproduce",
        "The thesis reproduced",
        folder=Path(__file__).parent,
        filters={"asked": asked},
        processes=processes,
        seconds=seconds,
        entries=entries,
        agree=sum(claim.agrees for claim in claims),
        claims=len(claims),
    )


def asked(claim: Claim) -> str:
    """The thesis's value with its tolerance."""
    value = quantity(claim.thesis, claim.unit)
    if claim.relation != "equal":
        return f"{claim.relation} {value}"
    if claim.thesis == 0.0:
        return f"{value} ± {quantity(claim.tolerance, claim.unit)}"
    return f"{value} ± {quantity(100 * claim.tolerance, '%')}"
