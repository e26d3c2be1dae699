"""Contents of a mesh file of any format, and what of it was not used."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tireroad.fem.decks.files.elements import Block
from tireroad.fem.decks.files.lines import Place
from tireroad.fem.errors import InputError

ALL_FACES = -1  # in a surface, of a solid element: its faces on the boundary
BOTH_SIDES = -2  # in a surface, of a membrane: where it lies


@dataclass
class Members:
    """One set as written: labels, ranges (first, last, step), names of other sets, and order."""

    labels: list[np.ndarray] = field(default_factory=list)
    ranges: list[tuple[int, int, int]] = field(default_factory=list)
    names: list[tuple[str, Place]] = field(default_factory=list)
    unsorted: bool = False


@dataclass(frozen=True)
class Sets:
    """Sets of one sort ("node set", "element set") by name, which is not case-sensitive.

    `known` (n,): all existing labels, ascending; a range selects among them.
    """

    sort: str
    members: Mapping[str, Members]
    known: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.members)

    def __contains__(self, name: str) -> bool:
        return name.upper() in self.members

    def labels(self, name: str, asked: Place | None = None) -> np.ndarray:
        """The labels of a set, ascending and unique. Raises InputError for an unknown set."""
        return self._resolved(name.upper(), asked, {})

    def ordered(self, name: str, asked: Place) -> np.ndarray:
        """The labels of a set in its own order: ascending unless it is UNSORTED."""
        labels = self.labels(name, asked)
        members = self.members[name.upper()]
        if not members.unsorted:
            return labels
        if members.names:
            raise asked.error(f"{self.sort} {name} is UNSORTED and made of other sets: not read")
        given = np.concatenate([*members.labels, *(self._range(*r) for r in members.ranges)])
        return given[np.sort(np.unique(given, return_index=True)[1])]

    def _resolved(self, name: str, asked: Place | None, done: dict) -> np.ndarray:
        if name in done:
            if done[name] is None:
                raise _error(asked, f"{self.sort} {name} is made of itself")
            return done[name]
        if name not in self.members:
            raise _error(asked, missing(self.sort, name, self.members))
        done[name] = None
        members = self.members[name]
        parts = [*members.labels, *(self._range(*given) for given in members.ranges)]
        parts += [self._resolved(inner, place, done) for inner, place in members.names]
        done[name] = np.unique(np.concatenate([np.empty(0, np.int64), *parts]))
        return done[name]

    def _range(self, first: int, last: int, step: int) -> np.ndarray:
        inside = self.known[np.searchsorted(self.known, first) :]
        inside = inside[: np.searchsorted(inside, last, side="right")]
        return inside[(inside - first) % step == 0]


def _error(asked: Place | None, message: str) -> InputError:
    return asked.error(message) if asked else InputError(message)


def missing(sort: str, name: str, names: Iterable[str]) -> str:
    """Message that a set does not exist, with the nearest name and the existing ones."""
    known = list(names)
    near = difflib.get_close_matches(name.upper(), [k.upper() for k in known], 1, 0.6)
    hint = f"did you mean {near[0]}? " if near else ""
    shown = ", ".join(known[:30]) + (", …" if len(known) > 30 else "")
    return f"there is no {sort} {name}; {hint}there are: {shown or 'none'}"


@dataclass(frozen=True)
class Solid:
    """A *SOLID SECTION: the elements of a set consist of a material."""

    elements: str
    material: str
    place: Place


@dataclass(frozen=True, kw_only=True)
class Layer:
    """A layer of cords in the membranes of a set, as in the deck (in its units).

    `angle` in degrees: from the meridian in axisymmetric elements, otherwise from the local first
    direction; `geometry` CONSTANT, ANGULAR (spacing in degrees) or LIFT EQUATION (`extension`,
    `radius`).
    """

    name: str
    elements: str
    area: float
    spacing: float
    material: str
    angle: float
    geometry: str = "CONSTANT"
    extension: float = 0.0
    radius: float = 0.0
    orientation: str = ""
    place: Place


@dataclass(frozen=True)
class Orientation:
    """An *ORIENTATION: its system in capitals, the six coordinates of two points, the axis of the
    normal (1 to 3) and the additional rotation about it in degrees.
    """

    system: str
    points: tuple[float, ...]
    axis: int
    turn: float
    place: Place


@dataclass(frozen=True)
class Embedded:
    """Sets of membranes embedded in the solids of a host set (None: of any)."""

    elements: tuple[str, ...]
    host: str | None
    place: Place


@dataclass(frozen=True)
class Compound:
    """A *MATERIAL as written: (keyword, options, rows of numbers, place) of each suboption."""

    name: str
    parts: tuple[tuple[str, Mapping[str, str], tuple[tuple[float, ...], ...], Place], ...]
    place: Place


@dataclass(frozen=True, kw_only=True)
class Deck:
    """A mesh from a file, in the file's own units and labels.

    labels (n,) ascending and points (n, 3) of the nodes; surfaces: name -> (k, 2) of (element
    label, face), faces counted from 0, or ALL_FACES or BOTH_SIDES; `held`: node sets fixed to the
    rim; `pressed`: surfaces under pressure in a step; `lines`: surfaces that may be cord lines
    inside the body. `used` and `unused` are lines for the user.
    """

    file: str
    labels: np.ndarray
    points: np.ndarray
    blocks: tuple[Block, ...]
    node_sets: Sets
    element_sets: Sets
    surfaces: Mapping[str, np.ndarray]
    solids: tuple[Solid, ...] = ()
    layers: tuple[Layer, ...] = ()
    embedded: tuple[Embedded, ...] = ()
    held: tuple[tuple[str, Place], ...] = ()
    pressed: tuple[str, ...] = ()
    materials: Mapping[str, Compound] = field(default_factory=dict)
    orientations: Mapping[str, Orientation] = field(default_factory=dict)
    lines: tuple[str, ...] = ()
    used: tuple[str, ...] = ()
    unused: tuple[str, ...] = ()

    @property
    def dimension(self) -> int:
        """2 for a section, 3 for a body, from its solid elements."""
        return max((b.kind.dimension for b in self.blocks if b.kind.role == "solid"), default=2)

    @property
    def face_names(self) -> tuple[str, ...]:
        """Names by which a face can be requested."""
        return (*self.surfaces, *self.node_sets.names)

    def rows(self, labels: np.ndarray, place: Place | None = None) -> np.ndarray:
        """Rows of `points` for node labels of any shape. InputError for an undefined node."""
        at = np.searchsorted(self.labels, labels)
        at[at == len(self.labels)] = 0
        if len(self.labels) == 0 or (self.labels[at] != labels).any():
            wrong = (
                labels.ravel()[0] if not len(self.labels) else labels[self.labels[at] != labels][0]
            )
            raise _error(place, f"node {wrong % SCOPE} is used by an element and not defined")
        return at


SCOPE = 10**10  # labels are offset by SCOPE * number of their part
