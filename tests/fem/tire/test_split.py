"""Strips of a section cut in two: the same shape, and all that lies on it."""

import numpy as np
import pytest

from tireroad.fem.sections import mesh2d
from tireroad.fem.sections.radial import radial
from tireroad.fem.static.load_error import split_ring, split_section
from tireroad.tests.validation.cases import thesis_torus


def area(section) -> float:
    """By Gauss's rule over the cells, m2."""
    edge, (t, w) = mesh2d.equispaced(section.order), np.polynomial.legendre.leggauss(4)
    xi, eta = mesh2d.grid_points(t / 2 + 0.5)
    value, slope = (
        [f(edge, x) for x in (xi, eta)] for f in (mesh2d.lagrange, mesh2d.lagrange_slope)
    )
    shapes = mesh2d.tensor(slope[0], value[1]), mesh2d.tensor(value[0], slope[1])
    across, along = (
        np.einsum("qa,cax->cqx", shape, section.nodes[section.cells]) for shape in shapes
    )
    rate = across[..., 0] * along[..., 1] - across[..., 1] * along[..., 0]
    return float((rate * np.outer(w, w).ravel() / 4).sum())


@pytest.mark.parametrize("order", [1, 2, 3])
def test_strips_are_cut_across_the_wall_and_the_shape_stays(order):
    ring = thesis_torus(segments=8, elements_arc=6, elements_thickness=2, order=order).ring()
    along, around = np.zeros(6, bool), np.zeros(8, bool)
    along[[2, 3]], around[0] = True, True
    finer = split_ring(ring, around, along)
    assert len(finer.section.cells) == 2 * 8
    assert finer.segments == 9
    assert len(finer.arc_corners) == 9
    assert finer.section.outer.shape == (8, 2)
    radius = np.hypot(finer.section.nodes[:, 0] - 0.22, finer.section.nodes[:, 1])
    face = finer.section.chain(finer.section.outer)
    assert radius[face] == pytest.approx(0.1, rel=1e-12)
    angle = np.arctan2(*(finer.section.nodes[face] - [0.22, 0.0]).T[::-1])
    assert angle[::order] == pytest.approx(finer.arc_corners)


def test_a_tire_of_layers_keeps_its_compounds_and_plies():
    section = radial("205/60 R15").ring(12, 14, 2).section
    finer = split_section(section, np.arange(len(section.outer)) % 3 == 0)
    # Nodes lie on the outline; what lies between them is of second order in the elements.
    assert area(finer) == pytest.approx(area(section), rel=3e-3)
    for name, edges in section.plies.items():
        before, after = (
            s.nodes[s.chain(e)] for s, e in ((section, edges), (finer, finer.plies[name]))
        )
        assert len(after) > len(before)
        assert after[[0, -1]] == pytest.approx(before[[0, -1]])
    known = {name: (section.region == i).any() for i, name in enumerate(section.regions)}
    assert all((finer.region == i).any() for i, name in enumerate(finer.regions) if known[name])
