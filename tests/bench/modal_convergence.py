"""Frequencies over the mesh, and axisymmetric tires by wave number against the general method."""

from __future__ import annotations

import time

import numpy as np
from mpi4py import MPI

from tireroad.modal.standing import sites
from tireroad.runs.validation.cases import thesis_torus
from tireroad.runs.validation.tables import Table

ABOUT = "error of the modes over mesh and order; round tires by wave number against the general way"
MESHES = ((12, 4), (16, 6), (24, 9), (32, 12), (48, 18))  # elements around, along
REFERENCE = (36, 14, 3)
LOWEST = 20
RINGS = ((20, 8, 200), (40, 16, 500), (80, 16, 1000))  # elements around, along, modes


def run() -> list[Table]:
    """Errors by mesh and order, and seconds of both methods. Collective."""
    return [_meshes(), _rings()]


def _operators(around: int, along: int, order: int):
    """The undeformed torus. Collective."""
    from tireroad.fem.matrices.operators import Operators
    from tireroad.fem.tire.body import Body
    from tireroad.fem.tire.material import compound

    section = thesis_torus(segments=around, elements_arc=along, order=order)
    rubber = compound("neo-hookean", 1200.0, youngs_modulus=48e6, poisson_ratio=0.45)
    return Operators(Body(MPI.COMM_WORLD, section, rubber), 0.0)


def _solve(operators, count: int, waves: bool = True):
    from tireroad.modal.solver import undamped

    return undamped.solve(
        operators.stiffness, operators.mass, count, sites=sites(operators), waves=waves
    )


def _meshes() -> Table:
    """Relative error of the lowest frequencies against order 3 on a fine mesh."""
    exact = _solve(_operators(*REFERENCE), LOWEST).frequency
    rows = []
    for order in (1, 2, 3):
        for around, along in MESHES[: 6 - order]:
            operators = _operators(around, along, order)
            error = np.abs(_solve(operators, LOWEST).frequency / exact - 1)
            size = operators.stiffness.getSize()[0]
            first, worst = 100 * float(error[0]), 100 * float(error.max())
            rows.append([f"order {order}", f"{around} x {along}", size, first, worst])
    return Table(
        f"Error of the {LOWEST} lowest frequencies by mesh",
        [("elements", ""), ("mesh", ""), ("unknowns", "-"), ("first", "%"), ("worst", "%")],
        rows,
        [
            f"Reference: order {REFERENCE[2]}, {REFERENCE[0]} x {REFERENCE[1]} elements; no inflation."
        ],
        {"x": "unknowns", "y": ["worst"], "log": "xy", "by": "elements"},
    )


def _rings() -> Table:
    """The same modes of an axisymmetric tire by both methods."""
    rows = []
    for around, along, count in RINGS:
        operators = _operators(around, along, 2)
        seconds, found = [], []
        for waves in (True, False):
            began = time.perf_counter()
            found.append(_solve(operators, count, waves))
            seconds.append(time.perf_counter() - began)
        off = float(np.abs(found[0].squares / found[1].squares - 1).max())
        size = operators.stiffness.getSize()[0]
        rows.append([size, count, *seconds, seconds[1] / seconds[0], off])
    return Table(
        "Round tire: by wave number against mirrors and slices",
        [
            ("unknowns", "-"),
            ("modes", "-"),
            ("by wave number", "s"),
            ("mirrors and slices", "s"),
            ("ratio", "-"),
            ("largest difference of the eigenvalues", "-"),
        ],
        rows,
        ["Both are proven complete by the inertia of the whole matrix."],
    )
