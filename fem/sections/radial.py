"""The built-in radial passenger tire, of a size like 205/60 R15; sources: docs/radial-tire.md."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.sections.construction import Construction, CordLine, Layer, Outline, Part

_SIZE = re.compile(
    r"(?P<use>P|LT)?\s*(?P<width>\d{3})\s*/\s*(?P<ratio>\d{2})\s*(?P<within>[HQSTVWYZ])?\s*R\s*(?P<rim>\d{2})\s?(?P<light>C|LT)?"
    r"(?:\s*[\s(]\s*(?P<index>\d{2,3})(?:\s*/\s*\d{2,3})?\s*(?P<symbol>[A-Z])?\s*\)?)?"
    r"(?P<marks>(?:\s+(?:XL|EXTRA\s*LOAD|REINFORCED|SL|M\s?[+&]\s?S|3PMSF|TL|(?:LR?\s?)?[B-F]|\d{1,2}\s?PR))*)",
    re.IGNORECASE,
)

RATED_PRESSURE = 2.5e5  # Pa
_REINFORCED = 2.9e5  # Pa, the pressure of the load indices of reinforced (XL) tires
_STRONGER = (
    1.08  # a load index over the size's as a standard tire from which on it is a reinforced one's
)
# Speed symbols, km/h (ECE R30).
SPEEDS = {
    "F": 80, "G": 90, "J": 100, "K": 110, "L": 120, "M": 130, "N": 140, "P": 150, "Q": 160, "R": 170,
    "S": 180, "T": 190, "U": 200, "H": 210, "V": 240, "W": 270, "Y": 300,
}  # fmt: skip
FIRST_INDEX = 50
# kg by load index from 50 on (ECE R30, Annex 4).
CAPACITIES = (
    190, 195, 200, 206, 212, 218, 224, 230, 236, 243, 250, 257, 265, 272, 280, 290, 300, 307, 315, 325,
    335, 345, 355, 365, 375, 387, 400, 412, 425, 437, 450, 462, 475, 487, 500, 515, 530, 545, 560, 580,
    600, 615, 630, 650, 670, 690, 710, 730, 750, 775, 800, 825, 850, 875, 900, 925, 950, 975, 1000, 1030,
    1060, 1090, 1120, 1150, 1180, 1215, 1250, 1285, 1320, 1360, 1400, 1450, 1500, 1550, 1600, 1650, 1700,
)  # fmt: skip
# Width of the measuring rim over that of the section by the least aspect ratio (%) for which it holds (ISO
# 4000-1), in steps of half an inch.
RIM_OVER_WIDTH = ((75, 0.70), (60, 0.75), (50, 0.80), (45, 0.85), (30, 0.90), (0, 0.92))
HALF_INCH, _SAME = 0.0127, 1e-6
# Width of the theoretical rim, on which a section has its nominal width, over that: from an aspect ratio of 50 % up, and
# below. Usual are 0.70 and 0.85; ECE R30 leaves the factor to the maker.
THEORETICAL_RIM, _LOW = (0.74, 0.87), 48  # -, %
WIDENS = 0.4  # section width over rim width, m/m: 5 mm for half an inch (ECE R30)
OTHER_RIMS = 0.0254  # m, an inch: how much narrower or wider a rim may be than the measuring rim
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
# How far the flange leads the face outwards: m, and at most this share of the wall's overhang over the rim.
LEAN = 0.0105, 0.38
WIDEST = 0.60  # of the section's height
APEX = 0.5  # of the length from the flange to the widest point
TREAD = 0.325  # half width of the crown over the section's width, at an aspect ratio of 60 %
WIDER = 0.25  # by how much that grows for an aspect ratio lower by 1
CROWN = 0.0704  # drop of the crown at its edge over the section's height
# Exponent of that drop over the half width, from an aspect ratio of 55 % up; below, it goes with the ratio's inverse:
# crowns of low sections are flat in the middle and round at their edges.
ROUND, FLATTER = 2.6, 0.55
SHOULDER = 0.075, 0.030  # how far out and down the shoulder reaches from there, over the width
LOWEST = (
    0.4,
    0.6,
)  # largest drop of the crown and of the shoulder over the height above the widest point
BELT_2 = 0.9  # its width over that of belt 1, which ends at the edge of the crown
GROOVES, MOST_GROOVES = 4, 8  # around the tread
GROOVED = "tread"  # the compound that they cut
GROOVE = 0.07  # width of each over that of the crown: 9.3 mm for 205/60 R15
TREAD_DEPTH = 8.0  # mm, of the tread and its grooves at the crown
LEAST_HEIGHT = 0.057  # m of a section; less leaves no sidewall above the flange


@dataclass(frozen=True)
class Size:
    """`nominal` section width, section `height` and `rim` radius, all in m.

    `index` and `symbol`: load index and speed symbol where they are given; `reinforced`: marked so;
    `light_truck`: LT or C.
    """

    nominal: float
    height: float
    rim: float
    index: int | None = None
    symbol: str | None = None
    reinforced: bool = False
    light_truck: bool = False

    @property
    def ratio(self) -> float:
        """Height of the section over its nominal width."""
        return self.height / self.nominal

    @property
    def width(self) -> float:
        """Width (m) of the section on the measuring rim: nominal on the theoretical rim, and wider by 0.4 of the rest."""
        theoretical = THEORETICAL_RIM[round(100 * self.ratio) < _LOW] * self.nominal
        return self.nominal + WIDENS * (self.measuring_rim - theoretical)

    @property
    def measuring_rim(self) -> float:
        """Width (m) between the flanges of the rim on which tires of this size are measured (ISO 4000-1)."""
        percent = round(100 * self.ratio)
        share = next(share for least, share in RIM_OVER_WIDTH if percent >= least)
        return HALF_INCH * round(share * self.nominal / HALF_INCH)

    @property
    def speed(self) -> float | None:
        """Speed (m/s) of the speed symbol."""
        return None if self.symbol is None else SPEEDS[self.symbol] / 3.6

    @property
    def rated_pressure(self) -> float | None:
        """Inflation (Pa) at which the rated load holds; None for a light truck's index: it is on the tire."""
        if self.index is not None and self.light_truck:
            return None
        heavier = self.index is not None and self._capacity > _STRONGER * self._standard_load
        return _REINFORCED if self.reinforced or heavier else RATED_PRESSURE

    @property
    def _capacity(self) -> float:
        """Load (N) of the load index."""
        assert self.index is not None, "the size gives no load index"
        return 9.81 * CAPACITIES[self.index - FIRST_INDEX]

    @property
    def _standard_load(self) -> float:
        """Load (N) that sizes like this one are rated for as standard, not reinforced tires, at 250 kPa.

        1.95e-3 width^0.86 height^0.89 rim diameter^0.63 kg, in mm: within 4.3 % (standard deviation
        1.7 %) of the load indices of 41 sizes from 145/80 R13 to 275/40 R19.
        """
        width, height, diameter = 1e3 * self.nominal, 1e3 * self.height, 2e3 * self.rim
        return 9.81 * 1.950e-3 * width**0.8634 * height**0.8949 * diameter**0.6315

    def rated_load(self, inflation: float | None = None) -> float:
        """Load (N) that the tire is rated for at an `inflation` (Pa); None: at its rated pressure.

        By its load index where that is given, else as a standard tire of that size. Below the rated
        pressure its 0.8th power, as in the tables of tire standards; above, no more.
        """
        most = self._standard_load if self.index is None else self._capacity
        if inflation is None or self.rated_pressure is None:
            return most
        return most * min(inflation / self.rated_pressure, 1.0) ** 0.8

    def inflation_for(self, load: float) -> float:
        """Least inflation (Pa) at which a `load` (N) is rated; at most the rated pressure."""
        most = self.rated_pressure or RATED_PRESSURE
        return most * min(load / self.rated_load(), 1.0) ** 1.25


def size(text: str) -> Size:
    """Parse 205/60 R15: section width in mm, height over width in %, rim diameter in inches.

    Also with P or LT before it, C after it, load index, speed symbol and marks: P205/60R15 91V,
    LT245/75R16 120/116S, 255/40 ZR17 (98W) XL. Of two load indices the first, of single tires, counts.
    Raises InputError for another format or a size out of range.
    """
    shown = f'tire.size = "{text[:40]}"'
    match = _SIZE.fullmatch(text.strip())
    if not match:
        raise InputError(
            f'{shown}: must be like "205/60 R15", "P205/60R15 91V" or "LT245/75R16 120/116S"'
        )
    width, ratio, inches = (int(match[part]) for part in ("width", "ratio", "rim"))
    if not (125 <= width <= 355 and 25 <= ratio <= 85 and 10 <= inches <= 24):
        raise InputError(
            f"{shown}: from 125 to 355 mm wide, 25 to 85 % high, on rims of 10 to 24 inches"
        )
    index, last = int(match["index"] or 0), FIRST_INDEX + len(CAPACITIES) - 1
    if index and not FIRST_INDEX <= index <= last:
        raise InputError(f"{shown}: load index {index} must lie from {FIRST_INDEX} to {last}")
    symbol = (match["symbol"] or (match["within"] or "").replace("Z", "").replace("z", "")).upper()
    if symbol and symbol not in SPEEDS:
        raise InputError(f"{shown}: speed symbol {symbol} must be one of {', '.join(SPEEDS)}")
    marks = " ".join(match["marks"].upper().split())
    return Size(
        width / 1e3,
        width * ratio / 1e5,
        inches * 0.0254 / 2,
        index=index or None,
        symbol=symbol or None,
        reinforced=bool(re.search(r"\b(XL|EXTRA ?LOAD|REINFORCED)\b", marks)),
        light_truck=bool(match["light"]) or (match["use"] or "").upper() == "LT",
    )


class _Stations(NamedTuple):
    """Lengths s (m) on the outer face from the crown: of belt 1, of the tread, to the widest point, to the apex,
    to the flange, to the heel."""

    belt: float
    shoulder: float
    widest: float
    apex: float
    held: float
    end: float


def radial(text: str, grooves: int = GROOVES, rim_width: float | None = None) -> Construction:
    """The construction for a size on a rim of `rim_width` m between its flanges, by default its measuring rim.

    Raises InputError for an invalid size, too low a section, or a rim that does not fit.

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
    outline = Outline(_outline(tire, _rim(tire, rim_width)))
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
            name: _filling(rubber(name), land(grooves) if name == GROOVED else 1.0)
            for name in COMPOUNDS
        },
        tread=at.shoulder,
        held=at.held,
    )


def land(grooves: int) -> float:
    """Share of its layer that the tread between so many grooves fills."""
    return 1 - GROOVE * grooves


def grooves_of(text: str, grooves: int) -> list[tuple[float, float, float]]:
    """Middle y, width and depth (m) of the circumferential grooves of a size, between ribs of equal width.

    Raises InputError for an invalid size.
    """
    half = _flat(size(text))
    width = 2 * half * GROOVE
    rib = (2 * half - grooves * width) / (grooves + 1)
    first = -half + rib + width / 2
    return [(first + k * (rib + width), width, 1e-3 * TREAD_DEPTH) for k in range(grooves)]


def rubber(name: str) -> dict[str, float]:
    """Values by name of a compound."""
    names = ("youngs_modulus", "poisson_ratio", "density", "dynamic", "loss_factor", "exponent")
    return dict(zip(names, COMPOUNDS[name], strict=True))


def _filling(values: dict[str, float], share: float) -> dict[str, float]:
    """Values of a layer of which a compound fills a `share`."""
    return values | {key: share * values[key] for key in ("youngs_modulus", "density")}


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
        layer("tread", "tread", *3 * (TREAD_DEPTH,), 7.0, 1.7, 2.0, 2.8, 3.0),
        layer("belt skim", "skim", 1.3, 1.3, 1.8, 1.8, 0.6, 1.4, 1.8, 2.0),
        layer("belt base", "skim", 1.5, 1.6, 3.0, 4.0, 1.0, 3.0, 5.5, 9.0),
        layer("carcass", "ply", 2.0, 2.0, 2.0, 2.0, 1.7, 1.6, 1.9, 2.0),
    )


def _rim(tire: Size, width: float | None) -> float:
    """The rim's width in m, of its measuring rim if None."""
    if width is None:
        return tire.measuring_rim
    least, most = (tire.measuring_rim + sign * OTHER_RIMS for sign in (-1, 1))
    if not least * (1 - _SAME) <= width <= most * (1 + _SAME):
        raise InputError(
            f"tire.rim_width = {width:g} m: rims for a section of {1e3 * tire.nominal:.0f} mm are {least:.4f} to "
            f"{most:.4f} m wide (measuring rim {tire.measuring_rim:.4f} m)"
        )
    return width


def _outline(tire: Size, rim_width: float) -> np.ndarray:
    """Points (r, y) of the outer face from the crown to the heel of the bead.

    On another rim than the measuring rim the section is wider by 0.4 of what the rim is wider.
    """
    top, flat = tire.rim + tire.height, _flat(tire)
    w = tire.width + WIDENS * (rim_width - tire.measuring_rim)
    widest, rim = tire.rim + WIDEST * tire.height, rim_width / 2
    upper = top - widest
    drop = min(CROWN * tire.height, LOWEST[0] * upper)
    power = ROUND * max(FLATTER / tire.ratio, 1.0)
    y = flat * np.array([0, 0.25, 0.5, 0.75, 0.92])
    crown = np.stack([top - drop * (y / flat) ** power, y], axis=-1)
    middle = np.array([widest, 0.5 * w])
    out, down = (part * tire.nominal for part in SHOULDER)
    down = min(drop + down, LOWEST[1] * upper)
    above = _leaving(middle, np.array([top - down, min(flat + out, 0.47 * w)]))
    lean = min(LEAN[0], LEAN[1] * (0.5 * w - rim))
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
    return float(np.clip(TREAD + WIDER * (0.60 - tire.ratio), 0.27, 0.45)) * tire.nominal


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
