"""The tables [contact], [pattern] and [time], with units, ranges and defaults."""

from __future__ import annotations

from dataclasses import dataclass, replace

from tireroad.contact.solver.solvers import SOLVERS
from tireroad.contact.tread.law import TREADS, TreadLaw
from tireroad.fem.parameters import Limits, filename, flag, numbers
from tireroad.greens.schemes import SCHEMES
from tireroad.runs.scene.schema import (
    Pitch,
    Variants,
    Where,
    choice,
    integer,
    number,
    points,
    registered,
    tables,
    variant,
    vector,
)

DRY_ASPHALT = 1.0  # coefficient of friction of a passenger tire
TREAD_RUBBER = 1e7  # Pa: contact.youngs_modulus of a radial tire, whose own tread is usual


@dataclass(frozen=True)
class GrooveTable:
    direction: str = choice(
        "lateral",
        ("lateral", "circumferential"),
        "lateral: one in each pitch; circumferential: around the tire",
    )
    position: float = number(
        0.0,
        "-",
        "position in its pitch, 0 to 1; of a circumferential groove y in m",
        least=-1,
        most=1,
    )
    width: float = number(0.004, "m", "width between the middles of the flanks", least=1e-6, most=1)
    depth: float = number(0.008, "m", "depth under the outer face", least=1e-6, most=0.1)
    flank: float = number(
        0.001,
        "m",
        "width of a flank, over which the groove reaches its depth",
        least=1e-5,
        most=0.1,
    )
    angle: float = number(
        0.0,
        "deg",
        "angle of a lateral groove to the direction of the axle; positive: its right side (y < 0) enters the "
        "footprint first",
        least=-80,
        most=80,
    )
    span: tuple[float, float] = vector(
        (-1.0, 1.0), "m", "range of y covered by a lateral groove", least=-10, most=10
    )


@dataclass(frozen=True)
class PatternTable:
    pitches: int = integer(
        60, "number of pitches around the tire, for the lateral grooves", least=1, most=2000
    )
    pitch_lengths: tuple[float, ...] = numbers(
        "relative lengths of the pitches, in random order; one value: all equal",
        "-",
        Limits(least=0.2, most=5),
        (1.0,),
    )
    seed: int = integer(1, "seed of their random order", least=0, most=2**31)
    file: str | None = filename(
        "depths in place of grooves: .npz with depth (n, m) m around the tire and y (m) m, or an image (.png) from "
        "white, the outer face, to black, the full depth, its width around the tire"
    )
    depth: float = number(
        0.008, "m", "depth that black stands for in an image", least=1e-6, most=0.1
    )
    width: float = number(0.15, "m", "width of an image, across the tire", least=1e-6, most=10)
    groove: tuple[GrooveTable, ...] = tables(GrooveTable, "a groove of the tread")


@dataclass(frozen=True, kw_only=True)
class ContactTable(Variants):
    tread: str = registered(
        TREADS,
        "half-space",
        "local compliance of the tread; absent, on section radial or file: layer, because belts hardly deform",
    )
    law: TreadLaw = variant("tread", TREADS)
    in_series: bool = flag(
        True,
        "true: the tread lies on the tire's own outer rubber, in series with it; false: it is that rubber, and counts only for "
        "what the elements do not resolve of it, on a grid of points; absent, on section radial or file where tread is absent "
        "too, on a grid and without bristles: false, and thickness and (on a file) youngs_modulus are those of the tire's tread",
    )
    points: str | Pitch = points(
        "contact points: the nodes of the mesh, or a grid with this spacing; auto: a grid as fine as the footprint and "
        "the waves up to accuracy.up_to require, or the nodes under a tread without compliance or with bristles counted "
        "per point",
        least=1e-5,
        most=1,
    )
    brush_stiffness: float | None = number(
        None,
        "N/m",
        "tangential stiffness of the bristle of a point, independent of its area, so that the force depends on the grid; "
        "absent, and brush_stiffness_per_area too: the tread alone deforms (shear)",
        least=1e-3,
        most=1e12,
    )
    brush_stiffness_per_area: float | None = number(
        None,
        "N/m³",
        "tangential stiffness of the bristles, instead of brush_stiffness: the same on every grid; a tread of shear "
        "modulus G and thickness h has about G/h, which contact.shear counts already",
        least=1e-3,
        most=1e15,
    )
    brush: str = choice(
        "rolling",
        ("rolling", "spring"),
        "bristles that pass through the patch with the tire, or springs fixed at the points",
    )
    friction: float | None = number(
        None,
        "-",
        "coefficient of Coulomb friction; 0: none, so that horizontal forces come from the road's slope alone and are up to "
        "12 dB wrong below 200 Hz; absent: 1.0, dry asphalt, on a tread that shears, while given bristles never slip",
        least=0,
        most=10,
    )
    shear: bool = flag(
        True,
        "with friction, an elastic or viscoelastic tread also deforms under horizontal forces, and pressure displaces it "
        'sideways; bristles are in series with it. Not with brush = "spring"',
    )
    slip: tuple[float, float] = vector(
        (0.0, 0.0), "-", "slip of the tire: longitudinal (> 0 drives), lateral", least=-1, most=1
    )
    solver: str = choice(
        "auto",
        ("auto", *SOLVERS),
        "solver of the complementarity problem of a step",
    )
    reach: float | None = number(
        None,
        "m",
        "static gap up to which points take part; absent: 1.5 times the road's height and 5 mm, rounded up to 5 mm times a power of 1.5",
        least=1e-6,
        most=1,
    )

    @property
    def on_nodes(self) -> bool:
        """Whether the points are nodes for any footprint."""
        counted = self.brush_stiffness is not None or not self.law.compliant
        return self.points == "nodes" or (self.points == "auto" and counted)

    @property
    def has_bristles(self) -> bool:
        """Whether bristles are given."""
        return (self.brush_stiffness, self.brush_stiffness_per_area) != (None, None)

    @property
    def has_friction(self) -> bool:
        """Whether the road holds the tread by friction or bristles."""
        return self.friction != 0 and (self.has_bristles or self.has_shear)

    @property
    def has_shear(self) -> bool:
        """Whether the tread deforms under horizontal forces."""
        rubs = self.friction is not None and self.friction > 0
        return self.shear and rubs and self.brush == "rolling" and self.law.shears

    def by_default(self) -> ContactTable:
        """The table with the friction of dry asphalt where the scene leaves it open and the tread shears."""
        if self.friction is not None or self.has_bristles:
            return self
        rubbed = replace(self, friction=DRY_ASPHALT)
        return rubbed if rubbed.has_shear else self


def check_tread(contact: ContactTable, standing: bool, error: Where, has_friction: bool) -> None:
    """Raise an error for invalid treads and brushes; `has_friction`: the static state has friction."""
    if contact.law.creeps and contact.on_nodes:
        raise error(
            ("contact", "tread"),
            "= a tread that creeps, by its relaxation or loss_factor, needs a grid: contact.points = { dx, dy } (m)",
        )
    if contact.on_nodes and not contact.in_series:
        raise error(
            ("contact", "in_series"),
            "= false: nodes have all of the tire's tread: take contact.points = { dx, dy } (m), or true",
        )
    if None not in (contact.brush_stiffness, contact.brush_stiffness_per_area):
        raise error(
            ("contact", "brush_stiffness_per_area"), "and brush_stiffness are two brushes: keep one"
        )
    if not contact.has_friction and contact.friction:
        raise error(
            ("contact", "friction"),
            "needs a tread that shears, or brush_stiffness_per_area (N/m³), to carry it",
        )
    if any(contact.slip) and (not (contact.has_friction or has_friction) or standing):
        raise error(
            ("contact", "slip"),
            "needs contact.friction, brush_stiffness_per_area (N/m³) or static.friction, and a rolling tire",
        )


@dataclass(frozen=True)
class TimeTable:
    duration: float = number(0.1, "s", "duration of the run", least=1e-7, most=1e5)
    step: float | str = number(
        "auto", "s", "step of the time integration", least=1e-9, most=1e3, word="auto"
    )
    scheme: str = choice(
        "auto",
        ("auto", *SCHEMES),
        "contact force within a step; auto: linear where the steps resolve the contact, else damped",
    )
    checkpoint: float = number(
        60.0, "s", "wall-clock time between two checkpoints", least=0.1, most=1e6
    )
