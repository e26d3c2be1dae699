"""The table [axle]: support of the wheel, and incompatible settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tireroad.fem.axle import DIRECTIONS, Axle
from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Key, Limits, OnlyFor, described, finite, parameter
from tireroad.runs.scene.schema import choice, number, vector

if TYPE_CHECKING:
    from tireroad.runs.scene.tables.scene import Scene

Where = Callable[[tuple[str, ...], str], InputError]
Springs = tuple[float, ...] | tuple[tuple[float, ...], ...]
_SPRINGS = Limits(least=-1e15, most=1e15)  # N/m, N m/rad and per unit of velocity
_HELD = tuple(name for name in DIRECTIONS if name != "z")
_MOVING: OnlyFor = ("kind", ("corner", "free"))
_SPRUNG: OnlyFor = ("kind", ("corner",))


def _entry(value: Any) -> float:
    number = finite(value)
    _SPRINGS.check(number, "")
    return number


def _springs(default: Springs, doc: str) -> Any:
    """A key of six diagonal entries, or a whole 6 x 6 matrix."""

    def read(value: Any) -> Springs:
        whole = isinstance(value, list | tuple) and len(value) == 6
        if not whole:
            raise ValueError(f"must be 6 numbers, or 6 rows of 6, not {described(value)}")
        if not any(isinstance(part, list | tuple) for part in value):
            return tuple(_entry(part) for part in value)
        rows = [part if isinstance(part, list | tuple) else () for part in value]
        if any(len(row) != 6 for row in rows):
            raise ValueError("must be 6 numbers, or 6 rows of 6")
        return tuple(tuple(_entry(part) for part in row) for row in rows)

    values = "6 numbers ≥ 0, or a symmetric matrix of 6 rows, each ≤ 1e+15"
    key = Key(read=read, unit="N, m, s, rad", doc=doc, values=values, only_for=_SPRUNG)
    return parameter(key, default)


def _directions(default: tuple[str, ...], doc: str) -> Any:
    def read(value: Any) -> tuple[str, ...]:
        if not isinstance(value, list | tuple) or any(part not in DIRECTIONS for part in value):
            raise ValueError(f"must be a list of {', '.join(DIRECTIONS)}, not {described(value)}")
        return tuple(name for name in DIRECTIONS if name in value)

    values = f"of {', '.join(DIRECTIONS)}"
    return parameter(Key(read=read, doc=doc, values=values, only_for=_MOVING), default)


@dataclass(frozen=True)
class AxleTable:
    kind: str = choice(
        "fixed",
        ("fixed", "corner", "free"),
        "support of the wheel: held, on springs and dampers, or free under the constant static load",
    )
    wheel_mass: float = number(
        15.0,
        "kg",
        "mass of rim, brake and all that moves with them, without the tire",
        least=0.01,
        most=1e6,
        only_for=_MOVING,
    )
    wheel_inertia: tuple[float, float, float] = vector(
        (0.4, 0.8, 0.4),
        "kg m²",
        "moments of inertia of the wheel about x, y (the axle) and z",
        least=0,
        most=1e6,
    )
    stiffness: Springs = _springs(
        (0.0, 0.0, 25e3, 0.0, 0.0, 0.0),
        "stiffness of the springs to the body along x, y, z (N/m) and about them (N m/rad)",
    )
    damping: Springs = _springs(
        (0.0, 0.0, 2.4e3, 0.0, 0.0, 0.0),
        "damping of the dampers parallel to the springs, N s/m and N m s/rad",
    )
    body_mass: float | None = number(
        None,
        "kg",
        "mass of the car body on this corner, which moves up and down; absent: springs to the ground",
        least=0.1,
        most=1e8,
        only_for=_SPRUNG,
    )
    locked: tuple[str, ...] = _directions(
        _HELD,
        "directions in which the wheel is held; about y (ry) it is its speed of rotation that is held",
    )


def axle_of(scene: Scene) -> Axle | None:
    """The moving wheel; None if held. Raises InputError if it is no valid mechanical system."""
    given = scene.axle
    if given.kind == "fixed" or len(given.locked) == len(DIRECTIONS):
        return None
    none = (0.0,) * 6
    free = given.kind == "free"
    return Axle(
        wheel_mass=given.wheel_mass,
        wheel_inertia=given.wheel_inertia,
        stiffness=np.array(none if free else given.stiffness),
        damping=np.array(none if free else given.damping),
        body_mass=None if free else given.body_mass,
        locked=given.locked,
    )


def check_axle(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """Raise an error for an unstable corner, and for settings incompatible with a moving wheel."""
    given = scene.axle
    if given.kind == "fixed":
        return
    try:
        axle = axle_of(scene)
    except InputError as problem:
        raise error(("axle",), str(problem).removeprefix("axle: ")) from None
    if axle is None:
        return
    if given.kind == "free" and any(k > 2 for k in axle.moving):
        raise error(
            ("axle", "locked"),
            'must hold rx, ry and rz of kind = "free": nothing else keeps the wheel upright',
        )
    if given.kind == "corner":
        _check_springs(axle, error)
    _check_company(scene, axle, error)


def _check_springs(axle: Axle, error: Where) -> None:
    if axle.body_mass is not None and not axle.has_body:
        raise error(("axle", "body_mass"), "has no part where z is locked: take it or the lock out")
    for k in axle.moving:
        if axle.stiffness[k, k] <= 0:
            what = "carries the static load" if k == 2 else "keeps the wheel in place"
            raise error(
                ("axle", "stiffness"),
                f"has no spring along {DIRECTIONS[k]}, and nothing else {what}: the corner is unstable. "
                f'Give one, or lock {DIRECTIONS[k]}; kind = "free" is a wheel under a constant force',
            )


def _check_company(scene: Scene, axle: Axle, error: Where) -> None:
    """Refuse what is available for a held wheel only."""
    turns = scene.rotation is not None and scene.rotation.speed > 0
    if scene.modes.rim == "free":
        raise error(("modal", "rim"), '= "free" is a wheel without mass: [axle] needs "fixed"')
    if scene.modes.road == "held":
        raise error(
            ("modal", "road"),
            f'= "held" keeps the wheel of axle.kind = "{scene.axle.kind}" where it is: take modal.road = "forces", '
            'or axle.kind = "fixed"',
        )
    if turns and scene.rotation.method == "full":
        raise error(("rotation", "method"), '= "full" knows no [axle] that moves: take "projected"')
    if turns and scene.rotation.inertia == "doppler":
        raise error(
            ("rotation", "inertia"),
            '= "doppler" pulls at a wheel that moves along with its tire: take "full"',
        )
    if scene.greens.residual == "second-order":
        raise error(
            ("greens", "residual"),
            '= "second-order" knows no [axle] that moves: take "static" or "attachment"',
        )
    tilts = any(k > 2 for k in axle.moving)
    if tilts and turns and not scene.static.steady_rolling:
        raise error(
            ("static", "steady_rolling"),
            "= false leaves out the centrifugal tension that keeps a tilting tire upright",
        )
