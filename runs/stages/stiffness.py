"""Stage stiffness: load and footprint over deflection, stiffness, and forces of sliding or slip."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import h5py
import numpy as np

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.road_stiffness import RoadStiffness, road_stiffness
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.friction_press import Slid, Slide
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.static.press import CurvePoint, load_curve, slopes
from tireroad.fem.static.state import StaticState
from tireroad.runs.files.store import put
from tireroad.runs.process import console
from tireroad.runs.scene.physics import wheel_slip
from tireroad.runs.scene.tables.scene import deflections
from tireroad.runs.stages.stage import Computed, Job, Record, Result
from tireroad.runs.stages.static import steady_rolling

AXES = ("longitudinal", "lateral")
_COLUMNS = ("moved", "force", "tangent", "moment", "sticks")
# Displacement at full sliding, times initial stiffness over friction force: 1.5 for two spheres
# (Cattaneo, Mindlin), 3 for a rolling brush.
_STANDING, _ROLLING = 2.0, 3.0
_MOST = 0.5  # slip

Curve = Mapping[str, np.ndarray]
_CURVE = {
    "deflection": "m",
    "load": "N",
    "stiffness": "N/m",
    "tangent": "N/m",
    "points": "-",
    "rolling_radius": "m",
    "pressure": "Pa",
    "footprint_length": "m",
    "footprint_width": "m",
    "footprint_area": "m2",
}
_FIGURES = {
    "load": "N",
    "vertical": "N/m",
    "longitudinal": "N/m",
    "lateral": "N/m",
    "torsional": "N m/rad",
    "vertical_tangent": "N/m",
    "vertical_stuck": "N/m",
}


def slides(job: Job, state: StaticState, stuck: RoadStiffness) -> dict[str, Curve]:
    """The curves by the names of `AXES`; none without friction.

    `start`: initial slope, with all points sticking. Leaves the body in another state. Collective.
    """
    stiffness, friction = job.scene.stiffness, job.scene.static.friction
    if state.pull is None or not friction or not stiffness.slide_steps:
        return {}  # friction 0 resists nothing: no displacement to slide over
    curves: dict[str, Curve] = {}
    for axis, name in enumerate(AXES):
        slide = Slide(job.tire.body, state, friction, axis)
        start = slide.start(wheel_slip(job.scene))
        rate = start if slide.rolls else getattr(stuck, name)
        end = stiffness.slip_to if slide.rolls else stiffness.slide_to
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
            (end * np.arange(1, stiffness.slide_steps + 1) / stiffness.slide_steps).tolist()
        ):
            points.append(point)
            console.say(f"  {name}: {_told(point, slide.rolls)}")
        columns = {key: np.array([getattr(point, key) for point in points]) for key in _COLUMNS}
        curves[name] = columns | {"start": np.array(start)}
    return curves


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


def fill(file: h5py.File, curves: Mapping[str, Curve], rolls: bool) -> None:
    """Write `slide/<axis>/...`."""
    for name, curve in curves.items():
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


def describe(record: Record, curves: Mapping[str, Curve], rolls: bool) -> None:
    """Record the headline figures."""
    for name, curve in curves.items():
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


@dataclass(frozen=True)
class Stiffness:
    """Stiffness of the tire.

    `curve`: arrays (k,) over the deflections, named as in the file; `figures` of one state by name;
    `matrix` (6, 6) of the stuck footprint, None if not requested; `slides` with friction, by axis.
    """

    curve: dict[str, np.ndarray]
    figures: dict[str, float]
    matrix: np.ndarray | None
    slides: Mapping[str, Curve] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class StiffnessStage(Computed[Stiffness]):
    """The load curve from the undeformed tire, and the stiffness about the scene's own state."""

    name: ClassVar[str] = "stiffness"
    reads: ClassVar[tuple[str, ...]] = ("stiffness",)
    static: Result[StaticState]

    def compute(self, record: Record) -> Stiffness:
        """Compute; the body is put back to the static state afterwards. Collective."""
        state, stiffness = self.static.product, self.job.scene.stiffness
        body = self.job.tire.body
        body.set_displacement(state.displacement)
        on_road = state.road_height is not None
        stuck = None
        if stiffness.which == "all" and on_road:
            force = state.force[body.surface.place]
            centre = state.force @ state.positions / state.force.sum()
            stuck = self._stuck(record, body.surface.local[force > 0], centre)
        try:
            points, force = self._curve(record)
            if stiffness.which == "all" and not on_road:
                places = body.lattice.points(body.ids) + body.owned(body.u.x.array)
                centre = body.comm.allreduce(force @ places) / points[-1].load
                stuck = self._stuck(record, np.flatnonzero(force > 0), centre)
            slides = self._slides(record, stuck)
        finally:
            body.set_displacement(state.displacement)
        result = replace(_result(points, state, stuck), slides=slides)
        _describe(record, result, stuck)
        describe(record, slides, state.travel is not None)
        return result

    def _stuck(self, record: Record, nodes: np.ndarray, centre: np.ndarray) -> RoadStiffness:
        """Stiffness of the present footprint; `nodes` are this process's own. Collective."""
        inflation = self.job.scene.inflation
        with record.timing("stuck footprint"):
            rolling = steady_rolling(self.job)
            return road_stiffness(self.job.tire.body, inflation, nodes, centre, rolling)

    def _slides(self, record: Record, stuck: RoadStiffness | None) -> Mapping[str, Curve]:
        """Force over road displacement with friction, if the scene has friction. Collective."""
        if stuck is None:
            return {}
        with record.timing("sliding"):
            return slides(self.job, self.static.product, stuck)

    def _curve(self, record: Record) -> tuple[list[CurvePoint], np.ndarray]:
        """The points of the curve, and the last contact forces on own nodes, N. Collective."""
        body, state = self.job.tire.body, self.static.product
        body.u.x.array[:] = 0.0
        with record.timing("mesh and forms"):
            equilibrium = Equilibrium(body, steady_rolling(self.job), state.road)
        loader = LoadStepper(equilibrium, lambda progress: None)
        try:
            loader.inflate(self.job.scene.inflation)
            points = load_curve(loader, deflections(self.job.scene.stiffness, _own(state)))
        except ConvergenceError as error:
            raise ConvergenceError(
                f"{error} It is the load-deflection curve that stops: give smaller "
                "stiffness.deflections, or a smaller stiffness.up_to (m)."
            ) from None
        record.cost |= equilibrium.cost
        record.indicators["Newton steps"] = (loader.newton_steps, "-")
        for point in points:
            console.say(
                f"  {1e3 * point.deflection:.4g} mm: {point.load:.5g} N, footprint "
                f"{1e3 * point.footprint.length:.3g} x {1e3 * point.footprint.width:.3g} mm"
            )
        return points, equilibrium.contact_force()

    def write(self, file, product: Stiffness) -> None:
        """The curve column by column, the figures, the matrix."""
        for name, unit in _CURVE.items():
            put(file, f"curve/{name}", product.curve[name], unit)
        for name, value in product.figures.items():
            put(file, name, np.array(value), _FIGURES[name])
        if product.matrix is not None:
            put(file, "matrix", product.matrix, "N/m, N/rad, N m/m, N m/rad")
        fill(file, product.slides, self.static.product.travel is not None)

    def read(self, file) -> Stiffness:
        """The same, read back."""
        return Stiffness(
            {name: file[f"curve/{name}"][:] for name in _CURVE},
            {name: float(file[name][()]) for name in _FIGURES if name in file},
            file["matrix"][:] if "matrix" in file else None,
            read(file),
        )


def _own(state: StaticState) -> float | None:
    """Deflection of the scene's own state, m; None without a road."""
    return state.deflection


def _result(points: list[CurvePoint], state: StaticState, stuck: RoadStiffness | None) -> Stiffness:
    plain = ("deflection", "load", "tangent", "points", "rolling_radius", "pressure")
    curve = {name: np.array([getattr(point, name) for point in points]) for name in plain}
    for name in ("length", "width", "area"):
        values = [getattr(point.footprint, name) for point in points]
        curve[f"footprint_{name}"] = np.array(values)
    curve["stiffness"] = slopes(curve["deflection"], curve["load"], curve["deflection"])
    load, vertical = _vertical(curve, state)
    figures = {"load": load, "vertical": vertical}
    if stuck is None:
        return Stiffness(curve, figures, None)
    for name in ("longitudinal", "lateral", "torsional"):
        figures[name] = getattr(stuck, name)
    figures |= {"vertical_tangent": stuck.frictionless, "vertical_stuck": float(stuck.matrix[2, 2])}
    return Stiffness(curve, figures, stuck.matrix)


def _vertical(curve: dict[str, np.ndarray], state: StaticState) -> tuple[float, float]:
    """(load, slope) at the scene's own state, added to the curve, or at the curve's last point."""
    own = _own(state)
    if own is None:
        return float(curve["load"][-1]), float(curve["stiffness"][-1])
    # Points much closer than the curve's own steps would turn rounding into waves.
    apart = np.abs(curve["deflection"] - own) > 0.05 * own
    deflection = np.append(curve["deflection"][apart], own)
    load = np.append(curve["load"][apart], state.load)
    order = np.argsort(deflection)
    return state.load, float(slopes(deflection[order], load[order], np.array([own]))[0])


def _describe(record: Record, result: Stiffness, stuck: RoadStiffness | None) -> None:
    curve, figures = result.curve, result.figures
    record.headline |= {
        "deflections": (len(curve["load"]), "-"),
        "largest deflection": (float(curve["deflection"][-1]), "m"),
        "load at the largest deflection": (float(curve["load"][-1]), "N"),
        f"vertical stiffness at {figures['load']:.4g} N": (figures["vertical"], "N/m"),
    }
    if stuck is None:
        return
    for name in ("longitudinal", "lateral", "torsional"):
        record.headline[name] = (figures[name], _FIGURES[name])
    record.indicators["departure of the stiffness from symmetry"] = (stuck.asymmetry, "-")
    tilt = np.diag(stuck.matrix)[3:5]
    if tilt.min() < 1e-6 * tilt.max():
        record.warnings.append(
            "all nodes in contact lie on one line: the stiffness of the stuck footprint is that of a "
            "mesh too coarse for it; refine tire.elements_arc, tire.segments or tire.footprint_size"
        )
