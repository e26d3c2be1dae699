"""The kit of all pages: one template with one style sheet, filled by report, comparison, sweep and tables.

A page is `pages/NAME.html.j2`, which extends `pages/base.html.j2` (title, heading, style, content) and
takes tables, facts and drawings from `pages/parts.html.j2`. It is self-contained: no network, no other
file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tireroad.runs.report.read import quantity
from tireroad.runs.version import PROGRAM, VERSION

PAGES = Path(__file__).parent / "pages"


def page_of(
    name: str,
    title: str,
    *,
    folder: Path = PAGES,
    filters: Mapping[str, Callable[..., Any]] | None = None,
    **values: Any,
) -> str:
    """The text of a page with its `title`; the template `name` is in the `folder`.

    `filters`: functions that the template uses, besides `quantity`; `values`: what it shows.
    """
    pages = Environment(
        loader=FileSystemLoader([PAGES, folder]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    pages.filters |= {"quantity": quantity} | dict(filters or {})
    template = pages.get_template(f"{name}.html.j2")
    return template.render({"title": title, "program": f"{PROGRAM} {VERSION}"} | values)
