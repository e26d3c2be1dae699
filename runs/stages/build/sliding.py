"""[stiffness] with friction: force over road displacement at rest, or over slip when rolling."""

from __future__ import annotations

from collections.abc import Mapping

import h5py
import numpy as np

from tireroad.fem.matrices.road_stiffness import RoadStiffness
from tireroad.fem.static.friction_press import Slid, Slide
from tireroad.fem.static.state import StaticState
from tireroad.runs.files.store import put
from tireroad.runs.process import observe
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.build.turning import wheel_slip

AXES = ("longitudinal", "lateral")
_COLUMNS = ("moved", "force", "tangent", "moment", "sticks")
# Displacement at full sliding, times initial stiffness over friction force: 1.5 for two spheres
# (Cattaneo, Mindlin), 3 for a rolling brush.
_STANDING, _ROLLING = 2.0, 3.0
_MOST = 0.5  # slip

Curve = Mapping[str, np.ndarray]


def slides(job: Job, state: StaticState, stuck: RoadStiffness) -> dict[str, Curve]:
    """The curves by the names of `AXES`; none without friction.

    `start`: initial slope, with all points sticking. Leaves the body in another state. Collective.
    """
    wanted, friction = job.scene.stiffness, job.scene.static.friction
    if state.pull is None or not friction or not wanted.slide_steps:
        return {}  # friction 0 resists nothing: no displacement to slide over
    found: dict[str, Curve] = {}
    for axis, name in enumerate(AXES):
        slide = Slide(job.tire.body, state, friction, axis)
        start = slide.start(wheel_slip(job.scene))
        rate = start if slide.rolls else getattr(stuck, name)
        end = wanted.slip_to if slide.rolls else wanted.slide_to
        if end is None:
            end = (
                (_ROLLING if slide.rolls else _STANDING)
                * friction
                * state.normal_force.sum()
                / rate
            )
            end = min(end, _MOST) if slide.rolls else end
        points = []
        for point in slide.curve(
            (end * np.arange(1, wanted.slide_steps + 1) / wanted.slide_steps).tolist()
        ):
            points.append(point)
            observe.say(f"  {name}: {_told(point, slide.rolls)}")
        columns = {key: np.array([getattr(point, key) for point in points]) for key in _COLUMNS}
        found[name] = columns | {"start": np.array(start)}
    return found


def _told(point: Slid, rolls: bool) -> str:
    way = f"slip {point.moved:.4g}" if rolls else f"{1e3 * point.moved:.4g} mm"
    return f"{way}: {point.force:.5g} N, {100 * point.sticks:.3g} % of the load sticks"


def units(rolls: bool) -> dict[str, str]:
    """Units of the columns; a rolling wheel has slip instead of displacement."""
    rate = "N" if rolls else "N/m"
    return {
        "moved": "-" if rolls else "m",
        "force": "N",
        "tangent": rate,
        "moment": "N m",
        "sticks": "-",
        "start": rate,
    }


def fill(file: h5py.File, found: Mapping[str, Curve], rolls: bool) -> None:
    """Write `slide/<axis>/...`."""
    for name, curve in found.items():
        for key, unit in units(rolls).items():
            put(file, f"slide/{name}/{key}", curve[key], unit)


def read(file: h5py.File) -> dict[str, Curve]:
    """The curves that `fill` wrote."""
    group = file.get("slide", {})
    return {name: {key: curve[key][()] for key in curve} for name, curve in group.items()}


def half_way(curve: Curve) -> float:
    """Secant stiffness at half of the largest force, N/m."""
    force, moved = (np.concatenate([[0.0], curve[key]]) for key in ("force", "moved"))
    half = 0.5 * force.max()
    last = int(np.argmax(force >= half))
    return float(half / np.interp(half, force[: last + 1], moved[: last + 1]))


def describe(record: Record, found: Mapping[str, Curve], rolls: bool) -> None:
    """Record the headline figures."""
    for name, curve in found.items():
        force = float(curve["force"].max())
        if rolls:
            title = "cornering stiffness" if name == "lateral" else "longitudinal slip stiffness"
            record.headline[title] = (float(curve["start"]), "N/rad" if name == "lateral" else "N")
        else:
            record.headline[f"{name}, secant at half of its largest force"] = (
                half_way(curve),
                "N/m",
            )
        record.headline[f"{name} force at most"] = (force, "N")
