"""Balance from a state that other elements found, which is near in place but not in force.

Elements strain cords only where they integrate them: in between, the field of long ones stretches a belt that it bends.
Other elements feel that (radial tire, 16 x 12 elements, 4000 N, elements half as long: 9 kN a node at the shoulder, all
around), and so much stress makes the first tangent meaningless: its step moves a sidewall by 35 mm, and Newton's method
never comes back. A drag (as in path.snap) holds the body in place while the cords slip by some 0.1 mm to where they are
not strained,

    k (u - u_0) + F(u) = f,  k in proportion to the nodes' mass,

and the problem itself is solved from there.
"""

from __future__ import annotations

from dataclasses import replace

from tireroad.fem.static.drag import Drag
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.path.step import Step

# Of the load, out of balance. The radial tire starts with 15 and 18 loads on 16 x 12 and 20 x 16 elements, where nothing
# but a drag converges, with 8 on 30 x 26, where one costs two tangents for nothing. Rubber alone may be further out, and is near.
_STRAINED = 10.0
_DRAGGED = 1.0  # of the load: what the dragged steps leave
_FIRST = 1e-2  # of the typical stiffness of an unknown
_EASED, _RAISED = 0.1, 10.0
_MOST = 6  # dragged steps


def cords_strained(equilibrium: Equilibrium, load: float) -> bool:
    """Whether the present state strains cords so much, beside the `load` (N), that a tangent there tells nothing. Collective."""
    cords = equilibrium.body.plies.cords
    return bool(cords) and equilibrium.out_of_balance() > _STRAINED * load


def balance_near(equilibrium: Equilibrium, road_height: float, load: float, allowed: float) -> Step:
    """Balance but for `allowed` N on a road at `road_height` (m) that carries about `load` N, from the present state and
    forces of the road. Collective.

    As `Equilibrium.solve`; where none is found the body, and the road, are put back.
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
