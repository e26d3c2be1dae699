"""Sections, cord layers, embedded membranes, rigid rims and materials of an Abaqus deck."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from tireroad.fem.decks.deck import Compound, Embedded, Layer, Orientation, Solid
from tireroad.fem.decks.files.abaqus_sets import data_lines
from tireroad.fem.decks.files.lines import Card, Data, Place
from tireroad.fem.decks.files.numbers import number

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
        if card.keyword == "MEMBRANE SECTION" and card.options.get("MATERIAL"):
            self.unused.append(
                f"*MEMBRANE SECTION: its cords are used, the stiffness of the membrane itself "
                f"({card.options['MATERIAL']}) is not ({card.place})"
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
                    place=place,
                )
            )

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
