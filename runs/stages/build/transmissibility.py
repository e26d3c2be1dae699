"""Force on the held axle per force at the driven points, over frequency: by momentum, and by a free rim."""

from __future__ import annotations

import numpy as np

from tireroad.fem.model import SmallMotions
from tireroad.fem.static.state import StaticState
from tireroad.greens.axle import by_momentum
from tireroad.greens.response import Response
from tireroad.greens.small_motions import wheel_of
from tireroad.modal.standing import standing_modes
from tireroad.runs.stages.build.setup import driven_points
from tireroad.runs.stages.build.turning import turning_of
from tireroad.runs.stages.job import Job
from tireroad.runs.stages.record import Record

Curves = dict[str, tuple[np.ndarray, str]]
FREQUENCY, MOMENTUM, FREE_RIM = (
    f"transmissibility/{name}" for name in ("frequency", "momentum", "free_rim")
)


def transmissibility(job: Job, record: Record, static: StaticState, response: Response) -> Curves:
    """The curves (f, 3, k), -, of k driven points, from `step` to `to` Hz: force of the tire on the axle per
    force. By the momentum of the response's states and, where the scene asks for it, by modes of the tire
    with a free rim (greens.axle): each checks the other. Collective.
    """
    wanted = job.scene.output.transmissibility
    frequency = wanted.step * np.arange(1, round(wanted.to / wanted.step) + 1)
    loads, _ = driven_points(job)
    total = loads.toarray().reshape(loads.shape[0], -1, 3).sum(axis=1).T
    with record.timing("transmissibility"):
        found = by_momentum(response, total, frequency)
    curves: Curves = {FREQUENCY: (frequency, "Hz"), MOMENTUM: (found, "-")}
    if wanted.free_rim:
        with record.timing("free rim"):
            other = _by_free_rim(job, static, loads, frequency)
        curves[FREE_RIM] = other, "-"
        name = f"axle force by the free rim off that by momentum up to {wanted.to:.4g} Hz"
        record.indicators[name] = (apart(other, found), "-")
    return curves


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Distance of two transmissibilities over the other's size, both as root mean squares over all entries."""
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def _by_free_rim(job: Job, static: StaticState, loads, frequency: np.ndarray) -> np.ndarray:
    """Modes of the same static state with its rim let go. Collective."""
    count, turning = job.scene.output.transmissibility.free_rim, turning_of(job)
    motions = SmallMotions(job.tire, static, rim="free", road=job.scene.modal.road)
    basis = standing_modes(motions, count=count, rotation=turning.speed != 0)
    wheel = wheel_of(motions, turning, projection=basis.projection)
    return wheel.axle(basis.modes, loads, frequency)
