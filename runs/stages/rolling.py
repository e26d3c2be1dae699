"""A scene's time loop: step, scheme, run-in, the driven tire, the normal solver, the brush."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from mpi4py import MPI
from threadpoolctl import threadpool_limits

from tireroad.contact.choices import LEAST_STEPS, TURN
from tireroad.contact.free_wheel import FreeWheel, with_spin
from tireroad.contact.loop import Block, DrivenTire, PushedTire, equal_steps, steps_of
from tireroad.contact.patch import Patch
from tireroad.contact.results.chatter import LARGE, Chosen, choose, oscillation
from tireroad.contact.rolling import bristles, make_loop, rolling_steadily
from tireroad.contact.setup import ContactSetup
from tireroad.greens.recursion import Convolution, Recursion, loop_communicator
from tireroad.greens.response import Response
from tireroad.greens.schemes import keeps_history
from tireroad.modal.rolling import RollingModes
from tireroad.runs.process import console
from tireroad.runs.scene.physics import run_in_time
from tireroad.runs.scene.tables.contact import TimeTable
from tireroad.runs.scene.tables.scene import PointForceTable, RoadTable, Scene
from tireroad.runs.stages import corner
from tireroad.runs.stages.stage import Job, Record

_PER_PERIOD = 16  # steps per shortest period of the excitation


def directions(forces: Sequence[PointForceTable]) -> np.ndarray:
    """Unit vectors of the forces, (k, 3)."""
    vectors = np.array([force.direction for force in forces]).reshape(-1, 3)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def histories(forces: Sequence[PointForceTable], time: np.ndarray, order: int = 0) -> np.ndarray:
    """The forces (nt, k) N: amplitude sin(2 pi f t), or the constant amplitude if f = 0.

    `order`: order of the time derivative, N/s^order.
    """
    columns = [_history(force, time, order) for force in forces]
    return np.stack(columns, axis=-1) if columns else np.zeros((len(time), 0))


def shortest_period(forces: Sequence[PointForceTable]) -> float:
    """Period of the fastest force, s; infinite if all are constant."""
    fastest = max((force.frequency for force in forces), default=0.0)
    return 1 / fastest if fastest else np.inf


def _history(force: PointForceTable, time: np.ndarray, order: int) -> np.ndarray:
    if force.frequency == 0:
        return np.full(len(time), force.amplitude if order == 0 else 0.0)
    omega = 2 * np.pi * force.frequency
    return force.amplitude * omega**order * np.sin(omega * time + order * np.pi / 2)


def run_in(setup: ContactSetup, road: RoadTable) -> float:
    """Time (s) until the whole patch is past the run-in; 0 if there is none.

    There is none either where the road is level up to its end, as before a cleat: nothing grows,
    and the impact would be left out with it.
    """
    return 0.0 if road.kind == "flat" else run_in_time(setup, road.run_in)


def first_step(setup: ContactSetup, road: RoadTable, time: np.ndarray) -> int:
    """Index of the first step past the run-in; 0 if that is half the run or more."""
    start = int(np.searchsorted(time, run_in(setup, road)))
    return start if start < len(time) // 2 else 0


def run_time(time: TimeTable) -> float:
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
    time = job.scene.time
    fastest = np.abs(response.every).max(initial=0.0)
    if isinstance(time.step, str):
        limits = [time.duration / LEAST_STEPS, shortest / _PER_PERIOD]
        if fastest > 0:
            limits.append(TURN / fastest)
        steps = equal_steps(time.duration, min(limits))
    else:
        steps = steps_of(time.duration, time.step)
    resolved = response.resolved(steps.size)
    moved = len(response.every) - len(resolved.every)
    console.say(
        f"  step {steps.size:.4g} s, {steps.count} steps; fastest mode {fastest:.4g} 1/s, "
        f"{moved} states too fast for the step respond statically"
    )
    if steps.duration > time.duration * (1 + 1e-9):
        console.say(
            f"  the run ends at {steps.duration:.6g} s: {time.duration:.6g} s is not a multiple of the step"
        )
    record.indicators["states moved to the residual"] = (moved, "-")
    return Planned(resolved, steps.size, steps.count)


def integration(job: Job, plan: Planned, scheme: str) -> Integration:
    """The integrator at t = 0 for the planned steps. Collective."""
    tire: Recursion | Convolution
    if keeps_history(scheme):
        tire = Convolution(response=plan.response, step=plan.step, steps=plan.steps)
    else:
        comm = loop_communicator(plan.response, job.comm)
        tire = Recursion(
            response=plan.response, step=plan.step, scheme=scheme, comm=comm, look_ahead=True
        )
        if comm.size < job.comm.size:
            console.say("  each process computes the whole loop: it is too small to distribute")
    return Integration(tire, plan.step, plan.steps, scheme)


def passing_period(road: RoadTable, spacing: float, speed: float) -> float:
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


def shortest_excitation(scene: Scene, setup: ContactSetup) -> float:
    """Shortest period of all excitation of a run in contact, s."""
    passing = passing_period(scene.road, setup.shortest, setup.rolled.speed)
    return min(passing, shortest_period(scene.force))


def free_wheel(job: Job, chosen: Integration) -> FreeWheel:
    """The tire of the integration, of a response with the spin, on the job's wheel that turns freely."""
    assert isinstance(chosen.tire, Recursion), "in a convolution the wheel is held"
    inertia = job.scene.axle.wheel_inertia[1]
    return FreeWheel(chosen.tire, inertia, job.speed, chosen.step, chosen.scheme)


def driven_tire(
    job: Job, chosen: Integration, patch: Patch, tire: PushedTire | None = None
) -> DrivenTire | None:
    """The tire, by default that of the integration, under prescribed forces and with wheel readings; None if the scene has
    neither."""
    forces = job.scene.force
    if not forces and not corner.readings(job):
        return None
    time = chosen.step * np.arange(chosen.steps + 1)
    seen = (3 if job.scene.horizontal_forces else 1) * len(patch.index)
    given = histories(forces, time), directions(forces), chosen.scheme, seen
    return DrivenTire(tire or chosen.tire, *given)


class ContactForces(NamedTuple):
    """Forces (n, 3) N of the road on the tire (`contact`) and of the tire on the axle (`axle`, None where unknown).

    After each of n steps of `step` s. `lines` (f, m) m kg^1/2: what the whole tire does under them (runs.stages.replay), None
    where it was not asked for.
    """

    contact: np.ndarray
    axle: np.ndarray | None
    step: float
    lines: np.ndarray | None = None


class Listener(Protocol):
    """A tire whose vibration is told (runs.stages.replay.Vibrating)."""

    def lines(
        self, change: np.ndarray, begun: np.ndarray, step: float, scheme: str
    ) -> np.ndarray: ...


def forces(
    job: Job,
    setup: ContactSetup,
    response: Response,
    step: float,
    steps: int,
    scheme: str,
    comm: MPI.Comm,
    contact=None,
    steady: bool = True,
    states: RollingModes | None = None,
    whole: Listener | None = None,
) -> ContactForces:
    """Run the loop of the job's scene with another response, step or setup (settled), in memory.

    `scheme`: see greens.recursion; `contact` replaces the scene's table; `steady`: begun with steady rolling, else at rest; `states` of
    the response, for a wheel that turns freely: held without; `whole`: tells the vibration of the whole tire.
    Raises ConvergenceError if the road touches outside the patch, or nothing rolls steadily. Collective on `comm`.
    """
    if steady:
        setup = rolling_steadily(contact or job.scene.contact, setup, response, step)
    comm = loop_communicator(response.resolved(step), comm)
    rolled = blocks(job, setup, response, step, steps, scheme, comm, contact, states)
    found = [
        (block.total_force, block.axle_force, block.change if whole else block.total_force[:0])
        for block in rolled
    ]
    total, axle, change = map(np.concatenate, zip(*found, strict=True))
    if whole is None:
        return ContactForces(total, axle, step)
    begun = setup.steady.change if setup.steady else np.zeros(change.shape[1])
    return ContactForces(total, axle, step, whole.lines(change, begun, step, scheme))


def blocks(
    job: Job,
    setup: ContactSetup,
    response: Response,
    step: float,
    steps: int,
    scheme: str,
    comm: MPI.Comm,
    contact=None,
    states: RollingModes | None = None,
) -> Iterator[Block]:
    """The blocks of a loop as in `forces`, of a setup that rolls steadily, on the processes `comm` that share it. Collective
    on these."""
    spec, resolved = contact or job.scene.contact, response.resolved(step)
    turns = states is not None and corner.turns_freely(job.scene) and spec.has_friction
    if turns:
        resolved = with_spin(response, states).resolved(step)
    tire = Recursion(response=resolved, step=step, scheme=scheme, comm=comm, look_ahead=True)
    chosen = Integration(tire, step, steps, scheme)
    driven = driven_tire(job, chosen, setup.patch, free_wheel(job, chosen) if turns else None)
    loop = make_loop(spec, setup, driven or tire, step)
    with threadpool_limits(1, "blas"):
        for block in loop.roll(setup.drive, step, steps):
            setup.patch.check_edge(block.force, block.time, setup.reach)
            yield block


def chosen_scheme(
    job: Job, record: Record, setup: ContactSetup, plan: Planned, begun: Chosen | None, large: bool
) -> Chosen:
    """The scheme and the reason for it; both are reported.

    `begun`: the choice stored in the checkpoint that the loop continues from, or None; `large`: whether motions are.
    """
    scheme = job.scene.time.scheme
    spec, patch = job.scene.contact, setup.patch
    rubbed = bristles(spec, patch)
    steps = oscillation(spec, patch, plan.response, plan.step, rubbed, setup.resolved)
    if math.isfinite(steps):
        record.indicators["steps in the fastest oscillation of the contact"] = (steps, "-")
    chosen = Chosen(scheme, f'time.scheme = "{scheme}"')
    if scheme == "auto":
        chosen = LARGE if large else choose(steps)
    return reported(record, begun or chosen)


def reported(record: Record, chosen: Chosen) -> Chosen:
    """Report the choice in the terminal and the record; returns it."""
    console.say(f"  scheme {chosen.scheme}: {chosen.reason}")
    record.indicators["reason for the scheme"] = (chosen.reason, "-")
    return chosen


def recursive(scheme: str) -> str:
    """The scheme of a recursion that repeats a run: a convolution approximates linear forces."""
    return "linear" if keeps_history(scheme) else scheme


def of_given_forces(scene: Scene) -> str:
    """The scheme for prescribed forces without contact.

    They cannot chatter, and linear over the step has the higher order.
    """
    return "linear" if scene.time.scheme == "auto" else scene.time.scheme
