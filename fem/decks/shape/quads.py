"""A section as nine-node quadrilaterals, built from a deck's elements (see quad_split)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tireroad.fem.decks.deck import SCOPE, Deck
from tireroad.fem.decks.files.elements import Block
from tireroad.fem.decks.shape.quad_split import SIDE_OF_FACE, TENSOR, Quads, Raw, nine_points, split

_MOST = 50_000  # elements of a section


@dataclass(frozen=True)
class DeckEdges:
    """The deck's edges: end nodes (e, 2) as rows of the deck's points, ascending; for each element
    label the numbers of its faces' edges (n, 4), -1 for the missing one of a triangle.
    """

    ends: np.ndarray
    labels: np.ndarray
    faces: np.ndarray

    def between(self, nodes: np.ndarray) -> np.ndarray:
        """Numbers of the edges both of whose ends are among the given rows of points."""
        return np.flatnonzero(np.isin(self.ends, nodes).all(axis=1))

    def numbers(self, pairs: np.ndarray) -> np.ndarray:
        """Numbers (k,) of edges by their end nodes (k, 2); -1 if there is none."""
        size = max(self.ends.max(initial=0), pairs.max(initial=0)) + 1
        keys = self.ends[:, 0] * size + self.ends[:, 1]
        low = np.sort(pairs, axis=1)
        wanted = low[:, 0] * size + low[:, 1]
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[at] == wanted, at, -1)


def build(deck: Deck, region_of: dict[int, int]) -> tuple[Quads, DeckEdges, bool]:
    """The cells of a two-dimensional deck's solids, its edges, and whether elements were split.

    `region_of`: compound number of each element label. Raises InputError, with file and line, for
    elements that are inside out.
    """
    blocks = [b for b in deck.blocks if b.kind.role == "solid" and b.kind.dimension == 2]
    if sum(len(b.labels) for b in blocks) > _MOST:
        raise blocks[0].place.error(f"more than {_MOST} elements in one section: use a coarser one")
    raws = {n: _raw(deck, [b for b in blocks if b.kind.corners == n], n, region_of) for n in (3, 4)}
    for block in blocks:
        _positive(deck, block)
    pairs = [_pairs(raw) for raw in raws.values()]
    ends, inverse = np.unique(np.concatenate(pairs), axis=0, return_inverse=True)
    inverse = inverse.ravel()
    edge3 = inverse[: len(pairs[0])].reshape(-1, 3)
    edge4 = inverse[len(pairs[0]) :].reshape(-1, 4)
    middles = _middles(deck, ends, ((edge3, raws[3]), (edge4, raws[4])), blocks)
    faces = np.concatenate([np.pad(edge3, ((0, 0), (0, 1)), constant_values=-1), edge4])
    edges = DeckEdges(ends, np.concatenate([raws[3].labels, raws[4].labels]), faces)
    nodes = deck.points[:, :2]
    if not len(raws[3].labels):
        return _whole(nodes, raws[4], edge4, middles), edges, False
    return split(nodes, raws, (edge3, edge4), middles), edges, True


def _raw(deck: Deck, blocks: list[Block], corners: int, region_of: dict[int, int]) -> Raw:
    labels, ends, middles = [np.empty(0, np.int64)], [], []
    for block in blocks:
        rows = deck.rows(block.nodes, block.place)
        labels.append(block.labels)
        ends.append(rows[:, :corners])
        none = np.full((len(rows), corners), -1)
        middles.append(rows[:, corners:] if block.kind.nodes > corners else none)
    every, empty = np.concatenate(labels), np.empty((0, corners), np.int64)
    return Raw(
        every,
        np.concatenate([empty, *ends]),
        np.concatenate([empty, *middles]),
        np.array([region_of[label] for label in every.tolist()], np.int64),
    )


def _positive(deck: Deck, block: Block) -> None:
    """Check that corners run counter-clockwise in (r, z) with angles below 180 degrees."""
    count = block.kind.corners
    corners = deck.points[deck.rows(block.nodes[:, :count], block.place)][:, :, :2]
    after, before = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    turn = after[..., 0] * before[..., 1] - after[..., 1] * before[..., 0]
    size = np.abs(turn).max(axis=1, initial=0.0)
    wrong = np.flatnonzero(~(turn.min(axis=1, initial=np.inf) > 1e-9 * size))
    if not len(wrong):
        return
    label, inverted = block.labels[wrong[0]] % SCOPE, turn[wrong[0]].max() <= 0
    r, z = corners[wrong[0]].mean(axis=0)
    what = "has a negative volume (its nodes run clockwise)" if inverted else "is folded or flat"
    hint = " All do: are the columns z, r?" if inverted and len(wrong) == len(block.labels) else ""
    raise block.place.error(
        f"element {label} at r = {r:.5g}, z = {z:.5g} {what}; {len(wrong)} of this block.{hint}"
    )


def _pairs(raw: Raw) -> np.ndarray:
    """End nodes (elements * corners, 2) of all edges, each ascending."""
    return np.sort(
        np.stack([raw.corners, np.roll(raw.corners, -1, axis=1)], axis=2), axis=2
    ).reshape(-1, 2)


def _middles(
    deck: Deck, ends: np.ndarray, parts: Sequence[tuple[np.ndarray, Raw]], blocks: list[Block]
) -> np.ndarray:
    """The middle of each edge: the deck's node if there is one, else halfway between its ends."""
    nodes = deck.points[:, :2]
    middles = nodes[ends].mean(axis=1)
    node = np.full(len(ends), -1)
    for edge, raw in parts:
        given = raw.middles >= 0
        node[edge[given]] = raw.middles[given]
        other = given & (node[edge] != raw.middles)
        if other.any():
            label = raw.labels[other.any(axis=1)][0] % SCOPE
            raise blocks[0].place.error(
                f"element {label} shares two corners with a neighbour and not the node between them"
            )
    middles[node >= 0] = nodes[node[node >= 0]]
    return middles


def _whole(nodes: np.ndarray, raw: Raw, edge: np.ndarray, middles: np.ndarray) -> Quads:
    used, corner = np.unique(raw.corners, return_inverse=True)
    corner = corner.reshape(raw.corners.shape)
    first, count = len(used), len(raw.labels)
    centre = first + len(middles) + np.arange(count)
    cells = np.column_stack([corner, first + edge, centre])[:, TENSOR]
    points = np.concatenate([nodes[used], middles, nine_points(nodes, raw, edge, middles)[:, 4]])
    origin = np.empty((count, 4), np.int64)
    origin[:, SIDE_OF_FACE] = edge
    return Quads(points=points, cells=cells, region=raw.region, element=raw.labels, origin=origin)
