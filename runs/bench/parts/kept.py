"""Results of a bench that goes on where it was stopped: a JSON file a case, with what they are of."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tireroad.runs.files.disk import write_text

Records = list[dict[str, Any]]


def read_kept(file: Path, of: list[Any]) -> Records | None:
    """Records that an earlier bench kept of the same program and settings; None where there are none."""
    if not file.exists():
        return None
    data = json.loads(file.read_text(encoding="utf-8"))
    return data["found"] if data["of"] == _plain(of) else None


def write_kept(file: Path, of: list[Any], found: Records) -> None:
    """Keep records, and the program and settings they are `of`."""
    file.parent.mkdir(parents=True, exist_ok=True)
    write_text(file, json.dumps({"of": of, "found": found}, indent=1) + "\n")


def _plain(of: list[Any]) -> Any:
    """As it comes back from a file: tuples are lists there."""
    return json.loads(json.dumps(of))
