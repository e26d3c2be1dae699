"""First touch: the lowest point of the face between its nodes."""

import numpy as np
import pytest

from tireroad.fem.static.equilibrium import Equilibrium
from tireroad.fem.static.footprint import TreadSurface
from tireroad.fem.static.load_steps import LoadStepper
from tireroad.fem.tire.mesh import NodeGrid, position
from tireroad.tests.validation.cases import thesis_torus


def torus(ring, arc):
    """Places on the outer face of the torus."""
    return position(ring, np.stack([0.22 + 0.1 * np.cos(arc), 0.1 * np.sin(arc)], axis=-1))


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("turn", [0.0, 0.2, 0.37])
def test_the_lowest_point_of_a_turned_wheel(order, turn):
    """A circle about the axle, turned by a part of an element: the face between nodes closes in on it."""
    errors = []
    for segments in (16, 32):
        section = thesis_torus(segments=segments, elements_arc=segments // 2, order=order)
        edge = {1: [0, 1], 2: [0, 0.5, 1], 3: [0, 0.27639320225, 0.72360679775, 1]}[order]
        lattice = NodeGrid(section, np.array(edge))
        ring, arc = np.meshgrid(lattice.ring, lattice.arc, indexing="ij")
        face = torus(ring.ravel() + turn * 2 * np.pi / segments, arc.ravel())
        errors.append(abs(TreadSurface(lattice, face).lowest() + 0.32))
    assert errors[0] < {1: 1e-2, 2: 3e-4, 3: 5e-5}[order]
    assert errors[1] < 1e-12 or errors[1] < errors[0] / 2**order


def test_no_place_on_the_face_is_lower():
    rng = np.random.default_rng(3)
    section = thesis_torus(segments=12, elements_arc=6, order=3)
    lattice = NodeGrid(section, np.array([0, 0.27639320225, 0.72360679775, 1]))
    ring, arc = np.meshgrid(lattice.ring, lattice.arc, indexing="ij")
    face = torus(ring.ravel(), arc.ravel())
    surface = TreadSurface(lattice, face + 5e-4 * rng.standard_normal(face.shape))
    anywhere = surface.at(rng.uniform(-0.6, 0.6, 200_000), rng.uniform(-0.6, 0.6, 200_000))[:, 2]
    assert anywhere.min() - 1e-5 < surface.lowest() <= anywhere.min()


@pytest.mark.slow
def test_a_tire_whose_crown_is_no_node_touches_below_its_nodes(make_body):
    equilibrium = Equilibrium(make_body(order=3, segments=8, arc=5))
    loader = LoadStepper(equilibrium, lambda progress: None)
    loader.inflate(2e5)
    assert loader.touch < equilibrium.road.tread_height().min() - 1e-5
    loader.carry(50.0)
    assert loader.load() == pytest.approx(50.0, rel=1e-8)


def test_a_tread_wide_for_its_height_is_found_to_its_ends():
    """Beyond 75 degrees of the section too, where it still faces down; not where it has turned up."""
    lattice = NodeGrid(thesis_torus(segments=32, elements_arc=12, order=2), np.array([0, 0.5, 1]))
    ring, arc = (part.ravel() for part in np.meshgrid(lattice.ring, lattice.arc, indexing="ij"))
    end = lattice.arc.max()
    assert end > np.radians(85)
    flat = position(ring, np.stack([0.32 - 0.02 * arc**2, 0.1 * arc], axis=-1))
    y = 0.1 * np.array([-0.99, -0.9, -0.5, 0.0, 0.5, 0.9, 0.99]) * end
    _, place, found = TreadSurface(lattice, flat).locate(0 * y, y)
    assert found.all()
    np.testing.assert_allclose(place, y / 0.1, atol=1e-9)
    folded = position(ring, np.stack([0.32 - 0.02 * arc**2, 0.1 * np.sin(arc)], axis=-1))
    _, place, found = TreadSurface(lattice, folded).locate(0 * y, 0.1 * np.sin(y / 0.1))
    assert np.abs(place).max() <= np.pi / 2 and found[2:5].all()
