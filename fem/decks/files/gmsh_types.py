"""The element types of Gmsh and their Abaqus counterparts."""

# Type number: dimension, nodes, Abaqus name, indices of its nodes in Abaqus's order.
_HEXAHEDRON = (*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15)


_WEDGE = (*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11)


TYPES = {
    1: (1, 2, "SFMGAX1", (0, 1)),
    8: (1, 3, "SFMGAX2", (0, 1, 2)),
    2: (2, 3, "CGAX3", (0, 1, 2)),
    3: (2, 4, "CGAX4", (0, 1, 2, 3)),
    9: (2, 6, "CGAX6", tuple(range(6))),
    10: (2, 9, "CGAX8", tuple(range(8))),
    16: (2, 8, "CGAX8", tuple(range(8))),
    5: (3, 8, "C3D8", tuple(range(8))),
    6: (3, 6, "C3D6", tuple(range(6))),
    17: (3, 20, "C3D20", _HEXAHEDRON),
    12: (3, 27, "C3D20", _HEXAHEDRON),
    18: (3, 15, "C3D15", _WEDGE),
    13: (3, 18, "C3D15", _WEDGE),
    15: (0, 1, "", (0,)),
}


FACES = {2: ("M3D3", 3), 3: ("M3D4", 4), 9: ("M3D6", 6), 10: ("M3D9", 9), 16: ("M3D8", 8)}
