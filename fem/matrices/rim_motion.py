"""The rim moves and carries the whole tire along as a rigid body: what its matrices answer.

R = (e_x, e_y, e_z, e_x x, e_y x, e_z x), x the deformed tire about the axle's centre. With K at the static state,
the road's forces on it constant:  K R = 0 for translations, and for rotations the moment of loads that do not
turn along; G R = S R = 0 for translations, which do not change what flows through the ring.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from tireroad.fem import compat
from tireroad.fem.axle import Axle
from tireroad.fem.collective import summed
from tireroad.fem.matrices.support import FIXED, TURN, Unknowns, rigid_motions, turning_moments
from tireroad.fem.static.virtual_work import (
    AT_REST,
    Rolling,
    body_rate_form,
    convection_form,
    convective_form,
    static_residual,
)
from tireroad.fem.tire.body import Body

TRANSLATIONS = slice(0, 3)


@dataclass(frozen=True)
class RimMotion:
    """By the names of the matrices, `rows` (n, 6): X R on own unknowns of the tire with a fixed rim, and
    `whole` (6, 6): R^T X R with the rim's own part; kg, N/m, kg/rad, kg/rad2 and with m or m2 for rotations. `rows`
    have "body", B R, besides. Without gyroscopic, convective and body ones when the wheel stands.
    """

    rows: dict[str, np.ndarray]
    whole: dict[str, np.ndarray]

    def moments(self, speed: float) -> np.ndarray:
        """A (3, 3, n) on own unknowns at `speed` (rad/s): a hub that is held carries the moments of the loads less
        A_2 u'' + A_1 u' + A_0 u, N m (modal.corner.Corner.moments)."""
        turned = {name: rows[:, TURN:].T for name, rows in self.rows.items()}
        out = np.stack([turned["stiffness"], np.zeros_like(turned["mass"]), turned["mass"]])
        if speed:
            out[0] += speed**2 * turned["convective"]
            out[1] -= 2 * speed * turned["gyroscopic"]
        return out


def rim_motion(body: Body, inflation: float, rolling: Rolling, turns: bool) -> RimMotion:
    """The rim's motions at the body's present displacement; the rim's static forces turn with it. Collective.

    No matrix is made: stresses, cords and pressure turn with the material, F(Q x) = Q F(x), so that of a rotation
    about e_k  K R = e_k x F,  F the nodal forces of the static state; the others act on R as linear forms.
    """
    comm, unknowns = body.comm, Unknowns(body, FIXED)
    points = body.lattice.points(body.ids) + body.owned(body.u.x.array)
    motions = rigid_motions(points)
    force = _nodal_forces(body, inflation, AT_REST)
    products = {"mass": body.nodal_mass()[:, None] * motions, "stiffness": np.zeros_like(motions)}
    for k, unit in enumerate(np.eye(3)):
        products["stiffness"][:, TURN + k] = np.cross(unit, force).ravel()
    if turns:
        products |= _turning(body, motions)
    rows = {name: product[unknowns.free] for name, product in products.items()}
    products.pop("body", None)
    whole = {name: summed(comm, motions.T @ product) for name, product in products.items()}
    # The wheel takes the forces of the rim: of the tire's own nodes, and the rim's where it rolls beside them.
    rim = np.setdiff1d(np.arange(body.nodes), unknowns.free // 3)
    turned = _nodal_forces(body, inflation, rolling)[rim].T @ points[rim] - force.T @ points
    turned = summed(comm, turned)
    whole["stiffness"] = np.zeros((6, 6))
    whole["stiffness"][TURN:, TURN:] = turning_moments(turned)
    for name, sign in (("gyroscopic", -1), ("convective", 1)):
        if name in whole:
            whole[name] = (whole[name] + sign * whole[name].T) / 2
            whole[name][TRANSLATIONS] = whole[name][:, TRANSLATIONS] = 0.0
    return RimMotion(rows, whole)


def _nodal_forces(body: Body, inflation: float, rolling: Rolling) -> np.ndarray:
    """Of stresses, pressure and rolling, own nodes (nodes, 3) N. Collective."""
    work = static_residual(body, fem.Constant(body.mesh, inflation), rolling)
    return _assembled(body, work)


def _assembled(body: Body, form: ufl.Form) -> np.ndarray:
    """Own rows (nodes, 3) of a linear form. Collective."""
    out = fem.petsc.assemble_vector(compat.form(form))
    out.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
    found = out.array_r.reshape(-1, 3).copy()
    out.destroy()
    return found


def _turning(body: Body, motions: np.ndarray) -> dict[str, np.ndarray]:
    """G R, S R and B R (3 nodes, 6); a translation meets nothing in G and S: what is there is rounding, or the mesh's
    error in a closed surface. Collective."""
    field = fem.Function(body.space)
    forms = {
        "gyroscopic": convection_form(body),
        "convective": convective_form(body),
        "body": body_rate_form(body),
    }
    acting = {name: ufl.action(form, field) for name, form in forms.items()}
    out = {name: np.zeros_like(motions) for name in forms}
    for k, motion in enumerate(motions.T):
        body.owned(field.x.array)[:] = motion.reshape(-1, 3)
        field.x.scatter_forward()
        for name, form in acting.items():
            if k >= TURN or name == "body":
                out[name][:, k] = _assembled(body, form).ravel()
    return out


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
