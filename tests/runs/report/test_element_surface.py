"""The outer face between its nodes: the elements' own shape, and their fields."""

import numpy as np
import pytest
from synthetic_results import lattice

from tireroad.runs.report.element_surface import FACET, ElementSurface


def uneven(order: int, segments: int, across: int) -> tuple[np.ndarray, np.ndarray]:
    """A ring of radius 0.3 m of elements of unequal length, straight across, and its quadrilaterals."""
    sizes = 1.0 + 0.7 * np.cos(2 * np.pi * np.arange(segments) / segments)
    corners = np.concatenate([[0.0], 2 * np.pi * np.cumsum(sizes) / sizes.sum()])
    edge = np.array([0.0, 0.2763932, 0.7236068]) if order == 3 else np.arange(order) / order
    angle = (corners[:-1, None] + np.diff(corners)[:, None] * edge).ravel()
    y = np.linspace(-0.1, 0.1, order * across + 1)
    t, y = np.meshgrid(angle, y, indexing="ij")
    points = np.stack([0.3 * np.sin(t), y, -0.3 * np.cos(t)], axis=-1).reshape(-1, 3)
    return points, lattice(len(angle), y.shape[1])[1]


@pytest.mark.parametrize("order", [2, 3])
def test_a_coarse_ring_is_round(order: int) -> None:
    """16 elements: a polygon of the nodes is off by up to 4 mm, the elements' shape by tenths."""
    points, quads = uneven(order, 16, 4)
    face = ElementSurface.of(points, quads, {"tire": {"order": order}})
    radius = np.hypot(face.points[:, 0], face.points[:, 2])
    chord = 0.3 * (
        1 - np.cos(np.diff(np.unique(np.arctan2(points[:, 0], -points[:, 2]))).max() / 2)
    )
    assert np.abs(radius - 0.3).max() < 0.25 * chord
    corners = face.points[face.quads]
    angle = np.arctan2(corners[..., 0], -corners[..., 2])
    assert np.abs(np.angle(np.exp(1j * (angle[:, 1] - angle[:, 0])))).max() < 1.1 * FACET
    # Every place belongs to quads that turn the same way, outwards.
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    outwards = (normal * corners.mean(axis=1) * (1, 0, 1)).sum(axis=1)
    flat = points[quads]
    given = np.cross(flat[:, 2] - flat[:, 0], flat[:, 3] - flat[:, 1])
    assert (
        np.sign(outwards) == np.sign((given * flat.mean(axis=1) * (1, 0, 1)).sum(axis=1)[0])
    ).all()


def test_a_field_keeps_its_values_at_the_nodes_and_is_quadratic_between_them() -> None:
    points, quads = uneven(2, 12, 3)
    face = ElementSurface.of(points, quads, {"tire": {"order": 2}})
    values = np.random.default_rng(3).standard_normal((5, len(points), 3))
    fine = face.field(values)
    assert fine.shape == (5, len(face.points), 3)
    for node in (0, 7, len(points) - 1):  # y is interpolated exactly, and so finds the corners
        same = np.linalg.norm(face.points - points[node], axis=1).argmin()
        if np.linalg.norm(face.points[same] - points[node]) < 1e-12:
            np.testing.assert_allclose(fine[:, same], values[:, node], atol=1e-12)
    square = points[None] ** [[0, 2, 0]] * (0, 1, 0)
    np.testing.assert_allclose(face.field(square)[0, :, 1], face.points[:, 1] ** 2, atol=1e-12)


@pytest.mark.parametrize("scene", [{}, {"tire": {"order": 1}}, {"tire": {"order": 7}}])
def test_what_is_no_grid_of_elements_is_drawn_by_its_nodes(scene: dict) -> None:
    points, quads = lattice(40, 9)
    face = ElementSurface.of(points, quads, scene)
    assert (face.points == points).all() and (face.quads == quads).all()
    np.testing.assert_array_equal(face.field(points), points)
