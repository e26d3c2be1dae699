"""The table [tire.cavity]: keys, when air is included by default, and incompatible settings.

The table of the tire, key by key, with units, ranges and defaults (contract: Scene).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from tireroad.fem.errors import InputError
from tireroad.fem.sections.ring import SIZE
from tireroad.fem.tire.law import MATERIALS, MaterialLaw
from tireroad.runs.scene.schema import (
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
from tireroad.runs.scene.sections.kind import SECTIONS, Proportions, SectionKind

if TYPE_CHECKING:
    from tireroad.fem.sections.ring import Ring
    from tireroad.runs.scene.tables.scene import Scene


Where = Callable[[tuple[str, ...], str], InputError]


@dataclass(frozen=True)
class Cavity:
    gas: str = choice(
        "air",
        ("air", "none"),
        "gas in the tire; none: neither its mass nor its resonances are modelled",
    )
    temperature: float = number(293.15, "K", "temperature of the gas", least=150, most=1000)
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


def filled(scene: Scene) -> Scene:
    """The scene with air included by default, for every section but the torus of the thesis."""
    tire = scene.tire
    if not tire.shape.air or tire.cavity is not None:
        return scene
    return replace(scene, tire=replace(tire, cavity=Cavity()))


def has_air(scene: Scene) -> bool:
    """Whether the air in the tire is modelled."""
    return scene.tire.cavity is not None and scene.tire.cavity.gas != "none"


def check_cavity(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """Raise an error for what is not available with air."""
    if not has_air(scene):
        return
    rotation, residual = scene.rotation, scene.greens.residual
    if rotation is not None and rotation.speed and rotation.method == "full":
        raise error(
            ("rotation", "method"),
            '= "full" knows no air: take "projected", or tire.cavity.gas = "none"',
        )
    used = bool(scene.force) or scene.contact is not None
    if used and scene.modes.rim == "free" and residual not in ("none", "attachment"):
        raise error(
            ("greens", "residual"),
            f'= "{residual}" of a free rim knows no air: take "attachment" or "none", or '
            'tire.cavity.gas = "none"',
        )


NEAR_ROAD = 0.2  # footprint_size with a road
AROUND_CROWN = (0.0, 45.0)  # deg: arc of a region of a torus that has none


@dataclass(frozen=True, kw_only=True)
class Material(Variants):
    model: str = registered(MATERIALS, "neo-hookean", "strain energy")
    law: MaterialLaw = variant("model", MATERIALS)
    density: float = number(1200.0, "kg/m³", "density, undeformed", least=1, most=3e4)


def _dynamic():
    return number(
        1.0,
        "-",
        "dynamic modulus, used for the modes, over the static modulus",
        least=0.01,
        most=100,
    )


def _loss_factor():
    return number(0.0, "-", "loss factor tan δ of the rubber, used for the modes", least=0, most=2)


@dataclass(frozen=True)
class Region:
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
    side: str = choice("both", ("both", "left", "right"), "side of the crown; left: y < 0")
    depth: tuple[float, float] = vector(
        (0.0, 1.0),
        "-",
        "start and end through the wall, from 0 at the inner face to 1 at the outer face",
        least=0,
        most=1,
    )
    material: Material | None = table(
        Material,
        "material of the region; absent: that of the file, or of [tire.material] in a torus",
        optional=True,
    )
    dynamic: float = _dynamic()
    loss_factor: float = _loss_factor()


@dataclass(frozen=True)
class Cords:
    name: str = text(
        "ply",
        "name of this line of cords in results and messages; the name of a line of a file or of the radial tire replaces "
        "its cords",
    )
    depth: float = number(
        0.006, "m", "depth under the outer face of the undeformed wall", least=0, most=5
    )
    arc: tuple[float, float] = vector(
        (-45.0, 45.0),
        "deg",
        "start and end, measured from the crown; y < 0 first",
        least=-180,
        most=180,
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
class Tire(Variants):
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
    material: Material = table(Material, "material of the wall")
    dynamic: float = _dynamic()
    loss_factor: float = _loss_factor()
    region: tuple[Region, ...] = tables(
        Region, "a part of the section that is made of another material"
    )
    cords: tuple[Cords, ...] = tables(Cords, "a line of cords in the wall: a ply or a belt")
    cavity: Cavity | None = table(
        Cavity, "the air inside; absent: none in a torus, else this table's defaults", optional=True
    )

    def with_elements(self, on_road: bool) -> Tire:
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

    def free_unknowns(self) -> int:
        """Displacement unknowns of the mesh, without those held by the rim."""
        return self.shape.free_unknowns(self)
