"""The built-in radial passenger tire of a size like 205/60 R15: docs/radial-tire.md has every number's source."""

from __future__ import annotations

import numpy as np

from tireroad.fem.sections.construction import Construction, CordLine, Layer, Part
from tireroad.fem.sections.outline import Outline
from tireroad.fem.sections.tire_size import Size, size

STEEL, STEEL_AREA, STEEL_SPACING = 190e9, 0.246e-6, 1.25e-3
BELT_ANGLE = np.radians(24)
NYLON, NYLON_AREA, NYLON_SPACING = 3e9, 0.33e-6, 1.0e-3
POLYESTER, POLYESTER_AREA, POLYESTER_SPACING = 7e9, 0.35e-6, 1.0e-3

# E Pa, Poisson's ratio, kg/m3, dynamic over static modulus, loss factor.
_COMPOUNDS = {
    "tread": (5.0e6, 0.49, 1150.0, 1.4, 0.25),
    "skim": (9.0e6, 0.49, 1200.0, 1.4, 0.15),
    "ply": (4.5e6, 0.49, 1150.0, 1.4, 0.15),
    "sidewall": (3.0e6, 0.49, 1120.0, 1.4, 0.15),
    "apex": (36e6, 0.49, 1200.0, 1.4, 0.15),
    "liner": (3.0e6, 0.49, 1150.0, 1.4, 0.2),
}


def radial(text: str) -> Construction:
    """The construction of a size."""
    tire = size(text)
    outline = Outline(_outline(tire))
    belt, shoulder, widest, end = _stations(tire, outline)
    mm = 1e-3

    def layer(name: str, compound: str, *values: float) -> Layer:
        places = (0.0, 0.8 * belt, shoulder, widest, 0.5 * (widest + end), end)
        pairs = tuple((s, v * mm) for s, v in zip(places, values, strict=True))
        return Layer(name, compound, pairs)

    return Construction(
        outline=outline,
        layers=(
            layer("tread", "tread", 8.5, 8.7, 8.5, 1.7, 2.2, 3.0),
            layer("belt skim", "skim", 1.3, 1.3, 2.0, 0.6, 1.0, 1.6),
            layer("belt base", "skim", 1.5, 1.7, 3.0, 1.0, 2.0, 4.4),
            layer("carcass", "ply", 2.0, 2.0, 2.0, 1.7, 1.8, 2.0),
        ),
        parts=(
            Part("tread", "sidewall", (shoulder, end)),
            Part("belt skim", "sidewall", (shoulder, end)),
            Part("belt base", "sidewall", (shoulder, 0.5 * (widest + end))),
            Part("belt base", "apex", (0.5 * (widest + end), end)),
        ),
        cords=_cords(belt, end),
        compounds={name: _rubber(values) for name, values in _COMPOUNDS.items()},
        tread=shoulder,
    )


def _rubber(values: tuple[float, ...]) -> dict[str, float]:
    names = ("youngs_modulus", "poisson_ratio", "density", "dynamic", "loss_factor")
    return dict(zip(names, values, strict=True))


def _outline(tire: Size) -> np.ndarray:
    """Points (r, y) of the outer face from the crown to where the rim's flange holds it."""
    top, w, h = tire.rim + tire.height, tire.width, tire.height
    rim = 0.37 * w
    flange = tire.rim + 0.012
    widest = tire.rim + 0.53 * h
    flat = _flat(tire)
    upper = top - widest
    return np.array(
        [
            (top, 0.0),
            (top - 0.022 * upper, 0.5 * flat),
            (top - 0.09 * upper, flat),
            (top - 0.31 * upper, flat + 0.66 * (0.475 * w - flat)),
            (widest + 0.42 * upper, 0.482 * w),
            (widest, 0.5 * w),
            (widest - 0.2 * h, 0.482 * w),
            (flange, rim + 0.012),
        ]
    )


def _flat(tire: Size) -> float:
    """Half width of the tread up to its rounded shoulder, m."""
    return 0.345 * tire.width


def _stations(tire: Size, outline: Outline) -> tuple[float, float, float, float]:
    """Lengths s (m) of the belt's edge, the tread's edge, the widest point and the end."""
    s = np.linspace(0.0, outline.length, 2001)
    r, y = outline.at(s).T
    widest = float(s[y.argmax()])
    edge = float(s[np.argmax(y > _flat(tire))])
    return 0.97 * edge, edge + 0.25 * (widest - edge), widest, outline.length


def _cords(belt: float, end: float) -> tuple[CordLine, ...]:
    steel = {
        "youngs_modulus": STEEL,
        "area": STEEL_AREA,
        "spacing": STEEL_SPACING,
        "density": 7850.0,
    }
    nylon = {
        "youngs_modulus": NYLON,
        "area": NYLON_AREA,
        "spacing": NYLON_SPACING,
        "density": 1140.0,
    }
    polyester = {
        "youngs_modulus": POLYESTER,
        "area": POLYESTER_AREA,
        "spacing": POLYESTER_SPACING,
        "density": 1380.0,
        "compression": 0.1,
    }
    return (
        CordLine(name="cap ply", under="tread", to=belt, angle=0.0, **nylon),
        CordLine(name="belt 2", under="tread", to=0.95 * belt, angle=-BELT_ANGLE, **steel),
        CordLine(name="belt 1", under="belt skim", to=belt, angle=BELT_ANGLE, **steel),
        CordLine(name="carcass", under="belt base", to=end, angle=np.pi / 2, **polyester),
    )
