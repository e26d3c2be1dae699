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
# Of the highest mode. Of a tire of 48 MPa with 60, 120, 250 modes (311, 448, 687 Hz) the two ways are 0.5, 0.25, 0.2 %
# apart up to half of it, and 40, 3, 0.2 % up to 300 Hz.
LIMIT = 0.5
FREQUENCY, MOMENTUM, FREE_RIM = (
    f"transmissibility/{name}" for name in ("frequency", "momentum", "free_rim")
)


def transmissibility(
    job: Job, record: Record, static: StaticState, response: Response, highest: float
) -> Curves:
    """The curves (f, 3, k), -, of k driven points, from `step` to `to` Hz: force of the tire on the axle per
    force. By the momentum of the response's states and, where the scene asks for it, by modes of the tire
    with a free rim (greens.axle): each checks the other. `highest` (Hz) of the modes. Collective.
    """
    wanted = job.scene.output.transmissibility
    frequency = wanted.step * np.arange(1, round(wanted.to / wanted.step) + 1)
    loads, _ = driven_points(job)
    total = loads.toarray().reshape(loads.shape[0], -1, 3).sum(axis=1).T
    with record.timing("transmissibility"):
        found = by_momentum(response, total, frequency)
    peak = np.unravel_index(np.abs(found).argmax(), found.shape)
    record.headline["largest force on the axle per force"] = (float(np.abs(found[peak])), "-")
    record.headline["force on the axle is largest at"] = (float(frequency[peak[0]]), "Hz")
    curves: Curves = {FREQUENCY: (frequency, "Hz"), MOMENTUM: (found, "-")}
    if wanted.free_rim:
        with record.timing("free rim"):
            other, top = _by_free_rim(job, static, loads, frequency)
        highest = min(highest, top)
        curves[FREE_RIM] = other, "-"
        name = f"axle force by the free rim off that by momentum up to {wanted.to:.4g} Hz"
        record.indicators[name] = (apart(other, found), "-")
    if wanted.to > LIMIT * highest:
        record.warnings.append(
            f"output.transmissibility goes to {wanted.to:g} Hz; beyond {LIMIT * highest:.4g} Hz, half the highest mode, "
            "it lacks the modes left out: take more of them (modal.count, output.transmissibility.free_rim)"
        )
    return curves


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Distance of two transmissibilities over the other's size, both as root mean squares over all entries."""
    return float(np.linalg.norm(one - other) / np.linalg.norm(other))


def _by_free_rim(
    job: Job, static: StaticState, loads, frequency: np.ndarray
) -> tuple[np.ndarray, float]:
    """By modes of the same static state with its rim let go; the highest of them, Hz. Collective."""
    count, turning = job.scene.output.transmissibility.free_rim, turning_of(job)
    motions = SmallMotions(job.tire, static, rim="free", road=job.scene.modal.road)
    basis = standing_modes(motions, count=count, rotation=turning.speed != 0)
    wheel = wheel_of(motions, turning, projection=basis.projection)
    return wheel.axle(basis.modes, loads, frequency), float(basis.frequency[-1])
