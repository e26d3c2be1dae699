"""Third octaves of a run against the same with twice the modes: up to where modes are an answer."""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

import h5py
import numpy as np

from tireroad.contact.choices import USABLE
from tireroad.contact.results.spectra import nominal, third_octaves
from tireroad.runs.process import console
from tireroad.runs.validation.tables import Table

ABOUT = "third octaves with modes to some frequency against twice that, beside the limit that is printed"
ROOT = Path(__file__).resolve().parents[2]
BELT = '{name="belt",depth=0.006,arc=[-30.0,30.0],angle=0.0,youngs_modulus=2e9}'
# Name, scene, highest mode (Hz), and what the run changes besides.
CASES = (
    ("quickstart", "quickstart", 500.0, ("static.error_estimate=false", "time.step=5e-5")),
    ("torus", "torus", 200.0, ("modal.count=",)),
    ("torus with a belt", "torus", 200.0, ("modal.count=", f"tire.cords=[{BELT}]")),
)
# A whole run to 1 kHz, and what is finer in its reference: modes, mesh and step; the points are the same.
NOISE = "noise", 1000.0, ("sound=", "contact.points.dx=0.003", "contact.points.dy=0.003")
FINER = (
    "modal.up_to=1750",
    "tire.segments=46",
    "tire.elements_arc=30",
    "time.step=2.8e-5",
)
LIMIT = 1.0  # dB
RESIDUALS = "static", "attachment"
DURATION, LEFT_OUT = 0.4, 0.2  # s, and the share of it that is left out as run-in
FORCES = {"total_force": "contact", "axle_force": "axle"}


def run() -> list[Table]:
    """One table for each residual. Not collective: the runs are processes of their own."""
    tables = []
    for residual in RESIDUALS:
        rows, within = [], []
        with tempfile.TemporaryDirectory() as folder:
            for case, scene, highest, more in CASES:
                out = Path(folder) / case
                few, many = (_levels(out, scene, by * highest, residual, more) for by in (1, 2))
                for force, what in FORCES.items():
                    centre, one = few[force]
                    count = min(len(centre), len(many[force][0]))
                    apart = one[:count] - many[force][1][:count]
                    edge = centre[:count] * 10**0.05 / highest
                    within.append(apart[edge <= USABLE].ravel())
                    for k, axis in enumerate("xyz"):
                        for name, share, off in zip(
                            nominal(centre), edge, apart[:, k], strict=False
                        ):
                            rows.append([case, f"{what} {axis}", name, share, off])
                console.say(f"  {residual}: {case}")
        every = np.abs(np.concatenate(within))
        note = (
            f"up to {USABLE:g} of the highest mode {100 * np.mean(every <= 0.5):.0f} % of {len(every)} differences are within "
            f"0.5 dB, the largest is {every.max():.2g} dB; target: 90 %, 1 dB"
        )
        columns = [
            ("scene", ""),
            ("force", ""),
            ("band", "Hz"),
            ("upper edge over highest mode", "-"),
            ("difference", "dB"),
        ]
        tables.append(Table(f"Against twice the modes, residual {residual}", columns, rows, [note]))
    return [*tables, _whole_band()]


def _whole_band() -> Table:
    """noise.toml, as accuracy.up_to chooses it, against a finer run: 40 minutes on two processes, 11 GB each."""
    scene, highest, more = NOISE
    rows, apart = [], []
    with tempfile.TemporaryDirectory() as folder:
        one, other = (
            _forces(Path(folder) / name, scene, highest, (*more, *finer))
            for name, finer in (("run", ()), ("finer", FINER))
        )
    for force, what in FORCES.items():
        centre = one[force][0]
        low = centre > 60.0
        off = (one[force][1] - other[force][1][: len(centre)])[low]
        apart.append(off[:, [2, 0]].ravel())
        for name, along, _, up in zip(nominal(centre[low]), *off.T, strict=True):
            rows.append([what, name, up, along])
    every = np.abs(np.concatenate(apart))
    note = (
        f"{int((every <= LIMIT).sum())} of {len(every)} differences are within {LIMIT:g} dB, the largest is {every.max():.2g} dB; "
        f"finer are {', '.join(FINER)}"
    )
    columns = [("force", ""), ("band", "Hz"), ("vertical", "dB"), ("longitudinal", "dB")]
    return Table("noise.toml against finer modes, mesh and step", columns, rows, [note])


def _levels(
    folder: Path, scene: str, highest: float, residual: str, more: tuple[str, ...]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Bands and levels (b, 3) of the forces of a run with modes to some frequency."""
    change = (
        f"modal.up_to={highest}",
        f"greens.residual={residual}",
        f"time.duration={DURATION}",
        *more,
    )
    return _forces(folder / f"{scene}-{residual}-{highest:g}", scene, 1.3 * highest, change)


def _forces(
    out: Path, scene: str, highest: float, change: tuple[str, ...]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Bands up to some frequency and levels (b, 3) of the forces of a run."""
    command = [
        str(ROOT / "tireroad"),
        "run",
        str(ROOT / "runs" / "scenes" / f"{scene}.toml"),
        "--out",
        str(out),
        "-n",
        "2" if scene == NOISE[0] else "1",
        "--until",
        "contact",
        "--set",
        "accuracy.estimate=false",
    ]
    done = subprocess.run(
        [*command, *(part for one in change for part in ("--set", one))],
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(done.stdout[-2000:] + done.stderr[-2000:])
    found = {}
    with h5py.File(out / "contact.h5") as file:
        step, count = float(file["time"][0]), len(file["time"])
        for name in FORCES:
            values = file[name][round(LEFT_OUT * count) :]
            found[name] = third_octaves(values, step, highest)
    return found
