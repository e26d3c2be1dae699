"""The time steps of a run: given by the scene, or derived from what must be resolved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.contact.loop import equal_steps, steps_of
from tireroad.greens.convolution import Convolution
from tireroad.greens.recursion import Recursion, sharers
from tireroad.greens.response import Response
from tireroad.runs.process import observe
from tireroad.runs.scene.tables.contact import Time
from tireroad.runs.scene.tables.scene import Road
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.record import Record

# Radians that a kept mode may turn per automatic step: at 0.3 its phase error is below 1 %.
_TURN = 0.3
_LEAST_STEPS = 200
_PER_PERIOD = 16  # steps per shortest period of the excitation


def run_time(time: Time) -> float:
    """Duration of the run, s: whole steps, so slightly longer than one that is not a multiple."""
    if isinstance(time.step, str):
        return time.duration
    return steps_of(time.duration, time.step).duration


@dataclass(frozen=True)
class Planned:
    """`steps` steps of `step` s, and the `response` of the states that they resolve."""

    response: Response
    step: float
    steps: int


@dataclass(frozen=True)
class Integration:
    """The time integrator `tire`, for `steps` steps of `step` s with a `scheme`."""

    tire: Recursion | Convolution
    step: float
    steps: int
    scheme: str


def planned(job: Job, record: Record, response: Response, shortest: float) -> Planned:
    """The steps from the scene's table [time]; the choice is reported. Collective.

    `shortest` (s): shortest period of the excitation.
    """
    wanted = job.scene.time
    fastest = np.abs(response.every).max(initial=0.0)
    if isinstance(wanted.step, str):
        limits = [wanted.duration / _LEAST_STEPS, shortest / _PER_PERIOD]
        if fastest > 0:
            limits.append(_TURN / fastest)
        steps = equal_steps(wanted.duration, min(limits))
    else:
        steps = steps_of(wanted.duration, wanted.step)
    kept = response.resolved(steps.size)
    moved = len(response.every) - len(kept.every)
    observe.say(
        f"  step {steps.size:.4g} s, {steps.count} steps; fastest mode {fastest:.4g} 1/s, "
        f"{moved} states too fast for the step respond statically"
    )
    if steps.duration > wanted.duration * (1 + 1e-9):
        observe.say(
            f"  the run ends at {steps.duration:.6g} s: {wanted.duration:.6g} s is not a multiple of the step"
        )
    record.indicators["states moved to the residual"] = (moved, "-")
    return Planned(kept, steps.size, steps.count)


def integration(job: Job, plan: Planned, scheme: str) -> Integration:
    """The integrator at t = 0 for the planned steps. Collective."""
    tire: Recursion | Convolution
    if scheme == "convolution":
        tire = Convolution(response=plan.response, step=plan.step, steps=plan.steps)
    else:
        comm = sharers(plan.response, job.comm)
        tire = Recursion(
            response=plan.response, step=plan.step, scheme=scheme, comm=comm, look_ahead=True
        )
        if comm.size < job.comm.size:
            observe.say("  each process computes the whole loop: it is too small to distribute")
    return Integration(tire, plan.step, plan.steps, scheme)


def passing_period(road: Road, spacing: float, speed: float) -> float:
    """Shortest period (s) of the road's excitation at `speed` (m/s).

    Of the shortest wave that its `spacing` (m) resolves, the sine of its motion, or the
    acceleration of its ramp (one wave long).
    """
    motion = road.motion
    periods = [2 * spacing / speed if speed else np.inf]
    if motion.kind == "sine":
        periods.append(1 / motion.frequency)
    elif motion.kind == "ramp":
        periods.append(motion.duration)
    return min(periods)
