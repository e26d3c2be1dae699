"""Equilibrium from a state that is not near it: cords strained between their points, a tire that snaps.

Springs to the current position, which weaken from step to step, hold the body while it moves there.
"""

from __future__ import annotations

from dataclasses import replace

from tireroad.fem.static.equilibrium import Equilibrium, RestoringSprings, SolveOutcome

# Residual over load. The radial tire starts with 15 and 18 on 16 x 12 and 20 x 16 elements, where
# only springs converge, and with 8 on 30 x 26, where they cost two tangents in vain. Rubber alone
# may start with more and still be close.
_STRAINED = 10.0
_DRAGGED = 1.0  # of the load: residual after the steps with springs
_FIRST = 1e-2  # of the typical stiffness of an unknown
_EASED, _RAISED = 0.1, 10.0
_MOST = 6  # steps with springs
_FIRST_DRAG = 1e-2  # of an unknown's typical stiffness: a step then moves the tread by < 1 mm
_LAST = 1e-5  # of the first: the tire is at rest
_MOST_FALLS = 80  # steps; a section that folds at a tenth of a metre takes 20 to 30
_DRAG_EASED, _DRAG_RAISED = 0.25, 8.0


def cords_strained(equilibrium: Equilibrium, load: float) -> bool:
    """Whether strained cords leave a residual so far above `load` (N) that a tangent is useless.
    Collective."""
    cords = equilibrium.body.plies.cords
    return bool(cords) and equilibrium.out_of_balance() > _STRAINED * load


def balance_near(
    equilibrium: Equilibrium, road_height: float, load: float, allowed: float
) -> SolveOutcome:
    """Equilibrium up to `allowed` N from the present state and road forces. Collective.

    The road is at `road_height` (m) and carries about `load` N. As `Equilibrium.solve`; on failure
    body and road are restored.

    Elements control cord strain only at their integration points; in between, the displacement of
    long elements stretches a belt that it bends. On another mesh this appears as stress (radial
    tire, 16 x 12 elements, 4000 N, elements half as long: 9 kN per node at the shoulder, all
    around), which makes the first tangent useless: its step moves a sidewall by 35 mm, and Newton's
    method does not recover. Springs to the current position hold the body while
    the cords relax by some 0.1 mm,

        k (u - u_0) + F(u) = f,  k in proportion to the nodes' mass,

    and the problem itself is solved from there.
    """
    if not cords_strained(equilibrium, load):
        step = equilibrium.solve(road_height, allowed=allowed)
        if step.converged:
            return step
    return _balance_with_springs(equilibrium, road_height, load, allowed)


def _balance_with_springs(
    equilibrium: Equilibrium, road_height: float, load: float, allowed: float
) -> SolveOutcome:
    body, road, field = equilibrium.body, equilibrium.road, equilibrium.body.u.x
    before = field.array.copy(), road.snapshot(), equilibrium.road_height
    typical = equilibrium.force_scale / body.ring.thickness
    springs, tangents = RestoringSprings(body, _FIRST * typical), 0
    share = _FIRST
    for _ in range(_MOST):
        equilibrium.springs = springs
        step = equilibrium.solve(road_height, allowed=_DRAGGED * load)
        equilibrium.springs = None
        tangents += step.iterations
        if step.converged and share <= _FIRST:
            step = equilibrium.solve(road_height, allowed=allowed)
            tangents += step.iterations
            if step.converged:
                return replace(step, iterations=tangents)
            factor = _EASED
        else:
            factor = _EASED if step.converged else _RAISED
        springs.here()
        share *= factor
        springs.stiffness *= factor
    field.array[:], equilibrium.road_height = before[0], before[2]
    road.restore(before[1])
    return replace(step, iterations=tangents)


def pseudo_transient(
    equilibrium: Equilibrium, road_height: float, allowed: float = 0.0
) -> SolveOutcome:
    """The stable state reached from the present one, on a road at `road_height` (m). Collective.

    As `Equilibrium.solve`; on failure body and road are restored.

    Where a wall folds, or a node that leaves the road takes others with it, no equilibrium is near
    the last one, however small the load step: Newton's method cycles between contact sets or
    diverges. Pseudo-transient continuation (Kelley and Keyes 1998, doi 10.1137/S0036142996304796)
    moves from the last state to the next stable one,

        k (u - u_n) + F(u) = f,  u_n the state before,  k in proportion to the nodes' mass,

    with the road's conditions satisfied in every step. k is reduced to a quarter after a step that
    converges and raised eightfold after one that does not. Once it is negligible, the state is
    solved for without it.
    """
    field, road = equilibrium.body.u.x, equilibrium.road
    before = field.array.copy(), road.snapshot(), equilibrium.road_height
    typical = equilibrium.force_scale / equilibrium.body.ring.thickness
    equilibrium.springs = springs = RestoringSprings(equilibrium.body, _FIRST_DRAG * typical)
    share, tangents = 1.0, 0
    for _ in range(_MOST_FALLS):
        step = equilibrium.solve(road_height, allowed=allowed)
        tangents += step.iterations
        if step.converged and equilibrium.springs is None:
            return replace(step, iterations=tangents, reason="snapped through")
        factor = _DRAG_EASED if step.converged else _DRAG_RAISED
        springs.here()
        share *= factor
        springs.stiffness *= factor
        equilibrium.springs = springs if share > _LAST else None
    equilibrium.springs = None
    field.array[:], equilibrium.road_height = before[0], before[2]
    road.restore(before[1])
    return SolveOutcome(
        False, tangents, step.residual, "pseudo-transient continuation does not converge either"
    )
