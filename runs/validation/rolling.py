"""Modes against full finite elements in time: a tire on a moved flat road, and rolling over rough ones."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from runs import observe
from runs.tabulate import Table

ABOUT = "contact and axle force of the modal program against full finite elements of the same mesh"
BAND = 300.0  # Hz, up to which errors are measured

SCENE = """
name = "validate"
[tire]
segments = 24
elements_arc = 10
footprint_size = 0.35
[tire.material]
youngs_modulus = 48e6
[static]
load = 500.0
[damping]
mass = 300.0
[rotation]
speed = {speed}
[modal]
count = {modes}
[greens]
residual = "{residual}"
[contact]
youngs_modulus = 1e7
[road]
{road}
[time]
duration = 0.1
step = 1e-4
"""


@dataclass(frozen=True)
class Case:
    """A road, a speed of rotation in rad/s, and what to call them."""

    name: str
    speed: float
    road: str


CASES = (
    Case(
        "standing, flat road moved 0.1 mm at 50 Hz",
        0.0,
        'kind = "flat"\nmotion = {kind = "sine", amplitude = 1e-4}',
    ),
    Case("sine road, 0.2 mm, 0.2 m", 100.0, 'kind = "sine"\namplitude = 2e-4\nwavelength = 0.2'),
    Case(
        "cobblestones",
        100.0,
        'kind = "cobblestones"\nheight_scatter = 1e-4\njoint_depth = 5e-4\nedge_radius = 3e-3',
    ),
)
CHOICES = (  # modes, residual, step in s
    (50, "none", 1e-4),
    (50, "static", 1e-4),
    (150, "none", 1e-4),
    (150, "static", 1e-4),
    (100, "second-order", 1e-4),
    (100, "attachment", 1e-4),
    (400, "static", 1e-4),
    (400, "static", 2.5e-5),
)
REFERENCE = 2.5e-5  # s
COMPARED = 1e-4  # s


@dataclass(frozen=True)
class History:
    """Forces over time, (n, 3) N each, and the seconds of the loop that made them."""

    contact: np.ndarray
    axle: np.ndarray
    seconds: float


def run() -> list[Table]:
    """A table of errors and run times for every road, number of modes and residual."""
    columns = [
        ("case", ""),
        ("modes", "-"),
        ("residual", ""),
        ("step", "s"),
        ("error of contact force", "%"),
        ("error of axle force", "%"),
        ("worst of contact force", "%"),
        ("loop", "s"),
        ("full finite elements", "s"),
        ("ratio", "-"),
    ]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            rows += _case_rows(case, Path(folder))
    notes = [
        f"Errors: relative L2 of the variation up to {BAND:g} Hz, Hann window; worst: largest difference "
        "in time over the largest variation, all frequencies.",
        f"Full finite elements: every dof, Wood-Bossak-Zienkiewicz, step {REFERENCE:g} s; same "
        "contact points, tread and road. Both loops exclude their set-up.",
    ]
    plot = {"x": "loop", "y": ["error of contact force"], "log": "xy", "by": "case"}
    return [
        Table("Rolling contact: modes against full finite elements", columns, rows, notes, plot)
    ]


def _case_rows(case: Case, folder: Path) -> list[list]:
    reference = None
    rows = []
    for modes, residual, step in CHOICES:
        session = _session(case, modes, residual, folder)
        if reference is None:
            reference = _history(session, _full(session), REFERENCE)
            contact, axle = _thinned(reference, REFERENCE)
        found = _history(session, _modal(session, step), step)
        found_contact, found_axle = _thinned(found, step)
        worst = np.abs(found_contact - contact).max() / np.ptp(contact[:, 2])
        rows.append(
            [
                case.name,
                modes,
                residual,
                step,
                100 * band_error(contact, found_contact, COMPARED),
                100 * band_error(axle, found_axle, COMPARED),
                100 * float(worst),
                found.seconds,
                reference.seconds,
                reference.seconds / found.seconds,
            ]
        )
    return rows


def _thinned(history: History, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Contact and axle force at the instants that all histories share."""
    every = round(COMPARED / step)
    return history.contact[every - 1 :: every], history.axle[every - 1 :: every]


def _session(case: Case, modes: int, residual: str, folder: Path):
    """A run of the case up to its Green's functions; static state and modes are shared by hash."""
    from runs.pipeline import run_scene
    from runs.scene import load

    place = folder / f"{case.speed:g}-{modes}"
    place.mkdir(exist_ok=True)
    file = folder / "scene.toml"
    file.write_text(SCENE.format(speed=case.speed, modes=modes, residual=residual, road=case.road))
    with observe.quiet():
        return run_scene(
            load(file, []), place, MPI.COMM_WORLD, until="greens", fresh=False, petsc_options=[]
        )


def _modal(session, step: float):
    from greens.recursion import Recursion

    return Recursion(session.contact_response.resolved(step), step, "linear", session.comm)


def _full(session):
    from fem.probe import nodes
    from fem.transient import FullTire

    points = nodes(session.patch.index, len(session.static.points))
    rotation = session.rotation_matrices if session.speed else None
    return FullTire(
        session.operators, rotation, session.speed, session.damping, REFERENCE, points, points
    )


def _history(session, tire, step: float) -> History:
    from contact.model import step_solver
    from contact.rolling import Drive, roll

    solver = step_solver(session.scene.contact, session.patch, tire.same_step)
    drive = Drive(session.road.height, session.motion, session.road_speed)
    steps = round(session.scene.time.duration / step)
    contact, axle = np.zeros((2, steps, 3))
    began = time.perf_counter()
    for k, instant in enumerate(roll(tire, solver, session.patch, drive, step, steps)):
        contact[k, 2], axle[k] = instant.force.sum(), instant.axle_force
    return History(contact, axle, time.perf_counter() - began)


def band_error(reference: np.ndarray, values: np.ndarray, step: float) -> float:
    """Relative L2 error up to BAND of what varies, from Hann-windowed spectra of (n, 3) histories."""
    window = np.hanning(len(reference))[:, None]
    keep = np.fft.rfftfreq(len(reference), step) <= BAND

    def size(x):
        return np.linalg.norm(np.fft.rfft(window * x, axis=0)[keep])

    return float(size(values - reference) / size(reference - reference.mean(axis=0)))
