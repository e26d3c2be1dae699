"""Through a snap: where equilibrium jumps, the tire moves against springs until it comes to rest.

Where a wall folds, or a node that leaves the road takes others with it, no equilibrium is near the
last one, however small the load step: Newton's method cycles between contact sets or diverges.
Pseudo-transient continuation (Kelley and Keyes 1998, doi 10.1137/S0036142996304796) moves from the
last state to the next stable one,

    k (u - u_n) + F(u) = f,  u_n the state before,  k in proportion to the nodes' mass,

with the road's conditions satisfied in every step. k is reduced to a quarter after a step that
converges and raised eightfold after one that does not. Once it is negligible, the state is solved
for without it.
"""

from __future__ import annotations

from dataclasses import replace

from tireroad.fem.static.drag import Drag
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.path.step import Step

_FIRST = 1e-2  # of an unknown's typical stiffness: a step then moves the tread by < 1 mm
_LAST = 1e-5  # of the first: the tire is at rest
_MOST = 80  # steps; a section that folds at a tenth of a metre takes 20 to 30
_EASED, _RAISED = 0.25, 8.0


def fall(equilibrium: Equilibrium, road_height: float, allowed: float = 0.0) -> Step:
    """The stable state reached from the present one, on a road at `road_height` (m). Collective.

    As `Equilibrium.solve`; on failure body and road are restored.
    """
    field, road = equilibrium.body.u.x, equilibrium.road
    kept = field.array.copy(), road.kept(), equilibrium.road_height
    typical = equilibrium.force_scale / equilibrium.body.ring.thickness
    equilibrium.drag = drag = Drag(equilibrium.body, _FIRST * typical)
    share, tangents = 1.0, 0
    for _ in range(_MOST):
        step = equilibrium.solve(road_height, allowed=allowed)
        tangents += step.iterations
        if step.converged and equilibrium.drag is None:
            return replace(step, iterations=tangents, reason="snapped through")
        factor = _EASED if step.converged else _RAISED
        drag.here()
        share *= factor
        drag.stiffness *= factor
        equilibrium.drag = drag if share > _LAST else None
    equilibrium.drag = None
    field.array[:], equilibrium.road_height = kept[0], kept[2]
    road.put_back(kept[1])
    return Step(
        False, tangents, step.residual, "pseudo-transient continuation does not converge either"
    )
