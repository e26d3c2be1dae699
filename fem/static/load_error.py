"""The error of the load by a companion: the same tire and deflection on elements of twice the size."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.fem.matrices.probe import line_shape
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.loading import Loader
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import Lattice, Torus

RATE = 2.0
LEAST = (6, 2)  # elements around and along: below, a tire is none


@dataclass(frozen=True)
class LoadError:
    """`load` N of the companion, `relative` the estimated error of the finer load, `unknowns` its size."""

    load: float
    relative: float
    unknowns: int


def load_error(loader: Loader, rolling: Rolling) -> LoadError | str:
    """How far the load at this deflection is from that of ever smaller elements; or why it is unknown.

    Richardson: (F_h - F_2h)/(r^RATE - 1), r the ratio of element sizes. The companion is inflated,
    takes over the finer displacement and meets its own road, at the same deflection from its own first
    touch. Collective; the body is left as it is.
    """
    fine, equilibrium = loader.body, loader.equilibrium
    section = _halved(fine.tire.section)
    if section is None:
        return "the mesh is too coarse to be halved"
    try:
        body = Body(fine.comm, section, fine.material, fine.regions, fine.plies.cords)
    except InputError as error:
        return f"on twice the size, {error}"
    coarse = Equilibrium(body, rolling)
    companion = Loader(coarse, lambda progress: None)
    deflection = equilibrium.road_height - loader.touch
    try:
        companion.inflate(float(equilibrium.pressure.value))
        inflated = body.u.x.array.copy()
        body.set_displacement(_sampled(fine.lattice, fine.displacement(), body.lattice))
        if not coarse.solve(companion.touch + deflection).converged:
            body.u.x.array[:] = inflated
            companion.deflect(deflection)
    except ConvergenceError as error:
        return f"on twice the size, {error}"
    load, found = loader.load(), companion.load()
    ratio = np.sqrt(_faces(fine.tire.section) / _faces(section))
    relative = abs(load - found) / (ratio**RATE - 1) / load if load else 0.0
    return LoadError(found, float(relative), 3 * body.lattice.size)


def _faces(section: Torus) -> int:
    return section.segments * section.elements_arc


def _halved(section: Torus) -> Torus | None:
    """Half the elements around and along; through the wall one is one."""
    around, along = section.segments // 2, section.elements_arc // 2
    if around < LEAST[0] or along < LEAST[1]:
        return None
    return replace(section, segments=around, elements_arc=along)


def _sampled(lattice: Lattice, values: np.ndarray, other: Lattice) -> np.ndarray:
    """Values (n, 3) of a lattice's nodes at the nodes of another one of the same tire."""
    section, edge = lattice.section, lattice.edge
    out = values.reshape(*lattice.shape, 3)
    lines = (
        (section.ring_corners, other.ring),
        (section.wall_corners, other.wall),
        (section.arc_corners, other.arc),
    )
    for axis, (corners, points) in enumerate(lines):
        first, shape = line_shape(corners, edge, points)
        index = (first[:, None] + np.arange(len(edge))) % out.shape[axis]
        taken = np.take(out, index, axis=axis)
        weights = shape.reshape(*(1,) * axis, *shape.shape, *(1,) * (3 - axis))
        out = (taken * weights).sum(axis=axis + 1)
    return out.reshape(-1, 3)
