"""Checks before solving that the road of a scene can be driven on: its file and its length."""

import math
from collections.abc import Callable
from typing import Any

from tireroad.contact.roads.kind import RoadKind
from tireroad.contact.roads.under_tire import Road
from tireroad.fem.errors import InputError
from tireroad.runs.scene.tables.scene import Scene

# Least ratio of a pressed tire's effective rolling radius to its outer radius, and farthest reach
# of the patch ahead of the axle, m: only what a run would certainly refuse is refused here.
LEAST_RADIUS = 0.85
AHEAD = 0.5
Where = Callable[[tuple[str, ...], str], InputError]


# Least ratio of an inside drum's radius to the tire's outer radius that leaves room to press it.
_ROOM = 1.15


def check_shape(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """Raise an error for a drum too small for the tire, or held modes without a level plane."""
    road, camber = scene.road, scene.static.camber
    drum = road.drum_radius if road else None
    outer = scene.tire.proportions().outer_radius
    if drum is not None and road.drum == "inside" and drum < _ROOM * outer:
        raise error(
            ("road", "drum_radius"),
            f"= {drum:g} m leaves no room inside for a tire of {outer:g} m: at least {_ROOM * outer:.3g} m",
        )
    if scene.modes.road == "held" and (drum is not None or camber):
        raise error(
            ("modal", "road"),
            '= "held" holds the nodes in height, on a level road: take "forces", or static.camber = 0 deg '
            "and no road.drum_radius",
        )


def check_road(scene: Scene) -> None:
    """Raise InputError if the road's file is unusable or certainly too short. Not collective.

    A road in a text file is read completely.
    """
    if scene.road is None:
        return
    road = made(scene.road.surface)
    if scene.contact is not None and scene.time is not None:
        _check_extent(scene, road)


_MADE: dict[tuple, Road] = {}  # only the last road


def made(surface: RoadKind) -> Road:
    """The road of a scene; the last one is kept, since reading a file may take seconds."""
    found = _MADE.get(_which(surface))
    return found or keep(surface, surface.make())


def keep(surface: RoadKind, road: Road) -> Road:
    """Keep a road, in place of the last one; returns it."""
    _MADE.clear()
    _MADE[_which(surface)] = road
    return road


def _which(surface: RoadKind) -> tuple:
    """The road and the state of its file, which may have been rewritten."""
    if surface.reads is None or not surface.reads.is_file():
        return (surface,)
    state = surface.reads.stat()
    return surface, state.st_ino, state.st_size, state.st_mtime_ns


def _check_extent(scene: Scene, road: Road) -> None:
    placed, source = scene.road, getattr(road, "source", "road")
    (x0, x1), (y0, y1) = road.extent
    if not y0 <= placed.lateral <= y1:
        raise InputError(
            f"{source}: road.lateral = {placed.lateral:g} m lies beside the road, which has y from "
            f"{y0:.4g} to {y1:.4g} m"
        )
    travel = least_travel(scene)
    if placed.start + travel > x1 or placed.start + travel + AHEAD < x0:
        raise InputError(
            f"{source}: the run needs the road from {placed.start:.4g} to about "
            f"{placed.start + travel:.4g} m (rotation.speed, tire.outer_radius, time.duration), and it "
            f"has {x0:.4g} to {x1:.4g} m; change [road] start, shorten [time] duration, or continue it "
            'by end = "mirror"'
        )


def least_travel(scene: Scene) -> float:
    """Distance (m) rolled in the run, estimated low because the static state is not known yet."""
    rotation, time = scene.rotation, scene.time
    if rotation is None or time is None:
        return 0.0
    radius = rotation.rolling_radius or LEAST_RADIUS * scene.tire.proportions().outer_radius
    travel = rotation.speed * radius * time.duration
    return travel if math.isfinite(travel) else 0.0
