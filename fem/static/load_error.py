"""The error of the load by a companion: the same tire and deflection on elements of twice the size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.probe import line_shape
from tireroad.fem.sections.locate import interpolation, locate
from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.loading import Loader
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import Lattice

RATE = 2.0


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
    ring = fine.ring.coarser()
    if ring is None:
        return "the mesh is too coarse to be halved"
    body = Body(fine.comm, ring, fine.materials, cords=fine.plies.cords)
    coarse = Equilibrium(body, rolling)
    companion = Loader(coarse, lambda progress: None)
    deflection = loader.deflection
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
    ratio = np.sqrt(fine.ring.faces / ring.faces)
    relative = abs(load - found) / (ratio**RATE - 1) / load if load else 0.0
    return LoadError(found, float(relative), 3 * body.lattice.size)


def _sampled(lattice: Lattice, values: np.ndarray, other: Lattice) -> np.ndarray:
    """Values (n, 3) of a lattice's nodes at the nodes of another one of the same tire."""
    section = lattice.tire.section
    place = locate(section.nodes, section.cells, section.order, other.section)
    across = interpolation(lattice.cells_2d, lattice.edge, lattice.shape[1], place)
    first, shape = line_shape(lattice.ring_corners, lattice.edge, other.ring)
    index = (first[:, None] + np.arange(len(lattice.edge))) % lattice.shape[0]
    around = np.einsum("ka,kanx->knx", shape, values.reshape(*lattice.shape, 3)[index])
    return np.stack([across @ ring for ring in around]).reshape(-1, 3)
