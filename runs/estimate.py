"""How much memory a scene will take, before anything is computed."""

import math

from runs.rules import free_unknowns
from runs.tables import Scene

PROGRAM = 1.5e8
"""Bytes of one process with all libraries loaded, before the mesh (measured: 1.1e8)."""
CONTACT_POINTS = 300


def memory(scene: Scene) -> dict[str, float]:
    """Bytes by part, for one process; an estimate within a factor of about two.

    The factor of the stiffness is that of nested dissection on a surface: 31/4 N log2 N entries for
    N columns of nodes (George 1973, doi 10.1137/0710032), each a dense block as large as the
    unknowns of one column, kept in one triangle. MUMPS took 84 MB for 27,225 and 194 MB for 59,697
    unknowns of second order, this gives 88 MB and 211 MB.
    """
    tire = scene.tire
    free = free_unknowns(tire)
    block = 3 * (tire.elements_thickness * tire.order + 1)
    columns = free / block
    count = scene.modal.count
    parts = {
        "program": PROGRAM,
        "mesh and matrices": 8.0 * 1.5 * free * (6 * block * tire.order**2) / tire.order,
        "factor of the stiffness": 4.0 * 7.75 * columns * math.log2(columns) * block**2,
        "modes": 8.0 * 1.5 * free * count,
    }
    if scene.rotation is not None and scene.rotation.speed > 0:
        parts["rotating pencil"] = 16.0 * 4 * (2 * count) ** 2
    if scene.contact is not None:
        parts["contact"] = 16.0 * 4 * CONTACT_POINTS * 2 * count
    return parts
