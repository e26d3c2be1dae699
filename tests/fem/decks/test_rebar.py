"""Cords of *REBAR, the old form, and of shells: the same tire as from membranes where they lie."""

import numpy as np
import pytest
from test_cords_of_decks import _by_vectors, depths
from torus_decks import CORDS, HALF_ANGLE, RUBBER, WALL, Torus, membranes, plain

from tireroad.fem.decks import embedding

AREA, SPACING = 2.118e-7, 1.16e-3
NUMBERS = f"{AREA}, {SPACING}"


def lines(torus, i, kind, name, first=9001):
    """Elements along the nodes at half step i of the wall's depth, from bead to bead."""
    row = [torus.label(i, j) for j in range(0, len(torus.arc), 2)]
    middle = [torus.label(i, j) for j in range(1, len(torus.arc), 2)]
    text = f"*ELEMENT, TYPE={kind}, ELSET={name}\n"
    for k, ends in enumerate(zip(row, row[1:], strict=False)):
        nodes = (ends[0], middle[k], ends[1]) if kind == "SAX2" else ends
        text += f"{first + k}, " + ", ".join(map(str, nodes)) + "\n"
    return text


def every_form() -> str:
    """A deck with cords in membranes, shells and solids, of sets and element by element."""
    torus = Torus(False, arcs=8, wall=2)
    text = plain(torus, "CGAX4") + CORDS + lines(torus, 2, "MGAX1", "PLY")
    text += (
        lines(torus, 0, "SAX1", "SKIN", 9101)
        + "*SHELL SECTION, ELSET=SKIN, MATERIAL=RUBBER\n5.E-4\n"
    )
    text += f"*REBAR LAYER\nS, {NUMBERS}, -0.003, STEEL, 70.\n"
    text += "*MEMBRANE SECTION, ELSET=PLY, MATERIAL=RUBBER\n1.E-3\n"
    for element in (9001, 9002):
        text += "*REBAR, ELEMENT=AXIMEMBRANE, MATERIAL=STEEL, GEOM=SKEW, NAME=M\n"
        text += f"{element}, {NUMBERS}, 0., 0.25\n"
    text += f"*REBAR, ELEMENT=CONTINUUM, MATERIAL=STEEL, NAME=C\n12, {NUMBERS}, 70., 0.4, 4\n"
    text += "*REBAR, ELEMENT=CONTINUUM, MATERIAL=STEEL, GEOMETRY=SKEW, NAME=D\n"
    return text + f"13, {NUMBERS}, 70.\n0.4, 0., 0.5, 0.\n"


def ply(found, name):
    """Angle in degrees, spacing, area and density of a ply."""
    (one,) = (one for one in found.plies if one.name == name)
    return np.degrees(one.angle), one.spacing, one.area, one.density


def test_all_forms_in_one_deck(own):
    """Lines of cords meet in one tire; the two solids, one by one, are one line."""
    found = own(every_form())
    names = [one.name.partition(" ")[0] for one in found.plies]
    assert set(names) == {"S", "M", "C", "D"}


@pytest.mark.parametrize("rounding", [1e-9, -1e-9])
def test_a_line_that_ends_on_a_side_belongs_to_the_cell_that_it_runs_through(
    own, monkeypatch, rounding
) -> None:
    """Which of both cells the end was in was rounding; in the one beyond, at an angle of 30 degrees, it was cut lengthwise."""
    locate = embedding.locate
    monkeypatch.setattr(embedding, "locate", lambda quads, at: locate(quads, at + [0.0, rounding]))
    names = {one.name.partition(" ")[0] for one in own(every_form()).plies}
    assert names == {"S", "M", "C", "D"}


@pytest.mark.parametrize("angle", [70.0, -70.0, 25.0])
def test_in_membranes(own, angle):
    """*REBAR, ELEMENT=AXIMEMBRANE is the *REBAR LAYER of the same membranes."""
    torus = Torus(arcs=12, wall=2)
    text = plain(torus) + CORDS + lines(torus, 2, "MGAX1", "PLY")
    new = own(f"{text}*SURFACE SECTION, ELSET=PLY\n*REBAR LAYER\nP, {NUMBERS}, , STEEL, {angle}\n")
    old = own(
        f"{text}*REBAR, ELEMENT=AXIMEMBRANE, MATERIAL=STEEL, GEOM=SKEW, NAME=P\nPLY, {NUMBERS}, {angle}\n"
    )
    assert ply(old, "P") == pytest.approx(ply(new, "P"))
    assert depths(old, "P")[0] == pytest.approx(depths(new, "P")[0])


@pytest.mark.parametrize("inside", [False, True])
def test_element_by_element(own, inside):
    """Lifted cords as preprocessors write them: a *REBAR for each element, each with its own spacing."""
    torus = Torus(arcs=12, wall=1 if inside else 2)
    count = len(torus.arc) // 2 * (2 if inside else 1)
    spacing = SPACING * (1 + 0.01 * np.arange(count))
    if inside:
        arcs = np.linspace(-HALF_ANGLE, HALF_ANGLE, count + 1)
        text = membranes("PLY", 0.005, arcs, 9001, 9001).partition("*SURFACE SECTION")[0]
    else:
        text = lines(torus, 2, "MGAX1", "PLY")
    text = plain(torus) + CORDS + text + "*MEMBRANE SECTION, ELSET=PLY, MATERIAL=RUBBER\n1.E-3\n"
    for k, one in enumerate(spacing):
        text += f"*REBAR, ELEMENT=AXIMEMBRANE, MATERIAL=STEEL, GEOM=SKEW, NAME=C_{9001 + k}\n"
        text += f"{9001 + k}, {AREA}, {one:.6e}, 0.\n"
    found = own(text)
    assert (
        len(found.mesh.cells) == 24
    )  # a line inside elements halves each, and its pieces no further
    assert len(found.plies) == count if not inside else len(found.plies) == 12
    for one in found.plies:
        number = int(one.name.split("_")[1]) - 9001
        assert one.spacing == pytest.approx(spacing[number], rel=1e-5)
        assert np.degrees(one.angle) == pytest.approx(90)
        assert one.density * one.area / one.spacing == pytest.approx(1.2)  # the membrane's own mass
        arc = depths(found, one.name)[1].mean()
        there = -HALF_ANGLE + (number + 0.5) * 2 * HALF_ANGLE / count
        assert arc == pytest.approx(there, abs=HALF_ANGLE / count + 1e-9)


@pytest.mark.parametrize("kind", ["SAX1", "SAX2"])
@pytest.mark.parametrize("new", [False, True])
def test_in_axisymmetric_shells(own, kind, new):
    """Shells on the inner face, cords at a distance: inside the wall, at their angle, with the shell's mass."""
    torus = Torus(arcs=24, wall=1)
    text = plain(torus) + CORDS + lines(torus, 0, kind, "SKIN")
    text += "*SHELL SECTION, ELSET=SKIN, MATERIAL=RUBBER\n5.E-4, 5\n"
    # Upwards along the section the normal, t turned by 90 degrees, points inwards.
    if new:
        text += f"*REBAR LAYER\nC, {NUMBERS}, -0.004, STEEL, 70.\n"
    else:
        text += f"*REBAR, ELEMENT=AXISHELL, MATERIAL=STEEL, NAME=C\nSKIN, {NUMBERS}, -0.004, 70.\n"
    found = own(text)
    there, arc = depths(found, "C")
    assert there == pytest.approx(WALL - 0.004, abs=4e-4 if kind == "SAX1" else 2e-5)
    assert arc[[0, -1]] == pytest.approx([-HALF_ANGLE, HALF_ANGLE], abs=1e-3)
    angle, spacing, area, density = ply(found, "C")
    assert angle == pytest.approx(-20)
    assert density * area / spacing == pytest.approx(1200 * 5e-4)
    assert any("SHELL SECTION: its cords and its mass" in line for line in found.unused)


@pytest.mark.parametrize("new", [False, True])
def test_a_shell_whose_nodes_are_on_its_outer_side(own, new):
    """OFFSET=SPOS: the middle lies half a thickness against the normal of the nodes."""
    torus = Torus(arcs=24, wall=1)
    text = plain(torus) + CORDS + lines(torus, 0, "SAX2", "SKIN")
    text += "*SHELL SECTION, ELSET=SKIN, MATERIAL=RUBBER, OFFSET=SPOS\n2.E-3, 5\n"
    if new:
        text += f"*REBAR LAYER\nC, {NUMBERS}, -0.003, STEEL, 70.\n"
    else:
        text += f"*REBAR, ELEMENT=AXISHELL, MATERIAL=STEEL, NAME=C\nSKIN, {NUMBERS}, -0.003, 70.\n"
    assert depths(own(text), "C")[0] == pytest.approx(WALL - 0.004, abs=2e-5)


def test_in_the_middle_of_shells(own):
    """Cords at the middle of shells that share the solids' nodes lie on those nodes."""
    torus = Torus(arcs=12, wall=2)
    text = plain(torus) + CORDS + lines(torus, 2, "SAX1", "SKIN")
    text += f"*SHELL SECTION, ELSET=SKIN\n1.E-3\n*REBAR LAYER\nC, {NUMBERS}, 0., STEEL, 70.\n"
    found = own(text)
    assert len(found.mesh.cells) == 24
    assert depths(found, "C")[0] == pytest.approx(WALL / 2, abs=1e-4)
    assert ply(found, "C")[0] == pytest.approx(-20)


# Data behind area and spacing, and the second line: edge 4 is on the inner face, edge 2 on the outer.
SOLIDS = {
    "ISOPARAMETRIC, from the inner face": ("70., 0.25, 4", ""),
    "ISOPARAMETRIC, from the outer face": ("70., 0.75, 2, 1", ""),
    "SKEW, across": ("70.", "0.25, 0., 0.75, 0.\n"),
}


@pytest.mark.parametrize("form", SOLIDS)
@pytest.mark.parametrize("quadratic", [False, True])
def test_in_solids(own, form, quadratic):
    """The cords of solids lie where an embedded line of membranes has them, at the same angle."""
    torus = Torus(quadratic, arcs=24, wall=1)
    kind = "CGAX8H" if quadratic else "CGAX4"
    numbers, second = SOLIDS[form]
    geometry = form.partition(",")[0]
    wall = [n for n, _ in torus.cells()]
    belt = wall[6:18]  # 60 degrees to both sides
    text = plain(torus, kind) + CORDS + "*ELSET, ELSET=BELT\n" + ", ".join(map(str, belt)) + "\n"
    text += f"*REBAR, ELEMENT=CONTINUUM, MATERIAL=STEEL, GEOMETRY={geometry}, NAME=C\n"
    found = own(text + f"BELT, {NUMBERS}, {numbers}\n" + second)
    there, arc = depths(found, "C")
    assert there == pytest.approx(0.75 * WALL, abs=1e-5 if quadratic else 5e-4)
    assert arc[[0, -1]] == pytest.approx([-HALF_ANGLE / 2, HALF_ANGLE / 2], abs=1e-6)
    assert ply(found, "C")[0] == pytest.approx(-20)
    assert len(found.mesh.cells) == 48  # the row is cut from bead to bead


def test_a_slanted_layer_in_solids_ends_where_its_fractions_say(own):
    """Skew cords through one element after another at growing depth are one line."""
    torus = Torus(False, arcs=24, wall=1)
    text = plain(torus, "CGAX4") + CORDS
    depth = np.linspace(
        0.2, 0.8, 13
    )  # of the wall from the inner face, at the sides of 12 elements
    for k in range(12):
        text += "*REBAR, ELEMENT=CONTINUUM, MATERIAL=STEEL, GEOMETRY=SKEW, NAME=C\n"
        text += f"{7 + k}, {NUMBERS}, 70.\n{depth[k]:.6f}, 0., {1 - depth[k + 1]:.6f}, 0.\n"
    found = own(text)
    assert len(found.mesh.cells) == 48 and len(found.plies) == 12
    for k, one in enumerate(found.plies):
        there, _ = depths(found, one.name)
        assert np.sort(there[[0, -1]])[::-1] == pytest.approx(
            WALL * (1 - depth[k : k + 2]), abs=6e-4
        )


def test_as_many_cords_at_every_radius(own):
    """A radius as last number: the spacing grows with r."""
    torus = Torus(arcs=12, wall=2)
    text = plain(torus) + CORDS + lines(torus, 2, "MGAX1", "PLY")
    text += f"*REBAR, ELEMENT=AXIMEMBRANE, MATERIAL=STEEL, NAME=P\nPLY, {NUMBERS}, 0., 0.25\n"
    found = own(text)
    for one in found.plies:
        r = found.mesh.nodes[found.mesh.chain(one.sides)][[0, -1], 0].mean()
        assert one.spacing == pytest.approx(SPACING * r / 0.25)


def test_the_mass_of_a_membrane_is_carried_once(own):
    """Two *REBAR in one membrane section."""
    torus = Torus(arcs=12, wall=2)
    text = plain(torus) + CORDS + lines(torus, 2, "MGAX1", "PLY")
    text += "*MEMBRANE SECTION, ELSET=PLY, MATERIAL=RUBBER\n1.E-3\n"
    for name, angle in (("A", 70.0), ("B", -70.0)):
        text += (
            f"*REBAR, ELEMENT=AXIMEMBRANE, MATERIAL=STEEL, NAME={name}\nPLY, {NUMBERS}, {angle}\n"
        )
    found = own(text)
    masses = [one.density * one.area / one.spacing for one in found.plies]
    assert masses == pytest.approx([1.2, 0.0])


@pytest.mark.parametrize("shells", [False, True])
def test_around_the_axle(own, shells):
    """Skew and isoparametric *REBAR in three dimensions: membranes and shells, in their middle and beside it."""
    from ring_decks import around, solids

    torus = Torus(False, arcs=8, wall=2)
    angles = np.linspace(0, 2 * np.pi, 9)[:-1]
    text = solids(torus, angles, "y") + CORDS
    text += around(torus, "S4R" if shells else "M3D4R", "BELT")
    text += "*ORIENTATION, NAME=ORI, SYSTEM=CYLINDRICAL\n0,0,0,0,1,0\n1, 0.\n"
    element, middle = ("SHELL", ", 0.") if shells else ("MEMBRANE", "")
    head = f"*REBAR, ELEMENT={element}, MATERIAL=STEEL, NAME="
    text += f"{head}A, GEOMETRY=SKEW, ORIENTATION=ORI\nBELT, {NUMBERS}{middle}, 20.\n"
    text += f"{head}B\nBELT, {NUMBERS}{middle}, 1\n"
    text += f"{head}C\nBELT, {NUMBERS}{middle}, 2\n"
    found = own(text)
    assert ply(found, "A")[0] == pytest.approx(_by_vectors("y", True, 20.0))
    assert ply(found, "B")[0] == pytest.approx(90)  # edge 1 is along the meridian
    assert ply(found, "C")[0] == pytest.approx(0)
    if shells:
        beside = text + f"{head}D\nBELT, {NUMBERS}, -0.002, 2\n"
        apart = depths(own(beside), "D")[0].mean() - depths(found, "C")[0].mean()
        assert abs(apart) == pytest.approx(0.002, rel=0.1)


def test_shells_without_cords_are_no_part_of_the_tire(own):
    """A rim of axisymmetric shells below the bead, and surfaces on it."""
    torus = Torus(arcs=12, wall=2)
    text = plain(torus) + "*NODE\n99001, 0.1, -0.1\n99002, 0.1, 0.1\n"
    text += "*ELEMENT, TYPE=SAX1, ELSET=WHEEL\n99001, 99001, 99002\n*SURFACE, NAME=W\nWHEEL, SPOS\n"
    text += "*SHELL SECTION, ELSET=WHEEL, MATERIAL=RUBBER\n1.E-3\n"
    found, alone = own(text), own(plain(torus))
    assert np.array_equal(found.mesh.nodes, alone.mesh.nodes)
    assert any("TYPE=SAX1: not used" in line for line in found.unused)
    assert any("SHELL SECTION: not used" in line for line in found.unused)


def test_cords_that_leave_the_wall_are_refused(own):
    """A distance to the wrong side of the inner face."""
    torus = Torus(arcs=24, wall=1)
    text = plain(torus) + CORDS + lines(torus, 0, "SAX1", "SKIN")
    text += f"*REBAR, ELEMENT=AXISHELL, MATERIAL=STEEL, NAME=C\nSKIN, {NUMBERS}, 0.004, 70.\n"
    with pytest.raises(Exception, match="cords C: .*outside the wall"):
        own(text)


def test_triangles_with_rebar_are_refused(own):
    torus = Torus(True, arcs=12, wall=1, triangles=True)
    text = plain(torus, "CGAX6H", RUBBER) + CORDS
    text += f"*REBAR, ELEMENT=CONTINUUM, MATERIAL=STEEL, NAME=C\nWALL, {NUMBERS}, 0., 0.5, 1\n"
    with pytest.raises(Exception, match="axisymmetric quadrilaterals"):
        own(text)


def test_a_rebar_for_each_of_very_many_elements_is_refused(own):
    torus = Torus(arcs=12, wall=2)
    text = plain(torus) + CORDS + "*REBAR, ELEMENT=AXIMEMBRANE, MATERIAL=STEEL, NAME=C\n"
    text += "".join(f"{n}, {NUMBERS}, 0.\n" for n in range(1, 5002))
    with pytest.raises(Exception, match="more than 5000 elements"):
        own(text)
