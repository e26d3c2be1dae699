"""Nodes, elements, sets and surfaces of an Abaqus deck, listed or generated.

*NGEN, *NFILL, *NCOPY, *ELGEN and *ELCOPY generate nodes and elements. As in Abaqus a keyword sees the nodes, elements and sets defined before it. Source: the Keywords
Reference, and "Node definition" and "Element definition" in the Analysis User's Guide.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from tireroad.fem.decks.deck import (
    ALL_FACES,
    BOTH_SIDES,
    LABEL,
    SCOPE,
    Card,
    CardBlock,
    Data,
    Members,
    Place,
    Sets,
    fields,
    label,
    labels,
    missing,
    number,
    rows,
    shown,
)
from tireroad.fem.errors import InputError

_FACE = re.compile(r"S([1-6])")
_FACES = 16  # more than the faces of an element
_NAME = re.compile(r"[^\d\s+.-]")  # marks a field as the name of a set, not a number
_FEW = 64  # blocks searched one by one; more are merged first
_APART = 1e-9  # of the deck's size: tolerance for a node defined again at the same place
_SAME = 1e-6  # of a radius: tolerance for the two ends of an arc
MOST = 10**7  # limit of generated nodes and elements per deck
Line = tuple[Place, list[str]]


def _among(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Mask of the rows (k, 2) of `first` that are rows of `second`."""
    one, other = (rows[:, 0] * _FACES + rows[:, 1] for rows in (first, second))
    return np.isin(one, other)


_COMBINED = {
    "UNION": lambda first, second: np.concatenate([first, second]),
    "INTERSECTION": lambda first, second: first[_among(first, second)],
    "DIFFERENCE": lambda first, second: first[~_among(first, second)],
}


def data_lines(lines: list[Data]) -> Iterator[tuple[Place, list[str]]]:
    """(place, fields) of every data line that is not blank."""
    for part in lines:
        first = part.place.line - part.text[: len(part.text) - len(part.text.lstrip())].count(b"\n")
        for offset, line in enumerate(part.text.split(b"\n")):
            if line.strip():
                yield Place(part.place.file, first + offset), fields(line)


@dataclass(frozen=True)
class _Side:
    """A line of a *SURFACE: one face of the elements of a set, or of an element with its label's offset."""

    of: str
    face: int
    offset: int
    place: Place


@dataclass(frozen=True)
class _Combination:
    """A *SURFACE, COMBINE: how it is made of surfaces."""

    how: str
    surfaces: tuple[str, ...]
    place: Place


@dataclass(frozen=True)
class _Within:
    """The part of a surface that belongs to the scope of an instance."""

    surface: str
    scope: int


class SetReader:
    """Collects sets as written; names are resolved once the deck is complete.

    Names belong to the part or assembly in which they stand: `name` gives what a set is called in
    the deck as a whole, which is its own name unless another part has one of that name. `scopes`:
    scope of each instance, since sets of an assembly name their instance.
    """

    def __init__(self) -> None:
        self.node_sets: dict[str, Members] = {}
        self.element_sets: dict[str, Members] = {}
        self.surfaces: dict[str, list[_Side | _Combination | _Within]] = {}
        self.pressed: list[str] = []
        self.scopes: dict[str, int] = {}
        self.parts: dict[int, str] = {0: "ASSEMBLY"}  # name of the part of each scope
        self.unused: list[str] = []
        self.reflected: list[
            np.ndarray
        ] = []  # elements whose faces are numbered differently from their originals'
        self.turned_over: dict[int, int] = {}  # elements of turned sections: number of faces
        self._owner: dict[str, str] = {}

    def name(self, text: str, scope: int) -> str:
        """A set's or surface's name in capitals, told apart from another part's of that name."""
        name = text.upper().strip("\"'")
        if name.partition(".")[0] in self.scopes:
            return name
        part = self.parts[scope]
        return name if self._owner.setdefault(name, part) == part else f"{name} ({part})"

    def add_nodes(self, card: Card, labels: np.ndarray, scope: int) -> None:
        """The NSET of a *NODE."""
        self.into(self.node_sets, card.options.get("NSET"), labels, scope)

    def add_elements(self, card: Card, labels: np.ndarray, scope: int) -> None:
        """The ELSET of an *ELEMENT."""
        self.into(self.element_sets, card.options.get("ELSET"), labels, scope)

    def into(
        self, sets: dict[str, Members], name: str | None, labels: np.ndarray, scope: int
    ) -> None:
        """Add labels to the set of this name, if one is given."""
        if name:
            self._members(sets, self.name(name, scope)).labels.append(labels)

    def qualify(self, instance: str, nodes: np.ndarray, elements: np.ndarray) -> None:
        """Name the sets and surfaces of an instance INSTANCE.NAME, too.

        `nodes`, `elements`: all labels so far, ascending.
        """
        scope = self.scopes[instance]
        part = self.parts[scope]
        mine = [name for name, owner in self._owner.items() if owner == part]
        mine += [name for name in self._all_names() if name.endswith(f" ({part})")]
        for sort, sets, known in (
            ("node set", self.node_sets, nodes),
            ("element set", self.element_sets, elements),
        ):
            by_name = Sets(sort, sets, known)
            for name in mine:
                if name in sets:
                    labels = by_name.labels(name)
                    plain = name.removesuffix(f" ({part})")
                    sets[f"{instance}.{plain}"] = Members([labels[labels // SCOPE == scope]])
        for name in mine:
            if name in self.surfaces:
                plain = name.removesuffix(f" ({part})")
                self.surfaces[f"{instance}.{plain}"] = [_Within(name, scope)]

    def _all_names(self) -> list[str]:
        return [*self.node_sets, *self.element_sets, *self.surfaces]

    def nodes_of(self, card: Card, lines: list[Data], scope: int) -> None:
        """A *NSET."""
        self._set(self.node_sets, "NSET", card, lines, scope)

    def elements_of(self, card: Card, lines: list[Data], scope: int) -> None:
        """An *ELSET."""
        self._set(self.element_sets, "ELSET", card, lines, scope)

    def _members(self, sets: dict[str, Members], name: str) -> Members:
        return sets.setdefault(name, Members())

    def _scope(self, card: Card, scope: int) -> int:
        return self.scopes.get(card.options.get("INSTANCE", "").upper(), scope)

    def _set(self, sets: dict, key: str, card: Card, lines: list[Data], scope: int) -> None:
        if not card.options.get(key):
            raise card.place.error(f"*{key} without {key}=name")
        members = self._members(sets, self.name(card.options[key], scope))
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
            names = [part for part in parts if _NAME.search(part)]
            members.names += [(self._asked(card, name, scope), place) for name in names]
            found = np.array([label(part, place) for part in numbers], np.int64)
            members.labels.append(found + offset)

    def _asked(self, card: Card, name: str, scope: int) -> str:
        """The set or label that a data line names; INSTANCE= looks for it in that instance."""
        instance = card.options.get("INSTANCE", "").upper()
        plain = name.strip("\"'")
        return self.name(f"{instance}.{plain}" if instance in self.scopes else plain, scope)

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
        if not card.options.get("NAME"):
            raise card.place.error("*SURFACE without NAME=")
        name = self.name(card.options["NAME"], scope)
        sort = card.options.get("TYPE", "ELEMENT").upper()
        offset = SCOPE * self._scope(card, scope)
        if "CROP" in card.options:
            raise card.place.error("*SURFACE with CROP is not read: name its elements")
        if "COMBINE" in card.options:
            self.surfaces[name] = [self._combined(card, lines, scope)]
            return
        if sort == "NODE":
            members = self._members(self.node_sets, name)
            for place, (first, *_) in data_lines(lines):
                if _NAME.search(first):
                    members.names.append((self._asked(card, first, scope), place))
                elif first:
                    members.labels.append(np.array([label(first, place) + offset]))
            return
        if sort != "ELEMENT":
            self.unused.append(f"*SURFACE, TYPE={sort}: not used ({card.place})")
            return
        of = self.surfaces.setdefault(name, [])
        for place, parts in data_lines(lines):
            face = self._face(parts[1] if len(parts) > 1 else "", place)
            named = _NAME.search(parts[0])
            element = self._asked(card, parts[0], scope) if named else parts[0]
            of.append(_Side(element, face, offset, place))

    def _combined(self, card: Card, lines: list[Data], scope: int) -> _Combination:
        """How a *SURFACE, COMBINE is made of surfaces that stand before it."""
        how = card.options["COMBINE"].upper()
        if how not in _COMBINED:
            raise card.place.error(f"*SURFACE, COMBINE={how}: {', '.join(_COMBINED)} are read")
        names = []
        for place, parts in data_lines(lines):
            for part in filter(None, parts):
                names.append(self._asked(card, part, scope))
                if names[-1] not in self.surfaces:
                    raise place.error(missing("surface", part, self.surfaces))
        if not names:
            raise card.place.error("*SURFACE, COMBINE names no surface: is the deck cut short?")
        return _Combination(how, tuple(names), card.place)

    def _face(self, text: str, place: Place) -> int:
        if not text:
            return ALL_FACES
        if text.upper() in ("SPOS", "SNEG"):
            return BOTH_SIDES
        match = _FACE.fullmatch(text.upper())
        if not match:
            raise place.error(f"{shown(text)} is not a face of an element: S1 to S6, SPOS, SNEG")
        return int(match[1]) - 1

    def pressure(self, card: Card, lines: list[Data], scope: int) -> None:
        """Record surfaces under pressure in a step: most likely the inner face."""
        for _place, parts in data_lines(lines):
            if len(parts) > 1 and parts[1].upper() == "P":
                self.pressed.append(self.name(parts[0], scope))

    def resolved_surfaces(self, elements: np.ndarray) -> dict[str, np.ndarray]:
        """name -> (k, 2) of (element, face). Raises InputError for an unknown set."""
        sets = Sets("element set", self.element_sets, elements)
        resolved: dict[str, np.ndarray | None] = {}  # None: being resolved

        def rows(name: str) -> np.ndarray | None:
            if name not in resolved:
                resolved[name] = None
                parts = [self._rows(part, sets, rows) for part in self.surfaces[name]]
                resolved[name] = np.unique(
                    np.concatenate([np.empty((0, 2), np.int64), *parts]), axis=0
                )
            return resolved[name]

        return {name: every for name in self.surfaces if (every := rows(name)) is not None}

    def _rows(
        self,
        part: _Side | _Combination | _Within,
        sets: Sets,
        rows: Callable[[str], np.ndarray | None],
    ) -> np.ndarray:
        """(element, face) of one part of a surface; `rows`: those of other surfaces."""
        if isinstance(part, _Side):
            return self._side(part, sets)
        if isinstance(part, _Within):
            every = rows(part.surface)
            assert every is not None, "a surface is not made of what is in its instances"
            return every[every[:, 0] // SCOPE == part.scope]
        matrix: np.ndarray | None = None
        for name in part.surfaces:
            other = rows(name)
            if other is None:
                raise part.place.error(f"surface {name} is made of itself")
            matrix = other if matrix is None else _COMBINED[part.how](matrix, other)
        assert matrix is not None, "a combination of no surface is refused when it is read"
        return matrix

    def _side(self, part: _Side, sets: Sets) -> np.ndarray:
        sides = (
            sets.labels(part.of, part.place)
            if _NAME.search(part.of) or part.of in sets
            else np.array([label(part.of, part.place) + part.offset])
        )
        sides = sides[np.isin(sides, sets.known)]
        if part.face >= 0 and any(np.isin(sides, turned).any() for turned in self.reflected):
            raise part.place.error(
                "the faces of elements copied with REFLECT have no known numbers: "
                "name the surface by a node set, or leave the face out"
            )
        faces = np.full(len(sides), part.face)
        if self.turned_over and part.face >= 0:
            over = np.array([self.turned_over.get(side, 0) for side in sides.tolist()], np.int64)
            faces = np.where(over > 0, over - 1 - faces, faces)
        return np.column_stack([sides, faces])


@dataclass(frozen=True)
class InstancePlacement:
    """Where an instance is: moved by `shift` (3,), then turned by `angle` rad about a line.

    The line goes through `start` (3,) along the unit vector `axis` (3,).
    """

    shift: np.ndarray
    start: np.ndarray
    axis: np.ndarray
    angle: float

    @classmethod
    def read(cls, lines: list[Data]) -> InstancePlacement | None:
        """Read the data lines of *INSTANCE: a shift, then two points of a line and degrees."""
        table = [
            (place, [number(part, place) for part in parts]) for place, parts in data_lines(lines)
        ]
        if not table:
            return None
        if len(table[0][1]) == 7:  # its blank line of no shift is left out
            table.insert(0, (table[0][0], []))
        (place, shift), (there, turn) = (*table, (table[0][0], []))[:2]
        if len(table) > 2 or len(shift) > 3 or len(turn) not in (0, 7):
            raise place.error(
                "an instance is placed by a line of three numbers (shift) and, if it is turned, one of seven "
                "(two points of the line, degrees)"
            )
        moved = np.array((shift + [0.0] * 3)[:3])
        if not turn:
            return cls(moved, np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.0)
        start, line = np.array(turn[:3]), np.array(turn[3:6]) - np.array(turn[:3])
        length = np.linalg.norm(line)
        if not length > 0:
            raise there.error(
                "the two points of the line about which an instance is turned are one"
            )
        return cls(moved, start, line / length, math.radians(turn[6]))

    @classmethod
    def turned_to(cls, origin: np.ndarray, axes: np.ndarray) -> InstancePlacement:
        """With the columns of `axes` (3, 3) as axes and an origin (3,)."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_matrix(axes).as_rotvec()
        angle = float(np.linalg.norm(turn))
        axis = turn / angle if angle else np.array([1.0, 0.0, 0.0])
        return cls(origin, origin, axis, angle)

    def of(self, points: np.ndarray) -> np.ndarray:
        """Points (k, 3) in the assembly."""
        return self.start + turned(points + self.shift - self.start, self.axis, self.angle)

    @property
    def turns_over(self) -> bool:
        """Whether a section in the plane z = 0 is seen from behind afterwards."""
        x, y = turned(np.eye(3)[:2], self.axis, self.angle)
        return bool(x[0] * y[1] - x[1] * y[0] < 0)


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
        places = np.full((len(labels), 3), np.nan)
        for some, points in ((self._labels, self._points), *self._new):
            _look_up(some, points, labels, places)
        missing = np.isnan(places[:, 0])
        if missing.any():
            raise asked.error(f"node {labels[missing][0] % SCOPE} is not defined before this line")
        return places

    def move(self, scope: int, placement: InstancePlacement, file: str) -> None:
        """Bring the nodes of a scope to where their instance is placed."""
        labels, points = self.table(file)
        mine = labels // SCOPE == scope
        self._points = points.copy()
        self._points[mine] = placement.of(points[mine])

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
        self.blocks: list[CardBlock] = []
        self.others = False
        self._place: dict[int, tuple[int, int]] = {}  # block and row
        self._indexed = 0

    def add(self, block: CardBlock) -> None:
        """Add elements of one type."""
        self.blocks.append(block)

    def labels(self) -> np.ndarray:
        """All labels, ascending."""
        return np.sort(np.concatenate([np.empty(0, np.int64), *(b.labels for b in self.blocks)]))

    def one(self, label: int, asked: Place) -> CardBlock | None:
        """A single element; None if it may be of an unused type. InputError if undefined."""
        for k, block in enumerate(self.blocks[self._indexed :], self._indexed):
            self._place |= {name: (k, row) for row, name in enumerate(block.labels.tolist())}
        self._indexed = len(self.blocks)
        if label not in self._place:
            if self.others:
                return None
            raise asked.error(f"element {label % SCOPE} is not defined before this line")
        number, row = self._place[label]
        return self.blocks[number].rows([row])

    def within(self, labels: np.ndarray) -> list[CardBlock]:
        """The parts of the blocks whose labels are among `labels`."""
        at = [np.flatnonzero(np.isin(block.labels, labels)) for block in self.blocks]
        return [block.rows(rows) for block, rows in zip(self.blocks, at, strict=True) if len(rows)]

    def turn_over(self, scope: int) -> dict[int, int]:
        """Reverse sections and their lines that a placement turned over: label -> number of faces.

        A section seen from behind runs clockwise; face k becomes face n - 1 - k.
        """
        turned: dict[int, int] = {}
        for k, block in enumerate(self.blocks):
            mine = block.labels // SCOPE == scope
            if block.kind.dimension != 2 or not mine.any():
                continue
            order = (
                block.kind.reflected(block.place)
                if block.kind.role == "solid"
                else slice(None, None, -1)
            )
            nodes = block.nodes.copy()
            nodes[mine] = nodes[mine][:, order]
            self.blocks[k] = CardBlock(block.type, block.kind, block.labels, nodes, block.place)
            if block.kind.role == "solid":
                turned |= dict.fromkeys(block.labels[mine].tolist(), block.kind.corners)
        return turned

    def check_once(self) -> None:
        """Raise InputError for an element defined twice."""
        labels = self.labels()
        again = labels[1:][labels[1:] == labels[:-1]]
        if len(again):
            block = next(b for b in reversed(self.blocks) if again[0] in b.labels)
            raise block.place.error(f"element {again[0] % SCOPE} is defined twice")


def along_line(first: np.ndarray, last: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Points (..., k, 3) at fractions (k,) of the way from `first` to `last`."""
    return first + share[:, None] * (last - first)


def along_arc(
    ends: np.ndarray, centre: np.ndarray, normal: np.ndarray, share: np.ndarray, place: Place
) -> np.ndarray:
    """Points (k, 3) at fractions of the arc between two ends (2, 3) about a centre.

    Right-handed about `normal`; without one (0) the smaller arc. Raises InputError for invalid
    arcs.
    """
    start, end = ends - centre
    radius = np.linalg.norm(start)
    if not radius or abs(np.linalg.norm(end) - radius) > _SAME * radius:
        raise place.error("*NGEN, LINE=C: the two ends are not equally far from the centre")
    has_normal = bool(normal.any())
    axis = normal if has_normal else np.cross(start, end)
    if np.linalg.norm(axis) < _SAME * (1 if has_normal else radius**2):
        raise place.error("*NGEN, LINE=C: an arc of 180 degrees or more needs its normal")
    axis = axis / np.linalg.norm(axis)
    angle = np.arctan2(axis @ np.cross(start, end), start @ end)
    angle = angle if angle > _SAME else angle + 2 * np.pi
    return centre + turned(np.tile(start, (len(share), 1)), axis, share * angle)


def turned(points: np.ndarray, axis: np.ndarray, angle: np.ndarray | float) -> np.ndarray:
    """Points (k, 3) rotated about a unit axis through the origin by angles (rad): Rodrigues."""
    cosine, sine = (np.asarray(f(angle))[..., None] for f in (np.cos, np.sin))
    along = (points @ axis)[:, None] * axis
    return along + cosine * (points - along) + sine * np.cross(axis, points)


def copied(points: np.ndarray, card: Card, table: list[list[float]]) -> np.ndarray:
    """The points of an *NCOPY: shifted and rotated, or reflected. Raises InputError for POLE."""
    rows = [np.array((row + [0.0] * 7)[:7]) for row in table] + [np.zeros(7)] * 2
    mirror = card.options.get("REFLECT", "").upper()
    if "SHIFT" in card.options:
        return _shifted(points + rows[0][:3], card, rows[1])
    if "POLE" in card.options:
        raise card.place.error("*NCOPY, POLE is not read: SHIFT and REFLECT are")
    a, b = rows[0][:3], rows[0][3:6]
    if mirror == "POINT":
        return 2 * a - points
    if mirror == "LINE":
        along = _unit(b - a, card)
        return 2 * (a + ((points - a) @ along)[:, None] * along) - points
    if mirror == "MIRROR":
        normal = _unit(np.cross(b - a, rows[1][:3] - a), card)
        return points - 2 * ((points - a) @ normal)[:, None] * normal
    raise card.place.error("*NCOPY needs SHIFT or REFLECT=LINE, MIRROR or POINT")


def _shifted(points: np.ndarray, card: Card, turn: np.ndarray) -> np.ndarray:
    """Rotated about the line through two points by an angle in degrees, MULTIPLE times."""
    angle = np.radians(turn[6]) * float(card.options.get("MULTIPLE") or 1)
    if not angle:
        return points
    return turn[:3] + turned(points - turn[:3], _unit(turn[3:6] - turn[:3], card), angle)


def _unit(direction: np.ndarray, card: Card) -> np.ndarray:
    length = np.linalg.norm(direction)
    if not length > 0:
        raise card.place.error("*NCOPY: its points give no line or plane")
    return direction / length


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
            self._sets.add_nodes(card, labels, scope)

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
            ends = [self._ordered(part, place, scope) for part in parts[:2]]
            lines_ = min(map(len, ends))
            self._count(intervals * lines_, place)
            first, last = (end[:lines_] for end in ends)
            share = _shares(intervals, bias, "TWO STEP" in card.options, place)
            labels = first[:, None] + step * np.arange(1, intervals)
            start, end = (self._nodes.points(end, place)[:, None] for end in (first, last))
            points = along_line(start, end, share)
            self._nodes.add(labels.ravel(), points.reshape(-1, 3))
            for made in (first, labels.ravel(), last):
                self._sets.add_nodes(card, made, scope)

    def _ncopy(self, card: Card, lines: list[Data], scope: int) -> None:
        """Copy the nodes of a set, shifted, rotated or reflected; labels grow by a number."""
        change = self._whole(card, "CHANGE NUMBER")
        old = self._ordered(card.options.get("OLD SET", ""), card.place, scope)
        self._count(len(old), card.place)
        table = [[number(part, place) for part in parts] for place, parts in data_lines(lines)]
        points = copied(self._nodes.points(old, card.place), card, table)
        self._nodes.add(old + change, points)
        self._sets.into(self._sets.node_sets, card.options.get("NEW SET"), old + change, scope)

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
            self._more(card, numbers[0], nodes, elements, place, scope)

    def _more(
        self,
        card: Card,
        master: int,
        nodes: np.ndarray,
        elements: np.ndarray,
        place: Place,
        scope: int,
    ) -> None:
        """Copies of a master element, which is the first of them."""
        master += scope * SCOPE
        element = self._elements.one(master, place)
        if element is None:
            self._sets.add_elements(card, np.empty(0, np.int64), scope)
            return
        arguments = master + elements[1:], element.nodes + nodes[1:, None]
        self._elements.add(CardBlock(element.type, element.kind, *arguments, place))
        self._sets.add_elements(card, master + elements, scope)

    def _elcopy(self, card: Card, lines: list[Data], scope: int) -> None:
        """Copy the elements of a set, with element and node labels increased by two numbers."""
        shift, nodes = self._whole(card, "ELEMENT SHIFT"), self._whole(card, "SHIFT NODES")
        name = card.options.get("OLD SET", card.options.get("OLDSET", ""))
        sets = Sets("element set", self._sets.element_sets, self._elements.labels())
        old = sets.labels(self._sets.name(name, scope), card.place)
        self._count(len(old), card.place)
        for block in self._elements.within(old):
            turned = block.nodes
            if "REFLECT" in card.options:
                turned = turned[:, block.kind.reflected(card.place)]
            self._elements.add(
                CardBlock(block.type, block.kind, block.labels + shift, turned + nodes, card.place)
            )
        if "REFLECT" in card.options:
            self._sets.reflected.append(old + shift)
        self._sets.into(self._sets.element_sets, card.options.get("NEW SET"), old + shift, scope)

    def _ordered(self, name: str, place: Place, scope: int) -> np.ndarray:
        """The nodes of a set known so far: ascending, or in the order of an UNSORTED set."""
        sets = Sets("node set", self._sets.node_sets, self._nodes.labels(place.file))
        return sets.ordered(self._sets.name(name, scope), place)

    def _whole(self, card: Card, key: str) -> int:
        value = number(card.options.get(key, ""), card.place)
        if key not in card.options or value != int(value) or abs(value) > LABEL:
            raise card.place.error(f"*{card.keyword} needs {key}=, a whole number")
        return int(value)

    def _count(self, more: int, place: Place) -> None:
        self._made += more
        if self._made > MOST:
            raise place.error(
                f"more than {MOST} nodes and elements would be generated: too many for a tire"
            )


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
