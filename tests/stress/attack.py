"""What the attacks by hand share: a small rolling scene, the program started, results compared."""

# isort: off
import tireroad  # noqa: F401  before numpy, whose BLAS chooses its kernels as it is loaded: a run in a fork has the bits of one alone

# isort: on
import hashlib
import os
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
from started import ROOT, environment
from tires import soft_torus

LONG = 1200  # s that a run may take on a busy machine

SCENE = (
    """
name = "attacked"
"""
    + soft_torus(12, 4)
    + """[static]
load = 300.0
error_estimate = false
[modal]
count = 8
[rotation]
speed = 30.0
[[force]]
angle = 90.0
frequency = 20.0
[contact]
youngs_modulus = 2e7
brush_stiffness = 2e5
[road]
kind = "sine"
amplitude = 1e-4
[time]
duration = 0.15
step = 3e-5
checkpoint = 0.1
"""
)


def write_scene(folder: Path) -> Path:
    """The scene's file in a folder."""
    path = folder / "attacked.toml"
    path.write_text(SCENE)
    return path


def command(*arguments: object, processes: int = 1) -> list[str]:
    """The launcher's command line."""
    line = [str(ROOT / "tireroad"), *map(str, arguments)]
    return line if processes == 1 else [*line, "-n", str(processes)]


def started(line: list[str], **extra: str) -> subprocess.Popen:
    """The program in a process group of its own, so that all of it can be killed."""
    return subprocess.Popen(
        line,
        env=environment(**extra),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        process_group=0,
    )


def finished(line: list[str], **extra: str) -> tuple[int, str]:
    """Exit status and everything printed."""
    with started(line, **extra) as process:
        text, _ = process.communicate(timeout=LONG)
    return process.returncode, text


def content(folder: Path) -> dict[str, np.ndarray]:
    """Every dataset of every result file: what may not depend on how often the run was stopped."""
    found = {}
    for path in sorted(folder.glob("*.h5")):
        with h5py.File(path) as file:

            def keep(name: str, item: object, stem: str = path.stem) -> None:
                if isinstance(item, h5py.Dataset):
                    text = h5py.check_string_dtype(item.dtype) is not None
                    found[f"{stem}:{name}"] = item.asstr()[()].astype(str) if text else item[()]

            file.visititems(keep)
    return found


def differences(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> list[str]:
    """Names of datasets that are not the same bits."""
    names = set(one) ^ set(other)
    for name in set(one) & set(other):
        if _digest(one[name]) != _digest(other[name]):
            names.add(name)
    return sorted(names)


RESULTS = (
    "static:displacement",
    "static:contact/force",
    "modes:frequency",
    "rotating:eigenvalue",
    "contact:normal_force",
    "contact:total_force",
    "response:displacement",
    "spectra:axle_force",
)
ROUND_OFF = 1e-6  # of the largest value: what is left of 1e-13 after eigenproblems and a time loop


def apart(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> list[str]:
    """Names of results that differ by more than round-off, as fresh runs on several processes may."""
    return [
        name
        for name in RESULTS
        if one[name].shape != other[name].shape
        or np.abs(one[name] - other[name]).max() > ROUND_OFF * np.abs(one[name]).max()
    ]


def _digest(values: np.ndarray) -> str:
    array = np.ascontiguousarray(values)
    return hashlib.sha256(f"{array.shape}{array.dtype}".encode() + array.tobytes()).hexdigest()


def processes_with(text: str) -> list[int]:
    """Processes whose command line has the text in it."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if os.fsencode(text) in entry.read_bytes():
                found.append(int(entry.parent.name))
        except OSError:
            pass
    return found


def gone(text: str) -> bool:
    """Whether all processes with the text have ended, given some time."""
    deadline = time.monotonic() + 120
    while processes_with(text):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.1)
    return True


def told(failures: list[str], number: int, what: str) -> int:
    """Print the outcome of an attack; the exit status."""
    for failure in failures:
        print(f"FAILED: {failure}")
    print(f"{number} {what}, {len(failures)} failures", file=sys.stderr)
    return 1 if failures else 0
