"""The nodes and elements that a deck has defined so far, by label."""

from __future__ import annotations

import numpy as np

from tireroad.fem.decks.deck import SCOPE
from tireroad.fem.decks.files.elements import Block
from tireroad.fem.decks.files.lines import Place
from tireroad.fem.errors import InputError

_FEW = 64  # blocks searched one by one; more are merged first
_APART = 1e-9  # of the deck's size: tolerance for a node defined again at the same place


class KnownNodes:
    """Blocks of nodes in the order of definition; of repeated nodes the last one holds."""

    def __init__(self) -> None:
        self.blocks = self.count = 0
        self._labels = np.empty(0, np.int64)
        self._points = np.empty((0, 3))
        self._new: list[tuple[np.ndarray, np.ndarray]] = []

    def add(self, labels: np.ndarray, points: np.ndarray) -> None:
        """Add nodes with labels (n,) at points (n, 3)."""
        self.blocks, self.count = self.blocks + 1, self.count + len(labels)
        self._new.append((labels, points))

    def labels(self, file: str) -> np.ndarray:
        """All labels, ascending. Raises InputError as `table` does."""
        return self.table(file)[0]

    def points(self, labels: np.ndarray, asked: Place) -> np.ndarray:
        """Positions (n, 3) of nodes. InputError for a node not yet defined at `asked`."""
        if len(self._new) > _FEW:
            self.table(asked.file)
        found = np.full((len(labels), 3), np.nan)
        for some, points in ((self._labels, self._points), *self._new):
            _look_up(some, points, labels, found)
        missing = np.isnan(found[:, 0])
        if missing.any():
            raise asked.error(f"node {labels[missing][0] % SCOPE} is not defined before this line")
        return found

    def table(self, file: str) -> tuple[np.ndarray, np.ndarray]:
        """Labels, ascending, and points. InputError for a node defined at two places."""
        if self._new:
            parts = [(self._labels, self._points), *self._new]
            labels, points = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
            self._labels, self._points = _once(labels, points, file)
            self._new = []
        return self._labels, self._points


def _look_up(known: np.ndarray, points: np.ndarray, labels: np.ndarray, found: np.ndarray) -> None:
    """Set `found` for those `labels` that are known."""
    if len(known) and (np.diff(known) < 0).any():
        order = np.argsort(known, kind="stable")
        known, points = known[order], points[order]
    at = np.searchsorted(known, labels, side="right") - 1
    there = at >= 0
    there[there] = known[at[there]] == labels[there]
    found[there] = points[at[there]]


def _once(labels: np.ndarray, points: np.ndarray, file: str) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(labels, kind="stable")
    labels, points = labels[order], points[order]
    again = np.flatnonzero(labels[1:] == labels[:-1])
    apart = abs(points[again] - points[again + 1]).max(axis=1, initial=0.0)
    moved = again[apart > _APART * abs(points).max(initial=0.0)]
    if len(moved):
        raise InputError(f"{file}: node {labels[moved[0]] % SCOPE} is defined twice, at two places")
    keep = np.append(labels[1:] != labels[:-1], True)[: len(labels)]
    return labels[keep], points[keep]


class KnownElements:
    """Blocks of used elements; `others`: whether elements of unused types occurred."""

    def __init__(self) -> None:
        self.blocks: list[Block] = []
        self.others = False
        self._place: dict[int, tuple[int, int]] = {}  # block and row
        self._indexed = 0

    def add(self, block: Block) -> None:
        """Add elements of one type."""
        self.blocks.append(block)

    def labels(self) -> np.ndarray:
        """All labels, ascending."""
        return np.sort(np.concatenate([np.empty(0, np.int64), *(b.labels for b in self.blocks)]))

    def one(self, label: int, asked: Place) -> Block | None:
        """A single element; None if it may be of an unused type. InputError if undefined."""
        for number, block in enumerate(self.blocks[self._indexed :], self._indexed):
            self._place |= {name: (number, row) for row, name in enumerate(block.labels.tolist())}
        self._indexed = len(self.blocks)
        if label not in self._place:
            if self.others:
                return None
            raise asked.error(f"element {label % SCOPE} is not defined before this line")
        number, row = self._place[label]
        return self.blocks[number].rows([row])

    def within(self, labels: np.ndarray) -> list[Block]:
        """The parts of the blocks whose labels are among `labels`."""
        at = [np.flatnonzero(np.isin(block.labels, labels)) for block in self.blocks]
        return [block.rows(rows) for block, rows in zip(self.blocks, at, strict=True) if len(rows)]

    def check_once(self) -> None:
        """Raise InputError for an element defined twice."""
        labels = self.labels()
        again = labels[1:][labels[1:] == labels[:-1]]
        if len(again):
            block = next(b for b in reversed(self.blocks) if again[0] in b.labels)
            raise block.place.error(f"element {again[0] % SCOPE} is defined twice")
