"""Random damage to decks, meshes, section files, sweeps and laser lines: by hand, in minutes.

    PYTHONPATH=.:tests:tests/stress:tests/fem/decks python3 -P tests/stress/damaged_texts.py --count 3000 --seed 7

Allowed ends: what the reader makes of it, or an InputError. `test_mutant_decks.py` runs a short form for decks.
"""

from __future__ import annotations

import argparse
import re
import signal
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from mutants import DECKS, mutants

from tireroad.contact.roads.kinds.laser import LaserFile
from tireroad.fem.decks.own import Wishes, read
from tireroad.fem.errors import InputError
from tireroad.fem.sections.section_file import read as read_section
from tireroad.runs.sweep.definition import read as read_sweep

ROOT = Path(__file__).resolve().parents[2]
LIMIT = 60  # s for a case
SWEEP = b"""name = "s"
scene = "scene.toml"
[[axis]]
key = "rotation.speed"
values = [20.0, 40.0, 60.0]
[[axis]]
key = "static.load"
range = [3000.0, 4000.0]
count = 3
[slurm]
time = "01:00:00"
"""
SCENE = "[tire]\n[static]\nload = 500.0\n[rotation]\nspeed = 50.0\n"


def texts() -> Iterator[tuple[str, bytes, Callable[[Path], object]]]:
    """Name and content of a good file, and what reads it."""
    page = (ROOT / "docs" / "section-file.md").read_text(encoding="utf-8")
    (section,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)[:1]
    yield "section.toml", section.encode(), read_section
    yield "sweep.toml", SWEEP, read_sweep
    rng = np.random.default_rng(0)
    line = zip(0.04 * np.arange(400), 0.04 * rng.standard_normal(400).cumsum(), strict=True)
    heights = "\n".join(f"{x:.2f},{z:.4f}" for x, z in line)
    yield "laser.csv", heights.encode(), lambda file: LaserFile(file=str(file)).make()
    for name, data in DECKS.items():
        wishes = Wishes(rim=("RIMNODES",) if name.endswith("inp") else ())
        yield name, data, lambda file, wishes=wishes: read(file, wishes)


def _alarm(*_: object) -> None:
    raise TimeoutError


def attack(folder: Path, count: int, seed: int) -> list[str]:
    """What ended otherwise than allowed, a line each; a line of counts a file is printed."""
    signal.signal(signal.SIGALRM, _alarm)
    (folder / "scene.toml").write_text(SCENE)
    failures: list[str] = []
    for name, data, use in texts():
        ends: Counter[str] = Counter()
        assert _end(use, folder / name, data) == "read", name
        for number, damaged in enumerate(mutants(data, count, seed)):
            end = _end(use, folder / name, damaged)
            ends[end.partition(" ")[0]] += 1
            if end not in ("read", "refused"):
                failures.append(f"{name} {number}: {end}")
        print(name, dict(ends), flush=True)
    return failures


def _end(use: Callable[[Path], object], file: Path, data: bytes) -> str:
    file.write_bytes(data)
    signal.alarm(LIMIT)
    try:
        use(file)
    except InputError:
        return "refused"
    except Exception:
        return f"crash {traceback.format_exc()[-900:]}"
    finally:
        signal.alarm(0)
    return "read"


def main() -> int:
    """1 where something crashed or hung."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=3000, help="damaged copies of each file")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as name:
        failures = attack(Path(name), args.count, args.seed)
    print(*failures, f"{len(failures)} failures", sep="\n")
    return min(len(failures), 1)


if __name__ == "__main__":
    sys.exit(main())
