"""Sizes of passenger tires like 205/60 R15.

The built-in radial passenger tire, e.g. 205/60 R15; sources: docs/radial-tire.md.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.sections.construction import Construction, CordLine, Layer, Outline, Part

_SIZE = re.compile(r"\s*(\d{3})\s*/\s*(\d{2})\s*Z?R\s*(\d{2})\s*", re.IGNORECASE)


RATED_PRESSURE = 2.5e5  # Pa


@dataclass(frozen=True)
class Size:
    """Section `width`, section `height` and `rim` radius, all in m."""

    width: float
    height: float
    rim: float

    def rated_load(self, inflation: float = RATED_PRESSURE) -> float:
        """Load (N) that the size is rated for at an `inflation` (Pa), as a standard, not a reinforced tire.

        1.95e-3 width^0.86 height^0.89 rim diameter^0.63 kg, in mm, at 250 kPa: within 4.3 % (standard
        deviation 1.7 %) of the load indices of 41 sizes from 145/80 R13 to 275/40 R19.  Below that pressure
        its 0.8th power, as in the tables of tire standards; above, no more.
        """
        width, height, diameter = 1e3 * self.width, 1e3 * self.height, 2e3 * self.rim
        index = 1.950e-3 * width**0.8634 * height**0.8949 * diameter**0.6315
        return 9.81 * index * min(inflation / RATED_PRESSURE, 1.0) ** 0.8

    def inflation_for(self, load: float) -> float:
        """Least inflation (Pa) at which a `load` (N) is rated; at most 250 kPa."""
        return RATED_PRESSURE * min(load / self.rated_load(), 1.0) ** 1.25


def size(text: str) -> Size:
    """Parse 205/60 R15: section width in mm, height over width in %, rim diameter in inches.

    Raises InputError for another format or a size out of range."""
    found = _SIZE.fullmatch(text)
    if not found:
        raise InputError(f'tire.size = "{text[:40]}": must be like "205/60 R15"')
    width, ratio, inches = (int(part) for part in found.groups())
    if not (125 <= width <= 355 and 25 <= ratio <= 85 and 10 <= inches <= 24):
        raise InputError(
            f'tire.size = "{text[:40]}": from 125 to 355 mm wide, 25 to 85 % high, on rims of 10 to 24 inches'
        )
    return Size(width / 1e3, width * ratio / 1e5, inches * 0.0254 / 2)


STEEL = {"youngs_modulus": 190e9, "area": 0.246e-6, "spacing": 1.25e-3, "density": 7850.0}
NYLON = {"youngs_modulus": 3e9, "area": 0.33e-6, "spacing": 1.0e-3, "density": 1140.0}
POLYESTER = {
    "youngs_modulus": 7e9,
    "area": 0.35e-6,
    "spacing": 1.0e-3,
    "density": 1380.0,
    "compression": 0.1,
}
BELT_ANGLE = np.radians(22)

# E Pa, Poisson's ratio, kg/m3, dynamic over static modulus, loss factor, both at 100 Hz, exponent of the
# modulus over frequency.  That of the tread is the rubber between its grooves.
COMPOUNDS = {
    "tread": (4.4e6, 0.49, 1110.0, 1.8, 0.3, 0.10),
    "skim": (11.7e6, 0.49, 1200.0, 1.20, 0.2, 0.08),
    "ply": (7.0e6, 0.49, 1150.0, 1.20, 0.2, 0.08),
    "sidewall": (8.5e6, 0.49, 1120.0, 1.20, 0.2, 0.08),
    "apex": (52e6, 0.49, 1200.0, 1.20, 0.2, 0.08),
    "bead": (400e6, 0.49, 2200.0, 1.0, 0.05, 0.0),
}

FLANGE = 0.016  # m above the rim; below it the rim holds the tire
RIM = 0.383  # half width of the rim over the section's width
WIDEST = 0.60  # of the section's height
APEX = 0.5  # of the length from the flange to the widest point
TREAD = 0.325  # half width of the crown over the section's width, at an aspect ratio of 60 %
CROWN = 0.13  # drop of the crown at its edge over its half width
ROUND = 2.6  # exponent of that drop over the half width: flat in the middle, rounder to the edges
SHOULDER = 0.075, 0.030  # how far out and down the shoulder reaches from there, over the width
LOWEST = (
    0.4,
    0.6,
)  # largest drop of the crown and of the shoulder over the height above the widest point
BELT_2 = 0.9  # its width over that of belt 1, which ends at the edge of the crown
GROOVES, MOST_GROOVES = 4, 8  # around the tread
GROOVE = 0.07  # width of each over that of the crown: 9.3 mm for 205/60 R15
LEAST_HEIGHT = 0.055  # m of a section; less leaves no sidewall above the flange


class _Stations(NamedTuple):
    """Lengths s (m) on the outer face from the crown: of belt 1, of the tread, to the widest point, to the apex,
    to the flange, to the heel."""

    belt: float
    shoulder: float
    widest: float
    apex: float
    held: float
    end: float


def radial(text: str, grooves: int = GROOVES) -> Construction:
    """The construction for a size. Raises InputError for an invalid size or too low a section.

    The circumferential `grooves`, as deep as the tread, take the share 1 - l = 0.07 `grooves` of it, which
    is spread over its width: E and density times l. That is exact for stretch and shear along ribs. Across
    them ribs resist less than that, but there the belts carry.
    """
    tire = size(text)
    if not 0 <= grooves <= MOST_GROOVES:
        raise InputError(f"tire.grooves = {grooves}: must lie from 0 to {MOST_GROOVES}")
    if tire.height < LEAST_HEIGHT:
        raise InputError(
            f'tire.size = "{text[:40]}": its section is {1e3 * tire.height:.0f} mm high; the built-in '
            f"construction needs {1e3 * LEAST_HEIGHT:.0f} mm"
        )
    outline = Outline(_outline(tire))
    at = _stations(tire, outline)
    return Construction(
        outline=outline,
        layers=_layers(at),
        parts=(
            Part("tread", "sidewall", (at.shoulder, at.end)),
            Part("belt skim", "sidewall", (at.shoulder, at.end)),
            Part("belt base", "sidewall", (at.shoulder, at.apex)),
            Part("belt base", "apex", (at.apex, at.held)),
            Part("belt base", "bead", (at.held, at.end)),
        ),
        cords=_cords(at),
        compounds={
            name: _rubber(values, 1 - GROOVE * grooves if name == "tread" else 1.0)
            for name, values in COMPOUNDS.items()
        },
        tread=at.shoulder,
        held=at.held,
    )


def _rubber(values: tuple[float, ...], land: float) -> dict[str, float]:
    """Values by name of a compound that fills the share `land` of its layer."""
    names = ("youngs_modulus", "poisson_ratio", "density", "dynamic", "loss_factor", "exponent")
    found = dict(zip(names, values, strict=True))
    return found | {key: land * found[key] for key in ("youngs_modulus", "density")}


def _layers(at: _Stations) -> tuple[Layer, ...]:
    """Layers with thickness in mm at the crown, under the belts, at their edge, at the end of the
    tread, at the widest point, halfway from there to the flange, at the flange and at the heel.

    A cushion under the belt edges, part of the belt base, carries the shoulder.
    """
    places = (
        0.0,
        0.75 * at.belt,
        at.belt,
        at.shoulder,
        at.widest,
        (at.widest + at.held) / 2,
        at.held,
        at.end,
    )

    def layer(name: str, compound: str, *values: float) -> Layer:
        return Layer(name, compound, tuple(zip(places, np.multiply(1e-3, values), strict=True)))

    return (
        layer("tread", "tread", 8.0, 8.0, 8.0, 7.0, 1.7, 2.0, 2.8, 3.0),
        layer("belt skim", "skim", 1.3, 1.3, 1.8, 1.8, 0.6, 1.4, 1.8, 2.0),
        layer("belt base", "skim", 1.5, 1.6, 3.0, 4.0, 1.0, 3.0, 5.5, 9.0),
        layer("carcass", "ply", 2.0, 2.0, 2.0, 2.0, 1.7, 1.6, 1.9, 2.0),
    )


def _outline(tire: Size) -> np.ndarray:
    """Points (r, y) of the outer face from the crown to the heel of the bead."""
    top, w, flat = tire.rim + tire.height, tire.width, _flat(tire)
    widest, rim = tire.rim + WIDEST * tire.height, RIM * tire.width
    upper = top - widest
    drop = min(CROWN * flat, LOWEST[0] * upper)
    y = flat * np.array([0, 0.25, 0.5, 0.75, 0.92])
    crown = np.stack([top - drop * (y / flat) ** ROUND, y], axis=-1)
    middle = np.array([widest, 0.5 * w])
    out, down = (part * w for part in SHOULDER)
    down = min(drop + down, LOWEST[1] * upper)
    above = _leaving(middle, np.array([top - down, min(flat + out, 0.47 * w)]))
    lean = min(0.009, 0.044 * w)  # of the flange, outwards
    below = _leaving(middle, np.array([tire.rim + FLANGE, rim + lean]))
    seat = [(tire.rim + FLANGE / 2, rim + lean / 3), (tire.rim, rim)]
    return np.concatenate([crown, above[::-1], [middle], below, seat])


def _leaving(middle: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Points on the circle from the widest point, vertical there, to another point."""
    rise, back = end[0] - middle[0], middle[1] - end[1]
    radius = (rise**2 + back**2) / (2 * back)
    angle = np.arcsin(rise / radius) * np.array([0.4, 0.7, 1.0])
    return middle + radius * np.stack([np.sin(angle), np.cos(angle) - 1], axis=-1)


def _flat(tire: Size) -> float:
    """Half width of the crown up to its rounded shoulder, m: larger for low aspect ratios."""
    ratio = tire.height / tire.width
    return float(np.clip(TREAD + 0.3 * (0.6 - ratio), 0.27, 0.45)) * tire.width


def _stations(tire: Size, outline: Outline) -> _Stations:
    s = np.linspace(0.0, outline.length, 4001)
    r, y = outline.at(s).T
    widest = float(s[y.argmax()])
    edge = float(s[np.argmax(y > _flat(tire))])
    held = float(s[np.flatnonzero(r > tire.rim + FLANGE)[-1]])
    shoulder, apex = edge + 0.25 * (widest - edge), held - APEX * (held - widest)
    return _Stations(edge, shoulder, widest, apex, held, outline.length)


def _cords(at: _Stations) -> tuple[CordLine, ...]:
    return (
        CordLine(name="cap ply", under="tread", to=at.belt, angle=0.0, **NYLON),
        CordLine(name="belt 2", under="tread", to=BELT_2 * at.belt, angle=-BELT_ANGLE, **STEEL),
        CordLine(name="belt 1", under="belt skim", to=at.belt, angle=BELT_ANGLE, **STEEL),
        CordLine(name="carcass", under="belt base", to=at.end, angle=np.pi / 2, **POLYESTER),
    )
