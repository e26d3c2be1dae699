"""What a tire does over time, and how far two histories are apart in a band of frequencies."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from tireroad.contact.grid_patch import OnPoints
from tireroad.contact.model import Spec, step_solver
from tireroad.contact.rolling import roll
from tireroad.contact.setup import ContactSetup

BAND = 300.0  # Hz, up to which errors are measured


@dataclass(frozen=True)
class History:
    """Quantities (n, k) by name at the end of each of n steps of `step` s; `seconds` of the loop, of one
    thread's processor time, which a busy machine changes little; `setup` of what it needs.
    """

    step: float
    values: dict[str, np.ndarray]
    seconds: float
    setup: float


@dataclass(frozen=True)
class Trial:
    """What any tire is taken over: the table [contact], patch and road, for `duration` s."""

    spec: Spec
    setup: ContactSetup
    duration: float


def follow(trial: Trial, tire, step: float, setup: float) -> History:
    """Take the tire over the trial's road: same points, tread, solver and road for any tire.

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


@dataclass(frozen=True)
class Distance:
    """Relative L2 distance in the band, and the largest difference there over the largest variation."""

    mean: float
    worst: float


def distance(reference: np.ndarray, found: np.ndarray, duration: float, band=BAND) -> Distance:
    """How far `found` (n', k) is from what varies of `reference` (n, k), both over `duration` s, from
    0 to `band` Hz.

    Each is looked at with its own step: thinned out to a common one, force above half its sampling
    frequency would fold down into the band (seen: 0.6 % where there was 0.03 %). Hann window.
    """
    rest = reference.mean(axis=0)
    exact = _low(reference - rest, duration, band)
    off = _low(found - rest, duration, band) - exact
    # Seen in time again, the same number of instants for both.
    seen = [np.fft.irfft(part, 8 * len(exact), axis=0) for part in (off, exact)]
    worst, most = (np.abs(part).max() for part in seen)
    return Distance(float(np.linalg.norm(off) / np.linalg.norm(exact)), float(worst / most))


def _low(values: np.ndarray, duration: float, band: float) -> np.ndarray:
    """Fourier coefficients of windowed values (n, k) at t = h, 2h, ... = duration, up to `band` Hz."""
    n = len(values)
    # The window vanishes at both ends, so the value at t = 0 may be any.
    window = np.sin(np.pi * np.arange(n) / n)[:, None] ** 2
    shifted = np.concatenate([values[:1], values[:-1]])
    keep = np.arange(n // 2 + 1) <= band * duration * (1 + 1e-9)
    return np.fft.rfft(window * shifted, axis=0)[keep] / n
