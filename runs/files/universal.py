"""Frequency responses as Universal File, dataset 58 (I-DEAS), which programs of modal analysis read.

One function a dataset: displacement of point i along its force over the force at point j, or force on
the axle over the force at point j. ASCII, double precision, SI units.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import h5py
import numpy as np
from numpy.typing import NDArray

from tireroad.runs.version import PROGRAM

FRF = 4  # function type: frequency response
COMPLEX_DOUBLE = 6
FREQUENCY, DISPLACEMENT, EXCITATION, REACTION = 18, 8, 13, 9  # specific data types
# Exponents of length, force, temperature.
_OF = {FREQUENCY: (0, 0, 0), DISPLACEMENT: (1, 0, 0), EXCITATION: (0, 1, 0), REACTION: (0, 1, 0)}
_NAMES = {
    FREQUENCY: ("Frequency", "Hz"),
    DISPLACEMENT: ("Displacement", "m"),
    EXCITATION: ("Force", "N"),
    REACTION: ("Axle force", "N"),
}
AXLE = 1000  # number of the axle as a point
_EVEN = 1e-9


def frequency_responses(file: h5py.File, directions: Sequence[Sequence[float]]) -> str:
    """All receptances and transmissibilities of a response.h5; empty if it has none.

    `directions` (k, 3): those of the forces, as in the scene.
    """
    ways = [direction(one) for one in directions]
    parts: list[str] = []
    if "receptance" in file:
        frequency, values = file["frequency"][()], file["receptance"][()]
        for i, j in np.ndindex(values.shape[1:]):
            ends = (i + 1, ways[i]), (j + 1, ways[j])
            parts += dataset(frequency, values[:, i, j], DISPLACEMENT, *ends)
    found = file.get("transmissibility/momentum")
    if found is not None:
        frequency, values = file["transmissibility/frequency"][()], found[()]
        for k, j in np.ndindex(values.shape[1:]):
            parts += dataset(frequency, values[:, k, j], REACTION, (AXLE, k + 1), (j + 1, ways[j]))
    return "".join(f"{line}\n" for line in parts)


def direction(vector: Sequence[float]) -> int:
    """1, 2, 3 along x, y, z, negative against them; 0 (scalar) for another direction."""
    size = np.asarray(vector, float) / np.linalg.norm(vector)
    axis = int(np.abs(size).argmax())
    if abs(size[axis]) < 1 - 1e-9:
        return 0
    return int(np.sign(size[axis])) * (axis + 1)


def dataset(
    frequency: NDArray,
    values: NDArray,
    what: int,
    response: tuple[int, int],
    reference: tuple[int, int],
) -> Iterator[str]:
    """The lines of one function: complex `values` (f,) at `frequency` (f,) Hz.

    `what`: data type of the numerator; `response`, `reference`: number and direction of the points.
    """
    step = float(frequency[1] - frequency[0]) if len(frequency) > 1 else 0.0
    even = len(frequency) > 1 and bool(
        np.abs(np.diff(frequency) - step).max() <= _EVEN * frequency[-1]
    )
    yield f"{-1:6d}"
    yield f"{58:6d}"
    yield f"{_NAMES[what][0]} of point {response[0]} over the force at point {reference[0]}"[:80]
    yield PROGRAM[:80]
    yield from ("NONE", "NONE", "NONE")
    yield (
        f"{FRF:5d}{0:10d}{1:5d}{0:10d} {'NONE':<10}{response[0]:10d}{response[1]:4d}"
        f" {'NONE':<10}{reference[0]:10d}{reference[1]:4d}"
    )
    yield f"{COMPLEX_DOUBLE:10d}{len(frequency):10d}{int(even):10d}{frequency[0]:13.5E}{step if even else 0.0:13.5E}{0.0:13.5E}"
    for kind in (FREQUENCY, what, EXCITATION):
        length, force, heat = _OF[kind]
        name, unit = _NAMES[kind]
        yield f"{kind:10d}{length:5d}{force:5d}{heat:5d} {name:<20} {unit:<20}"
    yield f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {'NONE':<20}"
    if even:
        flat = np.stack([values.real, values.imag], axis=1).ravel()
        for first in range(0, len(flat), 4):
            yield "".join(f"{value:20.11E}" for value in flat[first : first + 4])
    else:
        for f, value in zip(frequency, values, strict=True):
            yield f"{f:13.5E}{value.real:20.11E}{value.imag:20.11E}"
    yield f"{-1:6d}"
