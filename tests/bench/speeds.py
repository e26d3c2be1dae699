"""A family of speeds about one static state: savings from shared stages, in CPU time."""

from __future__ import annotations

import os
import resource
import subprocess
import tempfile
from pathlib import Path

from tireroad.fem.errors import ConvergenceError
from tireroad.runs.process import console
from tireroad.runs.validation.tables import Table

ABOUT = "20 speeds over one static state and its modes, against 20 separate runs: processor time"
ROOT = Path(__file__).resolve().parents[2]
SCENES = ("torus", "passenger")
MEMBERS, ALONE = 20, 2
LOWEST, STEP = 40.0, 1.0  # rad/s
SHAPE = "static.steady_rolling=false"  # otherwise each speed has its own static state
NOTE = (
    f"{MEMBERS} speeds from {LOWEST:g} rad/s on, {STEP:g} rad/s apart, about the shape of the tire at rest "
    f"(static.steady_rolling = false), with error bars and pages. Separate runs: {MEMBERS} times the mean of {ALONE}, "
    "the slowest and the fastest. Processor time of all processes, one BLAS thread each; target: 35 %."
)


def run() -> list[Table]:
    """One row per scene. Not collective: members are separate processes."""
    with tempfile.TemporaryDirectory() as folder:
        rows = [measured(Path(folder), scene, MEMBERS) for scene in SCENES]
    columns = [("scene", ""), ("members", "-"), ("sweep", "s"), ("separate runs", "s"), ("share", "%")]  # fmt: skip
    return [Table("A family of speeds", columns, rows, [NOTE])]


def measured(folder: Path, scene: str, members: int) -> list:
    """Scene, members, CPU time (s) of the sweep and of as many separate runs, their ratio (%)."""
    source = ROOT / "runs" / "scenes" / f"{scene}.toml"
    speeds = [LOWEST + STEP * k for k in range(members)]
    family = folder / f"{scene}.toml"
    family.write_text(
        f'name = "{scene}"\nscene = "{source}"\n[[axis]]\nkey = "rotation.speed"\nvalues = {speeds}\n'
        f'[[axis]]\nkey = "static.steady_rolling"\nvalues = [false]\n',
        encoding="utf-8",
    )
    together = _processor_time("sweep", str(family), "--out", str(folder / scene))
    console.say(f"  {scene}: sweep {together:.0f} s")
    alone = 0.0
    for speed in (speeds[0], speeds[-1])[:ALONE]:
        given = "--set", SHAPE, "--set", f"rotation.speed={speed}", "--fresh"
        out = folder / f"{scene}-{speed:g}"
        alone += _processor_time("run", str(source), "--out", str(out), *given) / ALONE
    console.say(f"  {scene}: a separate run {alone:.0f} s")
    return [scene, members, together, members * alone, 100 * together / (members * alone)]


def _processor_time(*command: str) -> float:
    """CPU time of a command of the program and all processes it starts, s."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    environment.pop("TIREROAD_CACHE", None)
    if command[0] == "run":
        environment["TIREROAD_CACHE"] = "off"
    before = _used()
    line = [str(ROOT / "tireroad"), *command]
    done = subprocess.run(line, cwd=ROOT, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise ConvergenceError(f"bench: {' '.join(line)} failed:\n{done.stderr[-2000:]}")
    return _used() - before


def _used() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
