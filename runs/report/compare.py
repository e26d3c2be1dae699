"""`compare`: two to twelve runs in one page and one table, from their result folders alone."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tireroad.fem.errors import InputError
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.present import UNFINISHED
from tireroad.runs.files.reader import RunResults
from tireroad.runs.report import comparison_figures as pictures
from tireroad.runs.report.differences import (
    Row,
    cost_rows,
    figure_rows,
    level_rows,
    mode_rows,
    scene_rows,
)
from tireroad.runs.report.figures import FEWEST_BANDS
from tireroad.runs.report.quantities import quantity
from tireroad.runs.version import PROGRAM, VERSION

MOST = 12
# Groups of levels that are drawn, and their names.
DRAWN = {
    "axle force z": "vertical axle force",
    "contact force z": "vertical contact force",
    "radiated power": "equivalent radiated power",
}


def compare(directories: Sequence[Path], out: Path) -> Path:
    """Write out/compare.html and out/compare.csv; returns the page. Not collective.

    The first run is the reference. Quantities that a run does not have are left out and listed.
    Raises InputError for fewer than 2 or more than 12 folders, and for one without results.
    """
    if not 2 <= len(directories) <= MOST:
        raise InputError(f"compare takes 2 to {MOST} result folders, not {len(directories)}")
    runs = [RunResults(directory) for directory in directories]
    names = _names(directories)
    groups = _groups(runs)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{out}: cannot be made ({error.strerror}): choose another --out"
        ) from error
    write_text(out / "compare.csv", _table(names, groups))
    page = out / "compare.html"
    write_text(page, _page(runs, names, groups))
    return page


def _names(directories: Sequence[Path]) -> list[str]:
    """The folders' names, with as much of their paths as makes them unique."""
    whole = [directory.resolve() for directory in directories]
    for depth in range(1, 1 + max(len(path.parts) for path in whole)):
        names = ["/".join(path.parts[-depth:]) for path in whole]
        if len(set(names)) == len(set(whole)):
            return names
    return [str(path) for path in whole]


def _groups(runs: Sequence[RunResults]) -> dict[str, list[Row]]:
    summaries = [run.summary for run in runs]
    return {
        "scene": scene_rows([run.scene for run in runs]),
        "figures": figure_rows(summaries),
        "levels": level_rows(runs),
        "modes": mode_rows(runs),
        "cost": cost_rows(summaries),
    }


def _table(names: Sequence[str], groups: dict[str, list[Row]]) -> str:
    """The CSV: one row per quantity, one column per run."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["group", "quantity", "unit", *names])
    for rows in groups.values():
        for row in rows:
            given = ["" if value is None else value for value in row.values]
            writer.writerow([row.group, row.name, row.unit, *given])
    return stream.getvalue()


def _page(runs: Sequence[RunResults], names: Sequence[str], groups: dict[str, list[Row]]) -> str:
    pages = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    pages.filters |= {"quantity": quantity, "change": _change}
    return pages.get_template("compare.html.j2").render(
        program=f"{PROGRAM} {VERSION}",
        names=names,
        groups=groups,
        figures=_figures(runs, names, groups["levels"]),
        missing=_missing(runs, names),
    )


def _change(row: Row, index: int) -> str:
    """A value's difference from the first run's: in dB for levels, in percent for other numbers."""
    first, value = row.values[0], row.values[index]
    numbers = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in (first, value))
    if index == 0 or not numbers or first == value:
        return ""
    if row.unit.startswith("dB"):
        return f"{value - first:+.1f} dB"
    if not first:
        return ""
    change = 100 * (value / first - 1)
    return f"{change:+.2g} %" if abs(change) < 99.5 else f"{change:+.0f} %"


def _figures(
    runs: Sequence[RunResults], names: Sequence[str], levels: Sequence[Row]
) -> list[tuple[str, str]]:
    found = []
    for group, what in DRAWN.items():
        rows = [row for row in levels if row.group == group]
        if len(rows) >= FEWEST_BANDS:  # fewer are in the table
            found.append((pictures.levels(rows, names), f"Third octaves of the {what}."))
    histories = {
        name: (run["contact/time"], run["contact/total_force"][:, 2])
        for name, run in zip(names, runs, strict=True)
        if "contact/total_force" in run
    }
    if len(histories) > 1:
        found.append((pictures.histories(histories), "Vertical contact force over time."))
    prints = {
        name: (run["static/contact/points"], run["static/contact/pressure"])
        for name, run in zip(names, runs, strict=True)
        if "static/contact/pressure" in run and (run["static/contact/pressure"] > 0).any()
    }
    if len(prints) > 1:
        found.append((pictures.footprints(prints), "Contact pressure at rest, one scale for all."))
    return found


def _missing(runs: Sequence[RunResults], names: Sequence[str]) -> list[str]:
    """Runs that did not finish, and result files that some runs have and others lack."""
    unfinished = {Path(name).stem for name in UNFINISHED}
    files = [{key.partition("/")[0] for key in run} - unfinished for run in runs]
    ended = [f"{name}: {run.ending}" for name, run in zip(names, runs, strict=True) if run.ending]
    return ended + [
        f"{name} has no {', '.join(f'{file}.h5' for file in sorted(set.union(*files) - own))}: left out there."
        for name, own in zip(names, files, strict=True)
        if set.union(*files) - own
    ]
