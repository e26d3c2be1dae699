"""Rigid motion of the rim with the whole tire: the products of the tire's matrices with it.

R = (e_x, e_y, e_z, e_x x, e_y x, e_z x), x the deformed position relative to the axle's centre. K
is that of the static state under constant road forces: K R = 0 for translations; for rotations K R
is the moment of the loads that do not rotate with the tire. G R = S R = 0 for translations, as a
uniform velocity does not change the flow of material through the ring.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from tireroad.fem import compat
from tireroad.fem.collective import summed
from tireroad.fem.matrices.operators import FIXED, TURN, Unknowns, rigid_motions, turning_moments
from tireroad.fem.static.virtual_work import (
    AT_REST,
    Rolling,
    body_convective_form,
    body_rate_form,
    convection_form,
    convective_form,
    static_residual,
)
from tireroad.fem.tire.body import Body
from tireroad.fem.wheel import Axle

TRANSLATIONS = slice(0, 3)
# The factors of 2 Omega and of Omega^2, by the inertia of rotation.
FELT = {"full": ("gyroscopic", "convective"), "doppler": ("body", "body_convective")}


@dataclass(frozen=True)
class RimMotion:
    """Products of the matrices X with the rim's motions R, by the names of the matrices.

    `rows` (n, 6): X R on own unknowns of the tire with fixed rim; `whole`
    (6, 6): R^T X R including the rim's own part. kg, N/m; kg/rad, kg/rad2 and factors m, m2 for
    rotations. A standing wheel has no "gyroscopic", "convective", "body" and "body_convective" (B R
    and S_B R, of `rows` alone).
    """

    rows: dict[str, np.ndarray]
    whole: dict[str, np.ndarray]

    def moments(self, speed: float, inertia: str = "full") -> np.ndarray:
        """A (3, 3, n) on own unknowns at `speed` (rad/s), for the moments at a fixed hub, N m.

        They are the moments of the loads minus A_2 u'' + A_1 u' + A_0 u
        (modal.corner.Corner.moments)."""
        turned = {name: rows[:, TURN:].T for name, rows in self.rows.items()}
        out = np.stack([turned["stiffness"], np.zeros_like(turned["mass"]), turned["mass"]])
        if speed:
            gyroscopic, convective = FELT[inertia]
            out[0] += speed**2 * turned[convective]
            out[1] -= 2 * speed * turned[gyroscopic]
        return out


def rim_motion(body: Body, inflation: float, rolling: Rolling, turns: bool) -> RimMotion:
    """Products with the rim's motions at the body's present displacement. Collective.

    The rim's static forces rotate with it. No matrix is assembled: stresses, cords and pressure
    rotate with the material, F(Q x) = Q F(x), so for a rotation about e_k  K R = e_k x F,  F being
    the nodal forces of the static state. The other matrices act on R as linear forms.
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
    for name in FELT["doppler"]:
        products.pop(name, None)
    whole = {name: summed(comm, motions.T @ product) for name, product in products.items()}
    # The wheel carries the forces on the rim: those of the tire's own nodes and those of rolling.
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
    """Forces (nodes, 3) N of stresses, pressure and rolling on own nodes. Collective."""
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
    """G R, S R, B R and S_B R (3 nodes, 6). Collective.

    For translations G R and S R are set to 0: the assembled values are rounding, or the mesh's
    error in a closed surface."""
    field = fem.Function(body.space)
    forms = {
        "gyroscopic": convection_form(body),
        "convective": convective_form(body),
        "body": body_rate_form(body),
        "body_convective": body_convective_form(body),
    }
    acting = {name: ufl.action(form, field) for name, form in forms.items()}
    out = {name: np.zeros_like(motions) for name in forms}
    for k, motion in enumerate(motions.T):
        body.owned(field.x.array)[:] = motion.reshape(-1, 3)
        field.x.scatter_forward()
        for name, form in acting.items():
            if k >= TURN or name in FELT["doppler"]:
                out[name][:, k] = _assembled(body, form).ravel()
    return out


def carried_pencil(
    axle: Axle, whole: Mapping[str, np.ndarray], speed: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass, damping and stiffness (7, 7) of the rigid motions of rim and body at `speed` (rad/s).

    They comprise the tire carried along (`whole`, by the names of `RimMotion.whole`), the wheel and
    its suspension.
    """
    mass = np.zeros((7, 7))
    mass[:6, :6], mass[6, 6] = whole["mass"] + axle.mass, axle.body_mass or 1.0
    drag, stiffness = (
        axle.between_wheel_and_body(axle.damping),
        axle.between_wheel_and_body(axle.stiffness),
    )
    stiffness[:6, :6] += whole["stiffness"]
    if speed:
        drag[:6, :6] += speed * (2 * whole["gyroscopic"] + axle.gyroscopic)
        stiffness[:6, :6] += speed**2 * whole["convective"]
    return mass, drag, stiffness
