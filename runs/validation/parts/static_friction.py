"""Friction of the static state against closed forms: (case, unit, computed, exact)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.optimize import root_scalar

from tireroad.contact import closed_forms as exact
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.friction_press import RubbingEquilibrium
from tireroad.fem.static.friction_road import Passing, Sliding, Standing
from tireroad.fem.static.virtual_work import AT_REST
from tireroad.runs.validation.parts.roller import Roller, middle, plane

FRICTION, HALF = 0.3, 0.015  # -; m, half the length of the contact
STIFF = Roller()
LAYER = Roller(outer=1.0, size=1e-3, reach=0.025, poisson_ratio=0.0)


def rows() -> Iterator[tuple]:
    """All cases."""
    for pushed in standing(STIFF):
        name = f"roller pushed sideways to {pushed.share:.2f} of sliding, traction in the middle (Cattaneo, Mindlin)"
        yield name, "-", pushed.in_the_middle, 1 - np.sqrt(1 - pushed.share)
    for share, found in rolling(STIFF, (0.2, 0.6)):
        closed = exact.carter_force(
            share * FRICTION * HALF / STIFF.outer, FRICTION, HALF, STIFF.outer
        )
        name = (
            f"roller at {share:g} of the creepage that slides, force over that of sliding (Carter)"
        )
        yield name, "-", found, closed
    thick, thin = (over_brush(replace(LAYER, thickness=thickness)) for thickness in (4e-3, 2e-3))
    name = "roller with a layer that sticks, force over that of bristles, from 4 and 2 mm to none (brush)"
    yield name, "-", 2 * thin - thick, 1.0


class Pressed:
    """A roller under a load (N) without friction; `rubbing` adds the friction of a tread model."""

    def __init__(self, roller: Roller, load: float, friction: float) -> None:
        self.roller, self.load, self.friction = roller, load, friction
        self.body = roller.body()
        self._without = plane(Equilibrium(self.body, AT_REST))
        height = -roller.outer + 0.01 * roller.thickness
        for part in (0.25, 0.5, 1.0):
            step = self._without.solve(height, load=part * load)
            height = self._without.road.height
            _check(step.converged)

    def rubbing(self, sliding: Sliding) -> RubbingEquilibrium:
        """The problem with friction, starting from the state without."""
        given = self.body, AT_REST, self.friction, sliding
        problem = plane(RubbingEquilibrium(*given))
        problem.road.take(self._without.contact_force(), self._without.road_height)
        return problem


class Pushed:
    """`x` (n,) m of the touching nodes in the middle of the width, `normal` and `pull` (n,) N."""

    def __init__(self, problem: RubbingEquilibrium, friction: float) -> None:
        self.x, some = middle(problem)
        self.normal, self.pull = problem.road.force[some], problem.road.pull[some, 0]
        self._friction = friction
        self.share = float(problem.road.pull[:, 0].sum() / friction / problem.road.force.sum())

    @cached_property
    def used(self) -> np.ndarray:
        """Tangential force over the force at which a node slides, (n,)."""
        return self.pull / (self._friction * self.normal)

    @property
    def in_the_middle(self) -> float:
        """`used` in the middle of the contact."""
        return float(np.interp(0.5 * (self.x[0] + self.x[-1]), self.x, self.used))


def standing(roller: Roller, pushes: tuple[float, ...] = (2e-4, 4e-4)) -> Iterator[Pushed]:
    """The road pushed sideways (m) under the roller."""
    load = roller.hertz_load(HALF)
    pressed = Pressed(roller, load, FRICTION)
    sliding = Standing(pressed.body)
    problem = pressed.rubbing(sliding)
    for push in pushes:
        sliding.place[0] = push
        _check(problem.solve(problem.road.height, load=load).converged)
        yield Pushed(problem, FRICTION)


def rolling(roller: Roller, shares: tuple[float, ...]) -> Iterator[tuple[float, float]]:
    """(share of the creepage of full sliding, force over that of full sliding), driving."""
    full = FRICTION * HALF / roller.outer
    drag = Rolling(Pressed(roller, roller.hertz_load(HALF), FRICTION))
    for share in shares:
        yield share, drag(drag.free * (1 - share * full)).share


class Rolling:
    """The rolling roller; `free` m: its travel per radian without drag."""

    def __init__(self, pressed: Pressed) -> None:
        self._pressed, radius = pressed, pressed.roller.outer
        self._sliding = Passing(pressed.body, radius)
        self._problem = pressed.rubbing(self._sliding)
        found = root_scalar(
            lambda trial: self(trial).share,
            method="secant",
            x0=radius,
            x1=radius * (1 - 1e-5),
            xtol=1e-9 * radius,
        )
        _check(found.converged)
        self.free = float(found.root)

    def __call__(self, travel: float) -> Pushed:
        """The state at that travel, m per radian."""
        self._sliding.radius = travel
        step = self._problem.solve(self._problem.road.height, load=self._pressed.load)
        _check(step.converged)
        return Pushed(self._problem, self._pressed.friction)


def over_brush(roller: Roller, creepage: float = 1e-3, half: float = 0.02) -> float:
    """Force of a layer that sticks throughout, over that of a brush of its G / thickness.

    nu = 0: each column of the layer carries for itself, p = E/h (half^2 - x^2)/2R. It drags its
    neighbours along over a length of its thickness, so the difference is of first order in that.
    """
    h, width, young = roller.thickness, roller.width, roller.youngs_modulus
    load = young / h * 2 * half**3 / 3 / roller.outer * width
    drag = Rolling(Pressed(roller, load, friction := 10.0))
    found = drag(drag.free * (1 - creepage)).share * friction * load
    return found / (young / 2 / h * creepage * 2 * half**2 * width)


def _check(fine: bool) -> None:
    if not fine:
        raise ConvergenceError("roller: no balance with friction was found: take other elements")
