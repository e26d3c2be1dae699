"""The command `reproduce`: the figures and tables of the thesis, and which of them agree."""

from __future__ import annotations

import importlib
import pkgutil
import time
from collections.abc import Sequence
from pathlib import Path

from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.files.cache import Cache
from tireroad.runs.process import console
from tireroad.runs.process.mpi import on_root
from tireroad.tests.thesis import figures, output
from tireroad.tests.thesis.figure import FIGURES, Figure, chosen
from tireroad.tests.thesis.runner import Scenes


def known() -> dict[str, Figure]:
    """All figures and tables by name, figures first, in the order of the thesis."""
    for found in pkgutil.iter_modules(figures.__path__):
        importlib.import_module(f"{figures.__name__}.{found.name}")
    return {name: FIGURES[name] for name in sorted(FIGURES, key=_place)}


def _place(name: str) -> tuple[str, str, int]:
    kind, _, number = name.partition("-")
    chapter, _, place = number.partition(".")
    return kind, chapter, int(place)


def reproduce(names: Sequence[str], directory: Path, comm: MPI.Comm) -> None:
    """Compute the named figures (all by default) into the directory. Collective.

    Raises InputError for an unknown name or a folder that cannot be created; ConvergenceError,
    after all others are done, if a figure could not be computed.
    """
    wanted = chosen(names, known())
    on_root(comm, lambda: _made(directory))
    cache = Cache.of_user().of_family(directory / "cache")
    scenes, entries, began = Scenes(directory, comm, cache), [], time.perf_counter()
    for one in wanted:
        entries.append(_entry(one, scenes))
        page = on_root(
            comm,
            lambda: output.write(entries, directory, time.perf_counter() - began, comm.size),
        )
        console.say(f"{one.name:12s} {entries[-1].verdict:20s} {entries[-1].seconds:7.1f} s")
    console.say(
        f"{page} and reproduce.json, reproduce.csv beside it: {time.perf_counter() - began:.1f} s"
    )
    failed = [f"{entry.figure.name}: {entry.failed}" for entry in entries if entry.failed]
    if failed:
        raise ConvergenceError(
            f"reproduce: {len(failed)} of {len(entries)} gave up: {'; '.join(failed)}"
        )


def _made(directory: Path) -> None:
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{directory}: cannot be made ({error.strerror}): choose another --out"
        ) from None


def _entry(one: Figure, scenes: Scenes) -> output.Entry:
    """Compute and draw a figure, or record its failure. Collective."""
    began = time.perf_counter()
    try:
        found = one.compute(scenes)
    except (ConvergenceError, InputError) as error:  # an input error: too little memory or disk
        return output.Entry(one, time.perf_counter() - began, failed=str(error))
    picture = on_root(scenes.comm, found.picture) if found.picture else ""
    return output.Entry(one, time.perf_counter() - began, found, picture)
