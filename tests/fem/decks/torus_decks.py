"""One tire, a torus with a ply and a belt, written as decks of every form."""

from __future__ import annotations

import numpy as np

CENTRE, MINOR, WALL = 0.22, 0.10, 0.012
HALF_ANGLE = np.radians(120)
BELT = np.radians(45)
RUBBER = "*MATERIAL, NAME=RUBBER\n*ELASTIC\n6.0E6, 0.45\n*DENSITY\n1200.\n"
CORDS = "*MATERIAL, NAME=STEEL\n*ELASTIC\n172.2E9, 0.3\n"


def place(arc, depth):
    """(r, z) at section angles and depths under the outer face."""
    radius = MINOR - np.asarray(depth)
    return np.stack([CENTRE + radius * np.cos(arc), radius * np.sin(arc)], axis=-1)


class Torus:
    """Quadrilaterals (arc x wall) of a torus, with labels for nodes and elements.

    `quadratic` has nodes on the middles of edges; `arcs` are the corners' section angles.
    """

    def __init__(self, quadratic=True, arcs=12, wall=2, half=False, triangles=False, scale=1.0):
        low = 0.0 if half else -HALF_ANGLE
        self.arc = np.linspace(low, HALF_ANGLE, 2 * (arcs // 2 if half else arcs) + 1)
        self.depth = np.linspace(WALL, 0.0, 2 * wall + 1)
        self.quadratic, self.triangles, self.scale = quadratic, triangles, scale

    def label(self, i, j):
        """Label of the node at half step i along the wall's depth and j along the arc."""
        return 1 + i * 1000 + j

    def nodes(self, columns="{:d}, {:.15g}, {:.15g}") -> str:
        lines = []
        for i, depth in enumerate(self.depth):
            for j, arc in enumerate(self.arc):
                if (i % 2 or j % 2) and not self.quadratic:
                    continue
                if i % 2 and j % 2 and not self.triangles:
                    continue
                lines.append(columns.format(self.label(i, j), *self.scale * place(arc, depth)))
        return "\n".join(lines) + "\n"

    def cells(self):
        """(label, labels of nodes) of the elements, counter-clockwise in (r, z)."""
        number = 0
        for i in range(0, len(self.depth) - 1, 2):
            for j in range(0, len(self.arc) - 1, 2):
                a, b, c, d = (i, j), (i + 2, j), (i + 2, j + 2), (i, j + 2)
                m = [(i + 1, j), (i + 2, j + 1), (i + 1, j + 2), (i, j + 1)]
                for cell in self._parts([a, b, c, d], m, (i + 1, j + 1)):
                    number += 1
                    yield number, [self.label(*node) for node in cell]

    def _parts(self, corners, middles, centre):
        if not self.triangles:
            return [corners + (middles if self.quadratic else [])]
        a, b, c, d = corners
        if not self.quadratic:
            return [[a, b, c], [a, c, d]]
        return [
            [a, b, c, middles[0], middles[1], centre],
            [a, c, d, centre, middles[2], middles[3]],
        ]

    def elements(self) -> str:
        return "\n".join(", ".join(map(str, (n, *nodes))) for n, nodes in self.cells()) + "\n"

    def ends(self) -> list[int]:
        """Labels of the nodes on the beads."""
        both = [len(self.arc) - 1] if self.arc[0] == 0 else [0, len(self.arc) - 1]
        step = 1 if self.quadratic else 2
        return [self.label(i, j) for j in both for i in range(0, len(self.depth), step)]

    def face(self, i) -> list[int]:
        """Labels of the nodes at half step i of the depth: 0 inner, -1 outer."""
        i = range(len(self.depth))[i]
        step = 1 if self.quadratic else 2
        return [self.label(i, j) for j in range(0, len(self.arc), step)]


def listed(labels) -> str:
    """Labels as data lines of sixteen."""
    labels = list(map(str, labels))
    return "".join(", ".join(labels[k : k + 16]) + "\n" for k in range(0, len(labels), 16))


def plain(torus: Torus, kind="CGAX8H", materials=RUBBER) -> str:
    """The rubber alone, its faces as node sets."""
    return (
        "*HEADING\na torus\n** nodes\n*NODE, NSET=ALL\n"
        + torus.nodes()
        + f"*ELEMENT, TYPE={kind}, ELSET=WALL\n"
        + torus.elements()
        + "*NSET, NSET=RIMNODES\n"
        + listed(torus.ends())
        + "*NSET, NSET=INSIDE\n"
        + listed(torus.face(0))
        + "*NSET, NSET=OUTSIDE\n"
        + listed(torus.face(-1))
        + "*SOLID SECTION, ELSET=WALL, MATERIAL=RUBBER\n"
        + materials
    )


def membranes(name, depth, arcs, first_node, first_element, quadratic=False, angle=70.0, scale=1.0):
    """A line of membranes with cords at a depth, ending at the given section angles, inside its host."""
    nodes = place(np.asarray(arcs), depth) * scale
    step = 2 if quadratic else 1
    text = f"*NODE, NSET={name}NODES\n"
    for k, (r, z) in enumerate(nodes):
        text += f"{first_node + k}, {r:.15g}, {z:.15g}\n"
    text += f"*ELEMENT, TYPE=SFMGAX{step}, ELSET={name}\n"
    for n, k in enumerate(range(0, len(nodes) - 1, step)):
        ids = [first_node + k, first_node + k + step] + ([first_node + k + 1] if quadratic else [])
        text += ", ".join(map(str, [first_element + n, *ids])) + "\n"
    return text + (
        f"*SURFACE SECTION, ELSET={name}\n*REBAR LAYER\n"
        f"{name}, 2.118E-7, 1.16E-3, 0., STEEL, {angle}\n*EMBEDDED ELEMENT, HOST ELSET=WALL\n{name}\n"
    )
