"""The rim moves and carries the whole tire along as a rigid body: what its matrices answer.

R = (e_x, e_y, e_z, e_x x, e_y x, e_z x), x the deformed tire about the axle's centre. With K at the static state,
the road's forces on it constant:  K R = 0 for translations, and for rotations the moment of loads that do not
turn along; G R = S R = 0 for translations, which do not change what flows through the ring.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from tireroad.fem.axle import Axle
from tireroad.fem.collective import summed
from tireroad.fem.matrices.direct import multiply
from tireroad.fem.matrices.operators import Operators
from tireroad.fem.matrices.support import Support, rigid_motions
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body

TRANSLATIONS = slice(0, 3)
NAMES = ("mass", "stiffness", "gyroscopic", "convective")


@dataclass(frozen=True)
class RimMotion:
    """By the names of the matrices, `rows` (n, 6): X R on own unknowns of the tire with a fixed rim, and
    `whole` (6, 6): R^T X R with the rim's own part; kg, N/m, kg/rad, kg/rad2 and with m or m2 for rotations.
    Without gyroscopic and convective ones when the wheel stands.
    """

    rows: dict[str, np.ndarray]
    whole: dict[str, np.ndarray]


def rim_motion(body: Body, inflation: float, rolling: Rolling, turns: bool) -> RimMotion:
    """The rim's motions at the body's present displacement; the rim's static forces turn with it. Collective."""
    operators = Operators(body, inflation, Support("free"), rolling)
    unknowns = operators.unknowns
    points = body.lattice.points(body.ids) + body.owned(body.u.x.array)
    motions = rigid_motions(points)[unknowns.free]
    if unknowns.rim is not None and unknowns.rim.mine:
        motions = np.vstack([motions, np.linalg.inv(unknowns.rim.coordinates)])
    products = {"mass": operators.mass[:, None] * motions}
    products["stiffness"] = _still(multiply(operators.stiffness, motions))
    operators.stiffness.destroy()
    if turns:
        rotation = operators.rotation()
        for name in ("gyroscopic", "convective"):
            matrix = getattr(rotation, name)
            products[name] = _still(multiply(matrix, motions))
            _destroy(matrix)
    rows = {name: product[: len(unknowns.free)] for name, product in products.items()}
    comm = body.comm
    whole = {name: summed(comm, motions.T @ product) for name, product in products.items()}
    for name in set(NAMES[1:]) & set(whole):
        sign = -1 if name == "gyroscopic" else 1
        whole[name] = (whole[name] + sign * whole[name].T) / 2
        whole[name][TRANSLATIONS] = whole[name][:, TRANSLATIONS] = 0.0
    return RimMotion(rows, whole)


def carried_pencil(
    axle: Axle, whole: Mapping[str, np.ndarray], speed: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass, damping and stiffness (7, 7) of the motions of rim and body alone, by the names of `RimMotion.whole`, at `speed`
    (rad/s): the tire carried along, the wheel, what holds it.
    """
    mass = np.zeros((7, 7))
    mass[:6, :6], mass[6, 6] = whole["mass"] + axle.mass, axle.body_mass or 1.0
    drag, stiffness = axle.joined(axle.damping), axle.joined(axle.stiffness)
    stiffness[:6, :6] += whole["stiffness"]
    if speed:
        drag[:6, :6] += speed * (2 * whole["gyroscopic"] + axle.gyroscopic)
        stiffness[:6, :6] += speed**2 * whole["convective"]
    return mass, drag, stiffness


def _still(product: np.ndarray) -> np.ndarray:
    """A translation meets nothing: what is there is rounding, or the mesh's error in a closed surface."""
    product[:, TRANSLATIONS] = 0.0
    return product


def _destroy(*matrices: PETSc.Mat) -> None:
    for matrix in matrices:
        matrix.destroy()
