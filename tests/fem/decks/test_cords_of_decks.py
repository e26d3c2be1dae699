"""Membranes with cords: where they lie, and at which angle."""

import numpy as np
import pytest
from good_decks import BELTED
from ring_decks import position
from torus_decks import (
    BELT,
    CENTRE,
    CORDS,
    HALF_ANGLE,
    MINOR,
    WALL,
    Torus,
    membranes,
    plain,
)


def depths(found, name):
    """Depth under the outer face and section angle of the nodes of a ply."""
    mesh = found.mesh
    nodes = mesh.nodes[mesh.chain(mesh.plies[name])] - [CENTRE, 0]
    return MINOR - np.hypot(*nodes.T), np.arctan2(nodes[:, 1], nodes[:, 0])


@pytest.mark.parametrize("fraction", [1 / 2, 5 / 6])
@pytest.mark.parametrize("quadratic", [False, True])
def test_embedded_inside_elements(own, fraction, quadratic):
    """A belt inside the one layer of elements, its nodes and ends not those of the hosts."""
    torus, depth = Torus(arcs=16, wall=1), fraction * WALL
    arcs = np.linspace(-BELT, BELT, 41)
    text = plain(torus) + membranes("BELT", depth, arcs, 9001, 9001, quadratic) + CORDS
    found = own(text)
    there, arc = depths(found, "BELT")
    sagitta = MINOR * (2 * BELT / 40) ** 2 / 8  # of the straight membranes
    # Quadratic hosts of 15 degrees are round to about 1e-8 m.
    assert there == pytest.approx(depth, abs=1e-7 if quadratic else 2 * sagitta)
    assert arc[[0, -1]] == pytest.approx([-BELT, BELT], abs=1e-9)
    # Ends at 45 degrees are sides of hosts already; the row is cut from bead to bead.
    assert len(found.mesh.cells) == 32
    assert np.degrees(found.plies[0].angle) == pytest.approx(-20)


def test_ends_inside_elements_and_two_in_a_row(own):
    """Belts of different width at two depths in one row of elements; their ends cut across."""
    torus = Torus(arcs=12, wall=1)
    text = plain(torus) + CORDS
    for name, depth, width, first in (("B1", 0.006, 0.75, 9001), ("B2", 0.002, 0.6, 9101)):
        text += membranes(name, depth, np.linspace(-width, width, 21), first, first, True)
    found = own(text)
    for name, depth, width in (("B1", 0.006, 0.75), ("B2", 0.002, 0.6)):
        there, arc = depths(found, name)
        # Quadratic hosts of 20 degrees are themselves 2e-6 m off the circle between their nodes.
        assert there == pytest.approx(depth, abs=5e-6)
        assert arc[[0, -1]] == pytest.approx([-width, width], abs=1e-6)
    assert len(found.mesh.cells) == 3 * (12 + 4)


@pytest.mark.parametrize("off", [-0.04, 0.04, 0.06])
def test_ends_near_a_side(own, off):
    """A belt that ends within a twentieth of an element of a side ends on it: no sliver is cut."""
    element = np.radians(15)
    width = 3 * element + off * element
    text = plain(Torus(arcs=16, wall=1)) + CORDS
    found = own(text + membranes("B", 0.006, np.linspace(-width, width, 31), 9001, 9001, True))
    cut = abs(off) > 0.05
    assert len(found.mesh.cells) == (36 if cut else 32)
    end = width if cut else 3 * element
    assert depths(found, "B")[1][[0, -1]] == pytest.approx([-end, end], abs=1e-6)


def test_on_sides_of_elements(own):
    """Membranes that share the solids' nodes: no cell is added."""
    torus = Torus(arcs=12, wall=2)
    row = [torus.label(2, j) for j in range(0, 25, 2)]
    text = plain(torus) + "*ELEMENT, TYPE=MGAX1, ELSET=PLY\n"
    text += "".join(
        f"{9001 + k}, {a}, {b}\n" for k, (a, b) in enumerate(zip(row, row[1:], strict=False))
    )
    text += "*MEMBRANE SECTION, ELSET=PLY, MATERIAL=RUBBER\n1.E-3\n*REBAR LAYER\n"
    found = own(text + "PLY, 4.21E-7, 1.E-3, , STEEL, 0.\n" + CORDS)
    assert len(found.mesh.cells) == 24
    assert np.degrees(found.plies[0].angle) == pytest.approx(90)
    assert depths(found, "PLY")[0] == pytest.approx(WALL / 2, abs=1e-4)
    assert any("MEMBRANE SECTION" in line for line in found.unused)


def belt_angle(own, arcs, angle, **torus):
    text = plain(Torus(arcs=12, wall=1, **torus)) + CORDS
    text += membranes("BELT", 0.006, arcs, 9001, 9001, True, angle)
    found = own(text, mirror=torus.get("half", False))
    return [np.degrees(ply.angle) for ply in found.plies], found


@pytest.mark.parametrize("angle", [70.0, -70.0, 110.0, 25.0])
def test_sense_of_angles(own, angle):
    """The same physical belt, its membranes numbered up or down, and its mirrored half."""
    up = np.linspace(-BELT, BELT, 21)
    (first,), _ = belt_angle(own, up, angle)
    (turned,), _ = belt_angle(own, up[::-1], -angle)
    (half,), found = belt_angle(own, np.linspace(0, BELT, 11), angle, half=True)
    assert first == pytest.approx(turned)
    assert first == pytest.approx(half)
    # From the picture: 70 degrees from the meridian towards e_theta, which is -x at the lowest point.
    direction = np.array([-np.sin(np.radians(angle)), np.cos(np.radians(angle))])  # (x, y)
    expected = np.degrees(np.arctan(direction[1] / direction[0]))
    assert first == pytest.approx(expected)
    assert depths(found, "BELT")[1][[0, -1]] == pytest.approx([-BELT, BELT])


def test_mirrored_pieces_continue_the_line(own):
    """A belt with a gap at the centre: both pieces of the mirrored tire have the same angle towards +y."""
    angles, _ = belt_angle(own, np.linspace(0.2, BELT, 11), 70.0, half=True)
    assert angles == pytest.approx([-20, -20])


def test_three_dimensional_membranes(own):
    """SFM3D4R about each axis: angles of the cylindrical system and of the default one agree with 2-D.

    The cord is laid down as a vector: at the lowest point, with the axle's direction y, it must be the
    same line as that of the section's ply.
    """
    from ring_decks import around, solids

    torus = Torus(False, arcs=8, wall=2)
    angles = np.linspace(0, 2 * np.pi, 9)[:-1]
    for axis, orientation, angle in (
        ("x", "", 70.0),
        ("y", "ORI", 20.0),
        ("z", "ORI", 20.0),
    ):
        text = solids(torus, angles, axis) + around(torus, "SFM3D4R", "BELT")
        ends = {"x": "1,0,0", "y": "0,1,0", "z": "0,0,1"}[axis]
        option = f", ORIENTATION={orientation}" if orientation else ""
        text += f"*ORIENTATION, NAME=ORI, SYSTEM=CYLINDRICAL\n0,0,0,{ends}\n1, 0.\n"
        text += f"*SURFACE SECTION, ELSET=BELT\n*REBAR LAYER{option}\nBELT, 2.E-7, 1.E-3, 0., STEEL, {angle}\n"
        found = own(text + CORDS)
        (ply,) = found.plies
        assert np.degrees(ply.angle) == pytest.approx(_by_vectors(axis, bool(orientation), angle))
        assert len(ply.sides) == 4


def _by_vectors(axis, cylindrical, angle):
    """Angle from -e_theta towards the axis, by vectors at a point of the crown."""
    a = np.radians(angle)
    e_axis = position(0, 1, 0, axis)
    e_r = position(1, 0, 0, axis)
    e_theta = np.cross(e_axis, e_r)
    normal = np.cross(e_axis, e_theta)  # corners go along the axis first, then around
    first = e_theta if cylindrical else e_axis
    cord = np.cos(a) * first + np.sin(a) * np.cross(normal, first)
    return np.degrees(np.arctan((cord @ e_axis) / (cord @ -e_theta)))


def test_lifted_and_angular_layers(own):
    """A radial ply by angular spacing, and one lifted from the drum, element by element at its radius."""
    text = plain(Torus(arcs=12, wall=1)) + CORDS
    arcs = np.linspace(-HALF_ANGLE, HALF_ANGLE, 49)
    ply = membranes("PLY", 0.006, arcs, 9001, 9001, True, 0.0)
    angular = ply.replace("*REBAR LAYER", "*REBAR LAYER, GEOMETRY=ANGULAR").replace(
        "1.16E-3", "0.3"
    )
    found = own(text + angular)
    for one in found.plies:
        r = found.mesh.nodes[found.mesh.chain(one.sides)][[0, -1], 0].mean()
        assert one.spacing == pytest.approx(r * np.radians(0.3))
    lifted = ply.replace("*REBAR LAYER", "*REBAR LAYER, GEOMETRY=LIFT EQUATION").replace(
        "STEEL, 0.0", "STEEL, 30., 1, 0.02, 0.25"
    )
    found = own(text + lifted)
    for one in found.plies:
        r = found.mesh.nodes[found.mesh.chain(one.sides)][[0, -1], 0].mean()
        cosine = r / (0.25 * 1.02) * np.cos(np.radians(60))
        assert np.cos(one.angle) == pytest.approx(cosine)
        ratio = np.sin(np.arccos(cosine)) / np.sin(np.radians(60))
        assert one.spacing == pytest.approx(1.16e-3 * r / 0.25 * ratio)


def test_materials_of_cords(own):
    """Young's modulus of hyperelastic and of measured cords, and cords without compression."""
    belt = plain(Torus(arcs=12, wall=1)) + membranes(
        "B", 0.006, np.linspace(-0.5, 0.5, 9), 9001, 9001
    )
    cases = {
        "*ELASTIC\n172.2E9, 0.3\n*DENSITY\n7800.\n*NO COMPRESSION\n": (172.2e9, 7800.0, 0.01),
        "*HYPERELASTIC, NEO HOOKE\n1.E8\n": (6e8, 0.0, 1.0),
        "*HYPERELASTIC, MARLOW\n*UNIAXIAL TEST DATA\n0., 0.\n5.E7, 0.01\n2.E8, 0.02\n": (
            5e9,
            0.0,
            1.0,
        ),
    }
    for text, (modulus, density, compression) in cases.items():
        (ply,) = own(belt + "*MATERIAL, NAME=STEEL\n" + text).plies
        assert ply.youngs_modulus == pytest.approx(modulus)
        assert (ply.density, ply.compression) == (density, compression)


@pytest.mark.parametrize(
    ("section", "added"),
    [
        ("*SURFACE SECTION, ELSET=BELT, DENSITY=0.9\n", 0.9),
        ("*MEMBRANE SECTION, ELSET=BELT, MATERIAL=SKIM\n0.0005\n", 0.5),
    ],
)
def test_the_mass_of_the_membrane_itself_counts(own, section, added):
    """Per area, kg/m2, beside that of its cords: A rho / s."""
    plain_deck = BELTED + "*MATERIAL, NAME=SKIM\n*ELASTIC\n6.0E6, 0.45\n*DENSITY\n1000.\n"
    heavy = plain_deck.replace("*SURFACE SECTION, ELSET=BELT\n", section)
    assert heavy != plain_deck
    one, other = (own(deck).plies for deck in (plain_deck, heavy))
    for light, loaded in zip(one, other, strict=True):
        per_area = [ply.density * ply.area / ply.spacing for ply in (light, loaded)]
        assert per_area[1] - per_area[0] == pytest.approx(added, rel=1e-9)
