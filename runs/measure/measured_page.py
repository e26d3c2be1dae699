"""The self-contained page of benchmarks and validations, with numbered tables and figures."""

from __future__ import annotations

import os
import platform
import time
from pathlib import Path
from typing import Any

from tireroad.runs.measure.plots import drawn
from tireroad.runs.version import PROGRAM, VERSION

LONG = 16  # rows above which a table is collapsed

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{{ title }}</title><style>
body{font:15px/1.55 Georgia,"Times New Roman",serif;max-width:60rem;margin:2.5rem auto;padding:0 1.2rem;color:#1d2733}
h1{font-size:1.7rem;margin:0}h2{font-size:1.3rem;margin:2.6rem 0 .3rem;border-bottom:2px solid #1d2733}
.about,.machine{color:#4a5a6c}.machine{margin:.3rem 0 1.2rem;font-size:.9rem}
nav a{margin-right:1rem}a{color:#2f6db5}
figure{margin:1.4rem 0}img{max-width:100%;display:block;margin:0 auto}
figcaption,caption{font-size:.92rem;text-align:left;color:#1d2733;padding:.3rem 0;caption-side:top}
table{border-collapse:collapse;margin:.4rem 0;font:13px/1.4 system-ui,sans-serif;font-variant-numeric:tabular-nums;
border-top:1.5px solid #1d2733;border-bottom:1.5px solid #1d2733}
th{border-bottom:1px solid #1d2733;text-align:right;vertical-align:bottom;font-weight:600}
th small{font-weight:400;display:block;color:#4a5a6c}td,th{padding:.2rem .7rem}td{text-align:right}
.word{text-align:left}td.word{white-space:nowrap}tr:nth-child(even) td{background:#f5f7fa}
.scroll{overflow-x:auto}.note{font-size:.9rem;margin:.25rem 0;color:#34424f}
summary{cursor:pointer;color:#2f6db5;font-size:.92rem}
@media print{body{margin:0}details>*{display:block}}
</style></head><body>
<h1>{{ title }}</h1><p class="machine">{{ machine }}</p>
<nav>{% for part in parts %}<a href="#{{ part.name }}">{{ part.name }}</a>{% endfor %}</nav>
{% for part in parts %}<h2 id="{{ part.name }}">{{ part.name }}</h2><p class="about">{{ part.about }}</p>
{% for t in part.tables %}
{% if t.image %}<figure><img alt="{{ t.title }}" src="{{ t.image }}">
<figcaption><b>Figure {{ t.figure }}.</b> {{ t.title }}. {{ t.notes[0] if t.notes else "" }}</figcaption></figure>{% endif %}
{% if t.long %}<details><summary>Table {{ t.number }}: {{ t.title }} ({{ t.rows|length }} rows)</summary>{% endif %}
<div class="scroll"><table><caption><b>Table {{ t.number }}.</b> {{ t.title }}</caption><thead><tr>
{% for name, unit, word in t.columns %}<th{% if word %} class="word"{% endif %}>{{ name }}{% if unit %}<small>{{ unit }}</small>{% endif %}</th>{% endfor %}
</tr></thead><tbody>
{% for row in t.rows %}<tr>{% for value, word in row %}<td{% if word %} class="word"{% endif %}>{{ value }}</td>{% endfor %}</tr>
{% endfor %}</tbody></table></div>
{% if t.long %}</details>{% endif %}
{% for note in t.notes %}{% if not (t.image and loop.first) %}<p class="note">{{ note }}</p>{% endif %}{% endfor %}
{% endfor %}{% endfor %}
</body></html>
"""


def page(results: dict[str, list], about: dict[str, str]) -> str:
    """HTML of tables (runs.measure.tabulate.Table) by module name, with their ABOUT lines."""
    import jinja2

    counted = {"tables": 0, "figures": 0}
    parts = [
        {"name": name, "about": about[name], "tables": [_shaped(t, counted) for t in tables]}
        for name, tables in results.items()
    ]
    template = jinja2.Environment(autoescape=True).from_string(_PAGE)
    return template.render(title=f"{PROGRAM} {VERSION}", machine=machine(), parts=parts)


def machine() -> str:
    """The machine and the date of the measurement."""
    bytes_here = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    cores = len(os.sched_getaffinity(0))
    return (
        f"{_processor()}, {cores} core{'s' if cores > 1 else ''}, {bytes_here / 2**30:.0f} GB; "
        f"{platform.system()} {platform.release()}, Python {platform.python_version()}; "
        f"{time.strftime('%Y-%m-%d')}"
    )


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.machine()


def _shaped(table: Any, counted: dict[str, int]) -> dict:
    """A table as the template needs it; numbers it and its figure."""
    image = drawn(table)
    counted["tables"] += 1
    counted["figures"] += image is not None
    words = [any(isinstance(row[k], str) for row in table.rows) for k in range(len(table.columns))]
    return {
        "title": table.title,
        "notes": table.remarks,
        "image": image,
        "number": counted["tables"],
        "figure": counted["figures"],
        "long": len(table.rows) > LONG,
        "columns": [
            (name, "" if unit == "-" else unit, word)
            for (name, unit), word in zip(table.columns, words, strict=True)
        ],
        "rows": [
            [(_shown(value), word) for value, word in zip(row, words, strict=True)]
            for row in table.rows
        ],
    }


def _shown(value: Any) -> str:
    """Three digits; powers of ten below a thousandth and from a million up."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float):
        return "" if value is None else str(value)
    if value == 0 or 1e-3 <= abs(value) < 1e6:
        return f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"
    mantissa, _, power = f"{value:.2e}".partition("e")
    if not power:
        return mantissa  # NaN or infinity
    raised = str(int(power)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"{mantissa.rstrip('0').rstrip('.')}·10{raised}"
