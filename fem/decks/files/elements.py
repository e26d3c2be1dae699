"""The Abaqus element types that can form a tire's section or body."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from tireroad.fem.decks.files.lines import Place


@dataclass(frozen=True)
class Kind:
    """An element shape: `role` solid or membrane, dimension of the deck, nodes and faces.

    A face is given by its corner nodes, in the manual's order S1, S2, ...
    """

    role: str
    dimension: int
    nodes: int
    corners: int
    faces: tuple[tuple[int, ...], ...] = ()

    def reflected(self, asked: Place) -> list[int]:
        """Node order that gives the mirror image of an element a positive volume."""
        if self not in _REFLECTED:
            raise asked.error(f"*ELCOPY, REFLECT of elements of {self.nodes} nodes is not read")
        return _REFLECTED[self]


_TRIANGLE = ((0, 1), (1, 2), (2, 0))
_QUAD = ((0, 1), (1, 2), (2, 3), (3, 0))
_WEDGE = ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0))
_HEXAHEDRON = (
    (0, 1, 2, 3),
    (4, 7, 6, 5),
    (0, 4, 5, 1),
    (1, 5, 6, 2),
    (2, 6, 7, 3),
    (3, 7, 4, 0),
)

# H hybrid, R reduced, I incompatible modes, T coupled temperature, M modified: the program has its
# own integration rules and ignores these.
_FAMILIES = (
    (re.compile(r"(?:CGAX|CAX)([3468])[RHIMT]*"), "solid", 2),
    (re.compile(r"C3D(4|6|8|10|15|20|27)[RHIMST]*"), "solid", 3),
    (re.compile(r"(?:SFMGAX|SFMAX|MGAX|MAX)([12])[RHT]*"), "membrane", 2),
    (re.compile(r"(?:SFM3D|M3D)([34689])[R]*"), "membrane", 3),
)
_SOLIDS = {
    (2, 3): Kind("solid", 2, 3, 3, _TRIANGLE),
    (2, 4): Kind("solid", 2, 4, 4, _QUAD),
    (2, 6): Kind("solid", 2, 6, 3, _TRIANGLE),
    (2, 8): Kind("solid", 2, 8, 4, _QUAD),
    (3, 4): Kind("solid", 3, 4, 4),
    (3, 10): Kind("solid", 3, 10, 4),
    (3, 6): Kind("solid", 3, 6, 6, _WEDGE),
    (3, 15): Kind("solid", 3, 15, 6, _WEDGE),
    (3, 8): Kind("solid", 3, 8, 8, _HEXAHEDRON),
    (3, 20): Kind("solid", 3, 20, 8, _HEXAHEDRON),
    (3, 27): Kind("solid", 3, 27, 8, _HEXAHEDRON),
}
_MEMBRANES = {
    (2, 1): Kind("membrane", 2, 2, 2),
    (2, 2): Kind("membrane", 2, 3, 2),
    (3, 3): Kind("membrane", 3, 3, 3),
    (3, 4): Kind("membrane", 3, 4, 4),
    (3, 6): Kind("membrane", 3, 6, 3),
    (3, 8): Kind("membrane", 3, 8, 4),
    (3, 9): Kind("membrane", 3, 9, 4),
}
# The first node stays, the others are traversed in reverse; in solids this holds for each end face.
_REFLECTED = {
    _SOLIDS[2, 3]: [0, 2, 1],
    _SOLIDS[2, 4]: [0, 3, 2, 1],
    _SOLIDS[2, 6]: [0, 2, 1, 5, 4, 3],
    _SOLIDS[2, 8]: [0, 3, 2, 1, 7, 6, 5, 4],
    _SOLIDS[3, 6]: [0, 2, 1, 3, 5, 4],
    _SOLIDS[3, 8]: [0, 3, 2, 1, 4, 7, 6, 5],
    _SOLIDS[3, 15]: [0, 2, 1, 3, 5, 4, 8, 7, 6, 11, 10, 9, 12, 14, 13],
    _SOLIDS[3, 20]: [0, 3, 2, 1, 4, 7, 6, 5, 11, 10, 9, 8, 15, 14, 13, 12, 16, 19, 18, 17],
}


def kind(name: str) -> Kind | None:
    """The shape of an Abaqus type in capitals; None for a type that is not used."""
    for pattern, role, dimension in _FAMILIES:
        match = pattern.fullmatch(name)
        if match:
            shapes = _SOLIDS if role == "solid" else _MEMBRANES
            return shapes.get((dimension, int(match[1])))
    return None


def used_kind(name: str) -> Kind:
    """The shape of a type known to be used."""
    found = kind(name)
    assert found is not None, f"{name} is not among the types that are used"
    return found


@dataclass(frozen=True)
class Block:
    """Elements of one type: labels (n,), nodes (n, k) by label, and the line where they begin."""

    type: str
    kind: Kind
    labels: np.ndarray
    nodes: np.ndarray
    place: Place

    def rows(self, rows: list[int] | np.ndarray) -> Block:
        """The given rows of the block."""
        return Block(self.type, self.kind, self.labels[rows], self.nodes[rows], self.place)
