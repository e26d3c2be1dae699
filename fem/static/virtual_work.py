"""Virtual work of stresses, inflation and steady rolling as UFL forms. Not collective."""

from __future__ import annotations

from dataclasses import dataclass

import ufl
from dolfinx import fem
from ufl.core.expr import Expr

from tireroad.fem import kinematics
from tireroad.fem.tire.body import Body


@dataclass(frozen=True, kw_only=True)
class Rolling:
    """Steady rolling: Omega `speed` rad/s, gamma1 `damping` 1/s, gamma2 `stiffness_damping` s.

    `inertia` "full": of the inertial rate, Omega^2 S (X + u), with centrifugal forces; "doppler":
    of the body rate only, Omega^2 S_B u, as in the pencil of that name. At speed 0 nothing is
    added.
    """

    speed: float = 0.0
    damping: float = 0.0
    stiffness_damping: float = 0.0
    inertia: str = "full"


AT_REST = Rolling()


def static_residual(
    body: Body, pressure: Expr, rolling: Rolling, share: Expr | float = 1.0
) -> ufl.Form:
    """Virtual work of everything except the road, a UFL form in the body's displacement.

    `share`: of the forces of rolling, inertia and mass-proportional damping.
    """
    work = elastic_work(body, pressure)
    return work + share * _rolling_work(body, rolling) if rolling.speed else work


def elastic_work(body: Body, pressure: Expr) -> ufl.Form:
    """Virtual work of the stresses, the cords and the follower pressure.

    Selective reduced integration: the dilatation has one Gauss point fewer per direction. Fully
    integrated it locks: at Poisson's ratio 0.4995 the first frequency of the clamped torus (order
    2, 20 x 8 and 40 x 16 elements) is 137 and 99 Hz, with this rule 94 and 88 Hz (discontinuous
    pressures of order 1: 87 Hz). At 0.45 it is 104 and 87.1 Hz against 91 and 85.6 Hz (converged:
    84.9 Hz). No unknowns are added, so all have a positive mass. Source: Malkus and Hughes 1978,
    doi 10.1016/0045-7825(78)90005-1.
    """
    u, v = body.u, body.test
    F = ufl.variable(kinematics.deformation_gradient(u))
    distortion, dilatation = body.wall.energy(F.T * F)
    work = ufl.inner(ufl.diff(distortion, F), ufl.grad(v)) * body.dx
    work += ufl.inner(ufl.diff(dilatation, F), ufl.grad(v)) * body.reduced_dx
    work += body.plies.work(u, v)
    normal = ufl.FacetNormal(body.mesh)
    return work + pressure * kinematics.pressure_virtual_work(u, v, normal) * body.inner_ds


def added_stress(body: Body, share: Expr, before: fem.Function) -> ufl.Form:
    """int share (S(C) - S(C_0)) : delta E: work of a share of the stress added since `before`.

    `share` is constant in each cell. The derivative at `before` is that share of the material part
    of the tangent, without geometric stiffness, pressure and cords.
    """
    u, v = body.u, body.test
    F, F0 = kinematics.deformation_gradient(u), kinematics.deformation_gradient(before)

    def part(number: int) -> Expr:
        added = second_stress(body, number, F.T * F) - second_stress(body, number, F0.T * F0)
        return share * ufl.inner(F * added, ufl.grad(v))

    return part(0) * body.dx + part(1) * body.reduced_dx


def added_energy(body: Body, share: Expr, before: fem.Function) -> ufl.Form:
    """The potential of `added_stress`: int share (W(C) - W(C_0) - S(C_0) : (E - E_0)), J."""
    F, F0 = kinematics.deformation_gradient(body.u), kinematics.deformation_gradient(before)
    C, C0 = F.T * F, F0.T * F0

    def part(number: int) -> Expr:
        stress = second_stress(body, number, C0)
        stored = body.wall.energy(C)[number] - body.wall.energy(C0)[number]
        return share * (stored - ufl.inner(stress, C - C0) / 2)

    return part(0) * body.dx + part(1) * body.reduced_dx


def second_stress(body: Body, part: int, C: Expr) -> Expr:
    """Second Piola-Kirchhoff stress of the rubber, Pa; part 0: distortion, 1: dilatation."""
    C = ufl.variable(C)
    return 2 * ufl.diff(body.wall.energy(C)[part], C)


def _rolling_work(body: Body, rolling: Rolling) -> ufl.Form:
    """Virtual work of inertia and of mass-proportional damping."""
    u, v = body.u, body.test
    w = kinematics.wheel_velocity(body.mesh)
    if rolling.inertia == "full":
        rate, test_rate = w + kinematics.convective(u, w), kinematics.convective(v, w)
    else:
        rate, test_rate = kinematics.body_rate(u, w), kinematics.body_rate(v, w)
    # fem.Constant: another speed needs no recompilation.
    inertia = fem.Constant(body.mesh, float(rolling.speed**2))
    drag = fem.Constant(body.mesh, float(rolling.speed * rolling.damping))
    work = body.inertia(-inertia * ufl.inner(rate, test_rate))
    return work + body.inertia(drag * ufl.inner(kinematics.body_rate(u, w), v))


def convection_form(body: Body) -> ufl.Form:
    """G: skew part of int rho v . (grad u w), in trial and test functions."""
    u, v = body.trial, body.test
    w = kinematics.wheel_velocity(body.mesh)
    convect = kinematics.convective
    skew = (ufl.inner(v, convect(u, w)) - ufl.inner(convect(v, w), u)) / 2
    return body.inertia(skew)


def convective_form(body: Body) -> ufl.Form:
    """S: -int rho (grad v w) . (grad u w), in trial and test functions."""
    w, convect = kinematics.wheel_velocity(body.mesh), kinematics.convective
    return body.inertia(-ufl.inner(convect(body.test, w), convect(body.trial, w)))


def body_rate_form(body: Body) -> ufl.Form:
    """B = G - Q, Q = int rho v . (e_y x u)."""
    u, v = body.trial, body.test
    return convection_form(body) - body.inertia(ufl.inner(v, kinematics.cross_axle(u)))


def body_convective_form(body: Body) -> ufl.Form:
    """S_B: -int rho (body rate of v) . (body rate of u), in trial and test functions."""
    w, rate = kinematics.wheel_velocity(body.mesh), kinematics.body_rate
    return body.inertia(-ufl.inner(rate(body.test, w), rate(body.trial, w)))


def tangent(body: Body, residual: ufl.Form) -> ufl.Form:
    """Derivative of a residual with respect to the body's displacement."""
    return ufl.derivative(residual, body.u, body.trial)


def stress_prediction(body: Body, before: fem.Function, share: Expr | float = 0.0) -> ufl.Form:
    """Correction that turns the tangent into that of a mixed (displacement-stress) Newton method.

    There the stresses S at the Gauss points are independent unknowns; S = S(C(u)) is linearised
    along with equilibrium and condensed. The residual is unchanged; the geometric stiffness int S :
    sym(grad du^T grad v) takes S = S(C_0) + dS/dC [dC], predicted from the last iterate `before`,
    instead of S(C(u)). In a thin or nearly incompressible wall S(C(u)) of an iterate is
    meaningless, as stretch is of second order in the step and is multiplied by the largest
    stiffness. `share`: that of `added_stress` in the residual. Source: Magisano, Leonetti, Garcea
    2017, doi 10.1016/j.cma.2016.10.023.
    """
    u, v, du = body.u, body.test, body.trial
    F, F0 = kinematics.deformation_gradient(u), kinematics.deformation_gradient(before)
    change = ufl.grad(u - before)
    rate = F0.T * change + change.T * F0
    bending = ufl.sym(ufl.grad(du).T * ufl.grad(v))
    reach = ufl.variable(fem.Constant(body.mesh, 0.0))

    def correction(part: int) -> Expr:
        def stress(C: Expr) -> Expr:
            return second_stress(body, part, C)

        slope = ufl.diff(stress(F0.T * F0 + reach * rate), reach)
        off = stress(F0.T * F0) + slope - stress(F.T * F)
        return (1 + share) * ufl.inner(off, bending)

    stretch = body.plies.stress_prediction(u, before, du, v)
    return correction(0) * body.dx + correction(1) * body.reduced_dx + stretch


def inverted_volume(body: Body) -> ufl.Form:
    """Volume in which det F is not positive, m3, in UFL."""
    J = ufl.det(kinematics.deformation_gradient(body.u))
    return ufl.conditional(ufl.le(J, 0.0), 1.0, 0.0) * body.dx
