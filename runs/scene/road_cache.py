"""The last road of a scene, kept because its file may take seconds to read."""

from __future__ import annotations

from tireroad.contact.roads.road import RoadKind
from tireroad.contact.roads.under_tire import Road

_LAST: dict[tuple, Road] = {}  # one road at most, by its keys and the state of its files


def road_of(surface: RoadKind) -> Road:
    """The road of a scene; the last one is kept, since reading a file may take seconds."""
    road = _LAST.get(_which(surface))
    return road or keep(surface, surface.make())


def keep(surface: RoadKind, road: Road) -> Road:
    """Keep a road, in place of the last one; returns it."""
    _LAST.clear()
    _LAST[_which(surface)] = road
    return road


def _which(surface: RoadKind) -> tuple:
    """The road and the state of its files, which may have been rewritten."""
    states = [file.stat() for file in surface.files if file.is_file()]
    return surface, *((state.st_ino, state.st_size, state.st_mtime_ns) for state in states)
