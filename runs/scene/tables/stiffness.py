"""The table [stiffness]: load-deflection curve and stiffness, and what they need."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Key, Limits, described, finite, parameter
from tireroad.runs.scene.schema import choice, integer, number

if TYPE_CHECKING:
    from tireroad.runs.scene.tables.scene import Scene

Where = Callable[[tuple[str, ...], str], InputError]
_MOST = 200
_BEYOND = 1.5  # times the scene's own deflection, by default


def _ascending(doc: str, unit: str, limits: Limits) -> Any:
    """A key for an ascending list of numbers, empty by default."""

    def read(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list | tuple) or len(value) > _MOST:
            raise ValueError(f"must be a list of at most {_MOST} numbers, not {described(value)}")
        result = tuple(finite(part) for part in value)
        for part in result:
            limits.check(part, unit)
        if any(b <= a for a, b in zip(result, result[1:], strict=False)):
            raise ValueError(f"must ascend, not {described(list(result))}")
        return result

    allowed = f"ascending numbers, {limits}"
    return parameter(Key(read=read, unit=unit, doc=doc, values=allowed, limits=limits), ())


@dataclass(frozen=True)
class Stiffness:
    deflections: tuple[float, ...] = _ascending(
        "deflections at which load and footprint are computed; empty: equal steps up to up_to",
        "m",
        Limits(least=1e-6, most=10),
    )
    up_to: float | None = number(
        None, "m", "largest deflection; absent: 1.5 times that of the scene", least=1e-6, most=10
    )
    steps: int = integer(6, "number of equal steps up to up_to", least=1, most=_MOST)
    which: str = choice(
        "all",
        ("all", "vertical"),
        "stiffnesses to compute: vertical, or all (also longitudinal, lateral and torsional)",
    )
    slide_steps: int = integer(
        8,
        "with static.friction and which = all: steps of the curves of force over the displacement of the road along and "
        "across a standing tire, or over the slip of a rolling one, up to sliding; 0: none",
        least=0,
        most=_MOST,
    )
    slide_to: float | None = number(
        None,
        "m",
        "largest displacement of these curves; absent: 2 friction times load over the stiffness of the sticking footprint",
        least=1e-6,
        most=1,
    )
    slip_to: float | None = number(
        None,
        "-",
        "largest slip of these curves for a rolling wheel; absent: 3 friction times load over the initial slope, at most "
        "0.5",
        least=1e-6,
        most=0.5,
    )


def deflections(wanted: Stiffness, own: float | None) -> list[float]:
    """The deflections (m) to compute; `own` is that of the scene's static state."""
    if wanted.deflections:
        return list(wanted.deflections)
    last = wanted.up_to or _BEYOND * own
    return (last * np.arange(1, wanted.steps + 1) / wanted.steps).tolist()


def check_stiffness(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """Raise an error if there is nothing to derive the deflections from."""
    wanted, static = scene.stiffness, scene.static
    if wanted is None or wanted.deflections or wanted.up_to:
        return
    if not static.on_road:
        raise error(
            ("stiffness", "up_to"),
            "is needed where the scene has no road: give it (m), or load (N) in [static]",
        )
