"""Node sets, element sets and surfaces of an Abaqus deck."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from tireroad.fem.decks.deck import ALL_FACES, BOTH_SIDES, SCOPE, Members, Sets
from tireroad.fem.decks.files.lines import Card, Data, Place
from tireroad.fem.decks.files.numbers import fields, label, labels, rows, shown

_FACE = re.compile(r"S([1-6])")
_NAME = re.compile(r"[^\d\s+.-]")  # marks a field as the name of a set, not a number


def data_lines(lines: list[Data]) -> Iterator[tuple[Place, list[str]]]:
    """(place, fields) of every data line that is not blank."""
    for part in lines:
        first = part.place.line - part.text[: len(part.text) - len(part.text.lstrip())].count(b"\n")
        for offset, line in enumerate(part.text.split(b"\n")):
            if line.strip():
                yield Place(part.place.file, first + offset), fields(line)


class SetReader:
    """Collects sets as written; names are resolved once the deck is complete.

    `scopes`: part number of each instance, since sets of an assembly name their instance.
    """

    def __init__(self) -> None:
        self.node_sets: dict[str, Members] = {}
        self.element_sets: dict[str, Members] = {}
        self.surfaces: dict[str, list] = {}
        self.pressed: list[str] = []
        self.scopes: dict[str, int] = {}
        self.unused: list[str] = []
        self.reflected: list[
            np.ndarray
        ] = []  # elements whose faces are numbered differently from their originals'

    def add_nodes(self, card: Card, labels: np.ndarray) -> None:
        """The NSET of a *NODE."""
        self.into(self.node_sets, card.options.get("NSET"), labels)

    def add_elements(self, card: Card, labels: np.ndarray) -> None:
        """The ELSET of an *ELEMENT."""
        self.into(self.element_sets, card.options.get("ELSET"), labels)

    def into(self, sets: dict[str, Members], name: str | None, labels: np.ndarray) -> None:
        """Add labels to the set of this name, if one is given."""
        if name:
            self._members(sets, name).labels.append(labels)

    def nodes_of(self, card: Card, lines: list[Data], scope: int) -> None:
        """A *NSET."""
        self._set(self.node_sets, "NSET", card, lines, scope)

    def elements_of(self, card: Card, lines: list[Data], scope: int) -> None:
        """An *ELSET."""
        self._set(self.element_sets, "ELSET", card, lines, scope)

    def _members(self, sets: dict[str, Members], name: str) -> Members:
        return sets.setdefault(name.upper(), Members())

    def _scope(self, card: Card, scope: int) -> int:
        return self.scopes.get(card.options.get("INSTANCE", "").upper(), scope)

    def _set(self, sets: dict, key: str, card: Card, lines: list[Data], scope: int) -> None:
        if not card.options.get(key):
            raise card.place.error(f"*{key} without {key}=name")
        members = self._members(sets, card.options[key])
        members.unsorted |= "UNSORTED" in card.options
        offset = SCOPE * self._scope(card, scope)
        if "GENERATE" in card.options:
            self._ranges(members, card, lines, offset)
            return
        plain = [labels(part) for part in lines]
        members.labels += [found + offset for found in plain if found is not None]
        rest = [part for part, found in zip(lines, plain, strict=True) if found is None]
        for place, parts in data_lines(rest):
            numbers = [part for part in parts if part and not _NAME.search(part)]
            members.names += [(p.upper().strip("\"'"), place) for p in parts if _NAME.search(p)]
            found = np.array([label(part, place) for part in numbers], np.int64)
            members.labels.append(found + offset)

    def _ranges(self, members: Members, card: Card, lines: list[Data], offset: int) -> None:
        for first, last, step in rows(lines, 3, least=2):
            step = step or 1
            if (
                min(first, last, step) < 1
                or last < first
                or first + last + step != int(first + last + step)
            ):
                raise card.place.error(
                    f"GENERATE from {first:g} to {last:g} in steps of {step:g} holds nothing"
                )
            members.ranges.append((int(first) + offset, int(last) + offset, int(step)))

    def surface(self, card: Card, lines: list[Data], scope: int) -> None:
        """A *SURFACE: one (set or element, face) per line."""
        name = card.options.get("NAME", "").upper()
        sort = card.options.get("TYPE", "ELEMENT").upper()
        if not name:
            raise card.place.error("*SURFACE without NAME=")
        if sort == "NODE":
            members = self._members(self.node_sets, name)
            members.names += [(p[0].upper(), place) for place, p in data_lines(lines) if p[0]]
            return
        if "COMBINE" in card.options or "CROP" in card.options:
            raise card.place.error("*SURFACE with COMBINE or CROP is not read: name its elements")
        if sort != "ELEMENT":
            self.unused.append(f"*SURFACE, TYPE={sort}: not used ({card.place})")
            return
        of = self.surfaces.setdefault(name, [])
        for place, parts in data_lines(lines):
            face = self._face(parts[1] if len(parts) > 1 else "", place)
            of.append(
                (parts[0].upper().strip("\"'"), face, self._scope(card, scope) * SCOPE, place)
            )

    def _face(self, text: str, place: Place) -> int:
        if not text:
            return ALL_FACES
        if text.upper() in ("SPOS", "SNEG"):
            return BOTH_SIDES
        match = _FACE.fullmatch(text.upper())
        if not match:
            raise place.error(f"{shown(text)} is no face of an element: S1 to S6, SPOS, SNEG")
        return int(match[1]) - 1

    def pressure(self, card: Card, lines: list[Data], _: int) -> None:
        """Record surfaces under pressure in a step: most likely the inner face."""
        for _place, parts in data_lines(lines):
            if len(parts) > 1 and parts[1].upper() == "P":
                self.pressed.append(parts[0].upper())

    def resolved_surfaces(self, elements: np.ndarray) -> dict[str, np.ndarray]:
        """name -> (k, 2) of (element, face). Raises InputError for an unknown set."""
        sets = Sets("element set", self.element_sets, elements)
        return {name: self._resolved(parts, sets) for name, parts in self.surfaces.items()}

    def _resolved(self, parts: list, sets: Sets) -> np.ndarray:
        found = [np.empty((0, 2), np.int64)]
        for of, face, offset, place in parts:
            given = (
                sets.labels(of, place)
                if _NAME.search(of) or of in sets
                else np.array([label(of, place) + offset])
            )
            given = given[np.isin(given, sets.known)]
            if face >= 0 and any(np.isin(given, turned).any() for turned in self.reflected):
                raise place.error(
                    "the faces of elements copied with REFLECT have no known numbers: "
                    "name the surface by a node set, or leave the face out"
                )
            found.append(np.column_stack([given, np.full(len(given), face)]))
        return np.unique(np.concatenate(found), axis=0)
