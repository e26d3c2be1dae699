"""Sections, cord layers, embedded membranes, rigid rims and materials of an Abaqus deck.

Reader of Abaqus decks, keyword by keyword, with a list of what is not used.
"""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tireroad.fem.decks.abaqus_generation import (
    Generator,
    KnownElements,
    KnownNodes,
    SetReader,
    data_lines,
)
from tireroad.fem.decks.deck import (
    LABEL,
    SCOPE,
    Block,
    Card,
    Compound,
    Data,
    Deck,
    Embedded,
    Layer,
    Orientation,
    Place,
    Sets,
    Solid,
    cards,
    kind,
    number,
    records,
    rows,
)
from tireroad.fem.errors import InputError

# Suboptions of *MATERIAL that are read; the reader lists all others as not used.
SUBOPTIONS = (
    "HYPERELASTIC",
    "ELASTIC",
    "DENSITY",
    "VISCOELASTIC",
    "NO COMPRESSION",
    "UNIAXIAL TEST DATA",
)


class SectionReader:
    """Collects what the elements consist of, as written in the deck."""

    def __init__(self) -> None:
        self.solids: list[Solid] = []
        self.layers: list[Layer] = []
        self.embedded: list[Embedded] = []
        self.held: list = []
        self.orientations: dict[str, Orientation] = {}
        self.unused: list[str] = []
        self._membranes: str | None = None
        self._mass: float = 0.0
        self._covering: tuple[str, float] | None = None
        self._material: str | None = None
        self._materials: dict[str, tuple[list, Place]] = {}
        self.handlers = {
            "SOLID SECTION": self._solid,
            "SURFACE SECTION": self._membrane,
            "MEMBRANE SECTION": self._membrane,
            "SHELL SECTION": self._shell,
            "REBAR LAYER": self._layer,
            "EMBEDDED ELEMENT": self._embed,
            "ORIENTATION": self._orientation,
            "RIGID BODY": self._rigid,
            "MATERIAL": self._begin_material,
            **{name: self._suboption for name in SUBOPTIONS},
        }

    def _solid(self, card: Card, lines: list[Data], _: int) -> None:
        elements, material = (card.options.get(key) for key in ("ELSET", "MATERIAL"))
        if not elements or not material:
            raise card.place.error("*SOLID SECTION needs ELSET= and MATERIAL=")
        self.solids.append(Solid(elements.upper(), material.upper(), card.place))

    def _membrane(self, card: Card, lines: list[Data], _: int) -> None:
        self._membranes = card.options.get("ELSET", "").upper()
        if not self._membranes:
            raise card.place.error(f"*{card.keyword} needs ELSET=")
        density = card.options.get("DENSITY", "")
        self._mass = number(density, card.place) if density else 0.0
        self._covering = None
        material = card.options.get("MATERIAL")
        if card.keyword == "MEMBRANE SECTION" and material:
            rows = [parts for _, parts in data_lines(lines) if parts and parts[0]]
            thickness = number(rows[0][0], card.place) if rows else 0.0
            self._covering = material.upper(), thickness
            self.unused.append(
                f"*MEMBRANE SECTION: its cords and its mass are used, the stiffness of the membrane itself "
                f"({material}) is not ({card.place})"
            )

    def _shell(self, card: Card, lines: list[Data], _: int) -> None:
        """Not used: a road or a wheel. Its cords would be taken for the tire's."""
        self._membranes = None
        self.unused.append(f"*SHELL SECTION: not used ({card.place})")

    def _layer(self, card: Card, lines: list[Data], _: int) -> None:
        """Data: name, area, spacing, position, material, angle, direction, extension, radius."""
        if self._membranes is None:
            raise card.place.error(
                "*REBAR LAYER belongs after a *SURFACE SECTION or *MEMBRANE SECTION; cords in shells are not read"
            )
        geometry = card.options.get("GEOMETRY", "CONSTANT").upper()
        geometry = "ANGULAR" if "ANGULAR SPACING" in card.options else geometry
        if geometry not in ("CONSTANT", "ANGULAR", "LIFT EQUATION"):
            raise card.place.error(f"*REBAR LAYER with GEOMETRY={geometry}")
        for place, parts in data_lines(lines):
            if len(parts) < 6 or not parts[0] or not parts[4]:
                raise place.error(
                    "a cord layer needs name, area, spacing, offset, material, angle; is the deck cut short?"
                )
            numbers = {i: number(parts[i], place) for i in (1, 2, 5, 7, 8) if i < len(parts)}
            if numbers[1] <= 0 or numbers[2] <= 0:
                raise place.error(f"cords of layer {parts[0]}: area and spacing must be > 0")
            self.layers.append(
                Layer(
                    name=parts[0],
                    elements=self._membranes,
                    area=numbers[1],
                    spacing=numbers[2],
                    material=parts[4].upper(),
                    angle=numbers[5],
                    geometry=geometry,
                    extension=numbers.get(7, 0.0),
                    radius=numbers.get(8, 0.0),
                    orientation=card.options.get("ORIENTATION", "").upper(),
                    mass=self._mass,
                    covering=self._covering,
                    place=place,
                )
            )
            self._mass, self._covering = 0.0, None

    def _embed(self, card: Card, lines: list[Data], _: int) -> None:
        host = card.options.get("HOST ELSET", card.options.get("HOST"))
        names = tuple(p.upper() for _, parts in data_lines(lines) for p in parts if p)
        self.embedded.append(Embedded(names, host.upper() if host else None, card.place))

    def _orientation(self, card: Card, lines: list[Data], _: int) -> None:
        table = [[number(part, place) for part in parts] for place, parts in data_lines(lines)]
        points, turn = (*table, [], [])[:2]
        turn = (turn + [1.0, 0.0])[:2] if not turn else (turn + [0.0])[:2]
        self.orientations[card.options.get("NAME", "").upper()] = Orientation(
            card.options.get("SYSTEM", "RECTANGULAR").upper(),
            tuple((points + [0.0] * 6)[:6]),
            int(turn[0]),
            turn[1],
            card.place,
        )

    def _rigid(self, card: Card, lines: list[Data], _: int) -> None:
        for key in ("TIE NSET", "PIN NSET"):
            if card.options.get(key):
                self.held.append((card.options[key].upper(), card.place))

    def _begin_material(self, card: Card, lines: list[Data], _: int) -> None:
        name = card.options.get("NAME", "").upper()
        if not name:
            raise card.place.error("*MATERIAL without NAME=")
        if name in self._materials:
            raise card.place.error(f"material {name} is defined twice")
        self._materials[name] = ([], card.place)
        self._material = name

    def _suboption(self, card: Card, lines: list[Data], _: int) -> None:
        if self._material is None:
            raise card.place.error(f"*{card.keyword} before any *MATERIAL")
        table = tuple(
            tuple(number(part, place) for part in parts) for place, parts in data_lines(lines)
        )
        part = (card.keyword, card.options, table, card.place)
        self._materials[self._material][0].append(part)

    def materials(self) -> dict[str, Compound]:
        return {
            name: Compound(name, tuple(parts), place)
            for name, (parts, place) in self._materials.items()
        }

    def used(self) -> Iterator[str]:
        """Lines for the user on what was read here."""
        counts = Counter(
            {
                "materials": len(self._materials),
                "solid sections": len(self.solids),
                "cord layers": len(self.layers),
                "embedded sets": len(self.embedded),
                "node sets held by the rim": len(self.held),
            }
        )
        yield from (f"{count} {name}" for name, count in counts.items() if count)


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
            raise data.place.error("data before the first keyword: this is not an Abaqus deck")
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
            raise card.place.error(f"*NODE: {labels[wrong][0]:g} is not a label of a node")
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
            raise InputError(f"{self.path}: no keyword in it: this is not an Abaqus deck")
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
