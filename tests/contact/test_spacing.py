"""How far apart contact points are that the program chooses, and what they settle to on the nodes of the mesh."""

from dataclasses import replace
from operator import is_
from types import SimpleNamespace

import numpy as np
import pytest

from tireroad.contact.patch import make_patch, spacing
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.roads.road import make_road
from tireroad.contact.roads.under_tire import RoadUnderTire
from tireroad.contact.setup import ContactSetup, Rolled
from tireroad.contact.tread.laws.elastic import HalfSpace
from tireroad.fem.static.footprint import Footprint
from tireroad.runs.scene.load import load
from tireroad.runs.scene.tables.contact import ContactTable

LOAD = 400.0  # N


def nodes(apart: float):
    """A ring of nodes `apart` (m) on a cylinder of 0.5 m over a road 1 mm inside it, which some of them touch."""
    x = apart * np.arange(-20, 21)
    x, y = (part.ravel() for part in np.meshgrid(x, x[10:-10], indexing="ij"))
    height = (x**2 + y**2) / 1.0 - 1e-3
    gap = np.maximum(height, 0.0)
    force = np.where(gap == 0, -height, 0.0)
    points = np.stack([x, y, gap], axis=-1)
    halves = np.full((len(x), 2), apart / 2)
    return make_patch(points, halves, LOAD * force / force.sum(), gap, (41, 21), 0.02)


@pytest.mark.parametrize(
    ("width", "speed", "apart", "expected"),
    [
        (0.0161, 15.9, 0.0057, 3.2e-3),  # a fifth of the width
        (0.13, 22.2, 0.0072, 4.6e-3),  # a twelfth of the shortest wave told, 22.2 m/s over 400 Hz
        (0.13, 0.0, 0.008, 2.6e-2),  # of a tire that stands
        (0.0161, 15.9, 0.012, 6.0e-3),  # half of what nodes are apart
    ],
)
def test_the_finest_of_what_is_needed_within_what_the_nodes_carry(
    width, speed, apart, expected
) -> None:
    footprint = Footprint(0.15, width, 0.1 * width)
    assert spacing(footprint, nodes(apart), speed, 400.0) == pytest.approx(expected, rel=1e-12)


def test_without_a_footprint_there_is_no_spacing() -> None:
    assert spacing(Footprint(0.0, 0.0, 0.0), nodes(0.01), 10.0, 400.0) is None


SCENE = """
[tire.material]
youngs_modulus = 48e6
[static]
load = 500.0
[contact]
points = "auto"
[road]
[time]
"""


@pytest.mark.parametrize(
    ("sets", "on_nodes"),
    [
        ([], False),
        (["contact.tread=none"], True),
        (["contact.brush_stiffness=1e5"], True),
        (["contact.brush_stiffness_per_area=1e9"], False),
        (["contact.points=nodes"], True),
        (["contact.points={ dx = 0.004, dy = 0.003 }"], False),
    ],
)
def test_points_stay_nodes_where_a_grid_cannot_be_or_means_something_else(
    tmp_path, sets, on_nodes
) -> None:
    """A tread that does not give way leaves a grid singular; a point's bristle has its stiffness on nodes."""
    (tmp_path / "scene.toml").write_text(SCENE)
    assert load(tmp_path / "scene.toml", sets).contact.on_nodes is on_nodes


@pytest.fixture
def wheel():
    """A setup on nodes of 5 mm, and its tire's response: 1 um/N of each node, 0.1 of all."""
    patch = nodes(0.005)
    rolled = Rolled(speed=10.0, duration=0.1)
    road = RoadUnderTire(Flat()).prepare(-1.0, 2.0, -1.0, 1.0)
    setup = ContactSetup(patch=patch, reach=0.02, road=road, rolled=rolled)
    p = len(patch.index)
    residual = 1e-6 * (np.eye(p) + 0.1)
    face = np.zeros(41 * 21)
    face[patch.index] = patch.force
    return setup, SimpleNamespace(static=lambda: 0.0, residual=residual, offset=None), face


def test_nodes_settle_on_their_tread(wheel) -> None:
    """f >= 0, g = g_0 + A (f - f_0) + C~ f + rise >= 0, f g = 0, the load kept: the static state had no tread."""
    setup, response, face = wheel
    patch, spec = setup.patch, ContactTable(law=HalfSpace(youngs_modulus=1e7))
    settled, rise = setup.equilibrated(response, face, spec)
    found = settled.patch
    assert found.force.sum() == pytest.approx(LOAD, rel=1e-7) and found.force.min() >= 0
    assert rise < -1e-4  # a tread that gives way lets the tire sink
    tread = spec.law.matrix(patch.points[:, :2], patch.half_sizes, 1.0)
    gap = patch.gap + response.residual @ (found.force - patch.force) + tread @ found.force + rise
    assert gap.min() > -1e-9 and found.gap == pytest.approx(np.maximum(gap, 0.0), abs=1e-9)
    assert not (found.force * found.gap).any()
    assert np.count_nonzero(found.force) > np.count_nonzero(patch.force)
    stiff, rise = setup.equilibrated(
        response, face, ContactTable(law=HalfSpace(youngs_modulus=1e13))
    )
    assert abs(rise) < 1e-4 and np.count_nonzero(stiff.patch.force) < np.count_nonzero(found.force)


def test_nodes_without_a_tread_have_their_static_state(wheel) -> None:
    setup, response, face = wheel
    settled, rise = setup.equilibrated(response, face, ContactTable(tread="none"))
    assert rise == 0.0 and all(map(is_, vars(settled.patch).values(), vars(setup.patch).values()))


def test_a_standing_wheel_meets_no_relief(wheel) -> None:
    """Its road stays in the run-in: heights were taken to vary the forces of too few points."""
    road = make_road(kind="sine", amplitude=1e-3, wavelength=0.1)
    found = []
    for speed in (0.0, 10.0):
        rolled = Rolled(speed=speed, duration=0.1)
        _, x1, y0, y1 = wheel[0].patch.extent
        strip = road.prepare(x1, x1 + rolled.travel, y0, y1)
        found.append(replace(wheel[0], rolled=rolled, road=strip).relief)
    assert found == [0.0, pytest.approx(2e-3)]
