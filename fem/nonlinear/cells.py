"""Element forces and stiffnesses of single cells, by the kernels that the form compiler makes.

dolfinx assembles whole meshes; a force of some weighted cells costs it more in preparation than in
arithmetic. Here the same compiled kernels are called for chosen cells only.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import ufl
from mpi4py import MPI

from tireroad.fem import compat
from tireroad.fem.collective import allgather_rows
from tireroad.fem.compiled import library
from tireroad.fem.tire.body import Body
from tireroad.fem.tire.mesh import INNER

_KINDS = {"coefficients": float, "coordinates": float, "constants": float} | dict.fromkeys(
    ("slot", "place", "facet"), np.int32
)
SOURCE = Path(__file__).with_name("cells.c")


@dataclass(frozen=True)
class CellForms:
    """Tensors of a form in cells c, as a function of the displacement of their nodes.

    `coefficients` (c, w), `coordinates` (c, g) m, `constants`: as the `kernels` take them; `slot` (d,):
    places of a cell's displacement among its coefficients; `place` (c, d): where its values are in the
    vector of displacements, -1 for those that are held; `facet` (f, 2): cells and their local facets on
    the inner face; `size`: of a tensor, d for forces and d^2 for stiffnesses; `number` (c,): the cells' numbers
    in the whole mesh. Not collective.
    """

    kernels: compat.Kernels
    size: int
    coefficients: np.ndarray
    coordinates: np.ndarray
    constants: np.ndarray
    slot: np.ndarray
    place: np.ndarray
    facet: np.ndarray
    number: np.ndarray
    _described: list[Any] = field(default_factory=list, compare=False)
    _work: list[np.ndarray] = field(default_factory=list, compare=False)

    def __post_init__(self) -> None:
        for name, kind in _KINDS.items():  # as compiled code reads them
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), kind))

    def __call__(self, displacement: np.ndarray) -> np.ndarray:
        """Tensors (c, size) at the displacement (n,) m: N, or N/m."""
        compiled, out = library(SOURCE), np.empty((len(self.place), self.size))
        given = np.ascontiguousarray(displacement, dtype=float)
        compiled.lib.element_tensors(
            self._struct(compiled), compiled.doubles(given), compiled.doubles(out)
        )
        return out

    def summed(self, displacement: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Forces (n,) N of the cells at the displacement (n,) m, each times its weight (c,)."""
        compiled, out = library(SOURCE), np.zeros(len(displacement))
        if not self._work:
            self._work.append(np.empty((len(self.place), self.size)))
        given = (np.ascontiguousarray(each, float) for each in (displacement, weights))
        pointers = map(compiled.doubles, (*given, self._work[0], out))
        compiled.lib.summed_forces(self._struct(compiled), *pointers)
        return out

    def _struct(self, compiled: Any) -> Any:
        if not self._described:
            self._described.append(self._described_for(compiled))
        return self._described[0]

    def _described_for(self, compiled: Any) -> Any:
        cells, own = self.place.shape
        return compiled.ffi.new(
            "forms *",
            {
                "cells": cells,
                "size": self.size,
                "width": self.coefficients.shape[1],
                "own": own,
                "points": self.coordinates.shape[1],
                "facets": len(self.facet),
                "slot": compiled.ints(self.slot),
                "place": compiled.ints(self.place),
                "coefficients": compiled.doubles(self.coefficients),
                "coordinates": compiled.doubles(self.coordinates),
                "constants": compiled.doubles(self.constants),
                "facet": compiled.ints(self.facet),
                "cell_kernel": compiled.ffi.cast("void *", self.kernels.cell),
                "facet_kernel": compiled.ffi.cast("void *", self.kernels.facet),
            },
        )

    def only(self, cells: np.ndarray) -> CellForms:
        """The same of some cells (k,), indices into these."""
        index = np.full(len(self.place), -1)
        index[cells] = np.arange(len(cells))
        facet = np.stack([index[self.facet[:, 0]], self.facet[:, 1]], axis=1)
        return replace(
            self,
            coefficients=self.coefficients[cells],
            coordinates=self.coordinates[cells],
            place=self.place[cells],
            facet=facet[facet[:, 0] >= 0],
            number=self.number[cells],
            _described=[],
            _work=[],
        )

    def moved_to(self, place: np.ndarray) -> CellForms:
        """The same, of displacements at other places (c, d)."""
        return replace(self, place=place, _described=[], _work=[])

    def everywhere(self, comm: MPI.Comm) -> CellForms:
        """The cells of all processes on every process, in the order of their numbers. Collective."""
        first = comm.exscan(len(self.place)) or 0
        moved = self.facet + np.array([first, 0])
        names = "coefficients", "coordinates", "place", "number"
        parts: dict[str, Any] = {name: allgather_rows(comm, getattr(self, name)) for name in names}
        order = np.argsort(parts["number"])
        whole = replace(self, facet=allgather_rows(comm, moved), _described=[], _work=[], **parts)
        return whole.only(order)


def cell_forms(body: Body, work: ufl.Form, rank: int) -> CellForms:
    """Cells of this process of a form in `body.u`: forces (rank 1) or stiffnesses (2). Collective.

    Displacements are those of this process's nodes, ghosts included, as `body.u.x.array`.
    """
    form = compat.form(work)
    count = body.mesh.topology.index_map(3).size_local
    values, kept = body.u.x.array, body.u.x.array.copy()
    marks = np.arange(1.0, len(values) + 1)
    values[:] = marks
    packed = compat.cell_coefficients(form)
    values[:] = -marks
    slot = np.flatnonzero((packed != compat.cell_coefficients(form)).any(axis=0))
    values[:] = kept
    nodes = compat.cell_nodes(body.space)[:count]
    place = (3 * nodes[:, :, None] + np.arange(3)).reshape(count, -1)
    if not np.array_equal(packed[:, slot], marks[place]):
        raise AssertionError("the form compiler packs displacements in another order")
    points = compat.cell_points(body.mesh)[:count].reshape(count, -1)
    return CellForms(
        kernels=compat.kernels(form),
        size=place.shape[1] ** rank,
        coefficients=packed,
        coordinates=points,
        constants=compat.constants(form),
        slot=slot,
        place=place,
        facet=_inner(body, count),
        number=np.asarray(body.mesh.topology.original_cell_index)[:count],
    )


def _inner(body: Body, count: int) -> np.ndarray:
    """Own cells and their local facets (f, 2) on the inner face."""
    facets = body.tire.facets
    inner = facets.indices[facets.values == INNER]
    found = np.nonzero(np.isin(compat.cell_facets(body.mesh)[:count], inner))
    return np.stack(found, axis=1)
