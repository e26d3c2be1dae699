"""Checks before solving that the road of a scene can be driven on: its file and its length."""

import math
from collections.abc import Callable
from typing import Any

from tireroad.contact.roads.grid import Grid
from tireroad.contact.roads.kinds.shapes import Edges
from tireroad.contact.roads.placement import begun_at, moved_start, shown
from tireroad.contact.roads.road import RoadKind, placed
from tireroad.contact.roads.under_tire import Road, is_level
from tireroad.fem.errors import InputError
from tireroad.runs.scene.tables.scene import RoadTable, Scene

# Least ratio of a pressed tire's effective rolling radius to its outer radius, and farthest reach
# of the patch ahead of the axle, m: only what a run would certainly refuse is refused here.
LEAST_RADIUS = 0.85
AHEAD = 0.5
# Half the width of road, and length, that `check` looks at for relief, m.
BESIDE, LOOKED = 0.5, 20.0
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


def remarks(scene: Scene) -> list[str]:
    """What `check` says of a road that can be driven on."""
    if scene.road is None or scene.contact is None:
        return []
    road = made(scene.road.surface)
    start = begun_at(road, scene.road.start)
    notes = [f"road: {moved_start(start)}"] if start != (scene.road.start or 0.0) else []
    end = start + AHEAD + least_travel(scene) / LEAST_RADIUS
    if least_travel(scene) == 0.0:
        notes += [f"warning: {text}" for text in never_met(scene.road)]
    elif scene.road.kind != "flat" and _level(scene.road, road, start, end):
        notes.append(f"warning: {without_relief(scene.road, start, end)}")
    elif (place := foot(scene.road)) is not None and start < place < start + scene.road.run_in:
        notes.append(f"warning: {within_run_in(scene.road, place)}")
    return notes


def never_met(road: RoadTable) -> list[str]:
    """A warning of a road with heights under a wheel that stands, at the start of the run-in."""
    if road.kind == "flat" and not road.offset:
        return []
    return [
        "the wheel stands: it meets a road by rolling out of its run-in, so that the heights of this one and "
        "road.offset have no effect; give [rotation] a speed, or move the whole road by [road.motion]"
    ]


def foot(road: RoadTable) -> float | None:
    """The foot (m) of a step's or cleat's first edge; None for other roads, and on a drum."""
    if isinstance(road.surface, Edges) and road.drum_radius is None:
        return road.surface.position
    return None


def within_run_in(road: RoadTable, place: float, share: float | None = None) -> str:
    """A warning of an obstacle at x = `place` (m) that is met at a `share` of its height only."""
    met = "less" if share is None else f"{100 * share:.2g} %"
    return (
        f"the {road.kind} at x = {shown(place)} m lies in the run-in, over which the road grows from flat: it is "
        f"met at {met} of its height; raise road.position, or shorten road.run_in ({road.run_in:g} m; 0: none)"
    )


def _level(table: RoadTable, road: Road, start: float, end: float) -> bool:
    """Whether a road has one height from `start` to `end` (m), on both sides of the tire's path.

    Of a long road only `LOOKED` m are looked at: bounds of files and textures take time.
    """
    if end - start > LOOKED and not isinstance(table.surface, Edges):
        return False
    whole = placed(road, table.surface, table).road  # on a drum it repeats
    beside = table.lateral - BESIDE, table.lateral + BESIDE
    return all(is_level(whole, start, last, *beside) for last in (min(start + 2.0, end), end))


def without_relief(road: RoadTable, first: float, last: float) -> str:
    """A warning of a road that has the same height all over the run, from `first` to `last` (m)."""
    key = "road.position, road.start" if hasattr(road.surface, "position") else "road.start"
    return (
        f'the road (kind = "{road.kind}") has no relief under the run, which passes over x = {shown(first)} to '
        f"{shown(last)} m: nothing on it moves the tire; change {key} or time.duration"
    )


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
    table, source = scene.road, getattr(road, "source", "road")
    (x0, x1), (y0, y1) = road.extent
    if not y0 <= table.lateral <= y1:
        raise InputError(
            f"{source}: road.lateral = {table.lateral:g} m lies beside the road, which has y from "
            f"{y0:.4g} to {y1:.4g} m"
        )
    start, travel = begun_at(road, table.start), least_travel(scene)
    # The first place needed is under the front of the patch.
    if start + travel > x1 or start + AHEAD < x0:
        raise InputError(
            f"{source}: the run needs the road from x = {shown(start)} to about "
            f"{shown(start + travel)} m (rotation.speed, tire.outer_radius, time.duration), and it "
            f"has {shown(x0)} to {shown(x1)} m; change [road] start, shorten [time] duration, or continue it "
            'by end = "mirror"'
        )
    if isinstance(road, Grid) and travel > AHEAD and table.drum_radius is None:
        # Refuses holes under the middle of the tire, before anything is solved.
        road.prepare(start + AHEAD, start + travel, table.lateral, table.lateral)


def least_travel(scene: Scene) -> float:
    """Distance (m) rolled in the run, estimated low because the static state is not known yet."""
    rotation, time = scene.rotation, scene.time
    if rotation is None or time is None:
        return 0.0
    radius = rotation.rolling_radius or LEAST_RADIUS * scene.tire.proportions().outer_radius
    travel = rotation.speed * radius * time.duration
    return travel if math.isfinite(travel) else 0.0
