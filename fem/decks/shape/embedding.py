"""Embedding of all membranes with cords in the cells of a section."""

from __future__ import annotations

import numpy as np

from tireroad.fem.decks.deck import SCOPE, Deck, Layer
from tireroad.fem.decks.shape.chains import strings
from tireroad.fem.decks.shape.cut import Origins
from tireroad.fem.decks.shape.membranes import Line, lay
from tireroad.fem.decks.shape.plies import Laid
from tireroad.fem.decks.shape.quad_split import Quads
from tireroad.fem.decks.shape.quads import DeckEdges


def lay_all(
    deck: Deck, quads: Quads, edges: DeckEdges, origins: Origins
) -> tuple[Quads, dict[str, Laid]]:
    """The cells with sides along all membranes that carry cords, and the position of each set.

    Membranes that share the solids' nodes already lie on sides; others are located
    geometrically.
    """
    done: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for layer in deck.layers:
        if layer.elements in done:
            continue
        ends, points, labels = _elements(deck, layer)
        numbers = edges.numbers(ends)
        if (numbers < 0).any():
            quads, numbers = _embed(deck, quads, layer, ends, points, labels, origins)
        done[layer.elements] = (numbers, points)
    return quads, {
        name: Laid(origins.with_parts(numbers), points[:, 1], points[:, 2] - points[:, 0])
        for name, (numbers, points) in done.items()
    }


def _elements(deck: Deck, layer: Layer) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """End nodes (k, 2), points (k, 3, 2) and labels (k,) of a layer's membranes."""
    wanted = deck.element_sets.labels(layer.elements, layer.place)
    ends, points, labels = [], [], []
    for block in deck.blocks:
        mine = np.isin(block.labels, wanted)
        if block.kind.role != "membrane" or not mine.any():
            continue
        rows = deck.rows(block.nodes[mine], block.place)
        at = deck.points[rows][:, :, :2]
        middle = at[:, 2] if block.kind.nodes == 3 else at.mean(axis=1)
        ends.append(rows[:, :2])
        points.append(np.stack([at[:, 0], middle, at[:, 1]], axis=1))
        labels.append(block.labels[mine])
    if not ends:
        raise layer.place.error(
            f"the set {layer.elements} of cords {layer.name} holds no membranes (SFMGAX, MGAX, SFM3D, M3D)"
        )
    ends, points, labels = (np.concatenate(part) for part in (ends, points, labels))
    flat = np.flatnonzero(ends[:, 0] == ends[:, 1])
    if len(flat):
        raise layer.place.error(f"membrane {labels[flat[0]] % SCOPE} begins and ends at one node")
    return ends, points, labels


def _embed(
    deck: Deck,
    quads: Quads,
    layer: Layer,
    ends: np.ndarray,
    points: np.ndarray,
    labels: np.ndarray,
    origins: Origins,
) -> tuple[Quads, np.ndarray]:
    """The cells split along membranes inside them, and the numbers of the sides created."""
    hosts = _hosts(deck, layer, labels)
    numbers: list[int] = []
    for line in strings(ends)[0]:
        turned = _turned(ends[line])
        three = np.where(turned[:, None, None], points[line][:, ::-1], points[line])
        first = labels[line[0]] % SCOPE

        def fail(text: str, first: int = first) -> Exception:
            return layer.place.error(
                f"cords {layer.name}: the line of membranes from element {first}: {text}"
            )

        quads, new = lay(quads, Line(layer.elements, three, fail, hosts), origins)
        numbers += new
    return quads, np.array(numbers, np.int64)


def _turned(ends: np.ndarray) -> np.ndarray:
    """Which elements of an ordered chain run against it."""
    if len(ends) == 1:
        return np.zeros(1, bool)
    turned = np.empty(len(ends), bool)
    turned[0] = ends[0, 1] not in ends[1]
    at = ends[0, 0] if turned[0] else ends[0, 1]
    for k in range(1, len(ends)):
        turned[k] = ends[k, 0] != at
        at = ends[k, 0] if turned[k] else ends[k, 1]
    return turned


def _hosts(deck: Deck, layer: Layer, labels: np.ndarray) -> frozenset | None:
    """Elements in which the membranes must lie; None if the deck names no host for them."""
    for embedded in deck.embedded:
        if embedded.host is None:
            continue
        for name in embedded.elements:
            if np.isin(labels, deck.element_sets.labels(name, embedded.place)).any():
                return frozenset(deck.element_sets.labels(embedded.host, embedded.place).tolist())
    return None
