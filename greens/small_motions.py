"""The full matrices of a tire's small motions about its static state, for a rolling wheel."""

from __future__ import annotations

from tireroad.fem.axle import Axle
from tireroad.fem.cavity.column import Column
from tireroad.fem.errors import InputError
from tireroad.fem.matrices.rim_motion import RimMotion
from tireroad.fem.model import SmallMotions
from tireroad.fem.turning import Turning
from tireroad.greens.coupling import Wheel
from tireroad.modal.basis import Projection
from tireroad.modal.damping import StrainEnergy, beyond
from tireroad.modal.joined import with_corner
from tireroad.modal.solver.modes import Modes


def wheel_of(
    motions: SmallMotions,
    turning: Turning,
    air: Column | None = None,
    projection: Projection | None = None,
    axle: Axle | None = None,
) -> Wheel:
    """The full matrices of a tire at its static state as the wheel rotates, with the `air` in it.

    `projection` on the modes: only for damping by strain energy, which has no full matrices.
    `axle`: the suspension of a wheel that moves; the full matrices are always those of a held rim.
    InputError if the static state was found for another speed or inertia, or the projection is
    missing. Collective.
    """
    shape, tail = motions.static.rolling, None
    if shape.speed and (shape.speed, shape.inertia) != (turning.speed, turning.inertia):
        raise InputError(
            f"the static state rolls at {shape.speed:g} rad/s with {shape.inertia} inertia, its small motions at "
            f"{turning.speed:g} rad/s with {turning.inertia}: take the same for both, or a static state at rest"
        )
    if isinstance(turning.damping, StrainEnergy):
        if projection is None:
            raise InputError("damping by strain energy needs the modes: give their projection")
        tail = beyond(turning.damping, projection)
    rotation = motions.rotation if turning.speed else None

    def rim() -> RimMotion | None:
        return motions.rim_motion(turning.speed != 0)

    def corner(projection: Projection, modes: Modes) -> Projection:
        comm, places = motions.body.comm, motions.static.positions
        return with_corner(projection, modes, axle, rim(), places, comm)

    return Wheel(
        operators=motions.operators,
        rotation=rotation,
        speed=turning.speed,
        damping=turning.damping,
        inertia=turning.inertia,
        air=air,
        beyond=tail,
        corner=corner,
        rim=rim,
    )
