"""`section = "radial"`: the built-in passenger tire, defined by its size (docs/radial-tire.md)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import integer, text
from tireroad.fem.sections.mesh2d import Ring
from tireroad.runs.scene.resolved import literal
from tireroad.runs.scene.schema import Source
from tireroad.runs.scene.tables.tire import (
    Proportions,
    SectionKind,
    cords_of,
    losses_of,
    proportions_of,
    region_of,
    section_kind,
    spelt,
)

if TYPE_CHECKING:
    from tireroad.fem.sections.construction import Construction
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import Material
    from tireroad.runs.scene.tables.tire import CordsTable, RegionTable, TireTable

_GROOVES, _MOST_GROOVES = 4, 8  # those of fem.sections.radial, whose import needs scipy
# (elements around, along) available to a search.
FINER = ((16, 14), (20, 18), (24, 22), (30, 26), (36, 32), (44, 38), (52, 46), (64, 56))


@section_kind("radial", "the built-in radial passenger tire (docs/radial-tire.md)")
class RadialSection(SectionKind):
    """Layers follow from the size; compounds and cords too, unless the scene changes them."""

    # With fewer, modes from 150 Hz up are too low (docs/verification.md, Frequencies of the default
    # mesh).
    segments = 40
    without = ("material",)

    size: str = text("205/60 R15", "size of the built-in passenger tire (docs/radial-tire.md)")
    grooves: int = integer(
        _GROOVES,
        "circumferential grooves of the tread, each 0.07 of its width, spread over it; 0: a slick tread",
        least=0,
        most=_MOST_GROOVES,
    )
    elements_arc: int | None = integer(
        None, "number of elements from bead to bead; absent: 26", least=2, most=1000
    )

    def elements(self, tire: TireTable) -> tuple[RadialSection, int, int]:
        _, order, segments = super().elements(tire)
        return replace(self, elements_arc=self.elements_arc or 26), order, segments

    def check(self, tire: TireTable, source: Source) -> None:
        if tire.material != type(tire)().material:
            text = "is for a torus: the compounds of a radial tire follow from its size; [[tire.region]] changes one"
            source.add(("tire", "material"), text)
        if tire.order == 1:
            text = "= 1: linear elements between cords cannot bend, so no static state is found: take 2 or 3"
            source.add(("tire", "order"), text)
        try:
            construction = built(self.size, self.grooves)
        except InputError as problem:
            source.add(("tire", "size"), str(problem).removeprefix("tire.size "))
            return
        lines = [line.name for line in construction.cords]
        _check_parts("region", tire.region, list(construction.compounds), source)
        _check_parts("cords", tire.cords, lines, source)

    def proportions(self, tire: TireTable) -> Proportions:
        ring = self.ring(tire)
        return proportions_of(ring, ring.section)

    def ring(self, tire: TireTable) -> Ring:
        return _ring(self.size, tire.segments, self.elements_arc, tire.order, tire.footprint_size)

    def rubbers(self, tire: TireTable) -> dict[str, Material]:
        return {
            name: _compound((_everywhere(tire), region_of(tire, name)), dict(values))
            for name, values in built(self.size, self.grooves).compounds.items()
        }

    def rubber(self, tire: TireTable) -> tuple[float, float, float]:
        """Values of the softest compound, in which the wall bends most."""
        compounds = built(self.size, self.grooves).compounds.values()
        soft = min(compounds, key=lambda one: one["youngs_modulus"])
        return soft["dynamic"] * soft["youngs_modulus"], soft["poisson_ratio"], soft["density"]

    def cords(self, tire: TireTable) -> list[Cords]:
        from tireroad.fem.tire.cords import Cords

        changed = {line.name: cords_of(line) for line in self._changed(tire)}
        own = (
            Cords(**{key: value for key, value in vars(line).items() if key not in ("under", "to")})
            for line in built(self.size, self.grooves).cords
        )
        return [changed.get(line.name, line) for line in own]

    def angles(self, tire: TireTable) -> dict[str, float]:
        own = {
            line.name: float(np.degrees(line.angle))
            for line in built(self.size, self.grooves).cords
        }
        return own | {line.name: line.angle for line in self._changed(tire)}

    def _changed(self, tire: TireTable) -> list[CordsTable]:
        return spelt(tire.cords, [line.name for line in built(self.size, self.grooves).cords])

    def meshes(self, tire: TireTable) -> tuple[tuple[int, int], ...]:
        return FINER

    def elements_along(self, along: int) -> RadialSection:
        return replace(self, elements_arc=along)

    def coarser(self, tire: TireTable) -> RadialSection:
        return replace(self, elements_arc=self.elements_arc // 2)

    def described(self, tire: TireTable) -> list[str]:
        from tireroad.fem.sections.radial import RATED_PRESSURE, size

        rated = size(self.size).rated_load()
        return [
            f"{self.size}: rated for about {rated:.0f} N at {1e-3 * RATED_PRESSURE:.0f} kPa as a standard tire (by "
            "load indices of sizes from 145 to 275 mm wide, within 4 %)"
        ]

    def has_losses(self, tire: TireTable) -> bool:
        """All compounds of the built-in tire have a loss factor."""
        return True


def _check_parts(
    table: str, given: Sequence[RegionTable | CordsTable], names: list[str], source: Source
) -> None:
    """Note unknown or repeated names of parts, and keys for what follows from the tire's size."""
    default = type(given[0])() if given else None
    known = {name.upper() for name in names}
    for number, one in enumerate(given):
        path = ("tire", table, str(number))
        own = (one.name or "").upper()
        if own and own not in known:
            source.add((*path, "name"), f"must be one of {', '.join(names)} in a radial tire")
        elif own in [(other.name or "").upper() for other in given[:number]]:
            taken = f'name = "{one.name}" is taken' if own else "is the second without a name"
            source.add(path, taken)
        for key in ("arc", "depth", "side"):
            if (value := getattr(one, key, None)) != getattr(default, key, None):
                source.add((*path, key), _fixed(value, names, named=bool(own)))


def _fixed(value: object, names: list[str], named: bool) -> str:
    """The place of a part cannot be given: what to write instead."""
    fixed = f"= {literal(value)} cannot be chosen: where each part of a radial tire lies follows from the size. "
    if named:
        return f"{fixed}Leave it out: the name says where"
    return f"{fixed}Name a compound instead: name = one of {', '.join(names)}"


def _everywhere(tire: TireTable) -> RegionTable | None:
    """The scene's [[tire.region]] without a name, which changes every compound, or None."""
    return next((region for region in tire.region if region.name is None), None)


def _compound(regions: Iterable[RegionTable | None], values: dict[str, Any]) -> Material:
    """A built-in compound, modified by the regions that it lies in, the last before the others."""
    from tireroad.fem.tire.material import Material, compound, power_law

    material, values["spectrum"] = None, power_law(values.pop("exponent"))
    for region in regions:
        values |= losses_of(region)
        material = (region and region.material) or material
    if material is None:
        return compound("neo-hookean", **values)
    return Material(
        law=material.law,
        density=material.density,
        **{key: values[key] for key in ("dynamic", "loss_factor", "spectrum")},
    )


@lru_cache(maxsize=4)
def built(size: str, grooves: int = _GROOVES) -> Construction:
    """The construction of a tire of that size and number of grooves."""
    from tireroad.fem.sections.radial import radial

    return radial(size, grooves)


@lru_cache(maxsize=4)
def _ring(size: str, segments: int, along: int, order: int, footprint_size: float) -> Ring:
    return built(size).ring(segments, along, order, footprint_size)
