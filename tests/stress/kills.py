"""Kill runs at random moments and let them go on: the results must be those of an unbroken run.

    PYTHONPATH=.:tests:tests/stress python3 tests/stress/kills.py --kills 100 --seed 1 [--processes 2] [--compile]

Signals: SIGKILL to the launcher's process, to one of the program's, or to all of them, SIGTERM, SIGHUP,
SIGINT. With --compile every run begins without compiled forms. On several processes half of the runs
find the stages before the loop, those of the unbroken run, and must give its bits; the others begin
afresh, which does not repeat round-off, and must agree to that. Every fourth run makes a report too.
"""

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from attack import (
    apart,
    command,
    content,
    differences,
    finished,
    gone,
    processes_with,
    started,
    told,
    write_scene,
)

BEFORE_THE_LOOP = (
    "static.h5",
    "modes.h5",
    "rotating.h5",
    "greens.h5",
    "summary.json",
    "scene.toml",
)


def attack(
    folder: Path, kills: int, seed: int, processes: int = 1, fresh_forms: bool = False
) -> list[str]:
    """Kill until `kills` is reached, a few times each run; what went wrong, one line each."""
    dice, failures, done = random.Random(seed), [], 0
    scene, whole = write_scene(folder), folder / "whole"
    began = time.monotonic()
    # Compiled here too: forms that were kept long ago may hold tables that other kernels of BLAS rounded.
    status, text = finished(
        _line(scene, whole, processes, report=False), **_own_cache(whole, fresh_forms)
    )
    if status:
        return [f"the unbroken run ended with {status}: {text}"]
    length = time.monotonic() - began
    wanted = content(whole)
    trial = 0
    while done < kills:
        trial += 1
        out = folder / f"broken{trial}"
        same = processes == 1 or trial % 2 == 0
        if processes > 1 and same:
            out.mkdir()
            for name in BEFORE_THE_LOOP:
                shutil.copy(whole / name, out / name)
        extra = _own_cache(out, fresh_forms)
        line = _line(scene, out, processes, report=trial % 4 == 3)
        for _ in range(min(dice.randint(1, 5), kills - done)):
            done += _killed(line, out, dice.uniform(0, length), dice, failures, extra)
        failures += _recovered(line, out, (wanted, differences if same else apart), extra)
        print(*failures[-3:], sep="\n", end="\n" if failures else "")
        print(f"{done} kills, {len(failures)} failures", flush=True)
        for path in (out, *extra.values()):
            shutil.rmtree(path, ignore_errors=True)
    return failures


def _own_cache(out: Path, own: bool) -> dict[str, str]:
    return {"XDG_CACHE_HOME": str(out.with_suffix(".cache"))} if own else {}


def _line(scene: Path, out: Path, processes: int, report: bool) -> list[str]:
    last = () if report else ("--until", "spectra")
    return command("run", scene, "--out", out, *last, processes=processes)


def _killed(
    line: list[str], out: Path, wait: float, dice: random.Random, failures: list[str], extra: dict
) -> int:
    """One run, killed after a while; 1, or 0 where it had ended before."""
    how = dice.choice(["launcher", "one", "all", "all", "SIGTERM", "SIGHUP", "SIGINT"])
    with started(line, **extra) as process:
        try:
            text, _ = process.communicate(timeout=wait)
            if process.returncode != 0:
                failures.append(f"ended with {process.returncode} unasked: {text}")
            return 0
        except subprocess.TimeoutExpired:
            _strike(process, out, how, dice)
        text, _ = process.communicate(timeout=600)
    if "Traceback" in text:
        failures.append(f"{how} after {wait:.2f} s: {text}")
    if how.startswith("SIG") and process.returncode not in (0, 4):
        failures.append(f"{how} after {wait:.2f} s ended with {process.returncode}: {text}")
    if not gone(str(out)):
        failures.append(f"{how} after {wait:.2f} s left processes behind")
    return 1


def _strike(process: subprocess.Popen, out: Path, how: str, dice: random.Random) -> None:
    if how.startswith("SIG"):
        process.send_signal(signal.Signals[how])
        return
    own = [*processes_with(str(out)), process.pid]
    targets = {"launcher": [process.pid], "one": [dice.choice(own)], "all": own}[how]
    for target in targets:
        with suppress(ProcessLookupError):
            os.kill(target, signal.SIGKILL)


def _recovered(
    line: list[str], out: Path, unbroken: tuple[dict, Callable], extra: dict[str, str]
) -> list[str]:
    """Let the run go on to its end; what is not as in the unbroken one, by the function given with it."""
    status, text = finished(line, **extra)
    if status or "Traceback" in text:
        return [f"{out.name} did not recover, status {status}: {text}"]
    wanted, compare = unbroken
    found = [f"{out.name} differs: {name}" for name in compare(wanted, content(out))]
    found += [f"left behind: {path}" for path in out.glob(".*.part")]
    for cache in extra.values():
        found += [f"left behind: {path}" for path in Path(cache).glob("tireroad/*/run-*")]
    return found


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--kills", type=int, default=100)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--processes", type=int, default=1)
    options.add_argument("--compile", action="store_true")
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as name:
        found = attack(Path(name), given.kills, given.seed, given.processes, given.compile)
    sys.exit(told(found, given.kills, "kills"))
