"""A deck that makes its nodes and elements from others is the deck that spells them out."""

import numpy as np
import pytest
from torus_decks import CENTRE, RUBBER, Torus, listed, place, plain

from tireroad.fem.decks import abaqus, abaqus_generation
from tireroad.fem.errors import InputError

BASE = "*HEADING\n"


@pytest.fixture
def deck(tmp_path):
    """The deck of a text."""

    def read(text):
        (tmp_path / "deck.inp").write_text(text)
        return abaqus.read(tmp_path / "deck.inp")

    return read


def elements(deck):
    """{label: nodes}."""
    return {
        label: tuple(nodes)
        for block in deck.blocks
        for label, nodes in zip(block.labels.tolist(), block.nodes.tolist(), strict=True)
    }


def same(made, spelt):
    """Nodes, elements and sets of two decks."""
    assert made.labels.tolist() == spelt.labels.tolist()
    np.testing.assert_allclose(made.points, spelt.points, atol=1e-13)
    assert elements(made) == elements(spelt)
    for sets in ("node_sets", "element_sets"):
        for name in getattr(spelt, sets).names:
            found, wanted = (getattr(one, sets).labels(name).tolist() for one in (made, spelt))
            assert found == wanted, name


def generated(torus: Torus, kind: str) -> str:
    """`plain` without a list: arcs by *NGEN, the wall by *NFILL, elements by *ELGEN."""
    step = 1 if torus.quadratic else 2
    rows, last = len(torus.depth), len(torus.arc) - 1
    corners = [(i, j, place(torus.arc[j], torus.depth[i])) for i in (0, -1) for j in (0, last)]
    text = "*NODE\n" + "".join(
        f"{torus.label(i % rows, j)}, {r:.16g}, {z:.16g}\n" for i, j, (r, z) in corners
    )
    for name, i in (("INSIDE", 0), ("OUTSIDE", rows - 1)):
        text += f"*NGEN, LINE=C, NSET={name}\n{torus.label(i, 0)}, {torus.label(i, last)}, {step}, , {CENTRE}, 0., 0., 0., 0., 1.\n"
    text += f"*NFILL, NSET=ALL\nINSIDE, OUTSIDE, {(rows - 1) // step}, {1000 * step}\n"
    first = next(torus.cells())
    text += f"*ELEMENT, TYPE={kind}\n" + ", ".join(map(str, [first[0], *first[1]])) + "\n"
    text += f"*ELGEN, ELSET=WALL\n1, {last // 2}, 2, 1, {(rows - 1) // 2}, 2000, {last // 2}\n"
    text += "*NSET, NSET=RIMNODES\n" + listed(torus.ends())
    return text + "*SOLID SECTION, ELSET=WALL, MATERIAL=RUBBER\n" + RUBBER


@pytest.mark.parametrize(("kind", "quadratic"), [("CAX4", False), ("CGAX8H", True)])
def test_a_generated_tire_is_the_tire(own, kind, quadratic):
    torus = Torus(quadratic, arcs=10)
    faces = {"inner": "INSIDE", "tread": "OUTSIDE"}
    made = own(generated(torus, kind), **faces).mesh
    spelt = own(plain(torus, kind), **faces).mesh
    np.testing.assert_allclose(made.nodes, spelt.nodes, atol=1e-13)
    assert made.cells.tolist() == spelt.cells.tolist()
    assert made.inner.tolist() == spelt.inner.tolist()
    assert made.outer.tolist() == spelt.outer.tolist()


def test_straight_lines_up_and_down_and_small_arcs(deck):
    """*NGEN through labels that fall; an arc of less than 180 degrees about a node needs no normal."""
    made = deck(
        BASE + "*NODE\n1, 0., 0., 0.\n7, 3., 0., 6.\n*NGEN, NSET=LINE\n7, 1, 2\n"
        "*NODE\n20, 5., 5.\n21, 6., 5.\n23, 5., 6.\n*NGEN, LINE=C\n21, 23, 1, 20\n"
    )
    half = np.sqrt(0.5)
    spelt = deck(
        BASE + "*NODE, NSET=LINE\n1, 0., 0., 0.\n3, 1., 0., 2.\n5, 2., 0., 4.\n7, 3., 0., 6.\n"
        f"*NODE\n20, 5., 5.\n21, 6., 5.\n22, {5 + half:.16g}, {5 + half:.16g}\n23, 5., 6.\n"
    )
    same(made, spelt)


def test_a_bias_is_the_ratio_of_neighbouring_intervals(deck):
    """0.5: each interval is twice the one before it; with TWO STEP every two of them, in equal halves."""
    ends = BASE + "*NODE, NSET=A\n1, 0.\n*NODE, NSET=B\n101, 7.\n"
    made = deck(ends + "*NFILL, BIAS=0.5\nA, B, 3, 10\n")
    assert made.points[:, 0] == pytest.approx([0, 1, 3, 7])
    assert made.labels.tolist() == [1, 11, 21, 101]
    made = deck(ends + "*NFILL, BIAS=0.5, TWO STEP\nA, B, 6, 10\n")
    assert made.points[:, 0] == pytest.approx([0, 0.5, 1, 2, 3, 5, 7])


def test_an_unsorted_set_keeps_its_order(deck):
    """The nodes of two bounds belong together in the order of the sets, or by ascending labels."""
    text = BASE + "*NODE, NSET=A\n1, 0., 0.\n2, 0., 1.\n*NODE\n101, 2., 0.\n102, 2., 1.\n"
    text += "*NSET, NSET=B{}\n102, 101\n*NFILL\nA, B, 2, 50\n"
    straight, crossed = deck(text.format("")), deck(text.format(", UNSORTED"))
    assert straight.points[2:4, :2].tolist() == [[1, 0], [1, 1]]
    assert crossed.points[2:4, :2].tolist() == [[1, 0.5], [1, 0.5]]


@pytest.mark.parametrize(
    ("options", "data", "wanted"),
    [
        ("SHIFT", "1., 2., 3.\n", [2, 4, 6]),
        ("SHIFT", ",,\n0., 0., 0., 0., 0., 2., 90.\n", [-2, 1, 3]),
        ("SHIFT, MULTIPLE=2", "1., 0., 0.\n0., 0., 0., 0., 0., 2., 45.\n", [-2, 2, 3]),
        ("REFLECT=POINT", "0., 0., 1.\n", [-1, -2, -1]),
        ("REFLECT=LINE", "0., 0., 0., 0., 5., 0.\n", [-1, 2, -3]),
        ("REFLECT=MIRROR", "0., 0., 1., 1., 0., 1.\n0., 1., 1.\n", [1, 2, -1]),
    ],
)
def test_copies_of_nodes(deck, options, data, wanted):
    text = BASE + "*NODE, NSET=OLD\n1, 1., 2., 3.\n"
    made = deck(text + f"*NCOPY, CHANGE NUMBER=10, OLD SET=OLD, NEW SET=NEW, {options}\n" + data)
    assert made.labels.tolist() == [1, 11]
    assert made.points[1] == pytest.approx(wanted)
    assert made.node_sets.labels("new").tolist() == [11]


def test_copies_of_elements(deck):
    """Shifted ones have their nodes' order, mirrored ones run round the other way; three layers of rows."""
    text = BASE + "*NODE\n1, 0., 0.\n2, 1., 0.\n3, 1., 1.\n4, 0., 1.\n"
    text += "*ELEMENT, TYPE=CAX4, ELSET=OLD\n1, 1, 2, 3, 4\n"
    made = deck(
        text + "*ELCOPY, ELEMENT SHIFT=5, OLD SET=OLD, SHIFT NODES=100, NEW SET=MORE\n"
        "*ELCOPY, ELEMENT SHIFT=7, OLD SET=OLD, SHIFT NODES=200, REFLECT\n"
    )
    assert elements(made) == {1: (1, 2, 3, 4), 6: (101, 102, 103, 104), 8: (201, 204, 203, 202)}
    assert made.element_sets.labels("MORE").tolist() == [6]
    layers = deck(text + "*ELGEN, ELSET=ALL\n1, 2, 10, 1, 2, 100, 10, 3, 1000, 100\n")
    wanted = {
        1 + i + 10 * j + 100 * k: tuple(n + 10 * i + 100 * j + 1000 * k for n in (1, 2, 3, 4))
        for i in range(2)
        for j in range(2)
        for k in range(3)
    }
    assert elements(layers) == wanted
    assert layers.element_sets.labels("ALL").tolist() == sorted(wanted)


def test_a_set_of_the_nodes_of_elements(deck):
    text = BASE + "*NODE\n1, 0., 0.\n2, 1., 0.\n3, 1., 1.\n4, 0., 1.\n5, 9., 9.\n"
    text += "*ELEMENT, TYPE=CAX4, ELSET=E\n1, 1, 2, 3, 4\n*NSET, NSET=N, ELSET=E\n"
    assert deck(text).node_sets.labels("N").tolist() == [1, 2, 3, 4]


def test_elements_of_a_type_that_is_not_used_may_be_generated(deck):
    """A road of shells beside the tire."""
    text = BASE + "*NODE\n1, 0., 0.\n*ELEMENT, TYPE=S4R, ELSET=ROAD\n1, 1, 2, 3, 4\n"
    made = deck(text + "*ELGEN, ELSET=ROAD\n1, 5, 1, 1\n")
    assert not elements(made) and "ROAD" in made.element_sets


TWO = "*NODE, NSET=A\n1, 0., 0.\n5, 1., 0.\n*ELEMENT, TYPE=CAX4, ELSET=E\n1, 1, 5, 7, 8\n"
BAD = {
    "*NGEN\n1, 6\n": r"line 7: node 6 is not defined before this line",
    "*NGEN\n1, 5, 3\n": r"line 7: .*steps of 3: no whole number",
    "*NGEN\n1\n": r"line 7: .*two end nodes",
    "*NGEN, LINE=P\n1, 5, 1\n": r"line 6: .*LINE=P is not read",
    "*NGEN, LINE=C\n1, 5, 1, , 3., 0.\n": r"line 7: .*not equally far",
    "*NGEN, LINE=C\n1, 5, 1, , 0.5, 0.\n": r"line 7: .*needs its normal",
    "*NFILL\nA, B, 2, 1\n": r"line 7: there is no node set B",
    "*NFILL, BIAS=0.\nA, A, 2, 1\n": r"line 6: .*BIAS=0 must be > 0",
    "*NFILL, BIAS=1e-9\nA, A, 99, 1\n": r"line 7: .*beyond any number",
    "*NFILL, TWO STEP\nA, A, 3, 1\n": r"line 7: .*3 intervals with TWO STEP",
    "*NFILL, SINGULAR=1\nA, A, 2, 1\n": r"line 6: .*SINGULAR is not read",
    "*NCOPY, OLD SET=A, SHIFT\n1., 0., 0.\n": r"line 6: .*CHANGE NUMBER=",
    "*NCOPY, CHANGE NUMBER=9, OLD SET=A, POLE\n1\n": r"line 6: .*POLE is not read",
    "*NCOPY, CHANGE NUMBER=9, OLD SET=A\n1\n": r"line 6: .*SHIFT or REFLECT",
    "*NCOPY, CHANGE NUMBER=9, OLD SET=A, REFLECT=LINE\n0.,0.,0.,0.,0.,0.\n": r"no line or plane",
    "*ELGEN\n2, 3, 1, 1\n": r"line 7: element 2 is not defined before this line",
    "*ELGEN\n1\n": r"line 7: .*needs an element",
    "*ELGEN\n1, 100000, 1, 1, 100000, 1, 1\n": r"line 7: more than 10000000 nodes and elements",
    "*ELGEN\n1, 3, 1, 1\n*ELEMENT, TYPE=CAX4\n3, 1, 5, 7, 8\n": r"line 8: element 3 is defined twice",
    "*ELCOPY, OLD SET=E, SHIFT NODES=1\n": r"line 6: .*ELEMENT SHIFT=",
    "*NMAP, NSET=A, TYPE=CYLINDRICAL\n0., 0., 0.\n": r"line 6: \*NMAP is not read",
    "*IMPERFECTION, SYSTEM=R\n1, 0.01, 0.\n": r"line 6: \*IMPERFECTION is not read",
    "*SYSTEM\n1., 0., 0., 1., 0., 0.\n": r"line 6: \*SYSTEM: its points give no axes",
    "*REBAR, ELEMENT=CONTINUUM, MATERIAL=M\nE, 1., 1.\n": r"line 7: .*edge 0 is not one of 1 to 4",
    "*REBAR, ELEMENT=CONTINUUM, MATERIAL=M\nE, 1., 1., 0., 1.5, 2\n": r"line 7: 1.5 of the way across",
    "*REBAR, ELEMENT=CONTINUUM, MATERIAL=M, GEOMETRY=SKEW\nE, 1., 1.\n0.5\n": r"line 7: .*two fractions",
    "*REBAR, ELEMENT=CONTINUUM, MATERIAL=M, GEOMETRY=SKEW\nE, 1., 1.\n": r"line 7: .*a second line",
    "*REBAR, ELEMENT=CONTINUUM, MATERIAL=M, SINGLE\nE, 1., 0.5, 0.5\n": r"line 6: \*REBAR, SINGLE",
    "*REBAR, ELEMENT=BEAM, MATERIAL=M\nE, 1., 0.5, 0.5\n": r"line 6: .*ELEMENT=BEAM",
    "*REBAR, ELEMENT=AXISHELL\nE, 1., 1.\n": r"line 6: .*without MATERIAL=",
    "*REBAR, ELEMENT=AXISHELL, MATERIAL=M\nE\n": r"line 7: .*cut short",
    "*REBAR, ELEMENT=AXISHELL, MATERIAL=M, NAME=N\nE, -1.\n": r"line 7: .*layer N: area and spacing",
    "*REBAR, ELEMENT=AXISHELL, MATERIAL=M\nF, 1., 1., 0.1\n": r"line 7: there is no element set F",
    "*SHELL SECTION\n*REBAR LAYER\nA, 1., 1., 0., M, 1.\n": r"line 7: .*must follow",
    "*SHELL SECTION, ELSET=E, COMPOSITE\n*REBAR LAYER\nA, 1., 1., 0., M, 1.\n": r"line 7: .*COMPOSITE",
    "*SURFACE, NAME=S, COMBINE=UNION\nA, B\n": r"line 7: there is no surface A",
    "*SURFACE, NAME=S, CROP\nA\n": r"line 6: .*CROP is not read",
    "*ELCOPY, ELEMENT SHIFT=1, OLD SET=E, SHIFT NODES=1, REFLECT\n*SURFACE, NAME=S\n2, S1\n": (
        r"line 8: the faces of elements copied with REFLECT"
    ),
}


@pytest.mark.parametrize("text", BAD, ids=lambda text: text.split("\n")[0][:40])
def test_what_cannot_be_made_is_told_by_line(deck, text):
    with pytest.raises(InputError, match=BAD[text]) as refused:
        deck(TWO + text)
    assert "deck.inp" in str(refused.value)


def test_no_deck_makes_more_than_memory_holds(deck, monkeypatch):
    monkeypatch.setattr(abaqus_generation, "MOST", 10)
    ends = "*NODE\n1, 0.\n{0}, 1.\n*NGEN\n1, {0}\n"
    assert len(deck(ends.format(11)).labels) == 11
    with pytest.raises(InputError, match="line 5: more than 10 nodes"):
        deck(ends.format(12))


def test_system_alone_is_the_global_one(deck):
    text = TWO + "*SYSTEM\n1., 2., 0.\n*NODE\n9, 1., 1.\n*SYSTEM\n*NODE\n10, 1., 1.\n"
    assert deck(text).points[-2:].tolist() == [[2, 3, 0], [1, 1, 0]]
