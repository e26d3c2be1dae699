"""Friction of a static state, in static.h5 and in its headline."""

from __future__ import annotations

import h5py
import numpy as np

from tireroad.fem.static.state import StaticState
from tireroad.runs.files.store import put

_SMALL = 1e-6  # of mu f: tolerance for a node that slips


def fill(file: h5py.File, state: StaticState) -> None:
    """Write `surface/pull` (s, 2) N and the travel per radian; nothing without friction."""
    if state.pull is None:
        return
    put(file, "surface/pull", state.pull, "N")
    file.attrs["horizontal_force"] = state.pull.sum(axis=0)
    file.attrs["moment"] = state.moment
    if state.travel is not None:
        file.attrs["travel"] = state.travel


def read(file: h5py.File) -> dict:
    """The fields of a static state that `fill` wrote."""
    if "pull" not in file["surface"]:
        return {}
    travel = file.attrs.get("travel")
    return {
        "pull": file["surface/pull"][:],
        "travel": None if travel is None else float(travel),
    }


def headline(state: StaticState, friction: float | None) -> dict[str, tuple[float, str]]:
    """Horizontal force, axle torque, moment about the vertical, share of the load that sticks."""
    if state.pull is None or friction is None:
        return {}
    force, size = state.pull.sum(axis=0), np.linalg.norm(state.pull, axis=1)
    sticks = size < (1 - _SMALL) * friction * state.normal_force
    share = state.force[sticks].sum() / state.force.sum()
    forward, left, torque, upright = np.round([*force, *state.moment[1:]], 6)
    return {
        "horizontal force, forward": (float(forward), "N"),
        "horizontal force, left": (float(left), "N"),
        "torque on the axle": (float(torque), "N m"),
        "moment about the vertical": (float(upright), "N m"),
        "share of the load that sticks": (float(100 * share), "%"),
    }
