"""The static state in static.h5."""

from __future__ import annotations

from dataclasses import asdict

import h5py
import numpy as np

from tireroad.fem.model import TireModel
from tireroad.fem.static.state import StaticState
from tireroad.runs.files.store import put
from tireroad.runs.stages.stored import cords_file, friction_file


def fill(file: h5py.File, state: StaticState, tire: TireModel) -> None:
    """Mesh, displacement, the outer face, the footprint."""
    lattice = tire.lattice
    put(file, "mesh/points", lattice.points(np.arange(lattice.size)), "m")
    put(file, "mesh/cells", lattice.cells(), "-")
    put(file, "displacement", state.displacement, "m")
    put(file, "surface/points", state.points, "m")
    put(file, "surface/displacement", state.moved, "m")
    put(file, "surface/quads", lattice.quads(), "-")
    put(file, "surface/force", state.force, "N")
    put(file, "surface/area", state.area, "m2")
    put(file, "surface/half_sizes", state.half_sizes, "m")
    put(file, "surface/ring_rate", state.ring_rate, "m/rad")
    cords_file.fill(file, state)
    friction_file.fill(file, state)
    file.attrs["touch_height"] = state.touch_height
    file.attrs["inflation"] = state.inflation
    file.attrs["load"] = state.load
    file.attrs["rolling_speed"] = state.rolling.speed
    file.attrs["rolling_inertia"] = state.rolling.inertia
    file.attrs["rolling_radius"] = state.rolling_radius()
    if state.road_height is None:
        return
    file.attrs["camber"] = float(np.degrees(state.road.camber))
    if state.road.drum_radius is not None:
        file.attrs["drum_radius"] = state.road.drum_radius
    near = np.flatnonzero(state.gap < tire.section.thickness)
    put(file, "contact/index", near, "-")
    put(file, "contact/points", state.positions[near], "m")
    put(file, "contact/force", state.push[near], "N")
    put(file, "contact/gap", state.gap[near], "m")
    put(file, "contact/area", state.area[near], "m2")
    put(file, "contact/pressure", state.pressure[near], "Pa")
    file.attrs["road_height"] = state.road_height
    file.attrs["deflection"] = state.deflection
    for name, value in asdict(state.footprint()).items():
        file.attrs[f"footprint_{name}"] = value
