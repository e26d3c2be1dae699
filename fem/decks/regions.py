"""Assignment of compounds to the elements of a section."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tireroad.fem.decks.deck import SCOPE, Deck
from tireroad.fem.decks.files.elements import Block
from tireroad.fem.decks.files.lines import Place
from tireroad.fem.errors import InputError


@dataclass(frozen=True)
class Regions:
    """Names of the regions, their materials in the deck (None: none), the place that defines each,
    and the region number of every element label (`of`).
    """

    names: tuple[str, ...]
    materials: tuple[str | None, ...]
    places: tuple[Place, ...]
    of: dict[int, int]
    notes: tuple[str, ...] = ()


def regions(deck: Deck) -> Regions:
    """The solid sections of a deck or, if it has none, its element sets."""
    blocks = [b for b in deck.blocks if b.kind.role == "solid" and len(b.labels)]
    if not blocks:
        raise InputError(
            f"{deck.file}: no solid element in it: CGAX, CAX (sections) and C3D types are read, and "
            "quadrilaterals, triangles, hexahedra and wedges of Gmsh"
        )
    labels = np.sort(np.concatenate([block.labels for block in blocks]))
    if not deck.solids:
        return _by_set(deck, blocks, labels)
    names: list[str] = []
    of: dict[int, int] = {}
    materials, places = [], []
    for solid in deck.solids:
        mine = np.intersect1d(deck.element_sets.labels(solid.elements, solid.place), labels)
        if not len(mine):
            continue
        twice = next((label for label in mine.tolist() if label in of), None)
        if twice is not None:
            raise solid.place.error(
                f"element {twice % SCOPE} is in two solid sections, {names[of[twice]]} and {solid.elements}"
            )
        of.update(dict.fromkeys(mine.tolist(), len(names)))
        names.append(solid.elements)
        materials.append(solid.material)
        places.append(solid.place)
    left = np.setdiff1d(labels, np.fromiter(of, np.int64, len(of)))
    if len(left):
        raise InputError(
            f"{deck.file}: {len(left)} solid elements are in no *SOLID SECTION, element {left[0] % SCOPE} for one"
        )
    return Regions(tuple(names), tuple(materials), tuple(places), of)


def _by_set(deck: Deck, blocks: list[Block], labels: np.ndarray) -> Regions:
    """One region per element set, smallest sets first, and one for the remaining elements."""
    sets = {
        name: np.intersect1d(deck.element_sets.labels(name), labels)
        for name in deck.element_sets.names
    }
    names: list[str] = []
    of: dict[int, int] = {}
    for name, mine in sorted(sets.items(), key=lambda item: len(item[1])):
        new = [label for label in mine.tolist() if label not in of]
        if new:
            of.update(dict.fromkeys(new, len(names)))
            names.append(name)
    left = [label for label in labels.tolist() if label not in of]
    if left:
        of.update(dict.fromkeys(left, len(names)))
        names.append("WALL")
    note = "no solid sections: the regions are the element sets, their materials those of the scene"
    place = blocks[0].place
    count = len(names)
    return Regions(tuple(names), (None,) * count, (place,) * count, of, (note,))
