"""Parts, and where their instances are placed: against the same tire written without parts."""

import numpy as np
import pytest
from ring_decks import solids
from torus_decks import BELT, CORDS, RUBBER, Torus, membranes, plain

from tireroad.fem.errors import InputError

FACES = {"inner": "INSIDE", "tread": "OUTSIDE"}


def parted(text: str, position: str = "", mesh_in: str = "part", more: str = "") -> str:
    """A flat deck as part TIRE with instance T-1; the mesh stands in the part or in the instance."""
    head, materials = text.split("*MATERIAL", 1)
    body = head.removeprefix("*HEADING\na torus\n")
    part, instance = (body, "") if mesh_in == "part" else ("", body)
    return (
        f"*HEADING\n*PART, NAME=TIRE\n{part}*END PART\n*ASSEMBLY, NAME=A\n"
        f"*INSTANCE, NAME=T-1, PART=TIRE\n{position}{instance}*END INSTANCE\n{more}*END ASSEMBLY\n"
        f"*MATERIAL{materials}"
    )


def belted(torus: Torus) -> str:
    arcs = np.linspace(-BELT, BELT, 41)[0 if torus.arc[0] < 0 else 20 :]
    return plain(torus, materials="") + membranes("BELT", 0.004, arcs, 90001, 9001) + CORDS + RUBBER


def same(one, other) -> None:
    """The two sections are one: nodes, faces, plies."""
    assert len(one.mesh.cells) == len(other.mesh.cells)
    order = [np.lexsort(np.round(mesh.mesh.nodes, 9).T) for mesh in (one, other)]
    np.testing.assert_allclose(one.mesh.nodes[order[0]], other.mesh.nodes[order[1]], atol=1e-9)
    for face in ("rim", "inner", "tread"):
        assert len(getattr(one.mesh, face)) == len(getattr(other.mesh, face)) > 0
    assert [np.degrees(p.angle) for p in one.plies] == pytest.approx(
        [np.degrees(p.angle) for p in other.plies]
    )
    assert [len(p.sides) for p in one.plies] == [len(p.sides) for p in other.plies]


@pytest.mark.parametrize("mesh_in", ["part", "instance"])
@pytest.mark.parametrize(
    ("position", "moved"),
    [
        ("", lambda r, z: (r, z)),
        ("0.05, 0., 0.\n", lambda r, z: (r - 0.05, z)),
        ("0., 0., 0.\n0.22, 0., 0., 0.22, 0., 1., 90.\n", lambda r, z: (0.22 + z, -(r - 0.22))),
        ("-0.05, 0.01, 0.\n0., 0., 0., 0., 0., 1., 30.\n", None),
        ("\n0.22, 0., 0., 0.22, 0., 1., 90.\n", lambda r, z: (0.22 + z, -(r - 0.22))),
    ],
)
def test_placed(own, position, moved, mesh_in):
    """Shifted, turned about a line, and both: first the shift, then the turn."""
    text = belted(Torus(scale=1.0))
    if moved is None:
        turn = np.exp(-1j * np.pi / 6)

        def moved(r, z):
            back = turn * (r + 1j * z) + 0.05 - 0.01j
            return back.real, back.imag

    def drawn(line):
        parts = line.split(",")
        if len(parts) != 3 or "*" in line or not any("." in p for p in parts[1:]):
            return line
        r, z = moved(float(parts[1]), float(parts[2]))
        return f"{parts[0]}, {r:.15g}, {z:.15g}"

    head, materials = text.split("*MATERIAL", 1)
    there = "\n".join(map(drawn, head.split("\n"))) + "*MATERIAL" + materials
    same(own(parted(there, position, mesh_in), **FACES), own(text, **FACES))


def test_half_twice(own):
    """Half a section, and the same turned by 180 degrees about the radius, make the whole.

    Cords go on as the same lines, as where tire.mirror completes the half."""
    text = belted(Torus(half=True))
    other = "*INSTANCE, NAME=T-2, PART=TIRE\n\n0., 0., 0.\n0., 0., 0., 1., 0., 0., 180.\n*END INSTANCE\n"
    found = own(parted(text, more=other), **FACES)
    same(found, own(belted(Torus()), **FACES))
    mirrored = own(text, mirror=True, **FACES).plies[0]
    assert len(found.plies) == 1 and found.plies[0].angle == pytest.approx(mirrored.angle)
    assert found.mesh.regions == ("WALL",)


def test_faces_of_a_turned_half(own):
    """Faces of elements keep their numbers when the section is turned over."""
    torus = Torus(half=True)
    inner = [n for n, nodes in torus.cells() if torus.label(0, 0) <= nodes[0] < torus.label(1, 0)]
    sets = "*ELSET, ELSET=IN\n" + "\n".join(map(str, inner)) + "\n*SURFACE, NAME=AIRSIDE\nIN, S4\n"
    text = plain(torus).replace("*SOLID SECTION", sets + "*SOLID SECTION")
    other = (
        "*INSTANCE, NAME=T-2, PART=TIRE\n0., 0., 0.\n0., 0., 0., 1., 0., 0., 180.\n*END INSTANCE\n"
    )
    found = own(parted(text, more=other), inner="AIRSIDE", tread="OUTSIDE")
    by_nodes = own(parted(text, more=other), **FACES)
    assert sorted(map(tuple, found.mesh.inner)) == sorted(map(tuple, by_nodes.mesh.inner))
    # One instance's face alone is half of it.
    with pytest.raises(InputError, match="inner|face"):
        own(parted(text, more=other), inner="T-2.AIRSIDE", tread="OUTSIDE")


def test_names_belong_to_their_part(own):
    """A second part may have a set of the same name; INSTANCE.NAME says which."""
    text = parted(plain(Torus()))
    road = (
        "*PART, NAME=ROAD\n*NODE\n1, 0.4, 1.\n2, 0.5, 1.\n3, 0.5, 1.1\n4, 0.4, 1.1\n"
        "*NSET, NSET=RIMNODES\n1, 2, 3, 4\n*ELSET, ELSET=WALL\n1\n*END PART\n"
    )
    text = text.replace("*HEADING\n", "*HEADING\n" + road).replace(
        "*END ASSEMBLY", "*INSTANCE, NAME=R-1, PART=ROAD\n*END INSTANCE\n*END ASSEMBLY"
    )
    found = own(text, rim=("T-1.RIMNODES",), inner="t-1.inside", tread="T-1.OUTSIDE")
    same(found, own(plain(Torus()), **FACES))


def test_without_an_instance(own):
    """A part that no instance places is not in the model; that is said."""
    spare = (
        "*PART, NAME=SPARE\n" + plain(Torus(arcs=8), materials="").split("\n", 2)[2] + "*END PART\n"
    )
    found = own(parted(plain(Torus())).replace("*HEADING\n", "*HEADING\n" + spare), **FACES)
    assert len(found.mesh.cells) == 24
    assert any("SPARE" in line and "no instance" in line for line in found.unused)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("PART=TIRE\n", "PART=TIER\n", "no part TIER; did you mean TIRE"),
        ("PART=TIRE\n", "PART=TIRE\n1., 2., 3., 4.\n", "placed by a line of three numbers"),
        ("PART=TIRE\n", "PART=TIRE\n0., 0., 0.\n1., 1., 1., 1., 1., 1., 90.\n", "are one"),
        ("*END INSTANCE\n", "", "no \\*END INSTANCE"),
        (
            "*END INSTANCE\n",
            "*END INSTANCE\n*INSTANCE, NAME=T-1, PART=TIRE\n*END INSTANCE\n",
            "twice",
        ),
        ("PART=TIRE\n", "INSTANCE=T-9\n", "earlier analysis"),
    ],
)
def test_refused(own, old, new, message):
    text = parted(plain(Torus()))
    assert old in text
    with pytest.raises(InputError, match=message):
        own(text.replace(old, new), **FACES)


def test_local_system(own):
    """*SYSTEM: nodes that follow are given from its origin along its axes, until the next one."""
    text = plain(Torus())
    turn = np.exp(1j * np.radians(25))

    def local(line):
        parts = line.split(",")
        if len(parts) != 3 or "*" in line or not any("." in p for p in parts[1:]):
            return line
        there = (complex(float(parts[1]), float(parts[2])) - (0.1 + 0.2j)) / turn
        return f"{parts[0]}, {there.real:.15g}, {there.imag:.15g}"

    along = 0.1 + 0.2j + turn
    system = f"*SYSTEM\n0.1, 0.2, 0., {along.real:.15g}, {along.imag:.15g}, 0.\n"
    there = "\n".join(map(local, text.split("\n"))).replace("*NODE,", system + "*NODE,")
    same(own(there, **FACES), own(text, **FACES))
    with pytest.raises(InputError, match="no axes"):
        own(text.replace("*NODE,", "*SYSTEM\n0., 0., 0., 0., 0., 0.\n*NODE,"), **FACES)


def test_combined_surfaces(own):
    """UNION, INTERSECTION and DIFFERENCE of surfaces."""
    torus = Torus()
    inner = [n for n, nodes in torus.cells() if nodes[0] < torus.label(1, 0)]
    half = len(inner) // 2
    text = plain(torus)
    for name, those in (("LOW", inner[: half + 1]), ("HIGH", inner[half - 1 :])):
        text += f"*SURFACE, NAME={name}\n" + "".join(f"{n}, S4\n" for n in those)
    text += "*SURFACE, NAME=WHOLE, COMBINE=UNION\nLOW, HIGH\n"
    text += "*SURFACE, NAME=MIDDLE, COMBINE=INTERSECTION\nLOW, HIGH\n"
    text += "*SURFACE, NAME=LEFT, COMBINE=DIFFERENCE\nLOW, HIGH\n"
    text += "*SURFACE, NAME=AGAIN, COMBINE=UNION\nLEFT, MIDDLE\n*SURFACE, NAME=FULL, COMBINE=UNION\nAGAIN, HIGH\n"
    by_nodes = own(text, **FACES).mesh.inner
    for name in ("WHOLE", "FULL"):
        assert len(own(text, inner=name, tread="OUTSIDE").mesh.inner) == len(by_nodes)
    # Written anew after what it is made of, and of itself.
    again = text + "*SURFACE, NAME=LOW, COMBINE=UNION\nHIGH, LEFT\n"
    with pytest.raises(InputError, match="is made of itself"):
        own(again, **FACES)
    later = text.replace("*SURFACE, NAME=WHOLE", "*SURFACE, NAME=LOW2\n1, S4\n*SURFACE, NAME=WHOLE")
    later += "*SURFACE, NAME=LOW2, COMBINE=UNION\nLEFT, HIGH\n"
    assert len(own(later, inner="LOW2", tread="OUTSIDE").mesh.inner) == len(by_nodes)
    with pytest.raises(InputError, match="no surface MIDLE; did you mean MIDDLE"):
        own(text + "*SURFACE, NAME=X, COMBINE=UNION\nMIDLE\n", **FACES)


@pytest.mark.parametrize(
    ("position", "axle"),
    [
        ("", "y"),
        ("0., 0., 0.\n0., 0., 0., 0., 0., 1., 90.\n", "x"),
        ("0., 0., 0.\n0., 0., 0., 1., 0., 0., 90.\n", "z"),
    ],
)
def test_a_body_that_is_turned(own, position, axle):
    """The axle turns with the instance; the section stays."""
    text = solids(Torus(False, arcs=8, wall=1), np.linspace(0, 2 * np.pi, 9)[:-1])
    found = own(parted(text, position))
    assert f"about {axle}:" in found.used[-1]
    np.testing.assert_allclose(
        np.sort(found.mesh.nodes[:, 0]), np.sort(own(text).mesh.nodes[:, 0]), atol=1e-12
    )
