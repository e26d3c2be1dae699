"""The rubber of a rolling tire: the shape that stands on the road with the moduli of n Omega, and what its losses move.

A static state has the moduli of a slow load, and no losses. Its waves around, which stand on the road while the tire turns, have
the complex modulus of n Omega (fem.matrices.rolling_loss). Under the same forces of the road, by one step of Newton's method with
the storage moduli of the mean frequency f_c at which each kind of compounds loses,

    u_1 = K^-1 f_storage(u_s),   u_2 = K^-1 f_loss(u_s + u_1),   K = K(f_c) + Omega^2 S.

One step has the losses of the built-in tire within 0.6 % of what further ones lead to. The contact settles on u_s + u_1 + u_2
(contact.setup) under the load that it had: the normal force moves ahead of the axle, until its moment, or the drag of a wheel that
nothing drives (contact.rolling), supplies the power lost.
"""

from __future__ import annotations

from dataclasses import dataclass

from scipy import sparse

from tireroad.fem.matrices.compliance import LoadedShapes, add_part, rotating_stiffness
from tireroad.fem.matrices.rolling_loss import RollingLoss, rolling_loss, stiffening_force
from tireroad.fem.tire.material import CONSTANT
from tireroad.fem.wheel import StrainEnergy
from tireroad.greens.basis import Array
from tireroad.greens.coupling import Wheel


@dataclass(frozen=True)
class Standing:
    """The static state as it rolls: its `loss`, and the `motion` (3 s,) m of the outer face to it, rim held."""

    loss: RollingLoss
    motion: Array


def standing(wheel: Wheel, lowest: float) -> Standing | None:
    """The shape that stands on the road, of a wheel that is damped by its compounds; None of one that loses nothing.

    `lowest`: frequency of the lowest mode, Hz. Collective.
    """
    operators = wheel.operators
    lossy = isinstance(wheel.damping, StrainEnergy) and operators.unknowns.rim is None
    if not (wheel.speed and lossy) or wheel.pressed is None:
        return None
    body = wheel.pressed()
    static, shapes = body.displacement(), _shapes(wheel, rolling_loss(body, wheel.speed))

    def moved(force: Array) -> Array:
        nodal = sparse.csr_matrix(force[body.ids].reshape(-1, 1))
        return shapes.whole(operators.unknowns.loads(nodal))

    rise = moved(stiffening_force(body, wheel.speed, lowest))
    body.set_displacement(static + body.everywhere(operators.spread(rise)[:, :, 0]))
    loss = rolling_loss(body, wheel.speed)
    body.set_displacement(static)
    motion = operators.trace(rise + moved(loss.force))[:, 0]
    shapes.destroy()
    return Standing(loss, motion)


def _shapes(wheel: Wheel, loss: RollingLoss) -> LoadedShapes:
    """Shapes under constant loads, with the storage moduli of the frequencies of a `loss`. Collective."""
    given = wheel.operators, wheel.rotation, wheel.speed, (0.0, 0.0), wheel.inertia
    stiffness = rotating_stiffness(*given)
    for compound, frequency in zip(wheel.compounds, loss.frequency, strict=True):
        if compound.kind.spectrum != CONSTANT:
            modulus = compound.kind.modulus(frequency).real
            add_part(stiffness, modulus - 1, compound.stiffness)
    return LoadedShapes(wheel.operators, stiffness, wheel.air)
