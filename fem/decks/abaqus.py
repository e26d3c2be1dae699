"""Reader of Abaqus decks, keyword by keyword, with a list of what is not used."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from tireroad.fem.decks import rebar
from tireroad.fem.decks.abaqus_generation import (
    Generator,
    InstancePlacement,
    KnownElements,
    KnownNodes,
    SetReader,
    data_lines,
    turned,
)
from tireroad.fem.decks.deck import (
    LABEL,
    LABELS,
    SCOPE,
    Card,
    CardBlock,
    CordLayer,
    Data,
    Deck,
    DeckCompound,
    Embedded,
    Orientation,
    Place,
    Sets,
    Solid,
    cards,
    kind,
    missing,
    number,
    records,
    rows,
)
from tireroad.fem.decks.rubber_tests import TESTS
from tireroad.fem.errors import InputError

# Suboptions of *MATERIAL that are read; the reader lists all others as not used.
SUBOPTIONS = (
    "HYPERELASTIC",
    "ELASTIC",
    "DENSITY",
    "VISCOELASTIC",
    "NO COMPRESSION",
    *TESTS,
    "VOLUMETRIC TEST DATA",
)


_SINGLE = 5000  # elements with a *REBAR each: a section has some hundreds
# Of the thickness: from a shell's middle to its nodes.
_OFFSETS = {"": 0.0, "SPOS": 0.5, "SNEG": -0.5}

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
    "IMPERFECTION": "nodes are read as they are given, without imperfections: write their places out",
}


@dataclass
class _Skin:
    """A *SURFACE, *MEMBRANE or *SHELL SECTION: what it is of itself, which one layer of its cords carries.

    Its numbers are read where it has cords alone: a road's or a wheel's do not matter.
    """

    elements: str
    card: Card
    first: str  # its first number
    corded: bool = False
    carried: list[np.ndarray] = field(default_factory=list)  # elements whose cords carry it

    @property
    def shell(self) -> bool:
        return self.card.keyword == "SHELL SECTION"

    @property
    def mass(self) -> float:
        """Per area, of a surface or membrane that has no material."""
        density = self.card.options.get("DENSITY", "")
        return number(density, self.card.place) if density and not self.shell else 0.0

    @property
    def covering(self) -> tuple[str, float] | None:
        """Its material and thickness."""
        material = self.card.options.get("MATERIAL", "").upper()
        thick = material and self.card.keyword != "SURFACE SECTION"
        return (material, self._thickness) if thick else None

    @property
    def middle(self) -> float:
        """The middle surface of a shell lies so far along the normal from its nodes: OFFSET= is a share of the
        thickness, towards them."""
        offset = self.card.options.get("OFFSET", "").upper() if self.shell else ""
        share = _OFFSETS[offset] if offset in _OFFSETS else number(offset, self.card.place)
        return -share * self._thickness

    @property
    def _thickness(self) -> float:
        return number(self.first, self.card.place)

    def take(self) -> dict:
        """Fields of the first layer of the section; of later ones nothing."""
        itself = {} if self.corded else {"mass": self.mass, "covering": self.covering}
        self.corded = True
        return itself


class SectionReader:
    """Collects what the elements consist of, as written in the deck."""

    def __init__(self, sets: SetReader) -> None:
        self._sets = sets
        self.solids: list[Solid] = []
        self.layers: list[CordLayer] = []
        self.embedded: list[Embedded] = []
        self.held: list = []
        self.orientations: dict[str, Orientation] = {}
        self._skins: list[_Skin] = []
        self._skin: _Skin | None = None  # the one whose layers follow
        self._single: list[tuple[str, int, int]] = []  # set, number of its element, scope
        self._lines: list[tuple[tuple, str, set[int]]] = []  # sort, set, its elements
        self._old: list[int] = []  # rows of layers of *REBAR
        self._material: str | None = None
        self._materials: dict[str, tuple[list, Place]] = {}
        self.handlers = {
            "SOLID SECTION": self._solid,
            "SURFACE SECTION": self._section,
            "MEMBRANE SECTION": self._section,
            "SHELL SECTION": self._section,
            "REBAR LAYER": self._layer,
            "REBAR": self._rebar,
            "EMBEDDED ELEMENT": self._embed,
            "ORIENTATION": self._orientation,
            "RIGID BODY": self._rigid,
            "MATERIAL": self._begin_material,
            **{name: self._suboption for name in SUBOPTIONS},
        }

    def _solid(self, card: Card, lines: list[Data], scope: int) -> None:
        elements, material = (card.options.get(key) for key in ("ELSET", "MATERIAL"))
        if not elements or not material:
            raise card.place.error("*SOLID SECTION needs ELSET= and MATERIAL=")
        self.solids.append(Solid(self._sets.name(elements, scope), material.upper(), card.place))

    def _section(self, card: Card, lines: list[Data], scope: int) -> None:
        """A *SURFACE, *MEMBRANE or *SHELL SECTION: its mass is that of its material, or DENSITY=."""
        name = card.options.get("ELSET", "")
        if not name and card.keyword != "SHELL SECTION":
            raise card.place.error(f"*{card.keyword} needs ELSET=")
        parts = [parts for _, parts in data_lines(lines) if parts and parts[0]]
        first = parts[0][0] if parts else ""
        self._skin = _Skin(self._sets.name(name, scope) if name else "", card, first)
        self._skins.append(self._skin)

    def _layer(self, card: Card, lines: list[Data], scope: int) -> None:
        """Data: name, area, spacing, position, material, angle, direction, extension, radius."""
        skin = self._skin
        if skin is None or not skin.elements:
            raise card.place.error(
                "*REBAR LAYER must follow a *SURFACE SECTION, *MEMBRANE SECTION or *SHELL SECTION with ELSET="
            )
        if "COMPOSITE" in skin.card.options:
            raise card.place.error(
                "cords in a *SHELL SECTION, COMPOSITE are not read: give it one material"
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
            numbers = {i: number(parts[i], place) for i in (1, 2, 3, 5, 7, 8) if i < len(parts)}
            if numbers[1] <= 0 or numbers[2] <= 0:
                raise place.error(f"cords of layer {parts[0]}: area and spacing must be > 0")
            self.layers.append(
                CordLayer(
                    name=parts[0],
                    elements=skin.elements,
                    area=numbers[1],
                    spacing=numbers[2],
                    material=parts[4].upper(),
                    angle=numbers[5],
                    geometry=geometry,
                    extension=numbers.get(7, 0.0),
                    radius=numbers.get(8, 0.0),
                    orientation=self._orientation_name(card, "ORIENTATION", scope),
                    position=numbers[3] + skin.middle if skin.shell else 0.0,
                    place=place,
                    **skin.take(),
                )
            )

    def _rebar(self, card: Card, lines: list[Data], scope: int) -> None:
        """A *REBAR: cords of sets, or of elements one by one, which may be one line together."""
        for layer in rebar.layers(card, lines):
            orientation = layer.orientation and self._sets.name(layer.orientation, scope)
            name, line = self._sets.name(layer.elements, scope), ""
            if layer.elements.isdigit() and name not in self._sets.element_sets:
                name, line = self._one(layer, int(layer.elements), scope)
            self._old.append(len(self.layers))
            self.layers.append(replace(layer, elements=name, line=line, orientation=orientation))

    def _one(self, layer: CordLayer, element: int, scope: int) -> tuple[str, str]:
        """Names of the sets of a single element, and of those whose cords are one line with it."""
        if len(self._single) >= 2 * _SINGLE:
            raise layer.place.error(
                f"more than {_SINGLE} elements have a *REBAR of their own: name sets of elements"
            )
        sort = scope, layer.material, layer.area, layer.position, layer.cut is None
        open_lines = [line for line in self._lines if line[0] == sort and element not in line[2]]
        if not open_lines:
            open_lines = [(sort, f"LINE {len(self._lines) + 1} OF *REBAR", set())]
            self._lines += open_lines
        _, line, elements = open_lines[0]
        elements.add(element)
        name = f"ELEMENT {element} OF *REBAR, {line}"
        self._single += [(name, element, scope), (line, element, scope)]
        return name, line

    def complete(self, elements: np.ndarray) -> None:
        """Called when all element labels (ascending) are known: resolves references of *REBAR and the elements that
        carry them."""
        scopes: dict[str, list[int]] = {}
        for scope, part in self._sets.parts.items():
            scopes.setdefault(part, []).append(scope)
        for name, element, scope in self._single:
            labels = element + SCOPE * np.array(scopes[self._sets.parts[scope]], np.int64)
            self._sets.into(self._sets.element_sets, name, labels, 0)
        sets = Sets("element set", self._sets.element_sets, elements)
        for row in self._old:
            layer = self.layers[row]
            mine = sets.labels(layer.elements, layer.place)
            for skin in self._skins:
                if not skin.elements or (skin.corded and not skin.carried):
                    continue
                whole = sets.labels(skin.elements, skin.card.place)
                if len(mine) and np.isin(mine, whole).all():
                    done = np.concatenate([np.empty(0, np.int64), *skin.carried])
                    skin.corded = True
                    skin.carried.append(mine)
                    layer = replace(layer, position=layer.position + skin.middle)
                    self.layers[row] = layer
                    if not np.isin(mine, done).any():
                        self.layers[row] = replace(layer, mass=skin.mass, covering=skin.covering)

    def _orientation_name(self, card: Card, key: str, scope: int) -> str:
        """Orientations belong to their part as sets do."""
        name = card.options.get(key, "")
        return self._sets.name(name, scope) if name else ""

    def _embed(self, card: Card, lines: list[Data], scope: int) -> None:
        host = card.options.get("HOST ELSET", card.options.get("HOST"))
        names = tuple(
            self._sets.name(p, scope) for _, parts in data_lines(lines) for p in parts if p
        )
        host = self._sets.name(host, scope) if host else None
        self.embedded.append(Embedded(names, host, card.place))

    def _orientation(self, card: Card, lines: list[Data], scope: int) -> None:
        table = [[number(part, place) for part in parts] for place, parts in data_lines(lines)]
        points, turn = (*table, [], [])[:2]
        turn = (turn + [1.0, 0.0])[:2] if not turn else (turn + [0.0])[:2]
        self.orientations[self._orientation_name(card, "NAME", scope)] = Orientation(
            card.options.get("SYSTEM", "RECTANGULAR").upper(),
            tuple((points + [0.0] * 6)[:6]),
            int(turn[0]),
            turn[1],
            card.place,
        )

    def place(self, of: dict[str, Orientation], placement: InstancePlacement) -> None:
        """Bring the orientations `of` an instance to where it is placed."""
        for name, part in of.items():
            points = np.array(part.points).reshape(2, 3)
            if part.system in ("RECTANGULAR", "R"):  # two directions
                points = turned(points, placement.axis, placement.angle)
            else:
                points = placement.of(points)
            self.orientations[name] = replace(part, points=tuple(points.ravel().tolist()))

    def _rigid(self, card: Card, lines: list[Data], scope: int) -> None:
        for key in ("TIE NSET", "PIN NSET"):
            if card.options.get(key):
                self.held.append((self._sets.name(card.options[key], scope), card.place))

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

    def materials(self) -> dict[str, DeckCompound]:
        return {
            name: DeckCompound(name, tuple(parts), place)
            for name, (parts, place) in self._materials.items()
        }

    def not_used(self) -> Iterator[str]:
        """Lines for the user on sections of which not all is used."""
        for skin in self._skins:
            keyword, place = skin.card.keyword, skin.card.place
            if skin.shell and not skin.corded:
                yield f"*{keyword}: not used ({place})"
            elif skin.covering:
                what = keyword.partition(" ")[0].lower()
                yield (
                    f"*{keyword}: its cords and its mass are used, the stiffness of the {what} itself "
                    f"({skin.card.options['MATERIAL']}) is not ({place})"
                )

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


def read(path: Path) -> Deck:
    """The deck in a file. Raises InputError with file and line for errors in it."""
    reader = _Reader(path)
    for item in cards(path):
        if isinstance(item, Card):
            reader.begin(item)
        else:
            reader.data(item)
    return reader.finish()


@dataclass
class _Part:
    """The content of a *PART, read once for each of its instances, and their scopes."""

    name: str
    place: Place
    cards: list[tuple[Card, list[Data]]] = field(default_factory=list)
    instances: list[int] = field(default_factory=list)
    orientations: dict[str, Orientation] = field(default_factory=dict)


@dataclass
class _Instance:
    """The *INSTANCE that is being read."""

    name: str
    part: _Part
    place: Place
    placement: InstancePlacement | None = None


class _Reader:
    """Collects the data of a used keyword until the next keyword begins, then interprets it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.card: Card | None = None
        self.lines: list[Data] = []
        self.scope = 0
        self.parts: dict[str, _Part] = {}
        self.step: Place | None = None
        self.part: _Part | None = None
        self.instance: _Instance | None = None
        self.system: InstancePlacement | None = None
        self.nodes, self.elements = KnownNodes(), KnownElements()
        self.sets = SetReader()
        self.sections = SectionReader(self.sets)
        self.unused: dict[str, list] = {}
        self.handlers = {
            "NODE": self._node,
            "ELEMENT": self._element,
            "NSET": self._node_set,
            "SYSTEM": self._system,
            "INSTANCE": self._placed,
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
            "END INSTANCE": self._end_instance,
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
        if self.used:
            self.lines.append(data)

    def _end(self) -> None:
        if self.card is not None and self.used:
            if self.part is not None:  # read by its instances
                self.part.cards.append((self.card, self.lines))
            else:
                self.handlers[self.card.keyword](self.card, self.lines, self.scope)
        self.lines = []

    def _step(self, card: Card) -> None:
        self.step = card.place
        self.unused.setdefault("STEP", []).append(card.place)

    def _end_step(self, _: Card) -> None:
        self.step = None

    def _part(self, card: Card) -> None:
        if self.part is not None:
            raise card.place.error("*PART inside a *PART: is an *END PART missing?")
        name = card.options.get("NAME", f"part {len(self.parts) + 1}").upper()
        if name in self.parts:
            raise card.place.error(f"part {name} is defined twice")
        self.part = self.parts[name] = _Part(name, card.place)

    def _end_part(self, _: Card) -> None:
        self.part = None

    def _instance(self, card: Card) -> None:
        """An instance begins: what its part holds, read in a scope of its own."""
        if self.instance is not None:
            raise card.place.error("*INSTANCE inside an *INSTANCE: is an *END INSTANCE missing?")
        part = card.options.get("PART", "").upper()
        if part not in self.parts:
            raise card.place.error(
                "an *INSTANCE of an earlier analysis is not read: write its mesh out"
                if not part
                else missing("part", part, self.parts)
            )
        name = card.options.get("NAME", part).upper()
        if name in self.sets.scopes:
            raise card.place.error(f"instance {name} is defined twice")
        self.instance = _Instance(name, self.parts[part], card.place)
        self._read(self.parts[part], name)

    def _read(self, part: _Part, instance: str) -> None:
        """Read a part as an instance; sections of a part are there once for all its instances."""
        self.scope = self.sets.scopes[instance] = len(self.sets.scopes) + 1
        self.sets.parts[self.scope] = part.name
        before = set(self.sections.orientations)
        for card, lines in part.cards:
            if not part.instances or card.keyword not in self.sections.handlers:
                self.handlers[card.keyword](card, lines, self.scope)
        part.instances.append(self.scope)
        part.orientations |= {
            name: orientation
            for name, orientation in self.sections.orientations.items()
            if name not in before
        }
        self.system = None

    def _placed(self, card: Card, lines: list[Data], _: int) -> None:
        assert self.instance is not None
        self.instance.placement = InstancePlacement.read(lines)

    def _end_instance(self, card: Card) -> None:
        if self.instance is None:
            raise card.place.error("*END INSTANCE without *INSTANCE")
        part, placement = self.instance.part, self.instance.placement
        if part.orientations and len(part.instances) > 1:
            raise self.instance.place.error(
                f"part {part.name} has cords with an *ORIENTATION and is placed twice: not read; write its "
                "instances as parts of their own"
            )
        if placement is not None:
            self.nodes.move(self.scope, placement, self.path.name)
            self.sections.place(part.orientations, placement)
            if placement.turns_over:
                self.sets.turned_over |= self.elements.turn_over(self.scope)
        labels = self.nodes.labels(self.path.name), self.elements.labels()
        self.sets.qualify(self.instance.name, *labels)
        self.instance, self.scope = None, 0

    def _system(self, card: Card, lines: list[Data], _: int) -> None:
        """A local system for the nodes that follow: origin, a point on its x axis, one in xy."""
        table = [number(part, place) for place, parts in data_lines(lines) for part in parts]
        if not table:
            self.system = None
            return
        origin, first, second = np.array((table + [0.0] * 9)[:9]).reshape(3, 3)
        if len(table) <= 3:
            self.system = InstancePlacement(origin, np.zeros(3), np.array([1.0, 0, 0]), 0.0)
            return
        if len(table) <= 6:  # x and y stay in the plane z = 0
            second = origin + np.cross([0.0, 0.0, 1.0], first - origin)
        x = first - origin
        z = np.cross(x, second - origin)
        if not np.linalg.norm(x) > 0 or not np.linalg.norm(z) > 0:
            raise card.place.error("*SYSTEM: its points give no axes")
        x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
        turn = np.column_stack([x, np.cross(z, x), z])
        self.system = InstancePlacement.turned_to(origin, turn)

    def _node(self, card: Card, lines: list[Data], scope: int) -> None:
        system = card.options.get("SYSTEM", "R").upper()
        if system not in ("R", "C"):
            raise card.place.error(f"*NODE with SYSTEM={system}: R and C are read")
        table = rows(lines, 7)
        labels = table[:, 0]
        wrong = (labels != np.floor(labels)) | (labels < 1) | (labels > LABEL)
        if wrong.any():
            raise card.place.error(
                f"*NODE: {labels[wrong][0]:.17g} is not a label of a node: {LABELS}"
            )
        points = table[:, 1:4]
        if system == "C":
            radius, angle = points[:, 0].copy(), np.radians(points[:, 1])
            points[:, 0], points[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
        if self.system is not None:
            points = self.system.of(points)
        labels = labels.astype(np.int64) + scope * SCOPE
        self.nodes.add(labels, points)
        self.sets.add_nodes(card, labels, scope)

    def _element(self, card: Card, lines: list[Data], scope: int) -> None:
        name = card.options.get("TYPE", "").upper()
        if not name:
            raise card.place.error("*ELEMENT without TYPE=")
        shape = kind(name)
        if shape is None:
            self.unused.setdefault(f"ELEMENT, TYPE={name}", []).append(card.place)
            self.sets.add_elements(card, np.empty(0, np.int64), scope)
            self.elements.others = True
            return
        table = records(lines, shape.nodes + 1)
        if not len(table):
            raise card.place.error(f"*ELEMENT, TYPE={name}: no elements follow")
        table = table + scope * SCOPE
        self.elements.add(CardBlock(name, shape, table[:, 0], table[:, 1:], card.place))
        self.sets.add_elements(card, table[:, 0], scope)

    def _node_set(self, card: Card, lines: list[Data], scope: int) -> None:
        self.sets.nodes_of(card, lines, scope)
        name = card.options.get("ELSET")
        if name:
            sets = Sets("element set", self.sets.element_sets, self.elements.labels())
            parts = self.elements.within(sets.labels(self.sets.name(name, scope), card.place))
            nodes = [np.empty(0, np.int64), *(block.nodes.ravel() for block in parts)]
            self.sets.add_nodes(card, np.unique(np.concatenate(nodes)), scope)

    def _refuse(self, card: Card, lines: list[Data], _: int) -> None:
        raise card.place.error(f"*{card.keyword} is not read: {_REFUSED[card.keyword]}")

    def finish(self) -> Deck:
        """The deck, once the file has ended. Raises InputError if it is incomplete."""
        self._end()
        for what, begun in (("INSTANCE", self.instance), ("PART", self.part)):
            if begun:
                raise begun.place.error(f"*{what} has no *END {what}: is the deck cut short?")
        if self.step:
            raise self.step.error("*STEP has no *END STEP: is the deck cut short?")
        if self.card is None:
            raise InputError(f"{self.path}: no keyword in it: this is not an Abaqus deck")
        placed = bool(self.sets.scopes)
        for name, part in self.parts.items():
            if not placed:
                self._read(part, name)
            elif not part.instances and part.cards:
                self.unused.setdefault(f"PART, NAME={name}, which has no instance", []).append(
                    part.place
                )
        labels, points = self.nodes.table(self.path.name)
        self.elements.check_once()
        self.sections.complete(self.elements.labels())
        read = Deck(
            file=self.path.name,
            labels=labels,
            points=points,
            blocks=tuple(self.elements.blocks),
            node_sets=Sets("node set", self.sets.node_sets, labels),
            element_sets=Sets("element set", self.sets.element_sets, self.elements.labels()),
            surfaces={},
            solids=tuple(self.sections.solids),
            layers=tuple(self.sections.layers),
            embedded=tuple(self.sections.embedded),
            held=tuple(self.sections.held),
            pressed=tuple(self.sets.pressed),
            materials=self.sections.materials(),
            orientations=self.sections.orientations,
        )
        deck = rebar.on_lines(read)
        return replace(
            deck,
            surfaces=self.sets.resolved_surfaces(deck.element_sets.known),
            used=tuple(self._used()),
            unused=tuple(self._not_used()),
        )

    def _used(self) -> Iterator[str]:
        """One line for each kind of item read."""
        yield f"{self.nodes.count} nodes in {self.nodes.blocks} blocks"
        for block in self.elements.blocks:
            if self._takes_part(block):
                yield f"{len(block.labels)} elements {block.type} ({block.place})"
        yield from self.sections.used()

    @cached_property
    def _corded(self) -> np.ndarray:
        """Labels of the elements with cords, once the file has ended."""
        sets = Sets("element set", self.sets.element_sets, self.elements.labels())
        names = {layer.elements for layer in self.sections.layers}
        return np.concatenate([np.empty(0, np.int64), *map(sets.labels, names)])

    def _takes_part(self, block: CardBlock) -> bool:
        """Whether the elements are the tire's: shells are where one of them has cords."""
        return block.kind.role != "shell" or bool(np.isin(block.labels, self._corded).any())

    def _not_used(self) -> Iterator[str]:
        """One line for each keyword not used, with its first place."""
        for block in self.elements.blocks:
            if not self._takes_part(block):
                name = f"ELEMENT, TYPE={block.type}"
                self.unused.setdefault(name, []).append(block.place)
        for name, places in self.unused.items():
            keyword = name.split(",")[0]
            known = keyword in _ANALYSIS or keyword in self.handlers or keyword == "PART"
            near = [] if known else difflib.get_close_matches(keyword, self.handlers, 1, 0.75)
            hint = f"; did you mean *{near[0]}?" if near else ""
            times = f", {len(places)} times" if len(places) > 1 else ""
            what = "not used" if known else "unknown keyword, not used"
            yield f"*{name}: {what} ({places[0]}{times}){hint}"
        yield from self.sections.not_used()
        yield from self.sets.unused
