"""Runs the program through its launcher, as a user does."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

from tireroad.fem.errors import ConvergenceError

ROOT = Path(__file__).resolve().parents[3]


def launched(scene: Path, out: Path, until: str, processes: int, *more: str) -> dict:
    """The summary's stages of a run up to a stage, with one BLAS thread per process."""
    command = [str(ROOT / "tireroad"), "run", str(scene), "--until", until]
    command += ["--out", str(out), "-n", str(processes), *more]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    environment["TIREROAD_CACHE"] = "off"  # what is timed must be computed
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    if done.returncode:
        raise ConvergenceError(f"bench: {' '.join(command)} failed:\n{done.stderr[-2000:]}")
    return json.loads((out / "summary.json").read_text(encoding="utf-8"))["stages"]
