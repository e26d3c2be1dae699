"""The torus of `torus_decks` revolved: three-dimensional decks."""

from __future__ import annotations

import numpy as np
from torus_decks import RUBBER, Torus, listed, place

AXES = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}  # columns of r cos, r sin, along


def position(r, along, theta, axis="y"):
    """(x, y, z) right-handed about the axis."""
    point = np.empty(3)
    first, second, third = AXES[axis]
    point[first], point[second], point[third] = r * np.cos(theta), r * np.sin(theta), along
    return point


def solids(torus: Torus, angles, axis="y", sector=False) -> str:
    """Hexahedra or wedges (by the torus's cells), C3D8, C3D20 or C3D6, around the axis."""
    half = 2 * len(angles)
    step = 1 if torus.quadratic else 2
    theta = np.interp(
        np.arange(half + 1) / 2, np.arange(len(angles) + 1), [*angles, angles[0] + 2 * np.pi]
    )
    text = "*NODE\n"
    for k in range(0, half, step):
        for i, depth in enumerate(torus.depth):
            for j, arc in enumerate(torus.arc):
                if (i % 2) + (j % 2) + (k % 2) > (1 if torus.quadratic else 0):
                    continue
                x = position(*place(arc, depth), theta[k], axis)
                text += f"{label(torus, i, j, k)}, {x[0]:.12g}, {x[1]:.12g}, {x[2]:.12g}\n"
    cells = list(torus.cells())
    kind = {3: "C3D6", 4: "C3D8R", 8: "C3D20H"}[len(cells[0][1])]
    text += f"*ELEMENT, TYPE={kind}, ELSET=WALL\n"
    last = len(angles) - (1 if sector else 0)
    for n in range(last):
        for number, nodes in cells:
            ids = _solid(torus, nodes, 2 * n, (2 * n + 2) % half)
            text += f"{number + n * 10000}, " + ",".join(map(str, ids[:12])) + "\n"
            if len(ids) > 12:
                text = text[:-1] + ",\n" + ",".join(map(str, ids[12:])) + "\n"
    around = range(0, half, step)
    for name, labels in (
        ("RIMNODES", torus.ends()),
        ("INSIDE", torus.face(0)),
        ("OUTSIDE", torus.face(-1)),
    ):
        ids = [
            one + 100_000 * k
            for k in around
            for one in labels
            if not (k % 2 and _middle(torus, one))
        ]
        text += f"*NSET, NSET={name}\n" + listed(ids)
    return text + "*SOLID SECTION, ELSET=WALL, MATERIAL=RUBBER\n" + RUBBER


def label(torus, i, j, k):
    return torus.label(i, j) + 100_000 * k


def _middle(torus, one) -> bool:
    i, j = divmod(one - 1, 1000)
    return bool(i % 2 or j % 2)


def _solid(torus, nodes, k, after):
    """Abaqus's order, the first face at the higher angle so that the volume is positive for y-right-handed."""
    low, high = [n + 100_000 * k for n in nodes], [n + 100_000 * after for n in nodes]
    count = 3 if len(nodes) in (3, 6) else 4
    a, b = high, low
    corner = a[:count] + b[:count]
    if len(nodes) == count:
        return corner
    between = [n + 100_000 * (k + 1) for n in nodes[:count]]
    return corner + a[count:] + b[count:] + between


def around(torus, kind, name) -> str:
    """Quadrilaterals between the two layers of `solids` at eight angles, along the axis first, then around."""
    text, number, arc = f"*ELEMENT, TYPE={kind}, ELSET={name}\n", 90001, range(4, 13, 2)
    for n in range(8):
        for a, b in zip(arc, [*arc][1:], strict=False):
            corner = [
                torus.label(2, j) + 200_000 * k
                for j, k in ((a, n), (b, n), (b, (n + 1) % 8), (a, (n + 1) % 8))
            ]
            text += f"{number}, " + ", ".join(map(str, corner)) + "\n"
            number += 1
    return text
