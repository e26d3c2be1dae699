"""The same tire in every form a deck may have gives the same section."""

from pathlib import Path

import numpy as np
import pytest
from ring_decks import solids
from torus_decks import CENTRE, HALF_ANGLE, MINOR, RUBBER, WALL, Torus, plain

from tireroad.fem.decks import abaqus, gmsh
from tireroad.fem.decks.user_section import read, regions
from tireroad.fem.errors import InputError

EXACT = 2 * np.pi * HALF_ANGLE * (MINOR**2 - (MINOR - WALL) ** 2) * CENTRE + 2 * np.pi * (
    2 * np.sin(HALF_ANGLE) * (MINOR**3 - (MINOR - WALL) ** 3) / 3
)  # volume of the torus, Pappus


def volume(mesh):
    """2 pi int r dA by Gauss's rule on every cell."""
    t, w = np.polynomial.legendre.leggauss(4)
    t, w = (t + 1) / 2, w / 2
    total, step = 0.0, 1e-6
    cells = np.arange(len(mesh.cells))
    for xi, a in zip(t, w, strict=True):
        for eta, b in zip(t, w, strict=True):
            x, y = np.full(len(cells), xi), np.full(len(cells), eta)
            along = (mesh.at(cells, x + step, y) - mesh.at(cells, x - step, y)) / (2 * step)
            across = (mesh.at(cells, x, y + step) - mesh.at(cells, x, y - step)) / (2 * step)
            area = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
            total += a * b * (area * mesh.at(cells, x, y)[:, 0]).sum()
    return 2 * np.pi * total


FULL = ("inner", "INSIDE"), ("tread", "outside")


@pytest.mark.parametrize("half", [False, True])
@pytest.mark.parametrize(
    ("kind", "quadratic", "triangles", "tolerance"),
    [
        ("CGAX8H", True, False, 2e-5),
        ("cax8r", True, False, 2e-5),
        ("CGAX6", True, True, 2e-5),
        ("CAX4", False, False, 2e-2),
        ("CGAX4RH", False, False, 2e-2),
        ("CAX3", False, True, 2e-2),
    ],
)
def test_axisymmetric_types(own, kind, quadratic, triangles, tolerance, half):
    torus = Torus(quadratic, arcs=16, triangles=triangles, half=half)
    found = own(plain(torus, kind), mirror=half, **dict(FULL))
    assert volume(found.mesh) == pytest.approx(EXACT, rel=tolerance)
    sides = 32 if triangles else 16
    assert [len(found.mesh.outer), len(found.mesh.inner), len(found.mesh.tread)] == [sides] * 3
    assert any("triangles" in note for note in found.notes) == triangles


def test_half_equals_full(own):
    """Mirrored nodes are those of the full section, in some order."""
    half = own(plain(Torus(half=True)), mirror=True).mesh.nodes
    full = own(plain(Torus())).mesh.nodes
    order = [np.lexsort(np.round(nodes, 9).T) for nodes in (half, full)]
    assert np.allclose(half[order[0]], full[order[1]], atol=1e-12)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize(("quadratic", "triangles"), [(False, False), (True, False), (False, True)])
def test_bodies_of_revolution(own, axis, quadratic, triangles):
    """C3D8, C3D20 and C3D6 about any axis, at uneven angles, reduce to the section of the 2-D deck."""
    torus = Torus(quadratic, arcs=8, triangles=triangles)
    angles = np.cumsum([0.0, 0.5, 0.7, 0.9, 0.8, 1.0, 0.6])
    found = own(solids(torus, angles, axis), **dict(FULL))
    kind = {(False, False): "CAX4", (True, False): "CAX8", (False, True): "CAX3"}[
        quadratic, triangles
    ]
    assert volume(found.mesh) == pytest.approx(volume(own(plain(torus, kind)).mesh), rel=1e-9)
    assert np.allclose(found.ring_angles, angles)
    assert len(found.mesh.inner) == len(found.mesh.outer) == (16 if triangles else 8)


MESHES = sorted((Path(__file__).parent / "meshes").glob("*.msh"))


@pytest.mark.parametrize("file", MESHES, ids=lambda path: path.stem)
def test_gmsh(file):
    """Files written by Gmsh itself: 2.2 and 4.1, text and binary, first and second order."""
    found = read(file)
    exact = 2e-4 if "quad" in file.stem else 5e-2
    assert volume(found.mesh) == pytest.approx(EXACT, rel=exact)
    assert found.mesh.regions == ("LINER", "TREAD RUBBER")
    assert {name: len(sides) for name, sides in found.mesh.plies.items()} == {"belt 1": 8}
    radius = np.hypot(
        *(found.mesh.nodes[found.mesh.chain(found.mesh.plies["belt 1"])] - [CENTRE, 0]).T
    )
    assert radius[::2] == pytest.approx(MINOR - WALL / 2, abs=1e-12)


def test_a_bead_held_by_its_flange_alone(own):
    """The rim holds the outer corner of each bead and the pressure ends at the inner one: the base joins them.

    As in a public deck of a 175 SR14, where it is 4 % of the inner face; a longer gap is an error."""
    torus = Torus(arcs=12, wall=2)
    first, last = len(torus.depth) - 1, len(torus.arc) - 1
    flange = [torus.label(i, j) for j in (0, last) for i in (first, first - 1, first - 2)]
    text = plain(torus) + "*NSET, NSET=FLANGE\n" + ", ".join(map(str, flange)) + "\n"
    found = own(text, rim=("FLANGE",), inner="INSIDE", tread="OUTSIDE")
    whole = own(text, inner="INSIDE", tread="OUTSIDE")
    assert len(found.mesh.rim) == len(whole.mesh.rim) // 2
    assert len(found.mesh.inner) == len(whole.mesh.inner) + 2
    assert any("2 sides of the bead's base" in note for note in found.notes)
    inner = torus.face(0)
    short = text + "*NSET, NSET=PART\n" + "".join(f"{n}\n" for n in inner[8:])
    with pytest.raises(InputError, match="inner face is open"):
        own(short, rim=("FLANGE",), inner="PART", tread="OUTSIDE")


def test_gmsh_with_parameters_of_nodes(tmp_path):
    """Mesh.SaveParametric = 1: the place in the entity stands behind each node."""
    plain = (MESHES[0].parent / "lin_2.2_0.msh").read_text()
    before, nodes = plain.split("$Nodes\n", 1)
    nodes, after = nodes.split("$EndNodes", 1)
    count, *lines = nodes.splitlines()
    lines = [f"{line} 1 3 0.25" if k % 2 else f"{line} 0 7" for k, line in enumerate(lines)]
    with_more = "\n".join(["$ParametricNodes", count, *lines, "$EndParametricNodes"])
    (tmp_path / "tire.msh").write_text(before + with_more + after)
    found, expected = read(tmp_path / "tire.msh"), read(MESHES[0].parent / "lin_2.2_0.msh")
    np.testing.assert_array_equal(found.mesh.nodes, expected.mesh.nodes)


def test_gmsh_saved_without_its_groups(tmp_path):
    """Mesh.SaveAll = 1 in format 2.2 gives every element the physical group 0."""
    text = (MESHES[0].parent / "lin_2.2_0.msh").read_text()
    before, elements = text.split("$Elements\n", 1)
    count, *lines = elements.splitlines()
    rows = [line.split() for line in lines]
    lines = [" ".join([*row[:3], "0", *row[4:]]) if len(row) > 4 else " ".join(row) for row in rows]
    (tmp_path / "tire.msh").write_text(before + "$Elements\n" + "\n".join([count, *lines]) + "\n")
    with pytest.raises(InputError, match=r"Mesh\.SaveAll = 1.*SaveAll = 0"):
        read(tmp_path / "tire.msh")


def test_there_are_gmsh_files():
    assert len(MESHES) == 6


@pytest.mark.parametrize(
    ("unit", "scale", "stress", "density"),
    [("mm", 1e3, 1e-6, 1e-12), ("in", 1 / 0.0254, 1 / 6894.757293, 1 / 1.0686896e7)],
)
def test_units(own, unit, scale, stress, density):
    """A deck in millimetres and tonnes, or in inches and pounds, is the deck in metres."""
    materials = f"*MATERIAL, NAME=RUBBER\n*ELASTIC\n{6e6 * stress:.12g}, 0.45\n*DENSITY\n{1200 * density:.12g}\n"
    found = own(plain(Torus(scale=scale), materials=materials), length_unit=unit)
    metres = own(plain(Torus()))
    assert np.allclose(found.mesh.nodes, metres.mesh.nodes, atol=1e-12)
    (rubber,), (known,) = found.rubbers, metres.rubbers
    assert rubber.density == pytest.approx(known.density, rel=1e-6)
    assert rubber.coefficients["youngs_modulus"] == pytest.approx(6e6, rel=1e-6)


def test_tolerance_of_the_reader(own, tmp_path):
    """Lower case, tabs, CRLF, comments, includes, continued keywords, sets of later sets, parts, D exponents."""
    torus = Torus()
    text = plain(torus)
    nodes = text[text.index("*NODE") : text.index("*ELEMENT")]
    (tmp_path / "nodes.inc").write_text(nodes + "99001, , \n99002\n99003, 0.1\n")
    text = text.replace(nodes, "*Include, Input=nodes.inc\n")
    text = text.replace(
        "*ELEMENT, TYPE=CGAX8H, ELSET=WALL", "*element,\n type=cgax8h,\n elset = wall"
    )
    text = text.replace(
        "*NSET, NSET=RIMNODES\n", "*nset, nset=RimNodes\nBEADS\n*NSET, NSET=beads\n"
    )
    text = text.replace("6.0E6, 0.45", "6.0D6,\t.45").replace("\n", "\r\n")
    text += (
        "** nothing\r\n*STEP\r\n*STATIC\r\n1., 1.\r\n*DSLOAD\r\nINSIDE, P, 2.E5\r\n*END STEP\r\n"
    )
    found = own("\ufeff" + text)
    assert np.allclose(found.mesh.nodes, own(plain(torus)).mesh.nodes)
    assert found.rubbers[0].coefficients["youngs_modulus"] == 6e6
    assert sum("*STATIC: not used" in line for line in found.unused) == 1


def test_generate_and_surfaces(own):
    """Faces by GENERATE, by *SURFACE with S1 to S4, and by set and face, are the same sides."""
    torus = Torus(arcs=6, wall=1)
    text = plain(torus).replace(RUBBER, "")
    faces = "*ELSET, ELSET=EVERY, GENERATE\n1, 6, 1\n*SURFACE, NAME=IN, TYPE=ELEMENT\nEVERY, S4\n"
    faces += "*SURFACE, NAME=OUT\n1, S2\n2, s2\nREST, S2\n*ELSET, ELSET=REST, GENERATE\n3, 6\n"
    by_face = own(text + faces + RUBBER, inner="in", tread="OUT").mesh
    by_node = own(text + RUBBER, inner="INSIDE", tread="OUTSIDE").mesh
    assert np.array_equal(np.unique(by_face.inner, axis=0), np.unique(by_node.inner, axis=0))
    assert np.array_equal(np.unique(by_face.tread, axis=0), np.unique(by_node.tread, axis=0))


def test_parts_and_instances(own):
    """A deck of parts: the wheel's nodes may have the tire's numbers."""
    tire = plain(Torus()).replace(RUBBER, "").replace("*HEADING\na torus\n", "")
    text = (
        "*HEADING\nparts\n*PART, NAME=TIRE\n"
        + tire
        + "*END PART\n*PART, NAME=WHEEL\n*NODE\n1, 0., 0.\n*END PART\n"
    )
    text += "*ASSEMBLY, NAME=A\n*INSTANCE, NAME=T-1, PART=TIRE\n*END INSTANCE\n*NSET, NSET=AIR, INSTANCE=T-1\nINSIDE\n"
    text += "*END ASSEMBLY\n" + RUBBER
    assert len(own(text, inner="AIR").mesh.inner) == 12


class Unmerged(Torus):
    """Two halves whose nodes on the middle plane are two each, a few ulp apart."""

    def cells(self):
        middle = len(self.arc) // 2
        for number, nodes in super().cells():
            left = min((node - 1) % 1000 for node in nodes) >= middle
            yield (
                number,
                [node + 500 if left and (node - 1) % 1000 == middle else node for node in nodes],
            )

    def nodes(self, columns="{:d}, {:.15g}, {:.15g}") -> str:
        twice = ""
        for line in super().nodes(columns).splitlines():
            label, r, z = line.split(",")
            if (int(label) - 1) % 1000 == len(self.arc) // 2:
                twice += f"{int(label) + 500}, {r}, {float(z) + 4e-17!r}\n"
        return super().nodes(columns) + twice


@pytest.mark.parametrize("quadratic", [True, False])
def test_coincident_nodes_are_one(own, quadratic):
    """As meshers leave them between the parts of a section; apart they are two bodies."""
    kind = "CGAX8H" if quadratic else "CAX4"
    whole = own(plain(Torus(quadratic), kind), **dict(FULL))
    merged = own(plain(Unmerged(quadratic), kind), **dict(FULL))
    assert any("tire.merge" in note for note in merged.notes)
    assert len(merged.mesh.nodes) == len(whole.mesh.nodes)
    assert volume(merged.mesh) == pytest.approx(volume(whole.mesh), rel=1e-12)
    assert len(merged.mesh.outer) == len(whole.mesh.outer)
    with pytest.raises(InputError, match="2 bodies that share no nodes"):
        own(plain(Unmerged(quadratic), kind), **dict(FULL), merge=0.0)
    with pytest.raises(InputError, match="nearer to each other than tire.merge"):
        own(plain(Torus(quadratic), kind), **dict(FULL), merge=0.01)


GROUPS = {"left": (4, 5), "all": (4, 5, 6, 7), "right": (6, 7)}


def _gmsh(version: str, first: int = 1, parted: bool = False) -> str:
    """A row of four quadrilaterals in three groups, two of them overlapping; labels from `first` on."""
    points = [(0.3, 0.01 * (k - 2), 0.0) for k in range(5)] + [
        (0.32, 0.01 * (k - 2), 0.0) for k in range(5)
    ]
    cells = [(k, k + 5, k + 6, k + 1) for k in range(4)]
    sides = {
        "rim": [(0, 5), (4, 9)],
        "inner": [(k, k + 1) for k in range(4)],
        "tread": [(k + 5, k + 6) for k in range(4)],
    }
    names = [*((1, name) for name in sides), *((2, name) for name in GROUPS)]
    head = [f"$MeshFormat\n{version} 0 8\n$EndMeshFormat", f"$PhysicalNames\n{len(names)}"]
    head += [f'{dimension} {k} "{name}"' for k, (dimension, name) in enumerate(names, 1)]
    head.append("$EndPhysicalNames")
    number = {name: k for k, (_, name) in enumerate(names, 1)}
    if version == "2.2":
        nodes = [f"{first + k} {x} {y} {z}" for k, (x, y, z) in enumerate(points)]
        rows = [
            f"1 2 {number[name]} 1 " + " ".join(str(first + n) for n in side)
            for name in sides
            for side in sides[name]
        ]
        for name, entities in GROUPS.items():
            rows += [
                f"3 2 {number[name]} 1 " + " ".join(str(first + n) for n in cells[e - 4])
                for e in entities
            ]
        elements = [f"{first + k} {row}" for k, row in enumerate(rows)]
        tail = [
            f"$Nodes\n{len(points)}",
            *nodes,
            f"$EndNodes\n$Elements\n{len(rows)}",
            *elements,
            "$EndElements",
        ]
        return "\n".join([*head, *tail]) + "\n"
    curves = [f"{k} 0 0 0 1 1 1 1 {number[name]} 0" for k, name in enumerate(sides, 1)]
    surfaces = []
    for entity in range(4, 8):
        mine = [str(number[name]) for name, entities in GROUPS.items() if entity in entities]
        surfaces.append(f"{entity} 0 0 0 1 1 1 {len(mine)} {' '.join(mine)} 0")
    shift = 100 if parted else 0  # a partitioned file has its elements in parts of the entities
    entities = [f"$Entities\n0 {len(curves)} {len(surfaces)} 0", *curves, *surfaces, "$EndEntities"]
    if parted:
        parts = [
            f"{100 + int(row.split()[0])} {d} {row.split()[0]} 1 1 {row.partition(' ')[2]}"
            for d, rows in ((1, curves), (2, surfaces))
            for row in rows
        ]
        entities += [
            f"$PartitionedEntities\n1\n0\n0 {len(curves)} {len(surfaces)} 0",
            *parts,
            "$EndPartitionedEntities",
        ]
    nodes = [
        f"2 4 0 {len(points)}",
        *(str(first + k) for k in range(len(points))),
        *(f"{x} {y} {z}" for x, y, z in points),
    ]
    blocks = []
    label = first
    for k, name in enumerate(sides, 1):
        blocks.append(f"1 {k + shift} 1 {len(sides[name])}")
        for side in sides[name]:
            blocks.append(f"{label} " + " ".join(str(first + n) for n in side))
            label += 1
    for entity in range(4, 8):
        blocks += [
            f"2 {entity + shift} 3 1",
            f"{label} " + " ".join(str(first + n) for n in cells[entity - 4]),
        ]
        label += 1
    last = first + len(points) - 1
    tail = [f"$Nodes\n1 {len(points)} {first} {last}", *nodes, "$EndNodes"]
    tail += [
        f"$Elements\n{len(sides) + 4} {label - first} {first} {label - 1}",
        *blocks,
        "$EndElements",
    ]
    return "\n".join([*head, *entities, *tail]) + "\n"


@pytest.mark.parametrize("version", ["2.2", "4.1", "4.1 parted"])
@pytest.mark.parametrize("first", [1, 3_000_000_000], ids=["labels from 1", "labels over 2^31"])
def test_groups_that_overlap(tmp_path: Path, version: str, first: int) -> None:
    """A surface in two groups is in both; the larger one is no region, and that is said; parts are followed to their groups."""
    (tmp_path / "two.msh").write_text(_gmsh(version[:3], first, "parted" in version))
    deck = gmsh.read(tmp_path / "two.msh")
    solids = [block for block in deck.blocks if block.kind.role == "solid"]
    assert [len(block.labels) for block in solids] == [4]
    sizes = {name: len(deck.element_sets.labels(name)) for name in deck.element_sets.names}
    assert sizes == {"LEFT": 2, "ALL": 4, "RIGHT": 2}
    found = regions(deck)
    assert sorted(found.names) == ["LEFT", "RIGHT"]
    assert any("ALL: 4 of its 4 elements are in LEFT, RIGHT, too" in note for note in found.notes)
    assert {name: len(rows) for name, rows in deck.surfaces.items()} == {
        "rim": 2,
        "inner": 4,
        "tread": 4,
    }


def test_the_deck_that_gmsh_writes_of_a_section_is_named(tmp_path: Path) -> None:
    text = plain(Torus(arcs=8, wall=1), "CAX4").replace("TYPE=CAX4", "type=CPS4")
    (tmp_path / "deck.inp").write_text(text)
    with pytest.raises(
        InputError, match="plane elements, CPS4 .Gmsh writes a section so.*rename them CGAX4"
    ):
        regions(abaqus.read(tmp_path / "deck.inp"))


@pytest.mark.parametrize(
    "name",
    [
        "MESH.INP",
        "C:\\work\\tire\\mesh.inp",
        "\\\\server\\tires\\mesh.inp",
        ".\\mesh.inp",
    ],
)
def test_includes_of_windows(tmp_path: Path, name: str) -> None:
    """Capitals, and folders of another machine: the file beside the deck; Ctrl-Z at the end of both."""
    text = plain(Torus(arcs=8, wall=1))
    (tmp_path / "mesh.inp").write_text(text.replace("\n", "\r\n") + "\x1a")
    (tmp_path / "deck.inp").write_text(f"*HEADING\n*INCLUDE, INPUT={name}\n\x1a\r\n")
    whole = abaqus.read(tmp_path / "mesh.inp").labels
    assert abaqus.read(tmp_path / "deck.inp").labels.tolist() == whole.tolist()
    (tmp_path / "deck.inp").write_text("*INCLUDE, INPUT=D:\\other.inp\n")
    with pytest.raises(
        InputError, match="a path of Windows, and there is no other.inp beside the deck"
    ):
        abaqus.read(tmp_path / "deck.inp")


def test_labels_beyond_those_of_abaqus_are_named(tmp_path: Path) -> None:
    (tmp_path / "deck.inp").write_text("*NODE\n3000000001, 0.3, 0., 0.\n")
    with pytest.raises(
        InputError, match=r"3000000001 is not a label of a node: .*up to 1,000,000,000"
    ):
        abaqus.read(tmp_path / "deck.inp")


def test_a_density_by_temperature_is_told(own):
    """That the first of several lines is taken was told of moduli, and not of the density."""
    found = own(
        plain(Torus(), materials=RUBBER.replace("1200.", "1200., 20.\n1100., 60.")), **dict(FULL)
    )
    assert found.rubbers[0].density == 1200.0
    assert any("the first of 2 lines of data" in note for note in found.notes)
