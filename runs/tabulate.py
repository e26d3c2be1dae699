"""Tables of measured figures: printed, kept as JSON, and drawn on a page of their own."""

from __future__ import annotations

import base64
import importlib
import io
import json
import pkgutil
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import ModuleType

from fem.errors import InputError
from runs import observe
from runs.disk import write_text
from runs.version import PROGRAM, VERSION


@dataclass
class Table:
    """Rows under (name, unit) columns; notes say what was measured and what the target is.

    `plot`: {"x": column, "y": [columns], "log": "xy", "x", "y" or "", "by": column or None}.
    """

    title: str
    columns: list[tuple[str, str]]
    rows: list[list]
    notes: list[str] = field(default_factory=list)
    plot: dict | None = None


def modules(package: str) -> dict[str, ModuleType]:
    """The modules of a package by name, each with ABOUT (a line) and run() -> list[Table]."""
    path = Path(importlib.import_module(package).__file__).parent
    names = sorted(found.name for found in pkgutil.iter_modules([str(path)]))
    loaded = {name: importlib.import_module(f"{package}.{name}") for name in names}
    return {name: module for name, module in loaded.items() if hasattr(module, "run")}


def run_all(package: str, names: list[str], out: Path | None) -> None:
    """Run the named modules of a package (all by default), show their tables, keep them in files."""
    known = modules(package)
    for name in names:
        if name not in known:
            raise InputError(f"{name!r} is none of: {', '.join(known)}")
    results = {}
    for name in names or known:
        observe.say(f"{name}: {known[name].ABOUT}")
        began = time.perf_counter()
        tables = known[name].run()
        for table in tables:
            show(table)
        observe.say(f"{name}: {time.perf_counter() - began:.1f} s\n")
        results[name] = tables
    if out is not None:
        _keep(results, out)


def show(table: Table) -> None:
    """Print a table as text."""
    from rich.console import Console
    from rich.table import Table as Grid

    grid = Grid(title=table.title, title_justify="left", header_style="bold")
    for name, unit in table.columns:
        grid.add_column(
            name if unit in ("", "-") else f"{name} [{unit}]".replace("[", r"\["), overflow="fold"
        )
    for row in table.rows:
        grid.add_row(*(_shown(value) for value in row))
    text = io.StringIO()
    Console(file=text, width=120).print(grid)
    observe.say(text.getvalue().rstrip())
    for note in table.notes:
        observe.say(f"  {note}")


def _shown(value) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _keep(results: dict[str, list[Table]], out: Path) -> None:
    """JSON at `out`, and a page with plots beside it."""
    data = {name: [asdict(table) for table in tables] for name, tables in results.items()}
    text = json.dumps({"program": PROGRAM, "version": VERSION, "results": data}, indent=1)
    write_text(out, text + "\n")
    page = out.with_suffix(".html")
    write_text(page, _page(results))
    observe.say(f"{out} and {page}")


_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{{ title }}</title><style>
body{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem;color:#1d2733}
table{border-collapse:collapse;margin:.7rem 0}td,th{padding:.25rem .8rem;border-bottom:1px solid #dde3ea;text-align:left}
small,p{color:#4a5a6c}img{max-width:100%}</style></head><body><h1>{{ title }}</h1>
{% for name, tables in results.items() %}<h2>{{ name }}</h2>{% for t, image in tables %}<h3>{{ t.title }}</h3>
<table><tr>{% for n, u in t.columns %}<th>{{ n }}{% if u not in ("", "-") %} <small>{{ u }}</small>{% endif %}</th>{% endfor %}</tr>
{% for row in t.rows %}<tr>{% for v in row %}<td>{{ shown(v) }}</td>{% endfor %}</tr>{% endfor %}</table>
{% for note in t.notes %}<p>{{ note }}</p>{% endfor %}
{% if image %}<img alt="{{ t.title }}" src="data:image/png;base64,{{ image }}">{% endif %}
{% endfor %}{% endfor %}</body></html>"""


def _page(results: dict[str, list[Table]]) -> str:
    import jinja2

    drawn = {name: [(t, _drawn(t)) for t in tables] for name, tables in results.items()}
    template = jinja2.Environment(autoescape=True).from_string(_PAGE)
    return template.render(title=f"{PROGRAM} {VERSION}", results=drawn, shown=_shown)


def _drawn(table: Table) -> str | None:
    """The table's plot as base64 PNG."""
    if table.plot is None:
        return None
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    names = [name for name, _ in table.columns]
    units = dict(table.columns)
    x, by = table.plot["x"], table.plot.get("by")
    figure, axes = pyplot.subplots(figsize=(8, 4.5), layout="constrained")
    groups = sorted({str(row[names.index(by)]) for row in table.rows}) if by else [None]
    for group in groups:
        rows = [r for r in table.rows if group is None or str(r[names.index(by)]) == group]
        for y in table.plot["y"]:
            points = [(r[names.index(x)], r[names.index(y)]) for r in rows]
            points = sorted(p for p in points if all(isinstance(v, int | float) for v in p))
            label = " ".join(
                part for part in (group, y if len(table.plot["y"]) > 1 else None) if part
            )
            axes.plot(*zip(*points, strict=True), "o-", label=label or y) if points else None
    if "x" in table.plot.get("log", ""):
        axes.set_xscale("log")
    if "y" in table.plot.get("log", ""):
        axes.set_yscale("log")
    axes.set_xlabel(f"{x} [{units[x]}]")
    first = table.plot["y"][0]
    axes.set_ylabel(f"{first} [{units[first]}]")
    axes.grid(alpha=0.3)
    axes.legend()
    image = io.BytesIO()
    figure.savefig(image, dpi=110)
    pyplot.close(figure)
    return base64.b64encode(image.getvalue()).decode()
