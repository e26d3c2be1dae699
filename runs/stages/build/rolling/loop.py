"""A scene's time loop: the driven tire, the normal solver, the brush."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from tireroad.contact.grid_patch import OnPoints
from tireroad.contact.loop import Driven, Loop, roll
from tireroad.contact.model import step_solver, tread_memory, tread_shear
from tireroad.contact.patch import Patch
from tireroad.contact.setup import ContactSetup
from tireroad.contact.solver.stick_slip import Friction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.free_rolling import free_slip
from tireroad.greens.recursion import Recursion, sharers
from tireroad.greens.response import Response
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.build import corner
from tireroad.runs.stages.build.point_forces import directions, histories
from tireroad.runs.stages.build.rolling.stepping import Integration


def driven_tire(job: Job, chosen: Integration) -> Driven | None:
    """The tire under prescribed forces and with wheel readings; None if the scene has neither."""
    forces = job.scene.force
    if not forces and not corner.readings(job):
        return None
    time = chosen.step * np.arange(chosen.steps + 1)
    return Driven(chosen.tire, histories(forces, time), directions(forces), chosen.scheme)


def make_loop(spec, setup: ContactSetup, tire, step: float) -> Loop:
    """The loop of tire, normal solver and friction, from the table [contact]."""
    patch = setup.patch
    p = len(patch.index)
    memory = tread_memory(spec, patch, setup.rolled.speed, step)
    at_once = memory.at_once if memory else 1.0
    solver = step_solver(spec, patch, tire.same_step[:p, :p], at_once)
    friction = None
    if spec.rubs:
        friction = _friction(spec, setup, tire, step, at_once)
    if patch.weights is not None:
        tire = OnPoints(tire, patch.weights, 1 if friction is None else 3)
    return Loop(tire, solver, friction, memory)


def bristles(spec, patch: Patch):
    """Bristle stiffness (N/m) per point, or (c,); inf if rigid, None without horizontal forces."""
    if not spec.rubs:
        return None
    if spec.brush_stiffness_per_area is not None:
        return spec.brush_stiffness_per_area * patch.area
    return spec.brush_stiffness or np.inf


def _friction(spec, setup: ContactSetup, tire, step: float, at_once: float) -> Friction:
    """The brush of the scene, at rest.

    Shear of the tread by pressure counts from the static state, like all motion. If the slip of the
    static shape counts (free rolling), the shear of its tread does too, except for a tread that
    creeps.
    """
    patch, stiffness = setup.patch, bristles(spec, setup.patch)
    shear, pressed, moved = tread_shear(spec, patch, at_once), None, None
    if shear is not None and setup.shape_slip is not None and spec.law.creep is None:
        drag = shear.drag(patch.force)
        pressed, moved = np.zeros(len(patch.points)), np.stack([drag.real, drag.imag], axis=-1)
    law = BrushLaw(stiffness, spec.friction, setup.slips, spec.brush)
    brush = Brush(law, patch.points[:, 0], patch.line, setup.rolled.speed, step)
    brush.begin(patch.force > 0, moved)
    return Friction(brush, tire.same_step, patch.weights, shear, pressed)


def freely_rolling(
    job: Job, setup: ContactSetup, response: Response, step: float, scheme: str
) -> tuple[ContactSetup, float]:
    """The setup (settled) with the slip of free rolling on a smooth road, and that slip.

    Found with the time loop itself, over six passages of the patch. Raises ConvergenceError if
    there is none. Collective.
    """
    x0, x1, _, _ = setup.patch.extent
    steps = max(int(np.ceil(6 * (x1 - x0) / setup.rolled.speed / step)), 20)
    smooth, load = setup.smooth(steps * step), float(setup.patch.force.sum())

    def drag(slip: float) -> float:
        found = forces(job, smooth.with_slip(slip), response, step, steps, scheme).contact
        return float(found[-max(steps // 6, 1) :, 0].mean())

    slip = free_slip(drag, load)
    return setup.with_slip(slip), slip


class Forces(NamedTuple):
    """Forces (n, 3) N of the road on the tire (`contact`) and of the tire on the axle (`axle`).

    After each of n steps of `step` s.
    """

    contact: np.ndarray
    axle: np.ndarray
    step: float


def forces(
    job: Job,
    setup: ContactSetup,
    response: Response,
    step: float,
    steps: int,
    scheme: str,
    contact=None,
) -> Forces:
    """Run the loop of the job's scene with another response, step or setup (settled), in memory.

    `scheme`: see greens.recursion; `contact` replaces the scene's table. Raises ConvergenceError
    if the road touches outside the patch. Collective.
    """
    kept = response.resolved(step)
    comm = sharers(kept, job.comm)
    tire = Recursion(response=kept, step=step, scheme=scheme, comm=comm, look_ahead=True)
    spec = contact or job.scene.contact
    driven = driven_tire(job, Integration(tire, step, steps, scheme))
    loop = make_loop(spec, setup, driven or tire, step)
    (total, axle), every = np.zeros((2, steps, 3)), np.ones(len(setup.patch.points))
    given = setup.patch, setup.drive, step, steps
    with threadpool_limits(1, "blas"):
        for k, instant in enumerate(
            roll(loop.tire, loop.solver, *given, loop.friction, 0, loop.memory, motion=False)
        ):
            total[k, :2] = every @ instant.horizontal
            total[k, 2], axle[k] = instant.force.sum(), instant.axle_force
            if instant.force[setup.patch.edge].any():
                setup.patch.check_edge(instant.force[None], np.array([instant.time]), setup.reach)
    return Forces(total, axle, step)
