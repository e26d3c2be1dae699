"""The interface of a kind of road: parameters, and the heights that they define."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.under_tire import Road
from tireroad.fem.parameters import Parameters, Registry, choice, number

Array = NDArray[np.float64]
Extent = tuple[tuple[float, float], tuple[float, float]]


class RoadKind(Parameters):
    """Base of all kinds: the parameters of a road, and `make`, which returns the road.

    If tables or files are needed, `make` returns another object; otherwise the kind is its own
    road.
    """

    owner = "road"

    @property
    def reads(self) -> Path | None:
        """The file that `make` reads, if any: one process reads it and shares the result."""
        return None

    def make(self) -> Road:
        """The road of these parameters. InputError if files cannot be used."""
        raise NotImplementedError


class EndlessRoad(RoadKind):
    """Base of endless roads whose heights follow from a formula.

    A derived class defines `height(x, y)` (m), its bounds `highest` and `lowest` (m) in a strip x0,
    x1, y0, y1 (m), and `spacing` (m), the shortest length that it resolves: half the shortest wave.
    """

    extent: Extent = ((-np.inf, np.inf), (-np.inf, np.inf))

    @property
    def spacing(self) -> float:
        """Half the shortest wave, m; an automatic time step resolves the wave by 16 steps."""
        return np.inf

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x along and y to the left (m), in their shape."""
        raise NotImplementedError

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Upper bound of the heights in a strip, m."""
        raise NotImplementedError

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Lower bound of the heights in a strip, m."""
        raise NotImplementedError

    def make(self) -> Road:
        """The kind itself."""
        return self

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> EndlessRoad:
        """Nothing to prepare."""
        return self


@dataclass(frozen=True, kw_only=True)
class Levelled(RoadKind):
    """Base of roads whose mean height, or waves longer than of interest, can be removed.

    A derived class is decorated like any other and inherits these two parameters.
    """

    datum: str = choice(
        "mean",
        ("mean", "zero"),
        "height of the road laid on the static road plane: the mean of the strip, or its own zero",
    )
    longest_wave: float | None = number(
        None,
        "m",
        "longer waves are filtered out, because the axle follows them; absent: none are",
        least=1e-3,
        most=1e4,
    )


ROADS: Registry[RoadKind] = Registry("road.kind", "tireroad.contact.roads.kinds", RoadKind)
road_kind = ROADS.register
