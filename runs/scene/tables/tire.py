"""The table of the tire, key by key, with units, ranges and defaults (contract: Scene)."""

from dataclasses import dataclass

from tireroad.fem.parameters import filename, flag, texts
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
from tireroad.runs.scene.tables.cavity import Cavity

TORUS, FILE = ("section", ("torus",)), ("section", ("file",))
RADIAL, MESHED = ("section", ("radial",)), ("section", ("torus", "radial"))


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
    name: str | None = text(None, "name of the region in the file; not for a torus")
    arc: tuple[float, float] = vector(
        (0.0, 45.0), "deg", "start and end, measured from the crown", least=0, most=175
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
        Material, "material of the region; absent: that of the file", optional=True
    )
    dynamic: float = _dynamic()
    loss_factor: float = _loss_factor()


@dataclass(frozen=True)
class Cords:
    name: str = text("ply", "name of this line of cords in results and messages")
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


# The mesh's defaults: largest error of the 28 lowest frequencies of the torus without loads, E = 480 MPa, against
# Fourier series around (bench.series.harmonics): 30 x 14 of order 3, 44,280 unknowns, 0.16 %; 24 x 12, 30,240: 0.22 %;
# 100 x 16 of order 2, 55,800: 1.4 to 1.75 %, as much processor time as 24 x 14 of order 3. Load at z = -0.31 m, soft
# torus, footprint_size 0.2 on 30 x 14: 2001.6 N, where 2000 N is known to 0.15 %.
@dataclass(frozen=True)
class Tire:
    section: str = choice("torus", ("torus", "radial", "file"), "shape of the section")
    size: str = text(
        "205/60 R15", "size of the built-in passenger tire (docs/radial-tire.md)", only_for=RADIAL
    )
    outer_radius: float = number(
        0.32, "m", "outer radius, from the axle to the crown", least=0.01, most=10, only_for=TORUS
    )
    minor_radius: float = number(
        0.10,
        "m",
        "radius of the section circle, to its outer face",
        least=1e-3,
        most=10,
        only_for=TORUS,
    )
    thickness: float = number(
        0.012, "m", "thickness of the wall", least=1e-4, most=5, only_for=TORUS
    )
    half_angle: float = number(
        120.0,
        "deg",
        "angle of the section from the crown to each bead",
        least=10,
        most=175,
        only_for=TORUS,
    )
    segments: int | None = integer(
        None,
        "number of elements around the axle; absent: 30 of order 3, 60 for a section from a file",
        least=8,
        most=4000,
    )
    elements_arc: int | None = integer(
        None,
        "number of elements from bead to bead; absent: 14 of order 3, 26 for a radial tire",
        least=2,
        most=1000,
        only_for=MESHED,
    )
    elements_thickness: int = integer(
        1, "number of elements through the wall", least=1, most=20, only_for=TORUS
    )
    order: int | None = integer(
        None,
        "polynomial order of the elements; absent: 3, or 2 where their number is given, and for a radial tire or a file",
        least=1,
        most=3,
    )
    grading: str = choice(
        "bead", ("bead", "uniform"), "grading of the elements along the section", only_for=TORUS
    )
    footprint_size: float | None = number(
        None,
        "-",
        "element length at the footprint relative to that elsewhere; absent: 0.2 with a road, else 1",
        least=0.05,
        most=1,
    )
    material: Material = table(Material, "material of the wall")
    dynamic: float = _dynamic()
    loss_factor: float = _loss_factor()
    region: tuple[Region, ...] = tables(
        Region, "a part of the section that is made of another material"
    )
    file: str | None = filename(
        "Abaqus deck (.inp), Gmsh mesh (.msh) or section file (.toml, docs/section-file.md)",
        only_for=FILE,
    )
    inner: str | None = text(
        None, "surface or node set that carries the inflation pressure", only_for=FILE
    )
    tread: str | None = text(None, "surface or node set that can touch the road", only_for=FILE)
    rim: tuple[str, ...] = texts("surfaces or node sets that are fixed to the wheel", only_for=FILE)
    length_unit: str = choice(
        "m",
        ("m", "mm", "in"),
        "length unit of the file; mm implies N, MPa and tonnes, in implies lbf and psi",
        only_for=FILE,
    )
    mirror: bool = flag(
        False,
        "true: the file holds half the section, which ends on z = 0, and is mirrored",
        only_for=FILE,
    )
    cords: tuple[Cords, ...] = tables(Cords, "a line of cords in the wall: a ply or a belt")
    cavity: Cavity | None = table(
        Cavity, "the air inside; absent: none in a torus, else this table's defaults", optional=True
    )
