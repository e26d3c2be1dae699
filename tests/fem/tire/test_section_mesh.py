"""The type of a section: its rules, other orders of it, and the torus's against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from tireroad.fem.errors import InputError
from tireroad.fem.sections import mesh2d
from tireroad.fem.sections.mesh2d import PlyLine, RegionPatch, element_corners
from tireroad.fem.sections.torus import Torus
from tireroad.tests.validation.cases import thesis_torus

HALF = np.radians(120)
BELT = PlyLine("belt", (-0.8, 0.8), 0.75)


def torus(order=2, arc=12, layers=1) -> Torus:
    return thesis_torus(segments=20, elements_arc=arc, elements_thickness=layers, order=order)


def area(mesh, region=None) -> float:
    """Area of a region in the meridian plane, m2, by Gauss points on the nodes' interpolation."""
    points, weights = np.polynomial.legendre.leggauss(5)
    t, w = points / 2 + 0.5, weights / 2
    edge = mesh2d.equispaced(mesh.order)
    xi, eta = mesh2d.grid_points(t)
    shape, slope = (
        [f(edge, x) for x in (xi, eta)] for f in (mesh2d.lagrange, mesh2d.lagrange_slope)
    )
    nodes = mesh.nodes[mesh.cells if region is None else mesh.cells[mesh.region == region]]
    a = np.einsum("ka,cax->ckx", mesh2d.tensor(slope[0], shape[1]), nodes)
    b = np.einsum("ka,cax->ckx", mesh2d.tensor(shape[0], slope[1]), nodes)
    return float((np.outer(w, w).ravel() * (a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])).sum())


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("raised", [1, 2, 3])
def test_other_orders_lie_on_the_same_torus(order, raised):
    mesh = torus(order).section([], [BELT]).of_order(raised)
    radius = np.hypot(mesh.nodes[:, 0] - 0.22, mesh.nodes[:, 1])
    assert radius.min() == pytest.approx(0.088, rel=1e-12)
    assert radius.max() == pytest.approx(0.1, rel=1e-12)
    assert len(mesh.nodes) == (raised * 2 + 1) * (raised * (len(mesh.cells) // 2) + 1)
    outer = mesh.nodes[mesh.chain(mesh.outer)]
    np.testing.assert_allclose(np.hypot(outer[:, 0] - 0.22, outer[:, 1]), 0.1, rtol=1e-12)
    belt = mesh.nodes[mesh.chain(mesh.plies["belt"])]
    np.testing.assert_allclose(np.hypot(belt[:, 0] - 0.22, belt[:, 1]), 0.097, rtol=1e-12)
    assert abs(np.arctan2(belt[:, 1], belt[:, 0] - 0.22)).max() == pytest.approx(0.8, rel=1e-12)


def test_without_an_exact_shape_a_raised_order_is_the_same_shape():
    mesh = replace(torus(2).section(), position=None)
    assert area(mesh.of_order(3)) == pytest.approx(area(mesh), rel=1e-12)


@pytest.mark.parametrize("arc", [5, 6, 9, 16, 31])
@pytest.mark.parametrize("layers", [1, 2, 5])
def test_a_region_has_its_area_on_every_mesh(arc, layers):
    """Closed form of the annular sector; edges at 0 and 45 degrees are no corners of plain meshes."""
    sector = RegionPatch("tread", ((0.0, np.radians(45)),), (0.4, 1.0))
    mesh = torus(3, arc, layers).section([sector])
    low = 0.088 + 0.4 * 0.012
    expected = np.radians(45) * (0.1**2 - low**2) / 2
    cubic = 5 * (1 / arc) ** 4  # of the elements' interpolation of the circle
    assert area(mesh, 1) == pytest.approx(expected, rel=cubic)
    assert area(mesh) == pytest.approx(HALF * (0.1**2 - 0.088**2), rel=cubic)
    nodes = mesh.nodes[np.unique(mesh.cells[mesh.region == 1])]
    angle, radius = (
        np.arctan2(nodes[:, 1], nodes[:, 0] - 0.22),
        np.hypot(nodes[:, 0] - 0.22, nodes[:, 1]),
    )
    extent = [angle.min(), angle.max(), radius.min(), radius.max()]
    np.testing.assert_allclose(extent, [0.0, np.radians(45), low, 0.1], atol=1e-12)


@pytest.mark.parametrize("count", [4, 7, 12, 40])
def test_corners_share_out_a_density_between_fixed_places(count):
    found = element_corners(count, lambda x: 1 + 3 * x**2, -1.0, 1.0, (-0.3, 0.3, 0.3 + 1e-13))
    np.testing.assert_array_equal(found, -found[::-1])
    assert np.isin([-1.0, -0.3, 0.3, 1.0], found).all()
    assert abs(len(found) - 1 - count) <= 1
    outside = np.diff(found)[found[1:] < -0.29]
    assert (np.diff(outside) > 0).all()


def _moved(mesh, node, by):
    nodes = mesh.nodes.copy()
    nodes[node] += by
    return nodes


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: {"nodes": m.nodes * [1, -1]}, "inside out"),
        (lambda m: {"nodes": m.nodes - [0.2, 0]}, "above it"),
        (lambda m: {"nodes": _moved(m, m.cells[0, 0], [0.02, 0.02])}, "element 0"),
        (lambda m: {"nodes": np.vstack([m.nodes, [1.0, 0.0]])}, "has no element"),
        (lambda m: {"nodes": _moved(m, 5, np.nan)}, "not a number"),
        (lambda m: {"region": m.region + 1}, "no region"),
        (lambda m: {"outer": m.outer[::-1]}, "higher y to the lower"),
        (lambda m: {"outer": m.outer[[0, 2, 1]]}, "one chain"),
        (lambda m: {"tread": m.inner}, "not of the outer face"),
        (lambda m: {"tread": np.array([[0, 1]])}, "inside the body"),
        (lambda m: {"inner": np.delete(m.inner, 4, axis=0)}, "ends 4 times"),
        (lambda m: {"inner": m.inner[:-1]}, "open at"),
        (lambda m: {"inner": m.inner[:0]}, "no edge is inner"),
        (lambda m: {"rim": np.array([[999, 0]])}, "edge of no element"),
        (lambda m: {"plies": {"x": m.plies["belt"][[0, 2]]}}, "ply 'x' is not one chain"),
        (lambda m: {"cells": m.cells[:, :4]}, "cells has shape"),
        (lambda m: {"order": 4}, "order 4"),
    ],
)
def test_a_broken_rule_is_told_by_name_and_place(change, message):
    mesh = torus(2, 12).section([], [BELT])
    with pytest.raises(InputError, match=message):
        replace(mesh, **change(mesh))


def test_two_bodies_are_told():
    mesh = torus(2, 6).section()
    far = {name: getattr(mesh, name) for name in ("inner", "outer", "rim", "tread")}
    cells = np.vstack([mesh.cells, mesh.cells + len(mesh.nodes)])
    nodes = np.vstack([mesh.nodes, mesh.nodes + [0.5, 0.0]])
    with pytest.raises(InputError, match="2 bodies"):
        replace(mesh, nodes=nodes, cells=cells, region=np.tile(mesh.region, 2), **far)
    with pytest.raises(InputError, match="share a node"):
        replace(
            mesh,
            nodes=np.vstack([mesh.nodes, mesh.nodes]),
            cells=cells,
            region=np.tile(mesh.region, 2),
        )


@pytest.mark.parametrize("depth", [0.0, 0.3, 1.0])
def test_a_ply_lies_where_it_should(depth):
    mesh = torus(2, 8).section([], [PlyLine("ply", (-HALF, HALF), depth)])
    line = mesh.nodes[mesh.chain(mesh.plies["ply"])]
    np.testing.assert_allclose(np.hypot(line[:, 0] - 0.22, line[:, 1]), 0.088 + 0.012 * depth)
    assert line[0, 1] < line[-1, 1]
