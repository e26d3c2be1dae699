"""Modes against full finite elements in time: a point force of 1 N (thesis figures 6.3 and C.1)."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI

from runs import observe
from runs.tabulate import Table

ABOUT = "displacement under a point force, modes against full finite elements of the same mesh"
STEP = 1e-4  # s
DURATION = 0.2  # s

SCENE = """
name = "validate"
[tire]
segments = 24
elements_arc = 10
[tire.material]
youngs_modulus = 4.8e8
[static]
inflation = 0.0
[damping]
mass = {damping}
[modal]
count = {modes}
[greens]
residual = "{residual}"
[[force]]
frequency = {frequency}
[time]
duration = 0.2
step = 1e-4
"""
CASES = ((5.0, 500.0), (20.0, 50.0))  # Hz, gamma1 in 1/s: figure 6.3, figure C.1
CHOICES = ((10, "none"), (10, "static"), (100, "none"), (100, "static"), (300, "static"))


def run() -> list[Table]:
    """Errors of the driven point's displacement and run times, by modes and residual."""
    columns = [
        ("frequency", "Hz"),
        ("modes", "-"),
        ("residual", ""),
        ("error of displacement", "%"),
        ("worst", "%"),
        ("loop", "s"),
        ("full finite elements", "s"),
        ("ratio", "-"),
    ]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for frequency, damping in CASES:
            rows += _rows(frequency, damping, Path(folder))
    notes = [
        "Error: relative L2 over 0.2 s; worst: largest difference over the largest displacement.",
        "Full finite elements: every dof, Wood-Bossak-Zienkiewicz, the same step of 1e-4 s.",
    ]
    return [Table("Point force of 1 N: modes against full finite elements", columns, rows, notes)]


def _rows(frequency: float, damping: float, folder: Path) -> list[list]:
    reference, rows = None, []
    for modes, residual in CHOICES:
        session = _session(frequency, damping, modes, residual, folder)
        if reference is None:
            reference, full_seconds = _history(_full(session), frequency)
        found, seconds = _history(_modal(session), frequency)
        error = np.linalg.norm(found - reference) / np.linalg.norm(reference)
        worst = np.abs(found - reference).max() / np.abs(reference).max()
        row = [frequency, modes, residual, 100 * float(error), 100 * float(worst)]
        rows.append([*row, seconds, full_seconds, full_seconds / seconds])
    return rows


def _session(frequency: float, damping: float, modes: int, residual: str, folder: Path):
    from runs.pipeline import run_scene
    from runs.scene import load

    place = folder / f"{modes}"
    place.mkdir(exist_ok=True)
    file = folder / "scene.toml"
    file.write_text(
        SCENE.format(frequency=frequency, damping=damping, modes=modes, residual=residual)
    )
    with observe.quiet():
        return run_scene(
            load(file, []), place, MPI.COMM_WORLD, until="greens", fresh=False, petsc_options=[]
        )


def _modal(session):
    from greens.recursion import Recursion

    return Recursion(session.force_response.resolved(STEP), STEP, "linear", session.comm)


def _full(session):
    from fem.transient import FullTire

    return FullTire(
        session.operators, None, 0.0, session.damping, STEP, session.readings, session.loads
    )


def _history(tire, frequency: float) -> tuple[np.ndarray, float]:
    """Vertical displacement of the driven point under the sine, and the loop's seconds."""
    steps = round(DURATION / STEP)
    force = np.sin(2 * np.pi * frequency * STEP * np.arange(steps + 1))[:, None]
    out = np.zeros(steps)
    tire.start(force[0])
    began = time.perf_counter()
    for k in range(steps):
        free = tire.predict()
        tire.advance(force[k + 1])
        out[k] = free[2] + tire.same_step[2] @ force[k + 1]
    return out, time.perf_counter() - began
