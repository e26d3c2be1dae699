"""A road that rises by centimetres in milliseconds: the loop's linear tire and the one with the reduced nonlinear force against
nonlinear finite elements in time."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from mpi4py import MPI
from threadpoolctl import threadpool_limits

from tireroad.contact.loop import ContactProblem, Drive, LinearTire, Loop
from tireroad.contact.setup import nodes_within
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.tread.compliance import winkler_compliance
from tireroad.fem.matrices.probe import nodes
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.road import Feature, contact_points
from tireroad.fem.nonlinear.training import Settings, train
from tireroad.fem.transient import FullTire, NonlinearTire
from tireroad.fem.wheel import Turning
from tireroad.greens.basis import Basis
from tireroad.greens.large_motion import LargeTire, large_response
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.runs.library import modes, press, radial, roll
from tireroad.runs.process import console
from tireroad.runs.validation.full_elements import digits, percent
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.large import ACROSS, BED, INFLATION, LOADS, SEGMENTS, bar

ABOUT = "a road that rises by 15 mm in 8 ms: linear and reduced nonlinear tire against nonlinear elements in time"

RISE, RISEN, LAST = 15e-3, 8e-3, 20e-3  # m, s, s
STEP, COUNTS, REACH = 1e-4, (100, 300), 0.035  # s, modes, m
DAMPING = (20.0, 0.0)
TRAINED = Feature(rise=25e-3), *(bar(25, 50, place, 25) for place in (0, 30, 60, 90))
BAND = 400.0  # Hz


def rising(t: float) -> float:
    """Height of the road, m."""
    part = min(t / RISEN, 1.0)
    return RISE * part * part * (3 - 2 * part)


def below(values: np.ndarray, step: float, band: float) -> np.ndarray:
    """The part of values (n,) below a frequency (Hz), their ends being held."""
    padded = np.pad(values, len(values), mode="edge")
    spectrum = np.fft.rfft(padded)
    spectrum[np.fft.rfftfreq(len(padded), step) > band] = 0.0
    return np.fft.irfft(spectrum, len(padded))[len(values) : 2 * len(values)]


def run() -> list[Table]:
    """The table of all tires. Serial."""
    with threadpool_limits(1, "blas"):
        return [_table()]


def _table() -> Table:
    tire = radial(segments=SEGMENTS, elements_arc=ACROSS, comm=MPI.COMM_SELF)
    state = press(tire, inflation=INFLATION, load=LOADS[0])
    patch = nodes_within(state, REACH)
    points = nodes(patch.index, len(state.points)).tocsr()
    drive = Drive(lambda x, y: np.zeros(x.shape), rising, 0.0)
    tread, steps = winkler_compliance(patch.area, BED), round(LAST / STEP)

    def force(tire: LinearTire) -> tuple[np.ndarray, float]:
        """Vertical force (n,) N of the road, and the loop's CPU time, s."""
        began = time.process_time()
        solver = ActiveSet(tire.same_step + tread)
        blocks = Loop(tire, ContactProblem(patch, tire.same_step, solver)).roll(drive, STEP, steps)
        found = np.concatenate([block.total_force[:, 2] for block in blocks])
        return found, time.process_time() - began

    standing = {count: modes(tire, state, count=count) for count in COUNTS}
    operators = standing[COUNTS[0]].motions.operators
    restoring = RestoringForce(operators, INFLATION)
    began = time.process_time()
    training = train(
        restoring, contact_points(tire.lattice, state, BED), TRAINED, Settings(), console.say
    )
    trained = time.process_time() - began
    given: dict[str, Any] = {"operators": operators, "damping": DAMPING, "step": STEP}
    given |= {"outputs": points, "loads": points}
    full = NonlinearTire(inflation=INFLATION, **given)
    exact, seconds = force(full)
    size = float(np.sqrt(np.mean((exact - state.load) ** 2)))
    rows: list[list] = []

    def add(name: str, found: np.ndarray, seconds: float, evaluations: float | str) -> None:
        off = found - exact
        parts = [float(np.sqrt(np.mean(v**2))) / size for v in (off, below(off, STEP, BAND))]
        row = [name, digits(found.max()), *map(percent, parts), evaluations, digits(seconds)]
        rows.append(row)

    add("elements, nonlinear", exact, seconds, digits(full.turns / steps))
    add("elements, linear", *force(FullTire(rotation=None, speed=0.0, **given)), "")
    for count, basis in standing.items():
        rolling = roll(basis, Turning(speed=0.0, damping=DAMPING))
        arguments = Basis.of(rolling.states), basis.basis.modes, points
        vectors = training.force, training.vectors
        response = large_response(rolling.wheel, *arguments, restoring, *vectors)
        own = slice(points.shape[0])
        add(f"loop, linear, {count} modes", *force(_recursion(response.between(own, own))), "")
        large = LargeTire(_recursion(response), training.force, points.shape[0])
        found = force(large)
        add(f"loop, reduced, {count} modes", *found, digits(large.evaluations / steps))
    columns = [("tire", ""), ("largest force", "N"), ("off", "%"), (f"below {BAND:g} Hz", "%"),
               ("evaluations a step", "-"), ("loop", "CPU s")]  # fmt: skip
    notes = [
        f"205/60 R15, {SEGMENTS} x {ACROSS} elements, {LOADS[0]:g} N, 2.2 bar, standing, no friction; the road rises by {1e3 * RISE:g} mm in "
        f"{1e3 * RISEN:g} ms and stays to {1e3 * LAST:g} ms; {points.shape[0]} nodes on springs of {BED:g} N/m3, steps of {1e3 * STEP:g} ms. "
        "Off: rms of the difference over the rms of the force beyond the load.",
        f"Training: {len(TRAINED)} roads, {trained:.0f} s of CPU time, {training.vectors.shape[1]} vectors, {len(training.force.cells)} cells; "
        f"{full.factors} factorisations of the nonlinear elements.",
    ]
    return Table("A rise in milliseconds", columns, rows, notes)


def _recursion(response: Response) -> Recursion:
    # Forces that are linear over a step chatter between points of the mesh.
    return Recursion(
        response=response.resolved(STEP), step=STEP, scheme="constant", comm=MPI.COMM_SELF
    )
