"""The loop of a contact: tire, solver, brush and tread memory of a setup; and the slip of free rolling."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from tireroad.contact.loop import ContactProblem, LinearTire, Loop
from tireroad.contact.model import ContactSpec, step_solver, tread_memory, tread_shear
from tireroad.contact.patch import Patch
from tireroad.contact.setup import ContactSetup
from tireroad.contact.solver.conditions import Array
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw, free_slip

PASSAGES = 6  # of the patch, after which the bristles of a smooth road are steady


def make_loop(spec: ContactSpec, setup: ContactSetup, tire: LinearTire, step: float) -> Loop:
    """The loop in steps of `step` s, at rest, of a `tire` and the contact that the `spec` asks for.

    InputError if the contact problem is not affordable or has no unique solution. Not collective.
    """
    patch = setup.patch
    p = len(patch.index)
    memory = tread_memory(spec, patch, setup.rolled.speed, step)
    at_once = memory.at_once if memory else 1.0
    solver = step_solver(spec, patch, tire.same_step[:p, :p], at_once)
    friction = _friction(spec, setup, tire, step, at_once) if spec.has_friction else None
    return Loop(tire, ContactProblem(patch, tire.same_step, solver, friction), memory)


def bristles(spec: ContactSpec, patch: Patch) -> float | Array | None:
    """Bristle stiffness (N/m) per point, or (c,); inf if rigid, None without friction."""
    if not spec.has_friction:
        return None
    if spec.brush_stiffness_per_area is not None:
        return spec.brush_stiffness_per_area * patch.area
    return spec.brush_stiffness or np.inf


def _friction(
    spec: ContactSpec, setup: ContactSetup, tire: LinearTire, step: float, at_once: float
) -> BrushFriction:
    """The brush at rest.

    Shear of the tread by pressure counts from the static state, like all motion. If the slip of the
    static shape counts (free rolling), the shear of its tread does too, except for a tread that
    creeps.
    """
    patch, stiffness = setup.patch, bristles(spec, setup.patch)
    assert stiffness is not None
    shear, pressed, moved = tread_shear(spec, patch, at_once), None, None
    if shear is not None and setup.shape_slip is not None and spec.law.creep is None:
        drag = shear.drag(patch.force)
        pressed, moved = np.zeros(len(patch.points)), np.stack([drag.real, drag.imag], axis=-1)
    law = BrushLaw(stiffness, spec.friction, setup.slips, spec.brush)
    brush = Brush(law, patch.points[:, 0], patch.line, setup.rolled.speed, step)
    brush.begin(patch.force > 0, moved)
    return BrushFriction(brush, tire.same_step, patch.weights, shear, pressed)


def freely_rolling(
    setup: ContactSetup, step: float, contact_force: Callable[[ContactSetup, int], Array]
) -> tuple[ContactSetup, float]:
    """The setup (settled) with the slip of free rolling on a smooth road, and that slip.

    `contact_force(setup, steps)` (n, 3) N runs the loop in steps of `step` s; it is asked for six passages of the
    patch. ConvergenceError if no slip is free of drag. Collective if `contact_force` is.
    """
    x0, x1, _, _ = setup.patch.extent
    steps = max(math.ceil(PASSAGES * (x1 - x0) / setup.rolled.speed / step), 20)
    smooth, load = setup.smooth(steps * step), float(setup.patch.force.sum())

    def drag(slip: float) -> float:
        found = contact_force(smooth.with_slip(slip), steps)
        return float(found[-max(steps // PASSAGES, 1) :, 0].mean())

    slip = free_slip(drag, load)
    return setup.with_slip(slip), slip
