"""Random damage to decks, meshes, section files, sweeps and laser lines: by hand, in minutes.

    PYTHONPATH=.:tests:tests/stress:tests/fem/decks python3 -P tests/stress/damaged_texts.py --count 3000 --seed 7

Allowed ends: what the reader makes of it, or an InputError. `test_mutant_decks.py` runs a short
form for decks.
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
from tireroad.fem.decks.user_section import Wishes, read
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


FIGURES = b"""size = "205/55 R16"
inflation = 2.4e5
load = 5026.7
mass = 8.1
lateral_frequency = 42.4
loads = [[0.0182, 3015.5], [0.0324, 6031.0]]
"""
DATA = b"""*HYPERELASTIC, OGDEN, N=2, TEST DATA INPUT
*UNIAXIAL TEST DATA
1.5E5, 0.1
2.6E5, 0.2
3.4E5, 0.3
*BIAXIAL TEST DATA
2.1E5, 0.1
3.9E5, 0.2
"""


def _new_forms() -> Iterator[tuple[str, bytes, Callable[[Path], object]]]:
    """Decks of parts, with test data, with steps; figures of tires."""
    from test_rebar import every_form
    from torus_decks import RUBBER, Torus, plain

    from tireroad.fem.decks.history import history
    from tireroad.runs.fit import read as read_figures
    from tireroad.tests.fem.decks.test_instances import belted, parted
    from tireroad.tests.runs.fit.test_fit import TIR
    from tireroad.tests.runs.report.test_tire_file import REVOLVE

    turned = "*INSTANCE, NAME=T-2, PART=TIRE\n\n0., 0., 0.\n0., 0., 0., 1., 0., 0., 180.\n*END INSTANCE\n"
    parts = parted(belted(Torus(half=True, arcs=8)), more=turned).replace(
        "*NODE, NSET=ALL", "*SYSTEM\n0., 0., 0., 1., 0., 0.\n*NODE, NSET=ALL", 1
    )
    wishes = Wishes(rim=("RIMNODES",))
    yield "parts.inp", parts.encode(), lambda file: read(file, wishes)
    yield "rebar.inp", every_form().encode(), lambda file: read(file, wishes)
    tested = plain(Torus(arcs=6)).encode().replace(RUBBER.split("\n", 1)[1][:19].encode(), DATA, 1)
    yield "tested.inp", tested, lambda file: read(file, wishes)
    yield "steps.inp", REVOLVE.encode(), history
    yield "figures.toml", FIGURES, read_figures
    yield "figures.tir", TIR.encode(), read_figures


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
    yield from _new_forms()
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
