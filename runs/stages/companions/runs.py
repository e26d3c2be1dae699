"""Companion runs: error estimates for a run's time step, contact points, modes and mesh."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tireroad.contact.grid_patch import halved, thinned
from tireroad.contact.results.error_bars import (
    Bars,
    Measured,
    bars,
    measured,
    orders,
    random_share,
    share,
)
from tireroad.contact.setup import on_shape
from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.process import observe
from tireroad.runs.stages.build.rolling.loop import Forces
from tireroad.runs.stages.build.setup import tread_surface
from tireroad.runs.stages.build.wall import backed
from tireroad.runs.stages.companions.coarser import coarser
from tireroad.runs.stages.companions.given import Given, settled

FEWER = 1 / np.sqrt(2)  # share of the highest mode up to which the companion keeps states


def longer_step(given: Given) -> Forces:
    """Twice the time step. Collective."""
    return given.longer


def other_points(given: Given) -> Forces:
    """Every other point of the grid both ways or, where affordable, twice as many. Collective."""
    job, patch = given.job, given.setup.patch
    if patch.places is None:
        raise InputError(
            "the points are nodes of the mesh: take a grid, contact.points = { dx, dy }"
        )
    coarser = given.points_ratio > 1
    brush = job.scene.contact.brush_stiffness
    if brush is not None:  # stiffness of a point that stands for four, or for a quarter
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
    """States up to `FEWER` of the highest mode; those from there to the highest are static.

    States above the highest mode are kept: they belong to the shapes that joined the modes, without
    which the band below would shift. Collective.
    """
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
    """With the local flexibility of the wall between nodes below the contact points added.

    A coarser mesh does not show this part: halving the elements changes the far field of a point
    eight times and more, but its near field only twice. Collective.
    """
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
"""By the cause of the error that each estimates (contact.results.error_bars.CAUSES)."""


class Companion(NamedTuple):
    """The `forces` of a companion run and their reference `beside` (None: the run itself).

    `share`: the fraction of their difference that is the error.
    """

    forces: Forces
    beside: Forces | None
    share: float

    def bars(
        self, run: Mapping[str, Measured], since: float, limit: float, up_to: float
    ) -> dict[str, Bars]:
        """Error bars of a `run` after `since` s; see contact.results.error_bars.measured."""
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
    """Companion runs for one cause, without terminal output; their errors add as squares.

    Raises InputError or ConvergenceError if the cause has none. Collective.
    """
    with observe.quiet():
        beside = None if cause == "step" else given.base
        found = [Companion(COMPANIONS[cause](given), beside, _share(cause, given))]
        if cause == "mesh":
            with suppress(InputError, ConvergenceError):
                found.append(Companion(finer_wall(given), beside, 1.0))
    return found


def _share(cause: str, given: Given) -> float:
    points = given.points_ratio if cause == "points" else 2.0
    size = {"step": 2.0, "points": points, "modes": 1 / FEWER, "mesh": 2.0}[cause]
    order = orders(given.job.tire.section.order, given.scheme)[cause]
    return (random_share if cause == "points" else share)(size, order)
