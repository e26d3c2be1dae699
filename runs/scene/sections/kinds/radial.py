"""`section = "radial"`: the built-in passenger tire, all of it by its size (docs/radial-tire.md)."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import integer, text
from tireroad.fem.sections.ring import Ring
from tireroad.runs.scene.sections.kind import Proportions, SectionKind, section_kind
from tireroad.runs.scene.source import Source

if TYPE_CHECKING:
    from tireroad.fem.sections.construction import Construction
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import Material
    from tireroad.runs.scene.tables.tire import Tire

# (elements around, along) that a search may take.
FINER = ((16, 14), (20, 18), (24, 22), (30, 26), (36, 32), (44, 38), (52, 46), (64, 56))


@section_kind("radial", "the built-in radial passenger tire (docs/radial-tire.md)")
class RadialSection(SectionKind):
    """Layers, compounds and cords by the size."""

    segments = 30

    size: str = text("205/60 R15", "size of the built-in passenger tire (docs/radial-tire.md)")
    elements_arc: int | None = integer(
        None, "number of elements from bead to bead; absent: 26", least=2, most=1000
    )

    def elements(self, tire: Tire) -> tuple[RadialSection, int, int]:
        _, order, segments = super().elements(tire)
        return replace(self, elements_arc=self.elements_arc or 26), order, segments

    def check(self, tire: Tire, source: Source) -> None:
        default = type(tire)()
        for key in ("material", "region", "cords"):
            if getattr(tire, key) != getattr(default, key):
                text = "is of a torus: a radial tire has all of it by its size"
                source.add(("tire", key), text)
        try:
            built(self.size)
        except InputError as problem:
            source.add(("tire", "size"), str(problem).removeprefix("tire.size "))

    def proportions(self, tire: Tire) -> Proportions:
        ring = self.ring(tire)
        return Proportions(
            outer_radius=float(ring.section.nodes[:, 0].max()),
            height=ring.height / 2,
            thickness=ring.thickness,
            half_angle=float(np.degrees(np.abs(ring.arc_corners).max())),
            along=len(ring.section.outer),
            through=len(built(self.size).layers),
        )

    def ring(self, tire: Tire) -> Ring:
        return _ring(self.size, tire.segments, self.elements_arc, tire.order, tire.footprint_size)

    def rubbers(self, tire: Tire) -> dict[str, Material]:
        from tireroad.fem.tire.material import compound

        compounds = built(self.size).compounds
        return {name: compound("neo-hookean", **values) for name, values in compounds.items()}

    def rubber(self, tire: Tire) -> tuple[float, float, float]:
        """Of the softest compound, in which the wall bends most."""
        compounds = built(self.size).compounds.values()
        soft = min(compounds, key=lambda one: one["youngs_modulus"])
        return soft["dynamic"] * soft["youngs_modulus"], soft["poisson_ratio"], soft["density"]

    def cords(self, tire: Tire) -> list[Cords]:
        from tireroad.fem.tire.cords import Cords

        places = {"under", "to"}
        return [
            Cords(**{key: value for key, value in vars(line).items() if key not in places})
            for line in built(self.size).cords
        ]

    def angles(self, tire: Tire) -> dict[str, float]:
        return {line.name: float(np.degrees(line.angle)) for line in built(self.size).cords}

    def meshes(self, tire: Tire) -> tuple[tuple[int, int], ...]:
        return FINER

    def elements_along(self, along: int) -> RadialSection:
        return replace(self, elements_arc=along)

    def coarser(self, tire: Tire) -> RadialSection:
        return replace(self, elements_arc=self.elements_arc // 2)

    def has_losses(self, tire: Tire) -> bool:
        """All compounds of the built-in tire have one."""
        return True


@lru_cache(maxsize=4)
def built(size: str) -> Construction:
    """What a tire of that size is built of."""
    from tireroad.fem.sections.radial import radial

    return radial(size)


@lru_cache(maxsize=4)
def _ring(size: str, segments: int, along: int, order: int, footprint_size: float) -> Ring:
    return built(size).ring(segments, along, order, footprint_size)
