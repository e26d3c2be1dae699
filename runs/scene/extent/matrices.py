"""Sizes of the matrices and factors of a mesh whose columns of nodes go through the wall."""

import math

import numpy as np


def factor(free: float, through: int, order: int) -> float:
    """Bytes of one triangle of a factor; `free` unknowns, `through` elements through the wall.

    That of nested dissection on a surface: 31/4 N log2 N entries for N columns of nodes (George
    1973, doi 10.1137/0710032), each a dense block of the unknowns of one column. For 27,225 and
    59,697 unknowns of second order MUMPS took 84 and 194 MB; this gives 88 and 211 MB.
    """
    block = unknowns_through(through, order)
    columns = max(free / block, 2.0)
    return 4.0 * 7.75 * columns * math.log2(columns) * block**2


def matrices(count: int, free: float, through: int, order: int) -> float:
    """Bytes of `count` sparse matrices of the same mesh."""
    coupled = _layers_coupled(through, order) * _columns_coupled(order)
    return 12.0 * count * (3 * free) * coupled


def unknowns_through(through: int, order: int) -> int:
    """Unknowns of a column of nodes."""
    return 3 * (through * order + 1)


def _columns_coupled(order: int) -> float:
    """Columns of nodes sharing an element with a given one, averaged over an element's columns."""
    own = np.full(order, order + 1.0)  # inside an element
    own[0] = 2 * order + 1  # between two elements
    return float(np.outer(own, own).mean())


def _layers_coupled(through: int, order: int) -> float:
    """Nodes of one column that share an element with a given one, on average."""
    inside = through * (order - 1) * (order + 1)
    return (inside + 2 * (order + 1) + (through - 1) * (2 * order + 1)) / (through * order + 1)
