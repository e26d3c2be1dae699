"""Nodes and elements that an Abaqus deck generates: *NGEN, *NFILL, *NCOPY, *ELGEN, *ELCOPY.

As in Abaqus a keyword sees the nodes, elements and sets defined before it. Source: the Keywords
Reference, and "Node definition" and "Element definition" in the Analysis User's Guide.
"""

from __future__ import annotations

import math

import numpy as np

from tireroad.fem.decks.deck import SCOPE, Sets
from tireroad.fem.decks.files.abaqus_sets import SetReader, data_lines
from tireroad.fem.decks.files.elements import Block
from tireroad.fem.decks.files.known import KnownElements, KnownNodes
from tireroad.fem.decks.files.lines import Card, Data, Place
from tireroad.fem.decks.files.numbers import LABEL, label, number
from tireroad.fem.decks.files.placing import along_arc, along_line, copied

MOST = 10**7  # limit of generated nodes and elements per deck

Line = tuple[Place, list[str]]


class Generator:
    """Handlers of keywords that generate nodes and elements from those known so far."""

    def __init__(self, nodes: KnownNodes, elements: KnownElements, sets: SetReader) -> None:
        self._nodes, self._elements, self._sets = nodes, elements, sets
        self._made = 0
        self.handlers = {
            "NGEN": self._ngen,
            "NFILL": self._nfill,
            "NCOPY": self._ncopy,
            "ELGEN": self._elgen,
            "ELCOPY": self._elcopy,
        }

    def _ngen(self, card: Card, lines: list[Data], scope: int) -> None:
        """A line of nodes; data: first, last, label increment, extra node or its coordinates,
        normal of the arc."""
        sort = card.options.get("LINE", "").upper()
        if sort not in ("", "C"):
            raise card.place.error(f"*NGEN, LINE={sort} is not read: straight lines and LINE=C are")
        if card.options.get("SYSTEM", "RC").upper() not in ("RC", "R"):
            raise card.place.error("*NGEN: the extra point is read in SYSTEM=RC alone")
        for place, parts in data_lines(lines):
            labels = self._range(parts, place, scope)
            ends = self._nodes.points(labels[[0, -1]], place)
            share = np.arange(len(labels))[1:-1] / (len(labels) - 1)
            if sort:
                points = along_arc(ends, *self._centre(parts, place, scope), share, place)
            else:
                points = along_line(ends[:1], ends[1:], share)
            self._nodes.add(labels[1:-1], points)
            self._sets.add_nodes(card, labels)

    def _range(self, parts: list[str], place: Place, scope: int) -> np.ndarray:
        """The labels from one end to the other."""
        if len(parts) < 2:
            raise place.error("*NGEN needs two end nodes")
        first, last = (label(part, place) for part in parts[:2])
        step = abs(label(parts[2].lstrip("-"), place)) if len(parts) > 2 and parts[2] else 1
        if step == 0 or first == last or abs(last - first) % step:
            raise place.error(f"*NGEN from {first} to {last} in steps of {step}: no whole number")
        self._count(abs(last - first) // step, place)
        step = step if last > first else -step
        return np.arange(first, last + (1 if step > 0 else -1), step) + scope * SCOPE

    def _centre(self, parts: list[str], place: Place, scope: int) -> tuple[np.ndarray, np.ndarray]:
        """Centre of an arc and the normal of its plane, 0 if none is given."""
        parts = parts + [""] * (10 - len(parts))
        if parts[3] and label(parts[3], place):
            centre = self._nodes.points(np.array([label(parts[3], place)]) + scope * SCOPE, place)[
                0
            ]
        else:
            centre = np.array([number(part, place) for part in parts[4:7]])
        return centre, np.array([number(part, place) for part in parts[7:10]])

    def _nfill(self, card: Card, lines: list[Data], scope: int) -> None:
        """Nodes on straight lines between two sets; data: set, set, intervals, label increment."""
        if "SINGULAR" in card.options:
            raise card.place.error("*NFILL, SINGULAR is not read")
        bias = number(card.options.get("BIAS", "1"), card.place)
        if not bias > 0:
            raise card.place.error(f"*NFILL: BIAS={bias:g} must be > 0")
        for place, parts in data_lines(lines):
            if len(parts) < 3:
                raise place.error("*NFILL needs two node sets and a number of intervals")
            intervals = label(parts[2], place)
            step = label(parts[3], place) if len(parts) > 3 and parts[3] else 1
            ends = [self._ordered(part, place) for part in parts[:2]]
            lines_ = min(map(len, ends))
            self._count(intervals * lines_, place)
            first, last = (end[:lines_] for end in ends)
            share = _shares(intervals, bias, "TWO STEP" in card.options, place)
            labels = first[:, None] + step * np.arange(1, intervals)
            start, end = (self._nodes.points(end, place)[:, None] for end in (first, last))
            points = along_line(start, end, share)
            self._nodes.add(labels.ravel(), points.reshape(-1, 3))
            for made in (first, labels.ravel(), last):
                self._sets.add_nodes(card, made)

    def _ncopy(self, card: Card, lines: list[Data], scope: int) -> None:
        """Copy the nodes of a set, shifted, rotated or reflected; labels grow by a number."""
        change = self._whole(card, "CHANGE NUMBER")
        old = self._ordered(card.options.get("OLD SET", ""), card.place)
        self._count(len(old), card.place)
        table = [[number(part, place) for part in parts] for place, parts in data_lines(lines)]
        points = copied(self._nodes.points(old, card.place), card, table)
        self._nodes.add(old + change, points)
        self._sets.into(self._sets.node_sets, card.options.get("NEW SET"), old + change)

    def _elgen(self, card: Card, lines: list[Data], scope: int) -> None:
        """Copies of an element in rows and layers; data: element, then counts and increments."""
        for place, parts in data_lines(lines):
            numbers = [label(part, place) if part else 1 for part in parts]
            numbers += [1] * (10 - len(numbers))
            if not 2 <= len(parts) <= 10 or 0 in numbers[1::3]:
                raise place.error(
                    "*ELGEN needs an element, and a number, two steps for each direction"
                )
            counts = numbers[1::3]
            self._count(math.prod(counts), place)
            steps = np.array([numbers[k : k + 2] for k in (2, 5, 8)])
            times = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1).reshape(-1, 3)
            nodes, elements = (times @ steps)[np.argsort((times @ steps)[:, 1], kind="stable")].T
            self._more(card, numbers[0] + scope * SCOPE, nodes, elements, place)

    def _more(
        self, card: Card, master: int, nodes: np.ndarray, elements: np.ndarray, place: Place
    ) -> None:
        """Copies of a master element, which is the first of them."""
        one = self._elements.one(master, place)
        if one is None:
            self._sets.add_elements(card, np.empty(0, np.int64))
            return
        made = master + elements[1:], one.nodes + nodes[1:, None]
        self._elements.add(Block(one.type, one.kind, *made, place))
        self._sets.add_elements(card, master + elements)

    def _elcopy(self, card: Card, lines: list[Data], scope: int) -> None:
        """Copy the elements of a set, with element and node labels increased by two numbers."""
        shift, nodes = self._whole(card, "ELEMENT SHIFT"), self._whole(card, "SHIFT NODES")
        name = card.options.get("OLD SET", card.options.get("OLDSET", ""))
        sets = Sets("element set", self._sets.element_sets, self._elements.labels())
        old = sets.labels(name, card.place)
        self._count(len(old), card.place)
        for block in self._elements.within(old):
            turned = block.nodes
            if "REFLECT" in card.options:
                turned = turned[:, block.kind.reflected(card.place)]
            self._elements.add(
                Block(block.type, block.kind, block.labels + shift, turned + nodes, card.place)
            )
        if "REFLECT" in card.options:
            self._sets.reflected.append(old + shift)
        self._sets.into(self._sets.element_sets, card.options.get("NEW SET"), old + shift)

    def _ordered(self, name: str, place: Place) -> np.ndarray:
        """The nodes of a set known so far: ascending, or in the order of an UNSORTED set."""
        sets = Sets("node set", self._sets.node_sets, self._nodes.labels(place.file))
        return sets.ordered(name.strip("\"'"), place)

    def _whole(self, card: Card, key: str) -> int:
        value = number(card.options.get(key, ""), card.place)
        if key not in card.options or value != int(value) or abs(value) > LABEL:
            raise card.place.error(f"*{card.keyword} needs {key}=, a whole number")
        return int(value)

    def _count(self, more: int, place: Place) -> None:
        self._made += more
        if self._made > MOST:
            raise place.error(f"more than {MOST} nodes and elements are generated: this is no tire")


def _shares(intervals: int, bias: float, two_step: bool, place: Place) -> np.ndarray:
    """Positions of nodes between two ends, 0 to 1; each interval is 1/bias times the last.

    With `two_step` this holds for pairs of equal intervals, for second-order elements.
    """
    pairs = intervals // 2 if two_step else intervals
    if intervals < 1 or (two_step and intervals % 2):
        raise place.error(f"*NFILL: {intervals} intervals" + (" with TWO STEP" if two_step else ""))
    with np.errstate(over="ignore", under="ignore"):
        sizes = bias ** -np.arange(pairs, dtype=float)
    if not (np.isfinite(sizes).all() and sizes.min() > 0):
        raise place.error(
            f"*NFILL: {intervals} intervals with BIAS={bias:g} reach beyond any number"
        )
    sizes = np.repeat(sizes, 2) if two_step else sizes
    return (np.cumsum(sizes) / sizes.sum())[:-1]
