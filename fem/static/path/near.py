"""Equilibrium from a state of another mesh whose displacement is close but whose forces are not.

Elements control cord strain only at their integration points; in between, the displacement of long
elements stretches a belt that it bends. On another mesh this appears as stress (radial tire, 16 x
12 elements, 4000 N, elements half as long: 9 kN per node at the shoulder, all around), which makes
the first tangent useless: its step moves a sidewall by 35 mm, and Newton's method does not recover.
Springs to the current position (as in path.snap) hold the body while the cords relax by some 0.1
mm,

    k (u - u_0) + F(u) = f,  k in proportion to the nodes' mass,

and the problem itself is solved from there.
"""

from __future__ import annotations

from dataclasses import replace

from tireroad.fem.static.drag import Drag
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.path.step import Step

# Residual over load. The radial tire starts with 15 and 18 on 16 x 12 and 20 x 16 elements, where
# only springs converge, and with 8 on 30 x 26, where they cost two tangents in vain. Rubber alone
# may start with more and still be close.
_STRAINED = 10.0
_DRAGGED = 1.0  # of the load: residual after the steps with springs
_FIRST = 1e-2  # of the typical stiffness of an unknown
_EASED, _RAISED = 0.1, 10.0
_MOST = 6  # steps with springs


def cords_strained(equilibrium: Equilibrium, load: float) -> bool:
    """Whether strained cords leave a residual so far above `load` (N) that a tangent is useless.
    Collective."""
    cords = equilibrium.body.plies.cords
    return bool(cords) and equilibrium.out_of_balance() > _STRAINED * load


def balance_near(equilibrium: Equilibrium, road_height: float, load: float, allowed: float) -> Step:
    """Equilibrium up to `allowed` N from the present state and road forces. Collective.

    The road is at `road_height` (m) and carries about `load` N. As `Equilibrium.solve`; on failure
    body and road are restored.
    """
    if not cords_strained(equilibrium, load):
        step = equilibrium.solve(road_height, allowed=allowed)
        if step.converged:
            return step
    return _dragged(equilibrium, road_height, load, allowed)


def _dragged(equilibrium: Equilibrium, road_height: float, load: float, allowed: float) -> Step:
    body, road, field = equilibrium.body, equilibrium.road, equilibrium.body.u.x
    kept = field.array.copy(), road.kept(), equilibrium.road_height
    typical = equilibrium.force_scale / body.ring.thickness
    drag, tangents = Drag(body, _FIRST * typical), 0
    share = _FIRST
    for _ in range(_MOST):
        equilibrium.drag = drag
        step = equilibrium.solve(road_height, allowed=_DRAGGED * load)
        equilibrium.drag = None
        tangents += step.iterations
        if step.converged and share <= _FIRST:
            step = equilibrium.solve(road_height, allowed=allowed)
            tangents += step.iterations
            if step.converged:
                return replace(step, iterations=tangents)
            factor = _EASED
        else:
            factor = _EASED if step.converged else _RAISED
        drag.here()
        share *= factor
        drag.stiffness *= factor
    field.array[:], equilibrium.road_height = kept[0], kept[2]
    road.put_back(kept[1])
    return replace(step, iterations=tangents)
