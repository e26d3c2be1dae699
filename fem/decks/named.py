"""Edges of a section by the names of surfaces and sets."""

from __future__ import annotations

import numpy as np

from tireroad.fem.decks.deck import ALL_FACES, BOTH_SIDES, Deck, missing
from tireroad.fem.decks.shape.quads import DeckEdges
from tireroad.fem.errors import InputError


def named_edges(deck: Deck, edges: DeckEdges, name: str, key: str) -> np.ndarray:
    """Edge numbers of a surface, node set or membrane set. InputError for other names.

    `key` is the scene's key, for the message."""
    surfaces = {surface.upper(): surface for surface in deck.surfaces}
    if name.upper() in surfaces:
        return _of_surface(deck, edges, deck.surfaces[surfaces[name.upper()]])
    if name in deck.node_sets:
        labels = deck.node_sets.labels(name)
        return edges.between(deck.rows(labels[np.isin(labels, deck.labels)]))
    if name in deck.element_sets:
        return membrane_edges(deck, edges, deck.element_sets.labels(name))
    raise InputError(f"tire.{key}: {missing('surface or node set', name, deck.face_names)}")


def _of_surface(deck: Deck, edges: DeckEdges, rows: np.ndarray) -> np.ndarray:
    order = np.argsort(edges.labels)
    at = np.searchsorted(edges.labels[order], rows[:, 0])
    at = order[np.minimum(at, len(order) - 1)]
    solid = edges.labels[at] == rows[:, 0]
    one = solid & (rows[:, 1] >= 0) & (rows[:, 1] < 4)
    found = [edges.faces[at[one], rows[one, 1]]]
    every = solid & (rows[:, 1] == ALL_FACES)
    found.append(edges.faces[at[every]].ravel())
    membranes = rows[~solid & np.isin(rows[:, 1], (ALL_FACES, BOTH_SIDES)), 0]
    found.append(membrane_edges(deck, edges, membranes))
    numbers = np.concatenate(found)
    return np.unique(numbers[numbers >= 0])


def membrane_edges(deck: Deck, edges: DeckEdges, labels: np.ndarray) -> np.ndarray:
    """Numbers of the edges on which membranes of the given labels lie."""
    found = [np.empty(0, np.int64)]
    for block in deck.blocks:
        if block.kind.role == "membrane":
            mine = np.isin(block.labels, labels)
            ends = deck.rows(
                block.nodes[mine][:, [0, -1 if block.kind.nodes == 2 else 1]], block.place
            )
            found.append(edges.numbers(ends))
    numbers = np.concatenate(found)
    return numbers[numbers >= 0]
