"""Time histories of any tire model with the same road, points, tread and solver."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from tireroad.contact.grid_patch import OnPoints
from tireroad.contact.loop import roll
from tireroad.contact.model import Spec, step_solver
from tireroad.contact.setup import ContactSetup


@dataclass(frozen=True)
class History:
    """Quantities (n, k) by name at the end of each of n steps of `step` s.

    `seconds` of the loop: CPU time of one thread, which a busy machine changes little; `setup`:
    seconds of its set-up.
    """

    step: float
    values: dict[str, np.ndarray]
    seconds: float
    setup: float


@dataclass(frozen=True)
class Trial:
    """The conditions of any tire model's run: table [contact], patch and road, `duration` s."""

    spec: Spec
    setup: ContactSetup
    duration: float


def follow(trial: Trial, tire, step: float, setup: float) -> History:
    """Run the tire over the trial's road, with the same points, tread and solver for any tire.

    Contact and axle force (n, 3) N, displacement of the contact points (n, c) m.
    """
    patch, drive = trial.setup.patch, trial.setup.drive
    solver = step_solver(trial.spec, patch, tire.same_step)
    if patch.weights is not None:
        tire = OnPoints(tire, patch.weights)
    steps = round(trial.duration / step)
    contact, axle = np.zeros((2, steps, 3))
    moved = np.zeros((steps, len(patch.points)))
    with threadpool_limits(1, "blas"):
        began = time.process_time()
        for k, instant in enumerate(roll(tire, solver, patch, drive, step, steps)):
            contact[k, 2], axle[k] = instant.force.sum(), instant.axle_force
            moved[k] = instant.displacement
        seconds = time.process_time() - began
    values = {"contact force": contact, "axle force": axle, "displacement": moved}
    return History(step, values, seconds, setup)
