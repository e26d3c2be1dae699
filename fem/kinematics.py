"""Kinematics in UFL: deformation gradient, invariants, follower pressure, a wheel rotating in place.

The mesh is fixed in the non-rotating frame; material flows through it with w = Omega e_y x X
(Nackenhorst 2004; thesis (2.6)-(2.8), corrected). All quantities are per unit Omega.
"""

from __future__ import annotations

import ufl
from dolfinx.mesh import Mesh
from ufl.core.expr import Expr


def deformation_gradient(u: Expr) -> Expr:
    """F = I + grad u, on the undeformed mesh."""
    return ufl.Identity(3) + ufl.grad(u)


def pressure_virtual_work(u: Expr, v: Expr, normal: Expr) -> Expr:
    """J F^-T N . v: virtual work per undeformed area of a unit follower pressure acting inwards."""
    F = deformation_gradient(u)
    return ufl.inner(ufl.det(F) * ufl.inv(F).T * normal, v)


def wheel_velocity(mesh: Mesh) -> Expr:
    """w = e_y x X = (z, 0, -x): velocity of the undeformed material at Omega = 1 rad/s, m/rad."""
    X = ufl.SpatialCoordinate(mesh)
    return ufl.as_vector((X[2], 0.0, -X[0]))


def convective(u: Expr, w: Expr) -> Expr:
    """grad(u) w: convective part of the inertial rate of u; the whole of it for a steady field."""
    return ufl.dot(ufl.grad(u), w)


def cross_axle(u: Expr) -> Expr:
    """e_y x u."""
    return ufl.as_vector((u[2], 0.0, -u[0]))


def body_rate(u: Expr, w: Expr) -> Expr:
    """grad(u) w - e_y x u: rate of a steady field as seen by the rotating material."""
    return convective(u, w) - cross_axle(u)


def isochoric(C: Expr) -> tuple[Expr, Expr]:
    """Invariants I1 and I2 of J^(-2/3) C."""
    J = ufl.sqrt(ufl.det(C))
    first = ufl.tr(C)
    second = (first**2 - ufl.tr(C * C)) / 2
    return J ** (-2 / 3) * first, J ** (-4 / 3) * second


def dilatation(C: Expr, bulk: Expr) -> Expr:
    """kappa/2 (J - 1)^2, the form of Abaqus and CalculiX."""
    return bulk / 2 * (ufl.sqrt(ufl.det(C)) - 1) ** 2
