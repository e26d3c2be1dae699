"""Random scenes through `check` and `run`, random damage to road files: by hand, in minutes to an hour.

    PYTHONPATH=.:tests:tests/stress python3 -P tests/stress/fuzz_scenes.py --seed 7 --checks 1000 --runs 200 --roads 400

Allowed ends: exit status 0 with results that are numbers, 2, 3 and 4 with a message and no traceback, for
roads an InputError or a road; never a hang; memory within the estimate. `test_fuzz.py` runs a short
form. Each case depends on the seed and its number.
"""

from __future__ import annotations

import argparse
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
from damaged_roads import LIMIT, fuzz_road, road_files
from in_child import forked, warm
from in_child import judged as ended
from scene_makers import BASES, damaged, overrides, write_files

from tireroad.fem.errors import InputError
from tireroad.runs.check import explain
from tireroad.runs.process.mpi import ending
from tireroad.runs.scene.load import load

FEW = 10  # runs up to which the scenes to start from are not run themselves
RARE = 0.05  # share of runs of the radial tire, which has many unknowns


class Hang(BaseException):
    """A case that took longer than LIMIT."""


def _alarm(*_: object) -> None:
    raise Hang


def limited(function: Callable[[], str]) -> str:
    """What `function` returns, or "hang", or the traceback of what it raised."""
    signal.signal(signal.SIGALRM, _alarm)
    signal.setitimer(signal.ITIMER_REAL, LIMIT)
    try:
        return function()
    except Hang:
        return "hang"
    except Exception:
        return f"crash {traceback.format_exc()}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def _base(rng: np.random.Generator) -> tuple[str, str, str]:
    """Name of a scene to start from, its text, the tables to change."""
    names = list(BASES)
    usual = (1 - RARE) / (len(names) - 1)
    name = str(rng.choice(names, p=[RARE if n == "radial" else usual for n in names]))
    return name, *BASES[name]


def fuzz_check(folder: Path, seed: int, number: int) -> tuple[str, str]:
    """(end, what was tried) of one scene through `check`."""
    rng = np.random.default_rng([seed, 1, number])
    name, text, focus = _base(rng)
    write_files(folder)
    path, changed = folder / "check.toml", []
    if rng.random() < 0.25:
        path.write_bytes(damaged(rng, text))
    else:
        path.write_text(text)
        changed = overrides(rng, rng.random() < 0.5, focus)

    def run() -> str:
        with ending() as end:
            explain(load(path, changed))
        if end.status not in (0, 2):
            return f"crash {end.status} {end.message}"
        return f"exit {end.status}" if len(end.message) < 20_000 else "crash: endless message"

    return limited(run), f"{name} {changed}"


def random_scene(path: Path, rng: np.random.Generator) -> tuple[str, list[str]]:
    """Name and overrides of a scene that `check` accepts, if a hundred are enough to find one; its text is written."""
    for _ in range(100):
        name, text, focus = _base(rng)
        path.write_text(text)
        changed = overrides(rng, True, focus)
        with suppress(InputError):
            explain(load(path, changed))
            break
    return name, changed


def fuzz_run(folder: Path, seed: int, number: int, limit: float) -> tuple[str, str]:
    """(end, what was tried) of one scene that `check` accepts, through `run` on a small mesh, in `limit` s."""
    write_files(folder)
    name, changed = random_scene(folder / "run.toml", np.random.default_rng([seed, 2, number]))
    status, said, memory = run_scene_file(folder, changed, limit)
    tried = f"{name} {changed} {said.strip()[-300:]}"
    wrong = ended(status, said, memory, folder / "out")
    return wrong or ("stopped" if status is None else f"exit {status}"), tried


def run_scene_file(folder: Path, changed: list[str], limit: float) -> tuple[int | None, str, int]:
    """Status, output and memory of the scene run.toml in a folder."""
    out = folder / "out"
    command = ["run", str(folder / "run.toml"), "--out", str(out), "--until", "spectra"]
    command += [part for item in changed for part in ("--set", item)]
    shutil.rmtree(out, ignore_errors=True)

    def run() -> int:
        from tireroad.runs.cli import main

        return main(command)

    return forked(run, folder / "said.txt", limit)


def run_bases(folder: Path) -> None:
    """Every scene to start from, unchanged: it must run, and its forms are compiled from then on."""
    write_files(folder)
    for name, (text, _) in BASES.items():
        (folder / "run.toml").write_text(text)
        status, said, memory = run_scene_file(folder, [], 20 * LIMIT)
        wrong = ended(status, said, memory, folder / "out")
        assert status == 0 and not wrong, f"{name}: {status} {wrong} {said}"


def main() -> int:
    """Number of cases that ended as they must not."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, count in (("seed", 1), ("checks", 1000), ("runs", 200), ("roads", 400)):
        parser.add_argument(f"--{name}", type=int, default=count)
    parser.add_argument("--limit", type=float, default=LIMIT, help="seconds a run may take")
    args = parser.parse_args()
    bad = 0
    warm()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = list(road_files(folder))
        if args.runs > FEW:
            run_bases(folder)
        for what, count, case in (
            ("check", args.checks, lambda n: fuzz_check(folder, args.seed, n)),
            ("road", args.roads, lambda n: fuzz_road(files, args.seed, n)),
            ("run", args.runs, lambda n: fuzz_run(folder, args.seed, n, args.limit)),
        ):
            began, ends = time.monotonic(), Counter()
            for number in range(count):
                end, tried = case(number)
                good = end.startswith(("exit", "driven", "refused", "stopped"))
                ends[end if good else "wrong"] += 1
                bad += not good
                if not good or what == "run":
                    print(f"  {what} {number}: {end}: {tried}", flush=True)
            print(f"{what}: {dict(ends)} in {time.monotonic() - began:.0f} s", flush=True)
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main())
