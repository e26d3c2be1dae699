"""Cheap companions of a run: what its time step, points, modes and mesh are worth."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tireroad.contact.respaced import halved, ratio, thinned
from tireroad.contact.results.chatter import choose, oscillation
from tireroad.contact.results.error_bars import (
    Bars,
    Measured,
    bars,
    measured,
    orders,
    random_share,
    share,
)
from tireroad.contact.setup import ContactSetup, on_shape
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.static.state import StaticState
from tireroad.greens.response import Response
from tireroad.modal.rolling import RollingModes
from tireroad.runs.process import observe
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.stage import Done
from tireroad.runs.stages.build.rolling.loop import Forces, bristles, forces
from tireroad.runs.stages.build.setup import tread_surface
from tireroad.runs.stages.build.wall import Normal, backed
from tireroad.runs.stages.coarser import coarser

FEWER = 1 / np.sqrt(2)  # of the highest mode: up to where the companion keeps states


@dataclass(frozen=True, kw_only=True)
class Given:
    """A run: its `job`, its static state, patch and road (not settled), response
    and rolling modes, and the first `steps` of `step` s of its loop, by a `scheme`, that companions repeat; `free_slip`: what the
    setup has of it, and another setup of the scene needs."""

    job: Job
    static: Done[StaticState]
    setup: ContactSetup
    response: Response
    rolling: RollingModes
    step: float
    steps: int
    scheme: str = "linear"
    free_slip: float = 0.0

    @cached_property
    def settled(self) -> ContactSetup:
        """The patch in its static state."""
        return settled(self.job, self.setup, self.response, self.static.product.normal_force)

    @cached_property
    def longer(self) -> Forces:
        """The run with twice its step. Collective."""
        return self.repeated(self.settled, self.response, coarser=2)

    @cached_property
    def base(self) -> Forces | None:
        """The run with twice the step where companions of points, modes and mesh, with that step too, are compared
        with it, at half the cost; None where its steps leave out a state or do not resolve the contact's
        oscillation, and those of the run do. Collective."""
        step, spec = 2 * self.step, self.job.scene.contact
        kept = self.response.resolved(step)
        if len(kept.every) < len(self.response.resolved(self.step).every):
            return None
        patch = self.settled.patch
        steps = oscillation(spec, patch, kept, step, bristles(spec, patch))
        if self.scheme == "linear" and choose(steps).scheme != "linear":
            return None
        try:
            return self.longer
        except (ConvergenceError, InputError):
            return None

    def of(self, job: Job) -> Given:
        """The same with another job; its base stays that of the run."""
        other = replace(self, job=job)
        other.__dict__["base"] = self.base
        return other

    def repeated(
        self,
        setup: ContactSetup,
        response: Response,
        coarser: int | None = None,
        contact: Normal | None = None,
    ) -> Forces:
        """The loop by another setup (settled), response, `contact` or a step `coarser` times as long, by default that
        of `base`. Collective."""
        times = coarser or (1 if self.base is None else 2)
        step, steps = times * self.step, self.steps // times
        return forces(self.job, setup, response, step, steps, self.scheme, contact)


def settled(job: Job, setup: ContactSetup, response: Response, force: np.ndarray) -> ContactSetup:
    """The patch in its static state under the nodal forces (s,) N."""
    return setup.settled(response, force, job.scene.contact)[0]


def longer_step(given: Given) -> Forces:
    """Twice the time step. Collective."""
    return given.longer


def other_points(given: Given) -> Forces:
    """Every other point of the grid both ways, or, of a footprint that holds few, twice as many. Collective."""
    job, patch = given.job, given.setup.patch
    if patch.places is None:
        raise InputError(
            "the points are nodes of the mesh: take a grid, contact.points = { dx, dy }"
        )
    coarser = ratio(given.settled.patch) > 1
    brush = job.scene.contact.brush_stiffness
    if brush is not None:  # of a point that stands for four, or for a quarter
        contact = replace(job.scene.contact, brush_stiffness=brush * (4 if coarser else 0.25))
        job = replace(job, scene=replace(job.scene, contact=contact))
    if coarser:
        patch = thinned(patch)
    else:
        surface = tread_surface(job, given.static.product, given.static.key)
        height = given.static.product.road_height
        assert height is not None
        patch = halved(patch, surface, height, given.setup.reach)
        patch = on_shape(patch, given.static.product.road)
    setup = replace(given.setup, patch=patch)
    setup = settled(job, setup, given.response, given.static.product.normal_force)
    return given.of(job).repeated(setup, given.response)


def fewer_modes(given: Given) -> Forces:
    """States up to `FEWER` of the highest mode, those from there to the highest following statically: what lies beyond are the
    shapes that joined the modes, without which the band below would move. Collective."""
    highest = given.rolling.highest
    joined = given.rolling.basis.projection.shapes > 0
    limits = FEWER * highest, highest if joined else np.inf
    kept = given.response.keeping_where(
        lambda s: (np.abs(s) <= limits[0]) | (np.abs(s) > limits[1])
    )
    if len(kept.every) == len(given.response.every):
        raise InputError("all states lie far below the highest mode: none can be left out")
    return given.repeated(given.settled, kept)


def coarser_mesh(given: Given) -> Forces:
    """Elements of twice the size, from the static state on. Collective."""
    job, done = coarser(given.job, given.static)
    response, state = done["greens"].product.contact, done["static"].product
    setup = done["setup"].product.with_slip(given.free_slip)
    setup = settled(job, setup, response, state.normal_force)
    return given.of(job).repeated(setup, response)


def finer_wall(given: Given) -> Forces:
    """With what the wall gives way to between the nodes under the points, which no coarser mesh tells: half the elements
    change what is far from a point eight times and more, what is near it twice. Collective."""
    force = given.static.product.normal_force
    made = backed(given.job, given.static.product, given.setup, given.response)
    setup = made.setup.settled(made.response, force, made.contact)[0]
    return given.repeated(setup, made.response, contact=made.contact)


COMPANIONS: dict[str, Callable[[Given], Forces]] = {
    "step": longer_step,
    "points": other_points,
    "modes": fewer_modes,
    "mesh": coarser_mesh,
}
"""By the cause of the error that each is for (contact.results.error_bars.CAUSES)."""


class Companion(NamedTuple):
    """The `forces` of a companion, those they are compared with (None: the run's own), and the share of their difference
    that is the error."""

    forces: Forces
    beside: Forces | None
    share: float

    def bars(
        self, run: Mapping[str, Measured], since: float, limit: float, up_to: float
    ) -> dict[str, Bars]:
        """What it tells of the forces of a `run` after `since` s, as of contact.results.error_bars.measured."""
        off = _figures(self.forces, since, limit, up_to)
        other = _figures(self.beside, since, limit, up_to) if self.beside else run
        return {name: bars(other[name], off[name], self.share) for name in run}


def _figures(forces: Forces, since: float, limit: float, up_to: float) -> dict[str, Measured]:
    first = round(since / forces.step)
    both = {"contact_force": forces.contact, "axle_force": forces.axle}
    return {
        name: measured(values[first:], forces.step, limit, up_to) for name, values in both.items()
    }


def companions(cause: str, given: Given) -> list[Companion]:
    """Of a cause, without a word; the errors they tell add up as squares.

    Collective; InputError or ConvergenceError where there is none.
    """
    with observe.quiet():
        beside = None if cause == "step" else given.base
        found = [Companion(COMPANIONS[cause](given), beside, _share(cause, given))]
        if cause == "mesh":
            with suppress(InputError, ConvergenceError):
                found.append(Companion(finer_wall(given), beside, 1.0))
    return found


def _share(cause: str, given: Given) -> float:
    points = ratio(given.settled.patch) if cause == "points" else 2.0
    size = {"step": 2.0, "points": points, "modes": 1 / FEWER, "mesh": 2.0}[cause]
    order = orders(given.job.tire.section.order, given.scheme)[cause]
    return (random_share if cause == "points" else share)(size, order)
