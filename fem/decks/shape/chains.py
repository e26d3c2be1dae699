"""Ordering of cell sides into chains from end to end."""

from __future__ import annotations

from collections import defaultdict

import numpy as np

from tireroad.fem.decks.shape.quad_split import Quads


def once(quads: Quads, edges: np.ndarray) -> np.ndarray:
    """Sides (k, 2), with those shared by two cells listed once."""
    middle = quads.sides()[edges[:, 0], edges[:, 1], 1]
    _, first = np.unique(middle, return_index=True)
    return edges[np.sort(first)]


def with_origin(quads: Quads, numbers: np.ndarray) -> np.ndarray:
    """Sides (k, 2) on the given edges of the deck, each listed once."""
    return once(quads, np.argwhere(np.isin(quads.origin, numbers) & (quads.origin >= 0)))


def ends(quads: Quads, edges: np.ndarray) -> np.ndarray:
    """End nodes (k, 2) of sides."""
    return quads.sides()[edges[:, 0], edges[:, 1]][:, [0, 2]]


def strings(pairs: np.ndarray) -> tuple[list[np.ndarray], list[int]]:
    """Line elements (k, 2) in order: indices of each chain, and nodes where three or more meet.

    A closed line is one chain. Chains end at branches.
    """
    at = defaultdict(list)
    for number, pair in enumerate(pairs.tolist()):
        for node in pair:
            at[node].append(number)
    left = set(range(len(pairs)))
    found = []
    for start in sorted(node for node, there in at.items() if len(there) != 2) + sorted(at):
        for number in at[start]:
            if number in left:
                found.append(np.array(_follow(start, number, pairs, at, left)))
    return found, [node for node, there in at.items() if len(there) > 2]


def _follow(node: int, number: int, pairs: np.ndarray, at: dict, left: set) -> list[int]:
    path = []
    while True:
        path.append(number)
        left.discard(number)
        a, b = pairs[number]
        node = b if node == a else a
        onward = [n for n in at[node] if n in left]
        if len(at[node]) != 2 or not onward:
            return path
        number = onward[0]


def along(pairs: np.ndarray) -> np.ndarray:
    """Nodes (k + 1,) along an ordered chain of line elements (k, 2)."""
    if len(pairs) == 1:
        return pairs[0]
    first = pairs[0, ::-1] if pairs[0, 0] in pairs[1] and pairs[0, 1] not in pairs[1] else pairs[0]
    nodes = list(first)
    for pair in pairs[1:]:
        nodes.append(pair[1] if pair[0] == nodes[-1] else pair[0])
    return np.array(nodes)


def forward(quads: Quads, edges: np.ndarray) -> np.ndarray:
    """An ordered chain, running towards higher y at its middle (higher r where level)."""
    nodes = along(ends(quads, edges))
    middle = (len(nodes) - 1) // 2
    step = quads.points[nodes[middle + 1]] - quads.points[nodes[middle]]
    level = abs(step[1]) < 1e-9 * abs(step[0])
    return edges[::-1] if (step[0] if level else step[1]) < 0 else edges
