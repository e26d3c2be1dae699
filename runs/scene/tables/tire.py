"""The table [tire], key by key, and the base of the kinds of section.

A kind of section has own keys, and makes the ring of elements, compounds and cords of them. A new
one is one file in runs.scene.sections, or a class in a user's script. The scene's keys, `check`, the
key reference and the range tests derive from it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Limits, Parameters, Registry, filename, numbers
from tireroad.fem.sections.mesh2d import SIZE
from tireroad.fem.tire.material import (
    CONSTANT,
    MATERIALS,
    MaterialLaw,
    Spectrum,
    measured,
    power_law,
    prony,
)
from tireroad.runs.scene.schema import (
    Source,
    Variants,
    choice,
    integer,
    number,
    registered,
    table,
    tables,
    text,
    variant,
    vector,
)

if TYPE_CHECKING:
    from tireroad.fem.sections.mesh2d import Ring, SectionMesh
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import Material


# Elements around in the meshes of a search, unless a kind has its own.
AROUND = (16, 20, 24, 30, 36, 44, 52, 64, 78, 96, 120)
Raw = dict[str, Any]
NEAR_ROAD = 0.2  # footprint_size with a road
# Of a torus: arc (deg) and depth of a region that has none, and place of a line of cords.
AROUND_CROWN, WHOLE_WALL = (0.0, 45.0), (0.0, 1.0)
CORDS_DEPTH, CORDS_ARC = 0.006, (-45.0, 45.0)  # m, deg
_SMALL_MOTIONS = "dynamic", "loss_factor", "spectrum"


@dataclass(frozen=True, kw_only=True)
class Proportions:
    """Sizes of a section, for estimates and for checks against other keys.

    `outer_radius` m at the crown; `height` m: half of the section's height (for a torus, the radius
    of its section circle); `thickness` m of the wall at the crown; `half_angle` deg from the crown
    to a bead; number of elements `along` the section from bead to bead and `through` the wall.
    """

    outer_radius: float
    height: float
    thickness: float
    half_angle: float
    along: int
    through: int


@dataclass(frozen=True)
class Parts:
    """The compounds and cords of a section, as tables of a scene: `compounds` by name, of [[tire.region]], and lines
    of `cords` by name, of [[tire.cords]].

    `elsewhere`: the table of a region or line of any other name, a key each. `whole`: written back in
    full.
    """

    compounds: Mapping[str, Raw]
    cords: Mapping[str, Raw]
    region_elsewhere: Raw
    cords_elsewhere: Raw
    whole: bool = False


class SectionKind(Parameters):
    """Base class of the kinds of section. Methods take the scene's [tire], which has the kind.

    `order` and `segments`: defaults of element order and elements around. `air`: whether air is
    included unless [tire.cavity] says otherwise. `tread_law`: default of `contact.tread`; a layer
    for treads on belts, which hardly deform. `without`: tables of [tire] that the kind has no use
    for. `built_in`: its compounds and cords follow from its keys, and are all written back.
    """

    owner = "section"
    order: ClassVar[int] = 2
    segments: ClassVar[int] = 60
    air: ClassVar[bool] = True
    tread_law: ClassVar[str] = "layer"
    without: ClassVar[tuple[str, ...]] = ()
    built_in: ClassVar[bool] = False

    def elements(self, tire: TireTable) -> tuple[Self, int, int]:
        """The kind with its number of elements set; order and segments, given or by default."""
        return self, tire.order or self.order, tire.segments or self.segments

    def check(self, tire: TireTable, source: Source) -> None:
        """Note problems of [tire] in `source`."""

    def proportions(self, tire: TireTable) -> Proportions:
        """Sizes of the section."""
        raise NotImplementedError

    def ring(self, tire: TireTable) -> Ring:
        """The ring of elements from the revolved section."""
        raise NotImplementedError

    def parts(self, tire: TireTable) -> Parts:
        """The compounds and cords of the section, over which the scene's [[tire.region]] and [[tire.cords]] are merged."""
        return Parts({}, {}, {}, {})

    def as_scaled(self) -> Self:
        """The kind once [tire.scale] is in the compounds and cords."""
        return self

    def rubbers(self, tire: TireTable) -> dict[str, Material]:
        """The compound of each region of the section, by name."""
        raise NotImplementedError

    def in_layers(self, tire: TireTable) -> dict[str, Material]:
        """The compounds as they fill their layers: without what grooves take of them."""
        return self.rubbers(tire)

    def tread_over_own(self, tire: TireTable, temperature: float) -> float | None:
        """Dynamic modulus of the tread at a temperature (degrees C) over that which the section has by itself at 20.

        None where it has none.
        """
        return None

    @property
    def land(self) -> float:
        """Share of the tread's face that the grooves spread over it leave."""
        return 1.0

    @property
    def grooves_around(self) -> list[tuple[float, float, float]]:
        """Middle y, width and depth (m) of these grooves."""
        return []

    def cords(self, tire: TireTable) -> list[Cords]:
        """The cords on the plies of the section."""
        raise NotImplementedError

    def angles(self, tire: TireTable) -> dict[str, float]:
        """Angle to the circumference (deg) of each line of cords, for drawings."""
        return {line.name: line.angle for line in tire.cords}

    def rubber(self, tire: TireTable) -> tuple[float, float, float]:
        """Dynamic modulus (Pa), Poisson's ratio and density (kg/m³) of the wall, for estimates."""
        assert tire.material is not None, "a kind without a wall of one material has its own"
        law = tire.material.law
        return (tire.dynamic or 1.0) * law.youngs, law.poisson, tire.material.density

    def free_unknowns(self, tire: TireTable) -> int:
        """Displacement unknowns of the mesh, without those held by the rim."""
        import numpy as np

        section = self.ring(tire).section
        held = len(np.unique(section.side(section.rim)))
        return 3 * tire.segments * tire.order * (len(section.nodes) - held)

    def coarser(self, tire: TireTable) -> Self:
        """The kind with half the elements along the section, however few that leaves."""
        raise NotImplementedError

    def meshes(self, tire: TireTable) -> tuple[tuple[int, int], ...]:
        """(elements around, along the section) for a search of settings, from coarse to fine.

        Each is about 1.2 times finer than the one before; the coarsest can be halved.
        """
        along = self.proportions(tire).along
        return tuple((around, along) for around in AROUND)

    def search_order(self, tire: TireTable) -> int:
        """Element order used by a search."""
        return tire.order

    def elements_along(self, along: int) -> Self:
        """The kind with that many elements along its section, if the number can be chosen."""
        return self

    def has_losses(self, tire: TireTable) -> bool:
        """Whether any compound has a loss factor."""
        return any(rubber.loss_factor for rubber in self.rubbers(tire).values())

    def varies(self, tire: TireTable) -> bool:
        """Whether any modulus depends on frequency."""
        return any(rubber.spectrum != CONSTANT for rubber in self.rubbers(tire).values())

    def fingerprint(self, tire: TireTable) -> str | None:
        """Hash of what a run takes from the section's files; None without files."""
        return None

    def described(self, tire: TireTable) -> list[str]:
        """Lines for `check`: which parts of a file are used and which are not."""
        return []


SECTIONS: Registry[SectionKind] = Registry("section", "tireroad.runs.scene.sections", SectionKind)
section_kind = SECTIONS.register


@dataclass(frozen=True)
class CavityTable:
    gas: str = choice(
        "air",
        ("air", "none"),
        "gas in the tire; none: neither its mass nor its resonances are modelled",
    )
    temperature: float | None = number(
        None, "K", "temperature of the gas; absent: that of the tire", least=150, most=1000
    )
    loss_factor: float | None = number(
        None,
        "-",
        "loss factor of the acoustic waves; absent: from friction at the walls",
        least=0,
        most=1,
    )
    up_to: float | None = number(
        None,
        "Hz",
        "highest frequency of its modes; absent: all of up to eight waves around the ring, about 1700 Hz",
        least=1,
        most=5000,
    )


@dataclass(frozen=True, kw_only=True)
class MaterialTable(Variants):
    model: str = registered(MATERIALS, "neo-hookean", "strain energy")
    law: MaterialLaw = variant("model", MATERIALS)
    density: float = number(1200.0, "kg/m³", "density, undeformed", least=1, most=3e4)


def _dynamic():
    return number(
        None,
        "-",
        "dynamic modulus, used for the modes, over the static modulus; absent: that of the compound, 1 in a torus",
        least=0.01,
        most=100,
    )


def _exponent():
    return number(
        None,
        "-",
        "growth of the dynamic modulus with the frequency's power; absent: that of the compound, 0 in a torus",
        least=0,
        most=0.5,
    )


def _shares():
    limits = Limits(least=0, most=1)
    return numbers("shares of the instantaneous modulus in a Prony series", "-", limits)


def _times():
    limits = Limits(least=1e-12, most=1e12)
    return numbers("relaxation times of the shares", "s", limits)


def _master_curve():
    return filename(
        "master curve at 20 °C as CSV: frequency, Hz, storage and loss modulus in stretch, Pa; takes the place of dynamic, "
        "loss_factor and exponent",
    )


def _loss_factor():
    return number(
        None,
        "-",
        "loss factor tan δ of the rubber, used for the modes; absent: that of the compound, 0 in a torus",
        least=0,
        most=2,
    )


@dataclass(frozen=True)
class RegionTable:
    name: str | None = text(
        None,
        "region of a file, or compound of a radial tire, that this changes; absent: all compounds of a radial tire; not "
        "for a torus",
    )
    arc: tuple[float, float] | None = vector(
        AROUND_CROWN,
        "deg",
        "start and end, measured from the crown; of a torus only, where absent is 0 to 45",
        least=0,
        most=175,
        absent=True,
    )
    side: str | None = choice(
        None,
        ("both", "left", "right"),
        "side of the crown; left: y < 0; of a torus only, where absent is both",
    )
    depth: tuple[float, float] | None = vector(
        WHOLE_WALL,
        "-",
        "start and end through the wall, from 0 at the inner face to 1 at the outer face; of a torus only, where "
        "absent is all of it",
        least=0,
        most=1,
        absent=True,
    )
    material: MaterialTable | None = table(
        MaterialTable,
        "material of the region; what is absent stays that of the compound, in a torus that of [tire.material]",
        optional=True,
    )
    dynamic: float | None = _dynamic()
    loss_factor: float | None = _loss_factor()
    exponent: float | None = _exponent()
    prony_shares: tuple[float, ...] = _shares()
    prony_times: tuple[float, ...] = _times()
    master_curve: str | None = _master_curve()
    hardness: float | None = number(
        None,
        "Shore A",
        "hardness of the rubber, from which its static moduli follow by Gent's formula; written back as these",
        least=20,
        most=95,
    )


@dataclass(frozen=True)
class CordsTable:
    name: str = text(
        "ply",
        "name of this line of cords in results and messages; of a file or the radial tire that of the line that it "
        "changes, of which stays what it leaves out",
    )
    depth: float | None = number(
        None,
        "m",
        f"depth under the outer face of the undeformed wall; of a torus only, where absent is {CORDS_DEPTH:g}",
        least=0,
        most=5,
    )
    arc: tuple[float, float] | None = vector(
        CORDS_ARC,
        "deg",
        "start and end, measured from the crown; y < 0 first; of a torus only, where absent is -45 to 45",
        least=-180,
        most=180,
        absent=True,
    )
    angle: float = number(
        20.0,
        "deg",
        "angle to the circumference; at the lowest point from +x towards +y",
        least=-90,
        most=90,
    )
    youngs_modulus: float = number(
        172.2e9, "Pa", "Young's modulus of a cord in tension", least=1e3, most=1e13
    )
    area: float = number(2.118e-7, "m²", "cross-sectional area of one cord", least=1e-12, most=1e-3)
    spacing: float = number(
        1.16e-3, "m", "distance between cords, measured across them", least=1e-6, most=0.1
    )
    density: float = number(0.0, "kg/m³", "density of the cords", least=0, most=3e4)
    compression: float = number(
        1.0, "-", "modulus in compression over that in tension", least=0, most=1
    )
    drum_radius: float | None = number(
        None,
        "m",
        "radius of the building drum on which angle and spacing are given; absent: they are those in the tire",
        least=0.01,
        most=10,
    )


@dataclass(frozen=True, kw_only=True)
class TireTable(Variants):
    section: str = registered(SECTIONS, "torus", "shape of the section")
    shape: SectionKind = variant("section", SECTIONS)
    segments: int | None = integer(
        None,
        "number of elements around the axle; absent: 28, of order 2 in a torus 100, for a radial tire 40, for a section from a file 60",
        least=8,
        most=4000,
    )
    order: int | None = integer(
        None,
        "polynomial order of the elements; absent: 3, or 2 where their number is given, and for a radial tire or a file",
        least=1,
        most=3,
    )
    footprint_size: float | None = number(
        None,
        "-",
        "element length at the footprint relative to that elsewhere; absent: 0.2 with a road, else 1",
        least=SIZE.least,
        most=SIZE.most,
    )
    material: MaterialTable | None = table(
        MaterialTable,
        "material of the wall, or of what a file leaves open; absent: its defaults, in a radial tire none",
        optional=True,
    )
    dynamic: float | None = _dynamic()
    loss_factor: float | None = _loss_factor()
    exponent: float | None = _exponent()
    prony_shares: tuple[float, ...] = _shares()
    prony_times: tuple[float, ...] = _times()
    master_curve: str | None = _master_curve()
    region: tuple[RegionTable, ...] = tables(
        RegionTable, "a part of the section that is made of another material"
    )
    cords: tuple[CordsTable, ...] = tables(
        CordsTable, "a line of cords in the wall: a ply or a belt"
    )
    cavity: CavityTable | None = table(
        CavityTable,
        "the air inside; absent: none in a torus, else this table's defaults",
        optional=True,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.material is None and "material" not in self.shape.without:
            object.__setattr__(self, "material", MaterialTable())

    def with_elements(self, on_road: bool) -> TireTable:
        """The tire with open mesh keys set; on a road, elements are smaller at the footprint."""
        shape, order, segments = self.shape.elements(self)
        near = self.footprint_size or (NEAR_ROAD if on_road else 1.0)
        return replace(self, shape=shape, order=order, segments=segments, footprint_size=near)

    def proportions(self) -> Proportions:
        """Sizes of the section."""
        return self.shape.proportions(self)

    def ring(self) -> Ring:
        """The ring of elements from the revolved section."""
        return self.shape.ring(self)

    @property
    def curves(self) -> list[str]:
        """The files of its master curves."""
        named = (self.master_curve, *(region.master_curve for region in self.region))
        return [name for name in named if name]

    def free_unknowns(self) -> int:
        """Displacement unknowns of the mesh, without those held by the rim."""
        return self.shape.free_unknowns(self)


def cords_of(line: CordsTable) -> Cords:
    """The cords of a [[tire.cords]], without their place in the section."""
    from tireroad.fem.tire.cords import Cords

    values = {k: v for k, v in vars(line).items() if k not in ("depth", "arc", "angle")}
    return Cords(angle=float(np.radians(line.angle)), **values)


def spelt(lines: Sequence[CordsTable], names: Iterable[str]) -> list[CordsTable]:
    """The [[tire.cords]] with names spelt as the section's plies are."""
    own = {name.upper(): name for name in names}
    return [replace(line, name=own.get(line.name.upper(), line.name)) for line in lines]


def region_of(tire: TireTable, name: str) -> RegionTable | None:
    """The scene's [[tire.region]] of that name, or None."""
    return next((r for r in tire.region if r.name and r.name.upper() == name.upper()), None)


def losses_of(part: TireTable | RegionTable, law: MaterialLaw) -> dict[str, Any]:
    """Keys of [tire] or a region for small motions, of a rubber of that law. A series or a master curve gives all of it."""
    if part.master_curve:
        modulus, *rest = master_curve(part.master_curve)
        return dict(zip(_SMALL_MOTIONS, (modulus / law.youngs, *rest), strict=True))
    if part.prony_shares or part.prony_times:
        return dict(zip(_SMALL_MOTIONS, prony(part.prony_shares, part.prony_times), strict=True))
    spectrum = None if part.exponent is None else power_law(part.exponent)
    values = dict(zip(_SMALL_MOTIONS, (part.dynamic, part.loss_factor, spectrum), strict=True))
    return {key: value for key, value in values.items() if value is not None}


def changed(compound: Material, region: RegionTable | None) -> Material:
    """A compound with what a region states."""
    if region is None:
        return compound
    material = region.material
    if material is not None:
        compound = replace(compound, law=material.law, density=material.density)
    return replace(compound, **losses_of(region, compound.law))


def master_curve(file: str) -> tuple[float, float, Spectrum]:
    """`measured` of a CSV file of frequency (Hz), storage and loss modulus (Pa); a first line may name the columns.

    InputError for a file that is none.
    """
    rows: list[list[float]] = []
    try:
        lines = Path(file).read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read: {error}") from None
    for number_, line in enumerate(lines, 1):
        cells = [cell.strip() for cell in line.split("#")[0].replace(";", ",").split(",")]
        if not any(cells):
            continue
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            if rows or number_ > 1:
                raise InputError(f"line {number_} of {file} is not three numbers") from None
            continue
        if len(row) != 3:
            raise InputError(f"line {number_} of {file} has {len(row)} numbers, not three")
        rows.append(row)
    if not rows:
        raise InputError(f"{file} has no line of three numbers")
    return measured(*zip(*rows, strict=True))


def check_series(tire: TireTable, source: Source) -> None:
    """Note Prony series and master curves that are none, or that stand beside an exponent."""
    parts: list[tuple[tuple[str, ...], TireTable | RegionTable]] = [(("tire",), tire)]
    parts += [(("tire", "region", str(n)), region) for n, region in enumerate(tire.region)]
    for path, part in parts:
        ways: dict[str, tuple[str, Callable[[], object]]] = {}
        if part.prony_shares or part.prony_times:
            series = partial(prony, part.prony_shares, part.prony_times)
            ways["prony_shares"] = "with prony_times: ", series
        if part.master_curve:
            ways["master_curve"] = "", partial(master_curve, part.master_curve)
        for key, (before, read) in ways.items():
            try:
                read()
            except InputError as wrong:
                source.add((*path, key), f"{before}{wrong}")
        stated = [
            key for key in ("dynamic", "loss_factor", "exponent") if getattr(part, key) is not None
        ]
        for key in [*stated, *list(ways)[1:]] if ways else ():
            source.add((*path, key), f"and {next(iter(ways))} exclude each other")


def proportions_of(ring: Ring, drawn: SectionMesh) -> Proportions:
    """Sizes of a ring from its section as drawn, of any element order."""
    return Proportions(
        outer_radius=float(drawn.nodes[:, 0].max()),
        height=ring.height / 2,
        thickness=ring.thickness,
        half_angle=float(np.degrees(np.abs(ring.arc_corners).max())),
        along=len(drawn.outer),
        through=max(1, round(len(drawn.cells) / len(drawn.outer))),
    )
