"""`section = "radial"`: the built-in passenger tire, defined by its size (docs/radial-tire.md)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Limits, factors, integer, number, text
from tireroad.fem.sections.mesh2d import Ring
from tireroad.runs.scene.resolved import literal
from tireroad.runs.scene.schema import Source
from tireroad.runs.scene.tables.tire import (
    CORDS_ARC,
    CORDS_DEPTH,
    Parts,
    Proportions,
    SectionKind,
    changed,
    cords_of,
    proportions_of,
    region_of,
    section_kind,
    spelt,
)

if TYPE_CHECKING:
    from tireroad.fem.sections.construction import Construction, CordLine
    from tireroad.fem.sections.radial import Size
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import Material
    from tireroad.runs.scene.tables.tire import CordsTable, RegionTable, TireTable

_GROOVES, _MOST_GROOVES = 4, 8  # those of fem.sections.radial, whose import needs scipy
# (elements around, along) available to a search.
FINER = ((16, 14), (20, 18), (24, 22), (30, 26), (36, 32), (44, 38), (52, 46), (64, 56))

# Places that a torus has by default are let pass, and left out of what is written back.
_TORUS = {("cords", "depth"): CORDS_DEPTH, ("cords", "arc"): CORDS_ARC}
_MODEL = "neo-hookean"


@section_kind("radial", "the built-in radial passenger tire (docs/radial-tire.md)")
class RadialSection(SectionKind):
    """Layers follow from the size; compounds and cords too, unless the scene changes them."""

    # With fewer, modes from 150 Hz up are too low (docs/verification.md, Frequencies of the default
    # mesh).
    segments = 40
    without = ("material",)
    built_in = True

    size: str = text("205/60 R15", "size of the built-in passenger tire (docs/radial-tire.md)")
    grooves: int = integer(
        _GROOVES,
        "circumferential grooves of the tread, each 0.07 of its width, spread over it; 0: a slick tread",
        least=0,
        most=_MOST_GROOVES,
    )
    rim_width: float | None = number(
        None,
        "m",
        "width of the rim between its flanges; absent: that of the size's measuring rim",
        least=0.05,
        most=0.5,
    )
    scale: dict[str, float] | None = factors(
        "factors on the tire's own values, by the name of a compound or a line of cords (belt: both belts; compounds, cords: "
        'all) and its quantity: tread = 1.1 of its modulus, "belt angle", "tread density", "sidewall loss factor" of others; '
        "written back in the compounds and cords themselves",
        Limits(least=0.01, most=100),
    )
    elements_arc: int | None = integer(
        None, "number of elements from bead to bead; absent: 26", least=2, most=1000
    )

    @property
    def construction(self) -> Construction:
        """The construction of the tire of this size. Raises InputError for a size or a rim that is none."""
        return built(self.size, self.grooves, self.rim_width)

    def elements(self, tire: TireTable) -> tuple[RadialSection, int, int]:
        _, order, segments = super().elements(tire)
        return replace(self, elements_arc=self.elements_arc or 26), order, segments

    def as_scaled(self) -> RadialSection:
        from tireroad.fem.sections.radial import size

        width = self.rim_width or round(size(self.size).measuring_rim, 6)
        return replace(self, rim_width=width, scale=None)

    def check(self, tire: TireTable, source: Source) -> None:
        whole = "is for a torus or a file: the compounds of a radial tire follow from its size; [[tire.region]] changes one"
        for key in (
            "material",
            "dynamic",
            "loss_factor",
            "exponent",
            "prony_shares",
            "prony_times",
            "master_curve",
        ):
            if getattr(tire, key):
                source.add(("tire", key), whole)
        if tire.order == 1:
            text = "= 1: linear elements between cords cannot bend, so no static state is found: take 2 or 3"
            source.add(("tire", "order"), text)
        try:
            construction = self.construction
        except InputError as problem:
            match = re.match(r"tire\.(\w+) (.*)", str(problem), re.DOTALL)
            key, text = match.groups() if match else ("size", str(problem))
            source.add(("tire", key), text)
            return
        lines = [line.name for line in construction.cords]
        _check_parts("region", tire.region, list(construction.compounds), source)
        _check_parts("cords", tire.cords, lines, source)

    def proportions(self, tire: TireTable) -> Proportions:
        ring = self.ring(tire)
        return proportions_of(ring, ring.section)

    def ring(self, tire: TireTable) -> Ring:
        return _ring(
            self.size,
            self.rim_width,
            tire.segments,
            self.elements_arc,
            tire.order,
            tire.footprint_size,
        )

    def parts(self, tire: TireTable) -> Parts:
        from tireroad.fem.sections.radial import COMPOUNDS
        from tireroad.runs.scene.parts import compound_table

        lines = {line.name: _cords_table(line) for line in self.construction.cords}
        own = {name: _own(name) for name in COMPOUNDS}
        compounds = {
            name: compound_table(
                name,
                part.law,
                _MODEL,
                part.density,
                {
                    "dynamic": part.dynamic,
                    "loss_factor": part.loss_factor,
                    "exponent": part.spectrum.exponent,
                },
            )
            for name, part in own.items()
        }
        return Parts(compounds, lines, {}, {}, whole=self.built_in)

    def rubbers(self, tire: TireTable) -> dict[str, Material]:
        return {
            name: changed(_own(name), region_of(tire, name)) for name in self.construction.compounds
        }

    def in_layers(self, tire: TireTable) -> dict[str, Material]:
        """The tread without what its grooves take of it."""
        from tireroad.fem.sections.radial import GROOVED

        rubbers, share = self.rubbers(tire), self.land
        tread = rubbers[GROOVED]
        grooved = replace(tread, law=tread.law.times(share), density=share * tread.density)
        return rubbers | {GROOVED: grooved}

    @property
    def land(self) -> float:
        from tireroad.fem.sections.radial import land

        return land(self.grooves)

    @property
    def grooves_around(self) -> list[tuple[float, float, float]]:
        from tireroad.fem.sections.radial import grooves_of

        return grooves_of(self.size, self.grooves)

    def tread_over_own(self, tire: TireTable, temperature: float) -> float:
        from tireroad.fem.sections.radial import GROOVED

        stated, own = self.rubbers(tire)[GROOVED].at(temperature), _own(GROOVED)
        if stated == own:
            return 1.0
        return stated.dynamic * stated.law.youngs / (own.dynamic * own.law.youngs)

    def rubber(self, tire: TireTable) -> tuple[float, float, float]:
        """Values of the softest layer, in which the wall bends most."""
        soft = min(self.in_layers(tire).values(), key=lambda one: one.law.youngs)
        return soft.dynamic * soft.law.youngs, soft.law.poisson, soft.density

    def cords(self, tire: TireTable) -> list[Cords]:
        from tireroad.fem.tire.cords import Cords

        stated = {line.name: cords_of(line) for line in self._stated(tire)}
        own = (
            Cords(**{key: value for key, value in vars(line).items() if key not in ("under", "to")})
            for line in self.construction.cords
        )
        return [stated.get(line.name, line) for line in own]

    def angles(self, tire: TireTable) -> dict[str, float]:
        own = {line.name: float(np.degrees(line.angle)) for line in self.construction.cords}
        return own | {line.name: line.angle for line in self._stated(tire)}

    def _stated(self, tire: TireTable) -> list[CordsTable]:
        return spelt(tire.cords, [line.name for line in self.construction.cords])

    def meshes(self, tire: TireTable) -> tuple[tuple[int, int], ...]:
        return FINER

    def elements_along(self, along: int) -> RadialSection:
        return replace(self, elements_arc=along)

    def coarser(self, tire: TireTable) -> RadialSection:
        return replace(self, elements_arc=self.elements_arc // 2)

    def described(self, tire: TireTable) -> list[str]:
        from tireroad.fem.sections.radial import size
        from tireroad.runs.scene.parts import in_lines, listed
        from tireroad.runs.scene.resolved import as_toml

        share = self.land
        grooved = (
            f"  the tread between its {self.grooves} grooves, which leave {share:.2f} of its layer: "
            f"E and density of the layer are {share:.2f} of these"
        )
        tables = in_lines(listed(as_toml(tire)))
        return [*_rating(self.size, size(self.size)), *tables, *([grooved] if self.grooves else [])]

    def has_losses(self, tire: TireTable) -> bool:
        """All compounds of the built-in tire have a loss factor."""
        return True


def _check_parts(
    table: str, given: Sequence[RegionTable | CordsTable], names: list[str], source: Source
) -> None:
    """Note unknown or repeated names of parts, and keys for what follows from the tire's size."""
    known = {name.upper() for name in names}
    for place, part in enumerate(given):
        path = ("tire", table, str(place))
        own = (part.name or "").upper()
        if own and own not in known:
            source.add((*path, "name"), f"must be one of {', '.join(names)} in a radial tire")
        elif own in [(other.name or "").upper() for other in given[:place]]:
            text = f'name = "{part.name}" is taken' if own else "is the second without a name"
            source.add(path, text)
        for key in ("arc", "depth", "side"):
            if (value := getattr(part, key, None)) not in (None, _TORUS.get((table, key))):
                source.add((*path, key), _fixed(value, names, named=bool(own)))


def _fixed(value: object, names: list[str], named: bool) -> str:
    """The place of a part cannot be given: what to write instead."""
    fixed = f"= {literal(value)} cannot be chosen: where each part of a radial tire lies follows from the size. "
    if named:
        return f"{fixed}Leave it out: the name says where"
    return f"{fixed}Name a compound instead: name = one of {', '.join(names)}"


def _own(name: str) -> Material:
    """A compound of the built-in tire."""
    from tireroad.fem.sections.radial import rubber
    from tireroad.fem.tire.material import compound, power_law

    values: dict[str, Any] = dict(rubber(name))
    return compound(_MODEL, spectrum=power_law(values.pop("exponent")), **values)


def _cords_table(line: CordLine) -> dict[str, Any]:
    """A line of cords as a [[tire.cords]]."""
    values = {key: value for key, value in vars(line).items() if key not in ("under", "to")}
    return values | {"angle": round(float(np.degrees(line.angle)), 10)}


def _rating(written: str, own: Size) -> list[str]:
    """Load and speed for which a size is rated, and its measuring rim."""
    load, pressure = f"{own.rated_load():.0f} N", own.rated_pressure
    at = "at the pressure on its sidewall" if pressure is None else f"at {1e-3 * pressure:.0f} kPa"
    if own.index is None:
        text = f"rated for about {load} {at} as a standard tire (by load indices of sizes from 145 to 275 mm wide, within 4 %)"
    else:
        text = f"load index {own.index}, rated for {load} {at}"
    if own.speed is not None:
        text += f"; speed symbol {own.symbol}, to {3.6 * own.speed:.0f} km/h"
    lines = [
        f"{written}: {text}",
        f"  measuring rim {own.measuring_rim / 0.0254:.3g} inches ({1e3 * own.measuring_rim:.1f} mm) wide",
    ]
    if own.light_truck:
        lines.append(
            "  built as a passenger tire of that size: plies and beads of light trucks' tires are stronger"
        )
    return lines


@lru_cache(maxsize=8)
def built(size: str, grooves: int = _GROOVES, rim_width: float | None = None) -> Construction:
    """The construction of a tire of that size, number of grooves and rim (m, None: the measuring rim)."""
    from tireroad.fem.sections.radial import radial

    return radial(size, grooves, rim_width)


@lru_cache(maxsize=4)
def _ring(
    size: str,
    rim_width: float | None,
    segments: int,
    along: int,
    order: int,
    footprint_size: float,
) -> Ring:
    return built(size, rim_width=rim_width).ring(segments, along, order, footprint_size)
