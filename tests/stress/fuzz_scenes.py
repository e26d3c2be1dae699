"""Random scenes through `check` and `run`, random damage to road files: by hand, in minutes to an hour.

    PYTHONPATH=. python3 tests/stress/fuzz_scenes.py --seed 7 --checks 1000 --runs 200 --roads 400

Allowed ends: exit status 0, 2, 3 and 4 with a message and no traceback, for roads an InputError or a
road; never a hang. `test_fuzz.py` runs a short form. Each case depends on the seed and its number.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.runs.process.mpi import judged
from tireroad.runs.scene.check import explain
from tireroad.runs.scene.load import load
from tireroad.runs.scene.schema import walk
from tireroad.runs.scene.tables.scene import Scene

BASE = """
name = "fuzz"
[tire]
segments = 12
elements_arc = 4
[tire.material]
youngs_modulus = 48e6
[static]
load = 300.0
[modal]
count = 8
[rotation]
speed = 50.0
[contact]
[road]
[time]
duration = 0.004
step = 2e-4
"""
FORCES = """
name = "fuzz"
[tire]
segments = 12
elements_arc = 4
[modal]
count = 8
[[force]]
amplitude = 2.0
[time]
duration = 0.01
[output.receptance]
to = 100.0
step = 10.0
"""
NASTY = ["nan", "inf", "-inf", "true", '"text"', '""', "[]", "[1]", "[1, 2, 3]", "{}", "{a = 1}", "0",
         "-0.0", "-1", "1e308", "-1e308", "5e-324", "1" + "0" * 400, "2147483648", "1979-05-27",
         '"' + "x" * 3000 + '"', "nodes", "auto", "{dx = 1e-5, dy = 1}", "{dx = 0.004, dy = 0.004}",
         '"\\u0000"', "../../etc/passwd", "/dev/zero", "/dev/null", "/", "[[1, 2], [3]]"]  # fmt: skip
LIMIT = 60.0  # s for a case
# Keys whose large values only make a run long.
SIZES = (
    "tire.segments",
    "tire.elements_arc",
    "tire.elements_thickness",
    "tire.order",
    "modal.count",
)


def value(rng: np.random.Generator, key, legal: bool) -> str:
    """A value of a key in TOML: one of its range, its ends included, or anything at all."""
    if not legal and rng.random() < 0.6:
        return str(rng.choice(NASTY))
    if key.choices:
        return str(rng.choice(list(key.choices)))
    if key.values == "true, false":
        return str(rng.choice(["true", "false"]))
    if key.limits is None:
        return str(rng.choice(NASTY))
    if "numbers" in key.values:
        counted = key.values.split()[0]
        count = int(counted) if counted.isdigit() else int(rng.integers(1, 4))
        return f"[{', '.join(_number(rng, key.limits, legal) for _ in range(count))}]"
    number = _number(rng, key.limits, legal)
    return str(int(float(number))) if key.values == str(key.limits) and key.unit == "-" else number


def _number(rng: np.random.Generator, limits, legal: bool) -> str:
    ends = [e for e in (limits.least, limits.above, limits.most, limits.below) if e is not None]
    low, high = (ends[0], ends[-1]) if len(ends) == 2 else (-1e3, 1e3)
    kind = rng.integers(4)
    if kind == 0:
        return repr(float(rng.choice([low, high])))
    if kind == 1 and low >= 0 and high > 0:
        return repr(float(np.exp(rng.uniform(np.log(max(low, 1e-9 * high)), np.log(high)))))
    if kind == 2 and not legal:
        return repr(float(rng.choice([low, high]) * (1 + rng.choice([-1e-9, 1e-9, 1e-3, -2.0]))))
    return repr(float(rng.uniform(low, high)))


def overrides(rng: np.random.Generator, legal: bool) -> list[str]:
    """Some keys with random values."""
    known = [(name.replace("[]", ".0"), key) for name, _, _, key in walk(Scene)]
    if legal:
        known = [(n, k) for n, k in known if not k.is_file and n not in SIZES and n != "name"]
    changed = []
    for _ in range(rng.integers(1, 4 if legal else 6)):
        name, key = known[rng.integers(len(known))]
        if not legal and rng.random() < 0.1:
            name = name[: rng.integers(1, len(name))]
        changed.append(f"{name}={value(rng, key, legal)}")
    return changed


def damaged(rng: np.random.Generator, text: str) -> bytes:
    """A scene's text with bytes changed, cut, or lines doubled."""
    data = bytearray(text.encode())
    for _ in range(rng.integers(1, 6)):
        data[rng.integers(len(data))] = rng.integers(256)
    if rng.random() < 0.3:
        data = data[: rng.integers(len(data))]
    if rng.random() < 0.3:
        data += data[rng.integers(len(data) + 1) :]
    return bytes(data)


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


def forked(function: Callable[[], str]) -> str:
    """The same in a process of its own: a segmentation fault ends that one."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        with os.fdopen(writing, "w") as pipe:
            pipe.write(limited(function))
            pipe.flush()
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        said = pipe.read()
    _, status = os.waitpid(child, 0)
    return said if said else f"crash: the process ended with {status}"


def fuzz_check(folder: Path, seed: int, number: int) -> tuple[str, str]:
    """(end, what was tried) of one scene through `check`."""
    rng = np.random.default_rng([seed, 1, number])
    text = str(rng.choice([BASE, FORCES]))
    path, changed = folder / "check.toml", []
    if rng.random() < 0.25:
        path.write_bytes(damaged(rng, text))
    else:
        path.write_text(text)
        changed = overrides(rng, legal=rng.random() < 0.5)

    def run() -> str:
        status, message = judged(lambda: explain(load(path, changed)))
        if status not in (0, 2):
            return f"crash {status} {message}"
        return f"exit {status}" if len(message) < 20_000 else "crash: endless message"

    return limited(run), f"{changed}"


def fuzz_run(folder: Path, seed: int, number: int) -> tuple[str, str]:
    """(end, what was tried) of one scene that `check` accepts, through `run` on a small mesh."""
    rng = np.random.default_rng([seed, 2, number])
    path = folder / "run.toml"
    for _ in range(100):
        path.write_text(str(rng.choice([BASE, BASE, FORCES])))
        changed = overrides(rng, legal=True)
        with suppress(InputError):
            explain(load(path, changed))
            break
    command = [sys.executable, "-P", "-m", "runs", "run", str(path), "--out", str(folder / "out")]
    command += ["--until", "spectra", *(part for item in changed for part in ("--set", item))]
    started = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        _, said = started.communicate(timeout=LIMIT)
    except subprocess.TimeoutExpired:
        started.terminate()
        try:
            _, said = started.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            started.kill()
            started.communicate()
            return "hang", f"{changed}"
    status = started.returncode
    if status not in (0, 2, 3, 4) or "Traceback" in said:
        return f"crash {status} {said[-2000:]}", f"{changed}"
    return f"exit {status}", f"{changed} {said.strip()[-300:]}"


def road_files(folder: Path) -> Iterator[Path]:
    """A small road in every format."""
    import h5py

    x, y = np.arange(0.0, 3.0, 0.02), np.arange(-0.3, 0.3, 0.02)
    z = 1e-3 * np.random.default_rng(0).standard_normal((len(x), len(y)))
    np.savez(folder / "a.npz", x=x, y=y, z=z)
    np.savez_compressed(folder / "b.npz", x=x, y=y, z=z)
    with h5py.File(folder / "c.h5", "w") as store:
        store["x"], store["y"] = x, y
        store.create_dataset("z", data=z, compression="gzip")
    head = ",".join(["", *map(str, y)])
    rows = [",".join(map(str, [px, *row])) for px, row in zip(x, z, strict=True)]
    (folder / "d.csv").write_text("\n".join([head, *rows]))
    sections = "".join(f"D:long section {i + 1},m\n" for i in range(len(y)))
    header = "$ROAD_CRG\nREFERENCE_LINE_INCREMENT = 0.02\nLONG_SECTION_V_INCREMENT = 0.02\n$\n"
    crg = (header + f"$KD_DEFINITION\n#:KRBI\n{sections}").encode() + b"$" * 80 + b"\n"
    crg += z.astype(">f4").tobytes() + b"\x7f\xc0\0\0" * (-z.size % 20)
    (folder / "e.crg").write_bytes(crg)
    yield from (folder / name for name in ("a.npz", "b.npz", "c.h5", "d.csv", "e.crg"))


def fuzz_road(files: list[Path], seed: int, number: int) -> tuple[str, str]:
    """(end, which file) of one road file with random damage."""
    from tireroad.contact.roads.road import make_road

    rng = np.random.default_rng([seed, 3, number])
    good = files[number % len(files)]
    data = bytearray(good.read_bytes())
    spread = len(data) if rng.random() < 0.5 else min(600, len(data))
    for _ in range(rng.integers(1, 20)):
        data[rng.integers(spread)] = rng.integers(256)
    if rng.random() < 0.2:
        data = data[: rng.integers(len(data))]
    bad = good.with_name(f"bad{good.suffix}")
    bad.write_bytes(bytes(data))

    def drive() -> str:
        try:
            kind = "crg" if bad.suffix == ".crg" else "grid"
            road = make_road(kind=kind, file=str(bad), holes="fill", run_in=0.0)
            strip = road.prepare(0.1, 2.0, -0.1, 0.1)
            z = strip.height(np.linspace(0.1, 2.0, 500), np.zeros(500))
            return "driven" if np.isfinite(z).all() else "crash: heights that are not finite"
        except InputError:
            return "refused"

    return forked(drive), good.name


def main() -> int:
    """Number of cases that ended as they must not."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name, count in (("seed", 1), ("checks", 1000), ("runs", 200), ("roads", 400)):
        parser.add_argument(f"--{name}", type=int, default=count)
    args = parser.parse_args()
    bad = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = list(road_files(folder))
        for what, count, case in (
            ("check", args.checks, lambda n: fuzz_check(folder, args.seed, n)),
            ("road", args.roads, lambda n: fuzz_road(files, args.seed, n)),
            ("run", args.runs, lambda n: fuzz_run(folder, args.seed, n)),
        ):
            began, ends = time.monotonic(), Counter()
            for number in range(count):
                end, tried = case(number)
                ends[end if end[:5] != "crash" else "crash"] += 1
                if end.startswith(("crash", "hang")):
                    bad += 1
                    print(f"{what} {number}: {end}\n  tried {tried}", flush=True)
                elif what == "run":
                    print(f"  run {number}: {end}: {tried}", flush=True)
            print(f"{what}: {dict(ends)} in {time.monotonic() - began:.0f} s", flush=True)
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main())
