"""Axle force by momentum and by the free rim (thesis (7.4)), and by full finite elements."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import sparse

from tireroad.fem.matrices.compliance import receptance
from tireroad.fem.model import SmallMotions
from tireroad.greens.coupling import wheel_of
from tireroad.greens.outputs import by_free_rim, by_momentum, from_moment
from tireroad.modal.corner import MOMENTS
from tireroad.modal.standing import solved
from tireroad.runs.validation.tables import Table
from tireroad.tests.validation.comparison import Tires

ABOUT = "axle force and moment per force on the tread: by momentum, by the free rim's modes, by full finite elements"
FREQUENCY = np.array([10.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0])  # Hz
COUNTS = (30, 100, 300)

SCENE = """
name = "validate"
[tire]
segments = 20
elements_arc = 8
[tire.material]
youngs_modulus = 48e6
[damping]
mass = 100.0
[rotation]
speed = {speed}
[modal]
count = 300
{forces}
[time]
duration = 0.1
"""

# Angle around the axle and arc along the section, degrees; direction. Near the place of a road, but
# without one: on a road a free rim topples.
FORCES = (
    (0.0, 0.0, (0.0, 0.0, 1.0)),
    (6.0, 4.0, (0.0, 0.0, 1.0)),
    (-8.0, -10.0, (0.0, 0.0, 1.0)),
    (4.0, -5.0, (1.0, 0.0, 0.0)),
    (0.0, 8.0, (0.0, 1.0, 0.0)),
)


@dataclass(frozen=True)
class AxleResult:
    """Axle force, -, and moment, m, per force (f, 3, k) by one method; its run time in seconds."""

    form: str
    modes: int | str
    transfer: np.ndarray
    moment: np.ndarray
    seconds: float


def run() -> list[Table]:
    """The tire at rest and rolling."""
    columns = [
        ("speed", "rad/s"),
        ("form", ""),
        ("modes", "-"),
        ("off full FE", "%"),
        ("worst off full FE", "%"),
        ("off the other form", "%"),
        ("moment off full FE", "%"),
        ("moment off the other form", "%"),
        ("run time", "s"),
    ]
    rows = [row for speed in (0.0, 100.0) for row in _rows(speed)]
    notes = [
        "Transfer functions from forces on the inflated tire's tread to the force on the held axle and to the moment about "
        f"its centre, {FREQUENCY[0]:g} to {FREQUENCY[-1]:g} Hz: relative L2, and the worst entry over the largest.",
        "Momentum: sum of forces less the rate of momentum, modes of the clamped rim with attachment modes. "
        "Free rim: -H_rr^-1 H_rc, modes of a rigid rim that nothing holds, with attachment modes of rim "
        "and loads. Full FE: all unknowns of the clamped rim, frequency by frequency.",
        "Rolling the two forms differ by the lumping of the mass too: int rho e_y x u is by full "
        "integration in one and by the diagonal mass in the other.",
    ]
    return [Table("Axle force and moment, two ways", columns, rows, notes)]


def _rows(speed: float) -> Iterator[list]:
    with tempfile.TemporaryDirectory() as folder:
        forces = "\n".join(
            f"[[force]]\nangle = {angle}\narc = {arc}\ndirection = {list(direction)}"
            for angle, arc, direction in FORCES
        )
        tires = Tires(SCENE.format(speed=speed, forces=forces), Path(folder))
        exact = _full(tires)
        free = _free_rim(tires)
        yield [speed, "full FE", "all", 0.0, 0.0, "", 0.0, "", exact.seconds]
        for count in COUNTS:
            pair = [_momentum(tires, count), next(free)]
            for one, other in (pair, pair[::-1]):
                yield [
                    speed,
                    one.form,
                    one.modes,
                    *_off(one.transfer, exact.transfer),
                    _off(one.transfer, other.transfer)[0],
                    _off(one.moment, exact.moment)[0],
                    _off(one.moment, other.moment)[0],
                    one.seconds,
                ]


def _off(forces: np.ndarray, exact: np.ndarray) -> tuple[float, float]:
    """Relative L2 error and largest error, %."""
    far = forces - exact
    mean = np.linalg.norm(far) / np.linalg.norm(exact)
    return 100 * float(mean), 100 * float(np.abs(far).max() / np.abs(exact).max())


def _total(loads: sparse.csr_matrix) -> np.ndarray:
    """Sum (3, k) of each unit load."""
    return loads.toarray().reshape(loads.shape[0], -1, 3).sum(axis=1).T


def _full(tires: Tires) -> AxleResult:
    """All unknowns; the moment from the rows that modes use, which tests compare with the forces on
    the rim's nodes."""
    loads = tires.probes.on_face.loads
    began = time.perf_counter()
    wheel, none = tires.wheel, sparse.csr_matrix((0, loads.shape[1]))
    full = wheel.rotating_stiffness, wheel.rotating_damping
    motion = tires.motions.rim_motion(wheel.speed != 0)
    beside = np.vstack([wheel.operators.carried, *motion.moments(wheel.speed)])
    receptances = receptance(wheel.operators, *full, none, loads, FREQUENCY, beside=beside)
    carried, static, rate, mass = np.split(receptances, 4, axis=1)
    s = 2j * np.pi * FREQUENCY[:, None, None]
    corner = tires.modes.projection.wheel
    moment = corner.rigid(loads)[:, MOMENTS].T - s**2 * mass - s * rate - static
    force = from_moment(_total(loads), carried, FREQUENCY)
    return AxleResult("full FE", "all", force, moment, time.perf_counter() - began)


def _momentum(tires: Tires, count: int) -> AxleResult:
    """The program's own method: its response, with the momentum of each state as an output."""
    loads = tires.probes.on_face.loads
    began = time.perf_counter()
    response = tires.response(count, "attachment", counted=False)
    transfer = by_momentum(response, _total(loads), FREQUENCY)
    moment = response.between(slice(-3, None), slice(None)).receptance(FREQUENCY)
    return AxleResult("momentum", count, transfer, moment, time.perf_counter() - began)


def _free_rim(tires: Tires) -> Iterator[AxleResult]:
    """Modes of the same static state with its rim released."""
    loads, motions = tires.probes.on_face.loads, tires.motions
    free = SmallMotions(motions.tire, motions.static, rim="free")
    wheel, modes = wheel_of(free, tires.wheel.turning), solved(free.operators, count=max(COUNTS))
    for count in COUNTS:
        began = time.perf_counter()
        arguments = modes.first(count), loads, FREQUENCY, motions.rim_motion(wheel.speed != 0)
        force, moment = np.split(by_free_rim(wheel, *arguments), 2, axis=1)
        yield AxleResult("free rim", count, force, moment, time.perf_counter() - began)
