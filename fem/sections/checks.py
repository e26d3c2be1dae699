"""Validity checks of a section mesh; each error names the fault and its position."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from tireroad.fem.errors import InputError
from tireroad.fem.sections import reference

if TYPE_CHECKING:
    from tireroad.fem.sections.mesh2d import SectionMesh

_SAME = 1e-9  # of the section's size: nodes closer than this coincide
_GAUSS = 4  # points per direction at which the Jacobian is checked, besides the corners


def check(mesh: SectionMesh) -> None:
    """Raise InputError for the first rule of `SectionMesh` that is violated."""
    _arrays(mesh)
    _nodes(mesh)
    _jacobians(mesh)
    _one_body(mesh)
    edges = _edges(mesh)
    for name in ("outer", "tread", "inner", "rim"):
        _on_boundary(mesh, name, edges)
    _outer(mesh)
    _inner(mesh)
    _plies(mesh, edges)


def _arrays(mesh: SectionMesh) -> None:
    if mesh.order not in (1, 2, 3):
        raise InputError(f"section: elements of order {mesh.order}; 1, 2 and 3 are available")
    shapes = {
        "nodes": mesh.nodes.ndim == 2 and mesh.nodes.shape[1] == 2,
        "cells": mesh.cells.ndim == 2 and mesh.cells.shape[1] == (mesh.order + 1) ** 2,
        "region": mesh.region.shape == mesh.cells.shape[:1],
    }
    for name, right in shapes.items():
        if not right:
            raise InputError(f"section: {name} has shape {getattr(mesh, name).shape}")
    if not len(mesh.cells):
        raise InputError("section: no element in it")
    if not np.isfinite(mesh.nodes).all():
        raise InputError("section: a coordinate is not a number")
    if not ((mesh.region >= 0) & (mesh.region < len(mesh.regions))).all():
        raise InputError("section: an element has no region")


def _place(point: np.ndarray) -> str:
    return f"r = {point[0]:.5g} m, y = {point[1]:.5g} m"


def _nodes(mesh: SectionMesh) -> None:
    if mesh.nodes[:, 0].min() <= 0:
        worst = mesh.nodes[mesh.nodes[:, 0].argmin()]
        raise InputError(
            f"section: a node at {_place(worst)}: the axle is r = 0, all lies above it"
        )
    unused = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.cells)
    if len(unused):
        raise InputError(
            f"section: node {unused[0]} at {_place(mesh.nodes[unused[0]])} has no element"
        )
    pairs = cKDTree(mesh.nodes).query_pairs(_SAME * np.ptp(mesh.nodes, axis=0).max())
    if pairs:
        a, b = min(pairs)
        raise InputError(
            f"section: nodes {a} and {b} are both at {_place(mesh.nodes[a])}: two bodies, or elements "
            "that should share a node"
        )


def _jacobians(mesh: SectionMesh) -> None:
    """Positive at Gauss points and at the corners of every element."""
    edge = reference.equispaced(mesh.order)
    t = np.polynomial.legendre.leggauss(_GAUSS)[0] / 2 + 0.5
    xi, eta = reference.grid_points(np.concatenate([[0.0], t, [1.0]]))
    value = [reference.line(edge, x) for x in (xi, eta)]
    slope = [reference.line_slope(edge, x) for x in (xi, eta)]
    points = mesh.nodes[mesh.cells]
    along_xi = np.einsum("ka,cax->ckx", reference.tensor(slope[0], value[1]), points)
    along_eta = np.einsum("ka,cax->ckx", reference.tensor(value[0], slope[1]), points)
    area = along_xi[..., 0] * along_eta[..., 1] - along_xi[..., 1] * along_eta[..., 0]
    low, high = area.min(axis=1), area.max(axis=1)
    bad = np.flatnonzero(~(low > 1e-6 * np.abs(area).max(axis=1)))
    if len(bad):
        middle = points[bad[0]].mean(axis=0)
        what = "is inside out" if high[bad[0]] <= 0 else "is folded or has no angle at a corner"
        raise InputError(
            f"section: element {bad[0]} at {_place(middle)} {what} ({len(bad)} of {len(mesh.cells)})"
        )


def _one_body(mesh: SectionMesh) -> None:
    count = mesh.cells.shape[1]
    rows = np.repeat(np.arange(len(mesh.cells)), count)
    table = coo_matrix((np.ones(rows.size), (rows, mesh.cells.ravel()))).tocsr()
    bodies, which = connected_components(table @ table.T, directed=False)
    if bodies > 1:
        apart = mesh.nodes[mesh.cells[np.flatnonzero(which == 1)[0]]].mean(axis=0)
        raise InputError(
            f"section: {bodies} bodies that share no node; one lies at {_place(apart)}"
        )


def _edges(mesh: SectionMesh) -> np.ndarray:
    """Number of cells that share each side of each cell, (c, 4)."""
    sides = np.sort(mesh.cells[:, reference.side_nodes(mesh.order)], axis=2)
    _, inverse, count = np.unique(
        sides.reshape(-1, mesh.order + 1), axis=0, return_inverse=True, return_counts=True
    )
    count = count[inverse.ravel()].reshape(-1, 4)
    if count.max() > 2:
        cell = np.argwhere(count > 2)[0][0]
        raise InputError(f"section: an edge of element {cell} belongs to more than two elements")
    return count


def _in_range(mesh: SectionMesh, name: str, edges: np.ndarray) -> None:
    if edges.ndim != 2 or edges.shape[1] != 2:
        raise InputError(f"section: {name} has shape {edges.shape}, not (edges, 2)")
    cell, side = edges.T
    if not ((cell >= 0) & (cell < len(mesh.cells)) & (side >= 0) & (side < 4)).all():
        raise InputError(f"section: {name} names an edge of no element")


def _on_boundary(mesh: SectionMesh, name: str, count: np.ndarray) -> None:
    edges = getattr(mesh, name)
    _in_range(mesh, name, edges)
    if not len(edges):
        raise InputError(f"section: no edge is {name}")
    inside = count[edges[:, 0], edges[:, 1]] > 1
    if inside.any():
        middle = mesh.nodes[mesh.side(edges[inside][:1])[0]].mean(axis=0)
        raise InputError(f"section: {name} has an edge inside the body, at {_place(middle)}")


def _outer(mesh: SectionMesh) -> None:
    chain = mesh.chain(mesh.outer)
    if not len(chain):
        raise InputError("section: the outer face is not one chain in order, bead to bead")
    if mesh.nodes[chain[0], 1] >= mesh.nodes[chain[-1], 1]:
        raise InputError("section: the outer face runs from the higher y to the lower")
    keys = {tuple(edge) for edge in mesh.outer.tolist()}
    for edge in mesh.tread.tolist():
        if tuple(edge) not in keys:
            middle = mesh.nodes[mesh.side(np.array([edge]))[0]].mean(axis=0)
            raise InputError(f"section: the tread at {_place(middle)} is not of the outer face")


def _inner(mesh: SectionMesh) -> None:
    """The inner face is one path whose two ends lie on the rim or at the ends of the outer face."""
    ends = mesh.side(mesh.inner)[:, [0, -1]]
    nodes, uses = np.unique(ends, return_counts=True)
    loose = nodes[uses == 1]
    if len(loose) != 2 or uses.max() > 2:
        where = "; ".join(_place(mesh.nodes[n]) for n in loose[:4])
        raise InputError(
            f"section: the inner face is not one unbroken line, it ends {len(loose)} times: {where}"
        )
    held = np.union1d(mesh.side(mesh.rim), mesh.chain(mesh.outer)[[0, -1]])
    for node in loose:
        if node not in held:
            raise InputError(f"section: the inner face is open at {_place(mesh.nodes[node])}")


def _plies(mesh: SectionMesh, count: np.ndarray) -> None:
    for name, edges in mesh.plies.items():
        _in_range(mesh, f"ply {name!r}", edges)
        if not len(edges):
            raise InputError(f"section: ply {name!r} has no edge")
        chain = mesh.chain(edges)
        if not len(chain):
            raise InputError(f"section: ply {name!r} is not one chain of element edges in order")
        if len(np.unique(chain)) != len(chain):
            raise InputError(f"section: ply {name!r} meets itself")
