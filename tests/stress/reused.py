"""Stages computed from what is stored: each gives the bits that it gave in the first run.

    PYTHONPATH=.:tests:tests/stress python3 -P tests/stress/reused.py --scenes 40 --seed 1

Random scenes that `check` accepts are run whole; then each result file in turn is removed and the scene is run
again, so that its stage is computed from files where it was computed from memory. What a file does not keep shows.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
from attack import content, differences
from fuzz_scenes import LIMIT, random_scene
from in_child import forked, warm
from scene_makers import write_files


def attack(folder: Path, scenes: int, seed: int, limit: float = LIMIT) -> list[str]:
    """What was not the same, a line each."""
    warm()
    write_files(folder)
    failures: list[str] = []
    for number in range(scenes):
        rng = np.random.default_rng([seed, 3, number])
        name, changed = random_scene(folder / "run.toml", rng)
        status = _run(folder, changed, folder / "whole", limit)
        parts = sorted((folder / "whole").glob("*.h5")) if status == 0 else []
        print(f"  scene {number}: {name} {changed}: exit {status}, {len(parts)} files", flush=True)
        if status not in (0, 2, 3, 4, None):
            failures.append(f"{name} {changed}: exit {status}")
        whole = content(folder / "whole") if parts else {}
        for part in parts:
            shutil.rmtree(folder / "again", ignore_errors=True)
            shutil.copytree(folder / "whole", folder / "again")
            (folder / "again" / part.name).unlink()
            ended = _run(folder, changed, folder / "again", limit)
            if ended is None:
                continue
            wrong = (
                differences(whole, content(folder / "again")) if ended == 0 else [f"exit {ended}"]
            )
            if wrong:
                failures.append(f"{name} {changed} without {part.name}: {wrong}")
                print(f"    {failures[-1]}", flush=True)
    return failures


def _run(folder: Path, changed: list[str], out: Path, limit: float) -> int | None:
    """Exit status of the scene; what is in `out` and belongs to it is kept. None where time was up."""
    command = ["run", str(folder / "run.toml"), "--out", str(out)]
    command += [part for item in changed for part in ("--set", item)]
    if out.name == "whole":
        shutil.rmtree(out, ignore_errors=True)

    def run() -> int:
        from tireroad.runs.cli import main

        return main(command)

    return forked(run, folder / "said.txt", limit)[0]


def main() -> int:
    """1 where something was not the same."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=LIMIT, help="seconds a run may take")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        failures = attack(Path(name), args.scenes, args.seed, args.limit)
    print(f"{len(failures)} differences")
    return min(len(failures), 1)


if __name__ == "__main__":
    sys.exit(main())
