"""The states in rotating.h5: those of the modes and, apart, those of the shapes that joined them.

A state dominated by rotation shapes (modal.rotation_shapes) is not an eigenfrequency of the tire: it
represents the coupling of its modes to faster ones. There are as many as shapes; `turning/place`
holds their indices among all states.
"""

from __future__ import annotations

import numpy as np

from tireroad.modal.rolling import RollingModes
from tireroad.modal.states import StateModes
from tireroad.runs.files.store import put

_STATES = {"eigenvalue": "1/s", "right": "-", "left": "s", "residual": "-", "left_residual": "-"}
_BLOCK = {"block": "1/s", "block_right": "-", "block_left": "s"}
_LAST = ("right",)  # the states lie along the last axis; for all others along the first


def of_shapes(rolling: RollingModes) -> np.ndarray:
    """Mask (q,) of the shapes' states: those with the largest share of shapes in their norm."""
    projection, right = rolling.basis.projection, rolling.states.right
    mask = np.zeros(right.shape[1], bool)
    if projection.shapes and not rolling.full:
        square = np.abs(right) ** 2
        share = square[projection.modes : projection.own].sum(axis=0) / square.sum(axis=0)
        mask[np.argsort(-share, kind="stable")[: projection.shapes]] = True
    return mask


def fill(file, rolling: RollingModes) -> None:
    """Write the states and the near-defective block."""
    states, joined = rolling.states, of_shapes(rolling)
    for group, mask in (("", ~joined), ("turning/", joined)):
        if group and not joined.any():
            continue
        for name, unit in _STATES.items():
            values = getattr(states, name)
            put(file, group + name, values[:, mask] if name in _LAST else values[mask], unit)
        put(file, f"{group}frequency", states.eigenvalue[mask].imag / (2 * np.pi), "Hz")
    if joined.any():
        put(file, "turning/place", np.flatnonzero(joined), "-")
    for name, unit in _BLOCK.items():
        put(file, name, getattr(states, name), unit)
    file.attrs["basis_condition"] = states.condition
    file.attrs["rigid_states"] = states.rigid


def read(file) -> StateModes:
    """The states in their original order."""
    values = {name: file[name][:] for name in (*_STATES, *_BLOCK)}
    if "turning" in file:
        place = file["turning/place"][:]
        joined = np.zeros(len(values["eigenvalue"]) + len(place), bool)
        joined[place] = True
        order = np.argsort(np.concatenate([np.flatnonzero(~joined), place]))
        for name in _STATES:
            axis = -1 if name in _LAST else 0
            both = np.concatenate([values[name], file[f"turning/{name}"][:]], axis=axis)
            values[name] = np.ascontiguousarray(np.take(both, order, axis=axis))
    known = float(file.attrs["basis_condition"]), int(file.attrs["rigid_states"])
    return StateModes(condition=known[0], rigid=known[1], **values)
