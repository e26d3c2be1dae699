"""Responses in result files."""

from __future__ import annotations

import h5py

from tireroad.greens.response import Response
from tireroad.runs.files.store import put

_UNITS = {
    "eigenvalue": "1/s",
    "output": "kg^-1/2",
    "input": "s/kg^1/2",
    "block": "1/s",
    "block_output": "kg^-1/2",
    "block_input": "s/kg^1/2",
    "residual": "m/N",
    "momentum": "kg^1/2",
    "block_momentum": "kg^1/2",
}
# Of the rate of momentum, the last three rows of the slope, in s instead.
_KNOWN = {"left_out": "kg m/N", "moments": "-", "slope": "m s"}


def fill_response(file: h5py.File, name: str, response: Response, points: int) -> None:
    """Write a response as a group.

    For readers of the file, also the static flexibility of its first `points` outputs, which are
    displacements; readings of the wheel follow them.
    """
    for key, unit in _UNITS.items():
        put(file, f"{name}/{key}", getattr(response, key), unit)
    flexibility = (response.residual + response.static())[:points]
    put(file, f"{name}/static_flexibility", flexibility, "m/N")
    for key, unit in _KNOWN.items():
        if (value := getattr(response, key)) is not None:
            put(file, f"{name}/{key}", value, unit)
    file[name].attrs["rigid_states"] = response.rigid
    file[name].attrs["pulse"] = response.pulse


def read_responses(file: h5py.File) -> dict[str, Response]:
    """All responses in a file, by name."""
    return {
        name: Response(
            **{key: group[key][:] for key in _UNITS},
            pulse=int(group.attrs["pulse"]),
            rigid=int(group.attrs["rigid_states"]),
            **{key: group[key][:] for key in _KNOWN if key in group},
        )
        for name, group in file.items()
        if "output" in group
    }
