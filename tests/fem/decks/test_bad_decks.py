"""What is wrong in a deck is told once, with file and line; nothing else ever comes out of the reader."""

import re

import numpy as np
import pytest
from good_decks import BELTED, GOOD, TORUS
from ring_decks import solids
from torus_decks import BELT, CORDS, Torus, membranes, plain

from tireroad.fem.decks import deck
from tireroad.fem.decks.user_section import read
from tireroad.fem.errors import InputError

RING = np.linspace(0, 2 * np.pi, 9)[:-1]


def line_of(text, part):
    return text[: text.index(part)].count("\n") + 1


def first_element(text):
    return re.search(r"\n(1, \d+, \d+, \d+, \d+, \d+, \d+, \d+, \d+)\n", text)[1]


def clockwise():
    old = first_element(GOOD)
    n = old.split(", ")
    return GOOD.replace(old, ", ".join([n[0], n[1], n[4], n[3], n[2], n[8], n[7], n[6], n[5]]))


def two_bodies():
    torus = Torus(arcs=6, wall=1)
    shifted = "".join(
        f"{20000 + int(line.split(',')[0])},{float(line.split(',')[1]) + 0.3},{line.split(',')[2]}\n"
        for line in torus.nodes().splitlines()
    )
    cells = "".join(
        ", ".join(str(v + 20000) for v in [n, *nodes]) + "\n" for n, nodes in torus.cells()
    )
    return GOOD.replace(
        "*NSET", f"*NODE\n{shifted}*ELEMENT, TYPE=CAX8, ELSET=WALL\n{cells}*NSET", 1
    )


def open_inner():
    inside = TORUS.face(0)
    gap = ", ".join(map(str, inside[:4] + inside[8:]))
    return re.sub(r"NSET=INSIDE\n[^*]*", f"NSET=INSIDE\n{gap}\n", GOOD)


def outside_belt():
    return GOOD + membranes("BELT", -0.004, np.linspace(-BELT, BELT, 9), 9001, 9001) + CORDS


def across_regions():
    """The host is the left half; the belt lies in both."""
    sets = "*ELSET, ELSET=HALF\n1, 2, 3\n"
    return BELTED.replace("HOST ELSET=WALL", "HOST ELSET=HALF") + sets


CASES = {
    "negative volume": (clockwise(), {}, r"line \d+: element 1 .*negative volume"),
    "no elements": (
        re.sub(r"(\*ELEMENT, TYPE=[^\n]*\n)[^*]*", r"\1", GOOD, count=1),
        {},
        r"line \d+: \*ELEMENT, TYPE=\w+: no elements follow",
    ),
    "missing set": (
        GOOD.replace("ELSET=WALL, MATERIAL", "ELSET=WALLS, MATERIAL"),
        {},
        r"line \d+: there is no element set WALLS; did you mean WALL",
    ),
    "missing face": (GOOD, {"inner": "INSIDES"}, r"tire\.inner: .*INSIDES; did you mean INSIDE"),
    "missing rim": (GOOD, {"rim": ()}, r"tire\.rim; there are: .*RIMNODES"),
    "missing material": (
        GOOD.replace("NAME=RUBBER", "NAME=GUM"),
        {},
        r"line \d+: there is no material RUBBER; there are: GUM",
    ),
    "two bodies": (two_bodies(), {}, r"tire\.inp: 2 bodies"),
    "open inner face": (open_inner(), {"inner": "INSIDE"}, r"inner face is not one unbroken line"),
    "belt outside": (outside_belt(), {}, r"line \d+: cords BELT.* outside the wall"),
    "belt across regions": (across_regions(), {}, r"line \d+: cords BELT.*another region"),
    "a tire of 320 m": (plain(Torus(scale=1e3)), {}, r"is this deck in mm\?.*length_unit"),
    "a tire of 0.3 mm": (GOOD, {"length_unit": "mm"}, r"is this deck in m\?"),
    "half without mirror": (plain(Torus(half=True)), {}, r"tire\.mirror = true"),
    "mirror of a whole": (GOOD, {"mirror": True}, r"mirror = true is for a half section"),
    "modulus in other units": (
        plain(Torus(scale=1e3)),
        {"length_unit": "mm"},
        r"line \d+: material RUBBER: .*units",
    ),
    "not a number": (GOOD.replace("0.45", "nan"), {}, r"line \d+: \"nan\" is not a finite number"),
    "infinite": (
        GOOD.replace("*ELEMENT", "777, inf, 0.\n*ELEMENT", 1),
        {},
        r"line \d+: \"inf\" is not a finite number",
    ),
    "huge": (
        GOOD.replace("*ELEMENT", "777, 1e400, 0.\n*ELEMENT", 1),
        {},
        r"line \d+: \"1e400\" is not a finite number",
    ),
    "text": (
        GOOD.replace("*ELEMENT", "777, tire, 0.\n*ELEMENT", 1),
        {},
        r"line \d+: \"tire\" is not a number",
    ),
    "label": (GOOD.replace("*ELEMENT", "7.5, 1., 0.\n*ELEMENT", 1), {}, r"7\.5 is not a label"),
    "cut short": (GOOD[: GOOD.index("*NSET") - 12], {}, r"line \d+: .*cut short"),
    "step without end": (GOOD + "*STEP\n*STATIC\n", {}, r"line \d+: \*STEP has no \*END STEP"),
    "zero byte": (GOOD[:300] + "\0" + GOOD[300:], {}, r"line \d+: a zero byte"),
    "no deck": ("a letter to a friend\n", {}, r"line 1: data before the first keyword"),
    "empty": ("", {}, r"no keyword in it"),
    "no solids": ("*NODE\n1, 0., 0.\n", {}, r"no solid element"),
    "undefined node": (
        GOOD.replace(first_element(GOOD), first_element(GOOD).replace("1, 1,", "1, 888888,")),
        {},
        r"line \d+: node 888888 is used",
    ),
    "set of itself": (
        GOOD.replace(
            "*NSET, NSET=INSIDE\n",
            "*NSET, NSET=RIMNODES\nLOOP\n*NSET, NSET=LOOP\nRIMNODES\n*NSET, NSET=INSIDE\n",
        ),
        {},
        r"made of itself",
    ),
    "two sections": (
        GOOD + "*SOLID SECTION, ELSET=WALL, MATERIAL=RUBBER\n",
        {},
        r"line \d+: element 1 is in two solid sections",
    ),
    "node twice": (
        GOOD.replace("*ELEMENT", "1, 0.5, 0.\n*ELEMENT", 1),
        {},
        r"node 1 is defined twice",
    ),
    "van der Waals": (
        GOOD.replace("*ELASTIC\n6.0E6, 0.45", "*HYPERELASTIC, VAN DER WAALS\n1., 2., 0."),
        {},
        r"line \d+: material RUBBER: .*VAN DER WAALS.*tire\.region",
    ),
    "outside file": (
        GOOD + "*INCLUDE, INPUT=../secret\n",
        {},
        r"line \d+: .*outside the deck's folder",
    ),
    "absent file": (
        GOOD + "*INCLUDE, INPUT=more.inp\n",
        {},
        r"line \d+: the included file more\.inp",
    ),
    "itself": (GOOD + "*INCLUDE, INPUT=tire.inp\n", {}, r"line \d+: tire\.inp includes itself"),
    "tetrahedra": (
        "*NODE\n1,1.,0.,0.\n2,0.,1.,0.\n3,0.,0.,1.\n4,1.,1.,1.\n*ELEMENT, TYPE=C3D4\n1,1,2,3,4\n",
        {},
        r"line 6: C3D4: tetrahedra",
    ),
    "no revolution": (
        re.sub(
            r"\n1, [^\n]*", "\n1, 0.001, 0.02, 0.2", solids(Torus(False, arcs=4), RING), count=1
        ),
        {},
        r"not a body of revolution.*Rolling is",
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_messages(own, name):
    text, wishes, message = CASES[name]
    with pytest.raises(InputError, match=message) as caught:
        own(text, **wishes)
    assert "tire" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unknown_keywords_are_listed_once(own):
    """With the line they first stand in, how often, and the nearest known one."""
    extra = "*FOO BAR\n1, 2\n*FOO BAR\n*ELEMNT, TYPE=CAX4\n1, 2\n*AMPLITUDE, NAME=A\n0., 1.\n*ELEMENT, TYPE=R2D2\n1, 1, 2\n"
    text = GOOD + extra
    unused = own(text).unused
    first = line_of(text, "*FOO BAR")
    assert f"*FOO BAR: unknown keyword, not used (tire.inp, line {first}, 2 times)" in unused
    assert any(line.startswith("*ELEMNT: unknown") and "*ELEMENT?" in line for line in unused)
    assert sum(line.startswith("*AMPLITUDE: not used") for line in unused) == 1
    assert sum("R2D2" in line for line in unused) == 1


def test_cycle_of_includes(tmp_path):
    (tmp_path / "tire.inp").write_text("*INCLUDE, INPUT=a.inp\n")
    (tmp_path / "a.inp").write_text("*INCLUDE, INPUT=b.inp\n")
    (tmp_path / "b.inp").write_text("** here\n*INCLUDE, INPUT=a.inp\n")
    with pytest.raises(InputError, match=r"b\.inp, line 2: a\.inp includes itself"):
        read(tmp_path / "tire.inp")


def test_includes_without_end(tmp_path):
    """Each file includes the next twice: the number of files is bounded."""
    for k in range(15):
        (tmp_path / f"{k}.inp").write_text(f"*INCLUDE, INPUT={k + 1}.inp\n" * 2)
    (tmp_path / "15.inp").write_text("*HEADING\n")
    with pytest.raises(InputError, match="files are included"):
        read(tmp_path / "0.inp")


def test_links_out_of_the_folder(tmp_path):
    """A symbolic link does not lead out of the deck's folder."""
    inside = tmp_path / "deck"
    inside.mkdir()
    (tmp_path / "secret").write_text("*NODE\n1, 1., 1.\n")
    (inside / "link.inp").symlink_to(tmp_path / "secret")
    (inside / "tire.inp").write_text("*INCLUDE, INPUT=link.inp\n")
    with pytest.raises(InputError, match="outside the deck's folder"):
        read(inside / "tire.inp")


def test_pieces_change_nothing(own, monkeypatch):
    """A deck read in pieces of 512 bytes is the deck read at once; line numbers too."""
    text = BELTED.replace(
        "*ELEMENT, TYPE=CGAX8H, ELSET=WALL", "*ELEMENT,\nTYPE=CGAX8H,\nELSET=WALL"
    )
    whole = own(text)
    monkeypatch.setattr(deck, "PIECE", 512)
    parts = own(text)
    assert np.array_equal(whole.mesh.nodes, parts.mesh.nodes)
    assert whole.unused == parts.unused
    bad = text.replace("0.45", "O.45")
    with pytest.raises(InputError, match=f"line {line_of(bad, 'O.45')}:"):
        own(bad)


def test_other_encodings(own):
    """Latin-1 bytes in comments and names harm nothing."""
    data = GOOD.replace("a torus", "ein Gürtel").encode("latin-1")
    assert len(own(data).mesh.cells) == 6
