"""Tables of measured figures: printed, saved as JSON, and drawn on a page."""

from __future__ import annotations

import importlib
import inspect
import io
import json
import pkgutil
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.files.disk import write_text
from tireroad.runs.process import console
from tireroad.runs.process.signals import Stopped
from tireroad.runs.version import PROGRAM, VERSION


def asked(words: Iterable[str], only: Sequence[str]) -> bool:
    """Whether a case of these words has all of one of `only`, as in "radial texture 30"; none asks for all."""
    return not only or any(set(one.split()) <= set(words) for one in only)


@dataclass
class Table:
    """Rows under (name, unit) columns; `notes` say what was measured and what the target is.

    `plot`: figure specification for runs.validation.tables_page. `failed`: what could not be measured, one
    line each with the reason.
    """

    title: str
    columns: list[tuple[str, str]]
    rows: list[list]
    notes: list[str] = field(default_factory=list)
    plot: dict | None = None
    failed: list[str] = field(default_factory=list)

    @property
    def remarks(self) -> list[str]:
        """The remarks under the table."""
        return [*self.notes, *(f"not measured: {line}" for line in self.failed)]


def modules(package: str) -> dict[str, ModuleType]:
    """A package's modules by name, subfolders included: each has ABOUT and run() -> list[Table].

    Some also have run_large(): the same on a mesh that takes too long to wait for.
    """
    path = importlib.import_module(package).__path__
    names = [
        module.name for module in pkgutil.walk_packages(path, f"{package}.") if not module.ispkg
    ]
    loaded = {name.rpartition(".")[2]: importlib.import_module(name) for name in names}
    return {name: loaded[name] for name in sorted(loaded) if hasattr(loaded[name], "ABOUT")}


def run_all(
    package: str,
    names: list[str],
    out: Path | None,
    large: bool = False,
    only: Sequence[str] = (),
) -> None:
    """Run the named modules of a package (all by default), show their tables; save them after each.

    `large`: run only modules with a full-size version, in that version; `only`: the cases with all words of one of these, of
    modules whose run() takes `only`. Raises InputError before anything runs if `out` cannot be written or a module
    has no cases, ConvergenceError at the end if something could not be measured.
    """
    known = modules(package)
    if large:
        known = {name: module for name, module in known.items() if hasattr(module, "run_large")}
    for name in names:
        if name not in known:
            raise InputError(f"{name!r} is none of: {', '.join(known)}")
        if only and "only" not in _parameters(known[name]):
            raise InputError(f"{name} has no cases to choose from: --only is not for it")
    if only and not names:
        raise InputError("--only chooses from the cases of a benchmark: name it")
    measurements = {
        name: (known[name].ABOUT, partial(_measured, known[name], out, large, only))
        for name in names or known
    }
    _all_measured(measurements, out)


def run_scenes(scenes: list[Path], out: Path | None) -> None:
    """Run scenes against full finite elements in time, show their tables, and save them as `run_all` does."""
    from tireroad.runs.validation.own_scene import against_elements

    about = "forces of a scene against full finite elements of the same mesh, in time"
    _all_measured({str(scene): (about, partial(against_elements, scene)) for scene in scenes}, out)


def _all_measured(
    measurements: Mapping[str, tuple[str, Callable[[], list[Table]]]], out: Path | None
) -> None:
    """Show the tables of each measurement, (what it is about, its function) by name; save them after each."""
    if out is not None:
        _check(out)
    results: dict[str, list[Table]] = {}
    try:
        for name, (about, measure) in measurements.items():
            console.say(f"{name}: {about}")
            began = time.perf_counter()
            results[name] = measure()
            for table in results[name]:
                show(table)
            console.say(f"{name}: {time.perf_counter() - began:.1f} s\n")
            if out is not None:
                _keep(results, {name: measurements[name][0] for name in results}, out)
    except Stopped as stop:
        stop.kept = _left(results, out)
        raise
    if out is not None:
        console.say(f"{out} and {out.with_suffix('.html')}")
    failed = [line for tables in results.values() for table in tables for line in table.failed]
    if failed:
        raise ConvergenceError(f"not measured: {'; '.join(failed)}")


def _check(out: Path) -> None:
    """Make the folder of `out`; InputError if no file of that name can be written there."""
    if out.is_dir():
        raise InputError(f"--out {out} is a folder: name a file, such as {out / 'measured.json'}")
    if out.exists() and not out.is_file():  # a device would be replaced by the file
        raise InputError(f"--out {out} is not an ordinary file: name another one")
    if out.suffix == ".html":
        raise InputError(f"--out {out}: a page of this name is written beside it; end it in .json")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out.parent):
            pass
    except OSError as error:
        raise InputError(f"--out {out} cannot be written: {error.strerror}") from None


def _left(results: dict[str, list[Table]], out: Path | None) -> str:
    """Message on the results that a stop leaves."""
    if out is None:
        return "nothing is kept; with --out FILE.json what is finished is written there"
    finished = f"{', '.join(results)} in {out}" if results else "nothing in the file of --out"
    folder = out.with_suffix(".kept")
    if folder.is_dir():
        return f"kept are {finished}, and cases of the last one in {folder}: the same command continues"
    return f"kept are {finished}; name those that remain, with another --out"


def _measured(
    module: ModuleType, out: Path | None, large: bool, only: Sequence[str]
) -> list[Table]:
    """The tables of a module; one that can resume gets a folder beside `out` for its results so far."""
    if large:
        return module.run_large()
    given: dict[str, Any] = {"only": only} if only else {}
    if out is not None and "kept" in _parameters(module):
        given["kept"] = out.with_suffix(".kept")
    return module.run(**given)


def _parameters(module: ModuleType) -> Mapping[str, inspect.Parameter]:
    """The parameters of a module's run()."""
    return inspect.signature(module.run).parameters


def show(table: Table) -> None:
    """Print a table as text."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table as Grid

    grid = Grid(title=table.title, title_justify="left", header_style="bold")
    for name, unit in table.columns:
        grid.add_column(
            name if unit in ("", "-") else f"{name} [{unit}]".replace("[", r"\["), overflow="fold"
        )
    for row in table.rows:
        grid.add_row(*(escape(_shown(value)) for value in row))
    text = io.StringIO()
    Console(file=text, width=120).print(grid)
    console.say(text.getvalue().rstrip())
    for line in table.remarks:
        console.say(f"  {line}")


def _shown(value) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float | np.floating) else str(value)


def _keep(results: dict[str, list[Table]], about: dict[str, str], out: Path) -> None:
    """Write JSON at `out`, and a page with figures beside it."""
    from tireroad.runs.validation.tables_page import machine, page

    data = {name: [asdict(table) for table in tables] for name, tables in results.items()}
    head = {"program": PROGRAM, "version": VERSION, "machine": machine()}
    text = json.dumps(head | {"results": data}, indent=1, default=lambda number: number.item())
    write_text(out, text + "\n")
    write_text(out.with_suffix(".html"), page(results, about))
