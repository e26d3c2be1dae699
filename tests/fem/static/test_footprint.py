"""Pressure and extent of the contact, from forces put on the nodes by a known pressure."""

import numpy as np
import pytest

from tireroad.fem.compat import field_nodes
from tireroad.fem.static.footprint import Footprint, evenness, footprint, nodal_area
from tireroad.fem.tire.mesh import NodeGrid, Torus, _edge

A, B = 0.03, 0.02  # m, half axes of the known footprint


@pytest.fixture
def plane():
    """A lattice whose outer face is laid out flat: x around, y along."""

    def make(order, segments, arc):
        section = Torus(
            outer_radius=0.32,
            minor_radius=0.1,
            thickness=0.01,
            half_angle=1.0,
            segments=segments,
            elements_arc=arc,
            elements_thickness=1,
            order=order,
            grading="uniform",
        )
        lattice = NodeGrid(section, _edge(field_nodes(order)))
        x = 0.05 * (np.where(lattice.ring > np.pi, lattice.ring - 2 * np.pi, lattice.ring))
        grid = np.stack(np.meshgrid(x, 0.05 * lattice.arc, [0.0], indexing="ij"), axis=-1)
        return lattice, grid.reshape(-1, 3)

    return make


@pytest.mark.parametrize("order", [1, 2, 3])
def test_areas_are_positive_and_cover_the_plane(plane, order):
    lattice, points = plane(order, 16, 8)
    area = nodal_area(lattice, points)
    assert area.min() > 0
    inside = area.reshape(lattice.shape[0], -1)[order : 5 * order + 1].sum()
    ends = area.reshape(lattice.shape[0], -1)[[order, 5 * order]].sum()
    width = 0.05 * 2 * np.pi / 16
    assert inside - ends / 2 == pytest.approx(4 * width * 0.1, rel=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_extent_of_an_ellipse_converges(plane, order):
    errors = []
    for segments in (40, 80):
        lattice, points = plane(order, segments, segments // 4)
        q = (points[:, 0] / A) ** 2 + (points[:, 1] / B) ** 2
        pressure, gap = np.sqrt(np.maximum(1 - q, 0)), 1e-3 * np.maximum(q - 1, 0) ** 1.5
        area = nodal_area(lattice, points)
        shape = lattice.face_shape
        found = footprint(shape, points, pressure, gap)
        assert (area * pressure).sum() == pytest.approx(2 / 3 * np.pi * A * B, rel=0.1)
        assert found.length == pytest.approx(2 * A, rel=1e-9)
        assert found.width == pytest.approx(2 * B, rel=1e-9)
        errors.append(abs(found.area / (np.pi * A * B) - 1))
    assert errors[0] < 0.05
    assert errors[1] < 0.02


def test_a_node_that_presses_beyond_the_edge_stands_for_what_is_inside(plane):
    """The road holds nodes: the last one often lies outside, and the gap of the next ones tells by how much."""
    lattice, points = plane(2, 40, 10)
    spacing = 0.05 * np.pi / 40
    q = (points[:, 0] / A) ** 2 + (points[:, 1] / B) ** 2
    beyond = (np.abs(points[:, 1]) < 1e-9) & (np.abs(points[:, 0]) < A + 0.4 * spacing)
    pressure = np.sqrt(np.maximum(1 - q, 0)) + 0.1 * beyond
    gap = 1e-3 * np.maximum(q - 1, 0) ** 1.5
    given = lattice.face_shape, points, pressure, gap
    held = np.abs(points[beyond, 0]).max()
    assert A < held < A + 0.4 * spacing
    assert footprint(*given).length == pytest.approx(2 * A, rel=1e-9)


def test_no_pressure_no_footprint(plane):
    lattice, points = plane(2, 16, 4)
    nothing = np.zeros(len(points))
    shape = lattice.face_shape
    assert footprint(shape, points, nothing, nothing + 1) == Footprint(0, 0, 0)


def test_extent_grows_with_the_load_without_jumps(plane):
    lattice, points = plane(2, 40, 10)
    shape = lattice.face_shape
    lengths = []
    for half in np.linspace(0.02, 0.03, 41):
        q = (points[:, 0] / half) ** 2 + (points[:, 1] / B) ** 2
        pressure, gap = np.sqrt(np.maximum(1 - q, 0)), 1e-3 * np.maximum(q - 1, 0) ** 1.5
        lengths.append(footprint(shape, points, pressure, gap).length)
    rise = np.diff(lengths)
    assert rise.min() > -1e-12
    assert rise.max() < 0.3 * (lengths[-1] - lengths[0])


def test_evenness_of_an_ellipse_and_of_a_saddle(plane):
    """Of an ellipse: lengths as sqrt(1 - y^2), pressures p(y)/p(0) as the mean along x, (1 - y^2)^(1/2)."""
    lattice, points = plane(2, 160, 40)
    q = (points[:, 0] / A) ** 2 + (points[:, 1] / B) ** 2
    gap, area = 1e-3 * np.maximum(q - 1, 0) ** 1.5, nodal_area(lattice, points)
    shape, across = lattice.face_shape, np.abs(points[:, 1]) / B
    for rise in (0.0, 3.0):
        force = area * np.sqrt(np.maximum(1 - q, 0)) * (1 + rise * across**2)
        found = evenness(shape, points, force, area, gap)
        y = np.linspace(0.0, 1.0, 2001)
        pressure = np.sqrt(1 - y**2) * (1 + rise * y**2)
        known = pressure[y >= 0.6].mean() / pressure[y <= 0.2].mean()
        assert found.shape_factor == pytest.approx(1 / 0.6, rel=0.02)
        assert found.shoulder == pytest.approx(known, rel=0.05)
    assert evenness(shape, points, 0 * force, area, gap) is None
