"""The interface of a kind of road: parameters, and the heights that they define.

The road as the tire meets it: any kind, shifted under the axle, levelled, and with a run-in.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.under_tire import Placement, Road, RoadUnderTire
from tireroad.fem.errors import InputError
from tireroad.fem.parameters import ParameterError, Parameters, Registry, choice, number

Array = NDArray[np.float64]
Extent = tuple[tuple[float, float], tuple[float, float]]


class RoadKind(Parameters):
    """Base of all kinds: the parameters of a road, and `make`, which returns the road.

    If tables or files are needed, `make` returns another object; otherwise the kind is its own
    road.
    """

    owner = "road"
    sampled: ClassVar[bool] = True
    """Whether a run meets a sample of a rough surface, so that its levels are those of the surface by chance; False for a shape."""
    drawn: ClassVar[bool] = False
    """Whether the heights are drawn by the key `seed`, each seed another sample of the surface."""

    def another(self, number: int) -> RoadKind | None:
        """Sample `number` (1, 2, ...) of the same surface beside this one; None where none can be drawn.

        Its seed follows from this one's, but is none that is near it: neighbouring seeds share no samples.
        """
        if not self.drawn:
            return None
        sequence = np.random.SeedSequence((vars(self)["seed"], number))
        return replace(self, seed=int(sequence.generate_state(1)[0] >> 1))  # type: ignore[call-arg]

    @property
    def reads(self) -> Path | None:
        """The file that `make` reads, if any: one process reads it and shares the result."""
        return None

    @property
    def files(self) -> tuple[Path, ...]:
        """All files that `make` reads: a result depends on their content."""
        return () if self.reads is None else (self.reads,)

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


def make_road(spec: Any = None, /, **keys: Any) -> RoadUnderTire:
    """The road of a scene, make_road(scene.road), or of keys, make_road(kind="sine",
    wavelength=0.2).

    Keys are those of `Placement` and of the kind (contact.roads.kinds), in their units; absent or
    None means the default. A spec with the attributes of Placement and `surface`, a RoadKind, is
    taken as it is. Use `placed` to reuse a road already made from a file. InputError for an unknown
    kind or key, a value out of its range or a file that cannot be used.
    """
    if spec is not None and not hasattr(spec, "__dict__"):
        raise InputError(
            f"make_road: {spec!r:.60} is not a road of a scene: give keys by name, such as "
            'make_road(kind="sine", wavelength=0.2)'
        )
    if spec is None or not hasattr(spec, "surface"):
        values = keys if spec is None else vars(spec)
        placement, surface = _read({k: v for k, v in values.items() if v is not None})
    else:
        placement = Placement(**{item.name: getattr(spec, item.name) for item in fields(Placement)})
        surface = spec.surface
    return placed(surface.make(), surface, placement)


def placed(road: Road, surface: RoadKind, placement: Placement) -> RoadUnderTire:
    """The `road` made from a `surface`, positioned by the placement."""
    return RoadUnderTire(
        road,
        **{item.name: getattr(placement, item.name) for item in fields(Placement)},
        datum=getattr(surface, "datum", "zero"),
        longest_wave=getattr(surface, "longest_wave", None),
    )


def _read(values: dict[str, Any]) -> tuple[Placement, RoadKind]:
    """Placement and surface from keys; InputError for keys of neither."""
    if "kind" not in values:
        raise InputError("road: kind is missing")
    kind = ROADS[values["kind"]]
    placed = {item.name for item in fields(Placement)}
    own = {item.name for item in fields(kind)}
    for key in values:
        if key not in placed | own | {"kind"}:
            raise ParameterError(key, f"does not belong to kind = {values['kind']}", "road")
    placement = Placement(**{k: v for k, v in values.items() if k in placed})
    return placement, kind(**{k: v for k, v in values.items() if k in own})
