"""The table of the tire, key by key, with units, ranges and defaults (contract: Scene)."""

from dataclasses import dataclass

from tireroad.runs.scene.schema import choice, integer, number, table, tables, text, vector

LINEAR = ("model", ("linear", "neo-hookean"))


@dataclass(frozen=True)
class Material:
    model: str = choice(
        "neo-hookean", ("linear", "neo-hookean", "mooney-rivlin", "yeoh"), "strain energy"
    )
    youngs_modulus: float = number(
        4.8e8, "Pa", "at small strain", above=0, most=1e13, only_for=LINEAR
    )
    poisson_ratio: float = number(
        0.45, "-", "at small strain", above=-1, below=0.5, only_for=LINEAR
    )
    density: float = number(1200.0, "kg/m³", "of the undeformed wall", above=0, most=1e5)
    c10: float = number(
        6.6e7,
        "Pa",
        "first invariant, linear",
        above=0,
        most=1e13,
        only_for=("model", ("mooney-rivlin", "yeoh")),
    )
    c01: float = number(
        1.6e7,
        "Pa",
        "second invariant, linear",
        least=0,
        most=1e13,
        only_for=("model", ("mooney-rivlin",)),
    )
    c20: float = number(
        0.0,
        "Pa",
        "first invariant, squared",
        least=-1e13,
        most=1e13,
        only_for=("model", ("yeoh",)),
    )
    c30: float = number(
        0.0,
        "Pa",
        "first invariant, cubed",
        least=-1e13,
        most=1e13,
        only_for=("model", ("yeoh",)),
    )
    bulk_modulus: float = number(
        1.6e9,
        "Pa",
        "of the volumetric term",
        above=0,
        most=1e15,
        only_for=("model", ("mooney-rivlin", "yeoh")),
    )


def _dynamic():
    return number(1.0, "-", "modulus of the modes over that of the static state", above=0, most=100)


def _loss_factor():
    return number(0.0, "-", "tan δ of the rubber in the modes", least=0, most=2)


@dataclass(frozen=True)
class Region:
    arc: tuple[float, float] = vector(
        (0.0, 45.0), "deg", "from, to, measured from the crown", least=0, most=175
    )
    side: str = choice("both", ("both", "left", "right"), "of the crown; left: y < 0")
    depth: tuple[float, float] = vector(
        (0.0, 1.0), "-", "from, to, through the wall; 0: inner face", least=0, most=1
    )
    material: Material = table(Material, "what the region is made of")
    dynamic: float = _dynamic()
    loss_factor: float = _loss_factor()


@dataclass(frozen=True)
class Cords:
    name: str = text("ply", "of this line of cords, in results and messages")
    depth: float = number(
        0.006, "m", "under the outer face of the undeformed wall", least=0, most=5
    )
    arc: tuple[float, float] = vector(
        (-45.0, 45.0), "deg", "from, to, measured from the crown; y < 0 first", least=-180, most=180
    )
    angle: float = number(
        20.0, "deg", "from the circumference, at the lowest point +x to +y", least=-90, most=90
    )
    youngs_modulus: float = number(172.2e9, "Pa", "of a cord in tension", above=0, most=1e13)
    area: float = number(2.118e-7, "m²", "cross-section of one cord", above=0, most=1)
    spacing: float = number(1.16e-3, "m", "between cords, across them", above=0, most=1)
    density: float = number(0.0, "kg/m³", "of the cords", least=0, most=1e5)
    compression: float = number(
        1.0, "-", "modulus in compression over that in tension", least=0, most=1
    )


# The mesh's defaults are from `bench discretisation`, soft torus, 5 mm on the road, errors of the first
# and the 20th frequency and of the load. 100 x 16 of order 2, graded at the beads: 0.4, 0.15 and 0.4 %.
# 50 x 16 with footprint_size 0.25 has half the unknowns: 0.65, 0.2 and 1.4 %. Without grading at the
# beads 1.7 % in the first frequency; two elements through the wall gain nothing; order 3, 20 x 10: 0.5,
# 0.1 and 0.8 % of fewer unknowns in about the same time, but the fewest nodes under the road.
@dataclass(frozen=True)
class Tire:
    section: str = choice("torus", ("torus",), "shape of the section")
    outer_radius: float = number(0.32, "m", "axle to crown", above=0, most=10)
    minor_radius: float = number(0.10, "m", "of the section, to its outer face", above=0, most=10)
    thickness: float = number(0.012, "m", "of the wall", above=0, most=5)
    half_angle: float = number(120.0, "deg", "arc from the crown to each bead", least=10, most=175)
    segments: int = integer(100, "elements around", least=8, most=4000)
    elements_arc: int = integer(16, "elements from bead to bead", least=2, most=1000)
    elements_thickness: int = integer(1, "elements through the wall", least=1, most=20)
    order: int = integer(2, "of the elements", least=1, most=3)
    grading: str = choice("bead", ("bead", "uniform"), "of the elements along the arc")
    footprint_size: float = number(
        1.0, "-", "length of elements at the footprint, relative to ungraded", least=0.05, most=1
    )
    material: Material = table(Material, "what the wall is made of")
    dynamic: float = _dynamic()
    loss_factor: float = _loss_factor()
    region: tuple[Region, ...] = tables(
        Region, "a part of the section of another material; elements whose middle it holds"
    )
    cords: tuple[Cords, ...] = tables(Cords, "a line of cords in the wall: a ply or a belt")
