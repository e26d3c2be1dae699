"""Reader of Abaqus decks, keyword by keyword, with a list of what is not used."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tireroad.fem.decks.deck import SCOPE, Deck, Sets
from tireroad.fem.decks.files.abaqus_sections import SectionReader
from tireroad.fem.decks.files.abaqus_sets import SetReader
from tireroad.fem.decks.files.elements import Block, kind
from tireroad.fem.decks.files.generation import Generator
from tireroad.fem.decks.files.known import KnownElements, KnownNodes
from tireroad.fem.decks.files.lines import Card, Data, Place, cards
from tireroad.fem.decks.files.numbers import LABEL, records, rows
from tireroad.fem.errors import InputError

# Keywords that describe an analysis and not the tire; all others not handled are reported as
# unknown.
_ANALYSIS = frozenset(
    """AMPLITUDE|ANALYTICAL SURFACE|ASSEMBLY|BOUNDARY|CHANGE FRICTION|CONSTRAINT CONTROLS|CONTACT|
CONTACT PAIR|CONTROLS|CLOAD|CONTACT CONTROLS|CONTACT INCLUSIONS|CONTACT OUTPUT|CONTACT PRINT|CONTACT FILE|
CONTACT PROPERTY ASSIGNMENT|CONTACT INITIALIZATION DATA|COUPLING|DISTRIBUTING|KINEMATIC|DISTRIBUTION|
DISTRIBUTION TABLE|DLOAD|DSLOAD|DYNAMIC|EL FILE|EL PRINT|ELEMENT OUTPUT|END ASSEMBLY|END INSTANCE|END PART|
END STEP|ENERGY PRINT|EQUATION|FILE FORMAT|FILM|FIELD|FILTER|FLUID BEHAVIOR|FLUID CAVITY|FLUID DENSITY|
FLUID INFLATOR|FREQUENCY|FRICTION|GAP|HEADING|HOURGLASS STIFFNESS|IMPORT|INITIAL CONDITIONS|
INTEGRATED OUTPUT|MASS|MASS SCALING|MODEL CHANGE|MONITOR|MPC|NODE FILE|NODE OUTPUT|NODE PRINT|OUTPUT|
PARAMETER|PERTURBATION|PHYSICAL CONSTANTS|PREPRINT|PRE-TENSION SECTION|PRINT|RADIATION|RESTART|
RIGID SURFACE|ROTARY INERTIA|SECTION CONTROLS|SPRING|STATIC|STEADY STATE DYNAMICS|STEADY STATE TRANSPORT|
STEP|SURFACE BEHAVIOR|SURFACE INTERACTION|SYMMETRIC MODEL GENERATION|SYMMETRIC RESULTS TRANSFER|SYSTEM|
TEMPERATURE|TIE|TIME POINTS|TRANSFORM|TRANSPORT VELOCITY|USER SUBROUTINES|VISCO|SURFACE SMOOTHING|MOTION|
CONTACT DAMPING|FASTENER|CONNECTOR SECTION|CONNECTOR BEHAVIOR|BEAM SECTION|RELEASE""".replace(
        "\n", ""
    ).split("|")
)
# Ignoring these would give a different tire.
_REFUSED = {
    "NMAP": "nodes are read as they are given, moved by no map: write their places out",
    "REBAR": "cords are read from *REBAR LAYER in *SURFACE SECTION or *MEMBRANE SECTION",
    "SYSTEM": "nodes are read in the global system alone",
}


def read(path: Path) -> Deck:
    """The deck in a file. Raises InputError with file and line for errors in it."""
    reader = _Reader(path)
    for item in cards(path):
        if isinstance(item, Card):
            reader.begin(item)
        else:
            reader.data(item)
    return reader.finish()


class _Reader:
    """Collects the data of a used keyword until the next keyword begins, then interprets it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.card: Card | None = None
        self.lines: list[Data] = []
        self.scope = 0
        self.parts: dict[str, int] = {}
        self.step: Place | None = None
        self.part: Place | None = None
        self.nodes, self.elements = KnownNodes(), KnownElements()
        self.sets = SetReader()
        self.sections = SectionReader()
        self.unused: dict[str, list] = {}
        self.handlers = {
            "NODE": self._node,
            "ELEMENT": self._element,
            "NSET": self._node_set,
            "ELSET": self.sets.elements_of,
            "SURFACE": self.sets.surface,
            "DSLOAD": self.sets.pressure,
            **Generator(self.nodes, self.elements, self.sets).handlers,
            **self.sections.handlers,
            **dict.fromkeys(_REFUSED, self._refuse),
        }

    def begin(self, card: Card) -> None:
        """A keyword begins: interpret the data of the one before."""
        self._end()
        self.card = card
        structure = {
            "STEP": self._step,
            "END STEP": self._end_step,
            "PART": self._part,
            "END PART": self._end_part,
            "INSTANCE": self._instance,
        }.get(card.keyword)
        if structure:
            structure(card)
        self.used = card.keyword in self.handlers and (
            self.step is None or card.keyword == "DSLOAD"
        )
        if not self.used and not structure:
            self.unused.setdefault(card.keyword, []).append(card.place)

    def data(self, data: Data) -> None:
        if self.card is None:
            raise data.place.error("data before the first keyword: this is no Abaqus deck")
        if self.used or self.card.keyword == "INSTANCE":
            self.lines.append(data)

    def _end(self) -> None:
        if self.card is not None and self.used:
            self.handlers[self.card.keyword](self.card, self.lines, self.scope)
        elif self.card is not None and self.card.keyword == "INSTANCE" and self.lines:
            self.unused.setdefault("INSTANCE, place of", []).append(self.card.place)
        self.lines = []

    def _step(self, card: Card) -> None:
        self.step = card.place
        self.unused.setdefault("STEP", []).append(card.place)

    def _end_step(self, _: Card) -> None:
        self.step = None

    def _part(self, card: Card) -> None:
        self.part = card.place
        name = card.options.get("NAME", f"part {len(self.parts) + 1}").upper()
        self.scope = self.parts[name] = len(self.parts) + 1

    def _end_part(self, _: Card) -> None:
        self.part, self.scope = None, 0

    def _instance(self, card: Card) -> None:
        part = card.options.get("PART", "").upper()
        if part in self.parts:
            self.sets.scopes[card.options.get("NAME", part).upper()] = self.parts[part]

    def _node(self, card: Card, lines: list[Data], scope: int) -> None:
        system = card.options.get("SYSTEM", "R").upper()
        if system not in ("R", "C"):
            raise card.place.error(f"*NODE with SYSTEM={system}: R and C are read")
        table = rows(lines, 7)
        labels = table[:, 0]
        wrong = (labels != np.floor(labels)) | (labels < 1) | (labels > LABEL)
        if wrong.any():
            raise card.place.error(f"*NODE: {labels[wrong][0]:g} is no label of a node")
        points = table[:, 1:4]
        if system == "C":
            radius, angle = points[:, 0].copy(), np.radians(points[:, 1])
            points[:, 0], points[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
        labels = labels.astype(np.int64) + scope * SCOPE
        self.nodes.add(labels, points)
        self.sets.add_nodes(card, labels)

    def _element(self, card: Card, lines: list[Data], scope: int) -> None:
        name = card.options.get("TYPE", "").upper()
        if not name:
            raise card.place.error("*ELEMENT without TYPE=")
        shape = kind(name)
        if shape is None:
            self.unused.setdefault(f"ELEMENT, TYPE={name}", []).append(card.place)
            self.sets.add_elements(card, np.empty(0, np.int64))
            self.elements.others = True
            return
        table = records(lines, shape.nodes + 1)
        if not len(table):
            raise card.place.error(f"*ELEMENT, TYPE={name}: no elements follow")
        table = table + scope * SCOPE
        self.elements.add(Block(name, shape, table[:, 0], table[:, 1:], card.place))
        self.sets.add_elements(card, table[:, 0])

    def _node_set(self, card: Card, lines: list[Data], scope: int) -> None:
        self.sets.nodes_of(card, lines, scope)
        name = card.options.get("ELSET")
        if name:
            sets = Sets("element set", self.sets.element_sets, self.elements.labels())
            parts = self.elements.within(sets.labels(name, card.place))
            nodes = [np.empty(0, np.int64), *(block.nodes.ravel() for block in parts)]
            self.sets.add_nodes(card, np.unique(np.concatenate(nodes)))

    def _refuse(self, card: Card, lines: list[Data], _: int) -> None:
        if card.keyword != "SYSTEM" or lines:  # *SYSTEM without data restores the global system
            raise card.place.error(f"*{card.keyword} is not read: {_REFUSED[card.keyword]}")

    def finish(self) -> Deck:
        """The deck, once the file has ended. Raises InputError if it is incomplete."""
        self._end()
        open_ = self.step or self.part
        if open_:
            what = "STEP" if self.step else "PART"
            raise open_.error(f"*{what} has no *END {what}: is the deck cut short?")
        if self.card is None:
            raise InputError(f"{self.path}: no keyword in it: this is no Abaqus deck")
        labels, points = self.nodes.table(self.path.name)
        self.elements.check_once()
        elements = self.elements.labels()
        return Deck(
            file=self.path.name,
            labels=labels,
            points=points,
            blocks=tuple(self.elements.blocks),
            node_sets=Sets("node set", self.sets.node_sets, labels),
            element_sets=Sets("element set", self.sets.element_sets, elements),
            surfaces=self.sets.resolved_surfaces(elements),
            solids=tuple(self.sections.solids),
            layers=tuple(self.sections.layers),
            embedded=tuple(self.sections.embedded),
            held=tuple(self.sections.held),
            pressed=tuple(self.sets.pressed),
            materials=self.sections.materials(),
            orientations=self.sections.orientations,
            used=tuple(self._used()),
            unused=tuple(self._not_used()),
        )

    def _used(self) -> Iterator[str]:
        """One line for each kind of item read."""
        yield f"{self.nodes.count} nodes in {self.nodes.blocks} blocks"
        for block in self.elements.blocks:
            yield f"{len(block.labels)} elements {block.type} ({block.place})"
        yield from self.sections.used()

    def _not_used(self) -> Iterator[str]:
        """One line for each keyword not used, with its first place."""
        for name, places in self.unused.items():
            keyword = name.split(",")[0]
            known = keyword in _ANALYSIS or keyword in self.handlers or keyword == "INSTANCE"
            near = [] if known else difflib.get_close_matches(keyword, self.handlers, 1, 0.75)
            hint = f"; did you mean *{near[0]}?" if near else ""
            times = f", {len(places)} times" if len(places) > 1 else ""
            what = "not used" if known else "unknown keyword, not used"
            yield f"*{name}: {what} ({places[0]}{times}){hint}"
        yield from self.sections.unused
        yield from self.sets.unused
