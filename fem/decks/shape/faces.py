"""The faces of a section: rim, inner face under pressure, outer face and tread."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tireroad.fem.decks.shape.chains import along, ends, once, strings
from tireroad.fem.decks.shape.quad_split import Quads
from tireroad.fem.errors import InputError


@dataclass(frozen=True)
class Faces:
    """Sides (k, 2) of (cell, side); `outer` from lower to higher y. `notes`: guesses made."""

    outer: np.ndarray
    tread: np.ndarray
    inner: np.ndarray
    rim: np.ndarray
    notes: tuple[str, ...]


def faces(
    quads: Quads, rim: np.ndarray, inner: np.ndarray | None, tread: np.ndarray | None
) -> Faces:
    """The faces from the sides that the deck names; unnamed inner face and tread from the outline.

    Without the rim the outline consists of two or more lines: the outer face reaches farthest from
    the axle, the inner face farthest of the rest. Raises InputError if there are too few.
    """
    outline = quads.boundary()
    notes = []
    held = rim if inner is None else np.concatenate([rim, inner])
    lines = _lines(quads, _without(quads, outline, held))
    if len(lines) < (2 if inner is None else 1):
        raise InputError(
            "the rim does not part the outline of the section into an inner and an outer face: it must be "
            "held at both beads (tire.rim; a half section needs mirror = true), or tire.inner must be named"
        )
    outer = lines[0]
    if inner is None:
        inner = lines[1]
        notes.append(
            f"inner face: guessed, the {len(inner)} sides between the rims that look at the axle"
        )
    if tread is None:
        tread = outer
        notes.append(f"tread: not named, the whole outer face of {len(outer)} sides")
    order = along(ends(quads, outer))
    if quads.points[order[0], 1] > quads.points[order[-1], 1]:
        outer = outer[::-1]
    return Faces(outer, tread, inner, rim, tuple(notes))


def _lines(quads: Quads, sides: np.ndarray) -> list[np.ndarray]:
    """Unbroken lines of an outline's sides, the one that reaches farthest from the axle first."""
    found, _ = strings(ends(quads, sides)) if len(sides) else ([], [])
    reach = [-quads.points[ends(quads, sides[line]).ravel(), 0].max() for line in found]
    return [sides[found[n]] for n in np.argsort(reach, kind="stable")]


def _without(quads: Quads, sides: np.ndarray, others: np.ndarray) -> np.ndarray:
    middle = quads.sides()[:, :, 1]
    gone = middle[others[:, 0], others[:, 1]]
    return sides[~np.isin(middle[sides[:, 0], sides[:, 1]], gone)]


def on_outline(quads: Quads, sides: np.ndarray) -> np.ndarray:
    """The given sides that are on the boundary."""
    middle = quads.sides()[:, :, 1]
    outline = quads.boundary()
    there = middle[outline[:, 0], outline[:, 1]]
    return once(quads, sides[np.isin(middle[sides[:, 0], sides[:, 1]], there)])


def one_body(quads: Quads, name: Callable[[int], str]) -> None:
    """Raise InputError unless all cells are connected by nodes; `name` formats an element label."""
    pairs = ends(quads, np.argwhere(np.ones((len(quads.cells), 4), bool)))
    group = np.arange(len(quads.points))
    while True:
        low = np.minimum(group[pairs[:, 0]], group[pairs[:, 1]])
        new = group.copy()
        np.minimum.at(new, pairs.ravel(), np.repeat(low, 2))
        new = new[new]
        if (new == group).all():
            break
        group = new
    bodies, first = np.unique(group[quads.cells[:, 0]], return_index=True)
    if len(bodies) > 1:
        a, b = (name(quads.element[cell]) for cell in first[:2])
        raise InputError(
            f"{len(bodies)} bodies that share no nodes, one with {a} and one with {b}: the section must be "
            "one; merge the nodes at their border"
        )
