"""How much memory a scene will take, before anything is computed."""

import math

import numpy as np

from tireroad.runs.scene.tables import Scene
from tireroad.runs.scene.tire_section import free_unknowns

PROGRAM = 2.1e8
"""Bytes of one process with all libraries loaded and the mesh made (measured)."""
MATRICES = 10
"""Sparse matrices held at the highest: K, its scaled copy and parts, four of rotation, the rolling two."""
BASES = 3
"""Copies of all modes held at the highest: slices, the sorted vectors, their products."""
CONTACT_POINTS = 300


def memory(scene: Scene) -> dict[str, float]:
    """Bytes by part, for one process at the highest; an estimate within a factor of about two.

    The factor of the stiffness is that of nested dissection on a surface: 31/4 N log2 N entries for
    N columns of nodes (George 1973, doi 10.1137/0710032), each a dense block as large as the
    unknowns of one column, kept in one triangle. MUMPS took 84 MB for 27,225 and 194 MB for 59,697
    unknowns of second order, this gives 88 MB and 211 MB. A turning tire's has both triangles.
    """
    tire = scene.tire
    free = free_unknowns(tire)
    block = 3 * (tire.elements_thickness * tire.order + 1)
    columns = free / block
    count = scene.modal.count
    turning = scene.rotation is not None and scene.rotation.speed > 0
    parts = {
        "program": PROGRAM,
        "matrices": 12.0 * MATRICES * free * block * _columns_coupled(tire.order),
        "factor of the stiffness": (8.0 if turning else 4.0)
        * 7.75
        * columns
        * math.log2(columns)
        * block**2,
        "modes": 8.0 * BASES * free * count,
    }
    if turning:
        parts["rotating pencil"] = 16.0 * 4 * (2 * count) ** 2
    if scene.contact is not None:
        parts["contact"] = 16.0 * 4 * CONTACT_POINTS * 2 * count
    return parts


def _columns_coupled(order: int) -> float:
    """Columns of nodes that share an element with one, on average over an element's own."""
    own = np.full(order, order + 1.0)  # inside an element
    own[0] = 2 * order + 1  # between two
    return float(np.outer(own, own).mean())
