"""Bodies of simple shape around the axle, for closed forms of cords: what the forms need and no more."""

from types import SimpleNamespace

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from tireroad.fem import compat
from tireroad.fem.tire.plies import Face, Laid, Plies


def cylinder(cords, laid, *, radius, height, width, counts=(8, 2, 1), sector=2 * np.pi, order=2):
    """A wall of `height` under `radius`, `width` along the axle, over a `sector` around it; reference axes:
    around, outwards, along the axle. `counts` elements; `laid` (number, side) the plies' faces of all cells."""
    reference = compat.geometry_nodes(order)
    edge = np.unique(reference[:, 0].round(12))  # not thirds in every version
    ends = (0, sector), (radius - height, radius), (-width / 2, width / 2)
    lines = [
        low + (high - low) / n * np.append((np.arange(n)[:, None] + edge[:-1]).ravel(), n)
        for (low, high), n in zip(ends, counts, strict=True)
    ]
    closed = sector == 2 * np.pi
    around = len(lines[0]) - closed
    shape = around, len(lines[1]), len(lines[2])
    angle, reach, along = np.meshgrid(lines[0][:around], *lines[1:], indexing="ij")
    points = np.stack([reach * np.sin(angle), along, -reach * np.cos(angle)], axis=-1)
    nodes = np.rint(reference * order).astype(int)
    first = np.stack(np.meshgrid(*(order * np.arange(n) for n in counts), indexing="ij"), axis=-1)
    index = first.reshape(-1, 1, 3) + nodes
    cells = np.ravel_multi_index((index[..., 0] % around, index[..., 1], index[..., 2]), shape)
    mesh = compat.create_mesh(MPI.COMM_SELF, cells, points.reshape(-1, 3), order)
    space = compat.vector_space(mesh, order)
    every = np.arange(len(cells))
    where = [Laid(number, every, 1, side, reverse=not side) for number, side in laid]
    return SimpleNamespace(
        faces=tuple(Face(mesh, 1, side, order) for side in (0, 1)),
        mesh=mesh,
        space=space,
        u=fem.Function(space),
        test=ufl.TestFunction(space),
        trial=ufl.TrialFunction(space),
        plies=Plies(mesh, order, cords, where),
        dx=ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 2 * order}),
    )
