"""Every key of a scene at both ends of its range, and at each of its choices, through `check` and `run`.

    PYTHONPATH=.:tests:tests/stress python3 -P tests/stress/both_ends.py --limit 60

Each value is laid over the first scene that `check` accepts with it, on a small mesh. Allowed ends:
exit status 0 with results that are numbers, 2 or 3 with a message; never a traceback; memory within
the estimate. A run that takes longer than the limit is stopped: that must end it, too. `--only
NAME` takes the keys that begin so.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from fuzz_scenes import run_scene_file
from in_child import judged, warm
from scene_makers import BASES, SIZES, needed, write_files

from tireroad.fem.errors import InputError
from tireroad.runs.check import explain
from tireroad.runs.scene.load import load
from tireroad.runs.scene.road_cache import _LAST
from tireroad.runs.scene.schema import walk
from tireroad.runs.scene.tables.scene import Scene


def ends(name: str, key) -> Iterator[str]:
    """The values to try, in TOML."""
    if key.choices:
        yield from key.choices
    elif key.values == "true, false":
        yield from ("true", "false")
    elif key.limits is not None and name not in SIZES:
        for end in (key.limits.least, key.limits.most):
            if end is None:
                continue
            whole = key.values == str(key.limits) and key.unit == "-"
            one = str(int(end)) if whole and float(end).is_integer() else repr(float(end))
            counted = key.values.split()[0] if "numbers" in key.values else ""
            many = int(counted) if counted.isdigit() else 1
            yield f"[{', '.join([one] * many)}]" if counted else one


def accepted(folder: Path, changed: list[str]) -> str | None:
    """The first scene that goes with the values, written to the folder; None where none does."""
    path = folder / "run.toml"
    _LAST.clear()  # a road kept here would count as the run's memory
    for name, (text, _) in BASES.items():
        path.write_text(text)
        with suppress(InputError):
            explain(load(path, changed))
            return name
    return None


def main() -> int:
    """Number of values that ended as they must not."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--limit", type=float, default=60.0, help="seconds a run may take")
    parser.add_argument("--only", default="", help="keys that begin so")
    given = parser.parse_args()
    warm()
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_files(folder)
        for dotted, of, _, key in walk(Scene):
            key_name = dotted.replace("[]", ".0")
            if key.is_file or not key_name.startswith(given.only):
                continue
            for value in ends(key_name, key):
                changed = [*needed(key_name, of, key), f"{key_name}={value}"]
                base = accepted(folder, changed)
                if base is None:
                    counts["refused by every scene"] += 1
                    continue
                status, said, memory = run_scene_file(folder, changed, given.limit)
                wrong = judged(status, said, memory, folder / "out")
                counts[
                    "FAILED" if wrong else "stopped" if status is None else f"exit {status}"
                ] += 1
                if wrong:
                    print(f"FAILED {base} {changed}: {wrong}", flush=True)
    print(", ".join(f"{what}: {count}" for what, count in sorted(counts.items())))
    return counts["FAILED"]


if __name__ == "__main__":
    sys.exit(1 if main() else 0)
