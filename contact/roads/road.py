"""The road as the tire meets it: any kind, shifted under the axle, levelled, and with a run-in."""

from dataclasses import fields
from typing import Any

from tireroad.contact.roads.kind import ROADS, RoadKind
from tireroad.contact.roads.placement import Placement
from tireroad.contact.roads.under_tire import Road, RoadUnderTire
from tireroad.fem.errors import InputError
from tireroad.fem.parameters import ParameterError


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
            f"make_road: {spec!r:.60} is no road of a scene: give keys by name, such as "
            'make_road(kind="sine", wavelength=0.2)'
        )
    if spec is None or not hasattr(spec, "surface"):
        given = keys if spec is None else vars(spec)
        placement, surface = _read({k: v for k, v in given.items() if v is not None})
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


def _read(given: dict[str, Any]) -> tuple[Placement, RoadKind]:
    """Placement and surface from keys; InputError for keys of neither."""
    if "kind" not in given:
        raise InputError("road: kind is missing")
    kind = ROADS[given["kind"]]
    placed = {item.name for item in fields(Placement)}
    own = {item.name for item in fields(kind)}
    for key in given:
        if key not in placed | own | {"kind"}:
            raise ParameterError(key, f"does not belong to kind = {given['kind']}", "road")
    placement = Placement(**{k: v for k, v in given.items() if k in placed})
    return placement, kind(**{k: v for k, v in given.items() if k in own})
