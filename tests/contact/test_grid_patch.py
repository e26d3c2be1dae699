"""Points on a regular grid of the deformed tread: interpolation, places, the state they settle in."""

from dataclasses import replace

import numpy as np
import pytest

from tireroad.contact import choices
from tireroad.contact.grid_patch import (
    equilibrate,
    halved,
    make_grid_patch,
    spread_pull,
    thinned,
)
from tireroad.contact.loop import ContactProblem, RoadMet
from tireroad.contact.model import step_solver
from tireroad.contact.patch import make_patch
from tireroad.contact.solver.active_set import ActiveSet, UsualSet
from tireroad.contact.solver.projected_cg import ProjectedCG
from tireroad.contact.tread.laws.elastic import HalfSpace
from tireroad.fem.errors import InputError
from tireroad.fem.static.footprint import TreadSurface
from tireroad.fem.tire.mesh import field_lattice
from tireroad.runs.scene.schema import Pitch
from tireroad.runs.scene.tables.contact import ContactTable
from tireroad.tests.validation.cases import thesis_torus

SECTION = thesis_torus(segments=60, elements_arc=16, grading="bead", footprint_size=0.3)


@pytest.fixture(scope="module")
def tread():
    """A torus flattened a little towards the road plane at z = -0.318 m: lattice, positions."""
    lattice = field_lattice(SECTION)

    points = lattice.points(lattice.face)
    road = -0.318
    depth = np.maximum(road - points[:, 2], 0.0)
    points = points + np.stack([0.1 * depth, -0.2 * depth, depth], axis=-1)
    return lattice, points, road


def patches(tread, reach: float, pitch: float):
    lattice, points, road = tread
    gap = np.maximum(points[:, 2] - road, 0.0)
    force = np.where(gap == 0, 1.0, 0.0)
    force *= 500 / force.sum()
    halves = np.full((len(points), 2), 0.01)
    shape = lattice.face_shape
    nodes = make_patch(points, halves, force, gap, shape, reach)
    surface = TreadSurface(lattice, points)
    return force, surface, make_grid_patch(surface, road, nodes, (pitch, pitch), reach)


def test_weights_hold_the_nodes_and_low_polynomials(tread) -> None:
    lattice, points, _ = tread
    surface = TreadSurface(lattice, points)
    ring, arc = np.meshgrid(lattice.ring[:5], lattice.arc[3:8], indexing="ij")
    weights = surface.weights(ring.ravel(), arc.ravel()).toarray()
    assert np.abs(weights).max(axis=1) == pytest.approx(1.0)
    assert np.abs(weights).sum(axis=1) == pytest.approx(1.0)
    anywhere = surface.weights(np.array([-0.1, 0.003, 6.2]), np.array([0.1, -0.4, 0.0]))
    assert anywhere.sum(axis=1) == pytest.approx(1.0)
    every = np.meshgrid(lattice.ring, lattice.arc, indexing="ij")
    assert anywhere[1] @ every[1].ravel() == pytest.approx(-0.4)
    assert anywhere[1] @ every[0].ravel() ** 2 == pytest.approx(9e-6)


def test_points_lie_where_they_were_asked(tread) -> None:
    _, surface, patch = patches(tread, 3e-3, 0.004)
    assert np.allclose(patch.points[:, :2] / 0.004, np.round(patch.points[:, :2] / 0.004))
    read = patch.weights @ surface._positions[patch.index]
    assert np.allclose(read[:, :2], patch.points[:, :2], atol=1e-10)
    assert np.allclose(
        read[:, 2], patch.points[:, 2], atol=0.004**2 / 12 / 0.05
    )  # the cell is curved
    assert np.array_equal(patch.edge, patch.gap > 3e-3)
    assert 0 < np.count_nonzero(patch.edge) < len(patch.edge)
    assert not patch.edge[patch.gap < 1e-3].any()
    # Every grid point within reach is there: neighbours in x of inner points are 4 mm away.
    found, _, _ = surface.locate(np.array([0.5]), np.array([0.0]))
    assert not surface.locate(np.array([0.5]), np.array([0.0]))[2][0]


def test_a_force_is_spread_over_the_cell_of_its_point(tread) -> None:
    """As the mean of the shape functions at many places of the cell."""
    _, surface, patch = patches(tread, 3e-3, 0.006)
    t = 0.006 * ((np.arange(24) + 0.5) / 24 - 0.5)
    for k in np.flatnonzero(patch.gap < 1e-3)[::7]:
        x, y = (a.ravel() + b for a, b in zip(np.meshgrid(t, t), patch.points[k], strict=False))
        ring, arc, found = surface.locate(x, y)
        assert found.all()
        mean = np.asarray(surface.weights(ring, arc).mean(axis=0)).ravel()
        assert patch.weights[k].toarray().ravel() == pytest.approx(
            mean[patch.index], abs=0.06
        )  # where elements meet


@pytest.mark.parametrize("pitch", [0.004, 0.002])
def test_settled_state_keeps_the_load(tread, pitch: float) -> None:
    force, _, patch = patches(tread, 3e-3, pitch)
    nodal = force[patch.index]
    p = len(patch.index)
    flexibility = 1e-5 * (np.eye(p) + 0.5)
    spec = ContactTable(law=HalfSpace(youngs_modulus=5e6), points=Pitch(pitch, pitch))
    settled, rise = equilibrate(patch, step_solver(spec, patch, flexibility), flexibility, nodal)
    assert settled.force.sum() == pytest.approx(500.0, rel=1e-7)
    assert settled.force.min() >= 0 and settled.gap.min() >= 0
    assert not (settled.force * settled.gap).any()
    assert abs(rise) < 2e-2
    # Taken as the reference, it stays.
    solver = step_solver(spec, settled, flexibility)
    again = solver.solve(settled.gap, settled.force > 0, reference=settled.force)
    assert np.array_equal(again, settled.force)


def test_a_patch_clear_of_the_road_settles_without_force(tread) -> None:
    """A grid point may lie a little below the nodes around it: no point is left inside the road."""
    force, _, patch = patches(tread, 3e-3, 0.004)
    flexibility = 1e-5 * np.eye(len(patch.index))
    spec = ContactTable(law=HalfSpace(youngs_modulus=5e6), points=Pitch(0.004, 0.004))
    patch = replace(patch, gap=patch.gap - 1e-5)
    free = np.zeros_like(force[patch.index])
    settled, rise = equilibrate(patch, step_solver(spec, patch, flexibility), flexibility, free)
    assert not settled.force.any() and settled.gap.min() == 0.0
    assert rise == pytest.approx(-patch.gap.min())
    pull = spread_pull(settled, np.zeros((len(free), 2)), free)
    assert not pull.any() and pull.shape == (len(settled.force), 2)


def test_nodes_and_points_exchange_the_same_work(tread) -> None:
    force, _, patch = patches(tread, 2e-3, 0.004)
    p = len(patch.index)
    same_step = 1e-5 * np.eye(p)
    spec = ContactTable(law=HalfSpace(youngs_modulus=5e6), points=Pitch(0.004, 0.004))
    problem = ContactProblem(patch, same_step, step_solver(spec, patch, same_step))
    free = np.linspace(0, 1e-3, p)
    pushed = problem.commit(problem.solve(RoadMet.level(patch), None, free))
    assert pushed.sum() == pytest.approx(problem.at_points.sum())
    assert pushed @ free == pytest.approx(problem.at_points @ (patch.weights @ free))


def test_every_other_point_is_a_grid_of_twice_the_pitch(tread) -> None:
    _, _, fine = patches(tread, 3e-3, 0.004)
    coarse, (_, _, wanted) = thinned(fine), patches(tread, 3e-3, 0.008)
    i, j = np.divmod(coarse.places.place, coarse.places.shape[1])
    places = np.stack([i, j], axis=1) * coarse.places.spacing
    assert np.ptp(coarse.points[:, :2] - places, axis=0) == pytest.approx(0.0, abs=1e-9)
    assert coarse.line.tolist() == j.tolist()
    assert coarse.area == pytest.approx(6.4e-5)
    near, other = coarse.points[~coarse.edge], wanted.points[~wanted.edge]
    assert near[np.lexsort(near.T)] == pytest.approx(other[np.lexsort(other.T)], abs=1e-9)


def test_twice_as_many_points_are_those_of_a_grid_of_half_the_pitch(tread) -> None:
    _, surface, coarse = patches(tread, 3e-3, 0.008)
    fine, (_, _, wanted) = halved(coarse, surface, tread[2], 3e-3), patches(tread, 3e-3, 0.004)
    i, j = np.divmod(fine.places.place, fine.places.shape[1])
    places = np.stack([i, j], axis=1) * fine.places.spacing
    assert np.ptp(fine.points[:, :2] - places, axis=0) == pytest.approx(0.0, abs=1e-9)
    assert fine.line.tolist() == j.tolist() and fine.area == pytest.approx(1.6e-5)
    own, other = ~fine.edge, ~wanted.edge
    assert fine.points[own] == pytest.approx(wanted.points[other], abs=1e-12)
    nodes = np.random.default_rng(0).random(len(tread[1]))
    read = fine.weights[own] @ nodes[fine.index]
    assert read == pytest.approx(wanted.weights[other] @ nodes[wanted.index], abs=1e-12)


def test_a_grid_needs_a_tread_and_a_sane_pitch(tread) -> None:
    _, _, patch = patches(tread, 3e-3, 0.001)
    flexibility = 1e-5 * np.eye(len(patch.index))
    with pytest.raises(InputError, match="tread"):
        step_solver(ContactTable(tread="none"), patch, flexibility)
    with pytest.raises(InputError, match="coarser"):
        patches(tread, 3e-3, 1e-6)


def test_solver_by_the_number_of_touching_points(tread, monkeypatch) -> None:
    for friction, limit in (0.0, "MOST_TOUCHING"), (1.0, "MOST_ALTERNATING"):
        for pitch, most, solver in (
            (0.004, 1000, ActiveSet),
            (0.002, 1000, UsualSet),
            (0.002, 50, ProjectedCG),
        ):
            _, _, patch = patches(tread, 3e-3, pitch)
            flexibility = 1e-5 * np.eye(len(patch.index))
            with monkeypatch.context() as here:
                here.setattr(choices, limit, most)
                here.setattr(choices, "MOST_A_NODE", 1000)
                found = step_solver(ContactTable(friction=friction), patch, flexibility)
            assert isinstance(found, solver)
