"""Results of a resumable benchmark: a JSON file per case; each case runs in its own process."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from tireroad.fem.errors import ConvergenceError
from tireroad.runs.files.disk import write_text
from tireroad.runs.files.store import identity
from tireroad.runs.process import console
from tireroad.tests.bench.parts import apart
from tireroad.tests.bench.parts.rolling_cases import Case

Records = list[dict[str, Any]]
Task = Callable[..., Records]
"""task(case, folder, kept, *settings): a module-level function."""


def every_case(
    cases: Iterable[Case],
    folder: Path,
    kept: Path,
    task: Task,
    settings: Callable[[Case], tuple],
    told: Callable[[Records], str],
) -> tuple[dict[Case, Records], list[str]]:
    """The task's results for each case, from `kept` if stored by the same program and settings.

    Also one line per failed case. Cases work in a folder per wheel; `told` makes the message about
    a result. `settings` are text and numbers. On one process.
    """
    found, failed = dict[Case, Records](), list[str]()
    for case in cases:
        name = (task.__module__ or "").rpartition(".")[2]
        file = kept / name / f"{case.wheel}-{case.road}.json"
        of = [identity("accuracy").code, *case.given, *settings(case)]
        known = read_kept(file, of)
        if known is None:
            console.say(f"  {case} ...")
            try:
                known = apart.apart(task, case, folder / case.wheel, kept, *settings(case))
            except ConvergenceError as error:
                failed.append(f"{case}: {error}")
                console.say(f"  {failed[-1]}")
                continue
            write_kept(file, of, known)
        found[case] = known
        console.say(f"  {case}: {told(known)}")
    return found, failed


def read_kept(file: Path, of: list[Any]) -> Records | None:
    """Records stored by an earlier benchmark with the same program and settings, or None."""
    if not file.exists():
        return None
    data = json.loads(file.read_text(encoding="utf-8"))
    return data["found"] if data["of"] == _plain(of) else None


def write_kept(file: Path, of: list[Any], found: Records) -> None:
    """Store records, with the program and settings they are `of`."""
    file.parent.mkdir(parents=True, exist_ok=True)
    write_text(file, json.dumps({"of": of, "found": found}, indent=1) + "\n")


def _plain(of: list[Any]) -> Any:
    """The value as read back from JSON: tuples become lists."""
    return json.loads(json.dumps(of))
