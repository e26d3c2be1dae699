"""Cord forces of a static state, in static.h5 and in its headline."""

from __future__ import annotations

import h5py
import numpy as np

from tireroad.fem.static.state import StaticState
from tireroad.fem.tire.cord_forces import CordForce
from tireroad.runs.files.store import put

_UNITS = {"points": "m", "force": "N", "area": "m2"}


def fill(file: h5py.File, state: StaticState) -> None:
    """Write `cords/<name>/...`: grids (ring, along), force in N per cord."""
    for name, cords in state.cords.items():
        for part, unit in _UNITS.items():
            put(file, f"cords/{name}/{part}", getattr(cords, part), unit)
    file.attrs["mass"] = state.mass


def read(file: h5py.File) -> dict:
    """The fields of a static state that `fill` wrote."""
    found = {
        name: CordForce(*(group[part][:] for part in _UNITS))
        for name, group in file.get("cords", {}).items()
    }
    return {"cords": found, "mass": float(file.attrs["mass"])}


def headline(state: StaticState) -> dict[str, tuple[float, str]]:
    """Mass, largest cord force, and the share of the ply area whose cords are in compression."""
    figures = {"mass": (state.mass, "kg")}
    if not state.cords:
        return figures
    plies = state.cords.values()
    slack = sum(cords.area[cords.force < 0].sum() for cords in plies)
    return figures | {
        "largest cord force": (float(max(cords.force.max() for cords in plies)), "N"),
        "compressed cords": (
            float(np.round(100 * slack / sum(cords.area.sum() for cords in plies), 6)),
            "%",
        ),
    }
