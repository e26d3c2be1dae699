"""Base of the kinds of section: own keys, and the resulting ring of elements, compounds and cords.

A new kind is one file in runs.scene.sections.kinds, or a class in a user's script. The scene's
keys, `check`, the key reference and the range tests derive from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

from tireroad.fem.parameters import Parameters, Registry
from tireroad.runs.scene.source import Source

if TYPE_CHECKING:
    from tireroad.fem.sections.ring import Ring
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import Material
    from tireroad.runs.scene.tables.tire import Tire

# Elements around in the meshes of a search, unless a kind has its own.
AROUND = (16, 20, 24, 30, 36, 44, 52, 64, 78, 96, 120)


@dataclass(frozen=True, kw_only=True)
class Proportions:
    """Sizes of a section, for estimates and for checks against other keys.

    `outer_radius` m at the crown; `height` m: half of the section's height (for a torus, the radius
    of its section circle); `thickness` m of the wall at the crown; `half_angle` deg from the crown
    to a bead; number of elements `along` the section from bead to bead and `through` the wall.
    """

    outer_radius: float
    height: float
    thickness: float
    half_angle: float
    along: int
    through: int


class SectionKind(Parameters):
    """Base class of the kinds of section. Methods take the scene's [tire], which has the kind.

    `order` and `segments`: defaults of element order and elements around. `air`: whether air is
    included unless [tire.cavity] says otherwise. `tread_law`: default of `contact.tread`; a layer
    for treads on belts, which hardly deform. `without`: tables of [tire] that the kind has no use
    for.
    """

    owner = "section"
    order: ClassVar[int] = 2
    segments: ClassVar[int] = 60
    air: ClassVar[bool] = True
    tread_law: ClassVar[str] = "layer"
    without: ClassVar[tuple[str, ...]] = ()

    def elements(self, tire: Tire) -> tuple[Self, int, int]:
        """The kind with its number of elements set; order and segments, given or by default."""
        return self, tire.order or self.order, tire.segments or self.segments

    def check(self, tire: Tire, source: Source) -> None:
        """Note problems of [tire] in `source`."""

    def proportions(self, tire: Tire) -> Proportions:
        """Sizes of the section."""
        raise NotImplementedError

    def ring(self, tire: Tire) -> Ring:
        """The ring of elements from the revolved section."""
        raise NotImplementedError

    def rubbers(self, tire: Tire) -> dict[str, Material]:
        """The compound of each region of the section, by name."""
        raise NotImplementedError

    def cords(self, tire: Tire) -> list[Cords]:
        """The cords on the plies of the section."""
        raise NotImplementedError

    def angles(self, tire: Tire) -> dict[str, float]:
        """Angle to the circumference (deg) of each line of cords, for drawings."""
        return {line.name: line.angle for line in tire.cords}

    def rubber(self, tire: Tire) -> tuple[float, float, float]:
        """Dynamic modulus (Pa), Poisson's ratio and density (kg/m³) of the wall, for estimates."""
        law = tire.material.law
        return tire.dynamic * law.youngs, law.poisson, tire.material.density

    def free_unknowns(self, tire: Tire) -> int:
        """Displacement unknowns of the mesh, without those held by the rim."""
        import numpy as np

        section = self.ring(tire).section
        held = len(np.unique(section.side(section.rim)))
        return 3 * tire.segments * tire.order * (len(section.nodes) - held)

    def coarser(self, tire: Tire) -> Self:
        """The kind with half the elements along the section, however few that leaves."""
        raise NotImplementedError

    def meshes(self, tire: Tire) -> tuple[tuple[int, int], ...]:
        """(elements around, along the section) for a search of settings, from coarse to fine.

        Each is about 1.2 times finer than the one before; the coarsest can be halved.
        """
        along = self.proportions(tire).along
        return tuple((around, along) for around in AROUND)

    def search_order(self, tire: Tire) -> int:
        """Element order used by a search."""
        return tire.order

    def elements_along(self, along: int) -> Self:
        """The kind with that many elements along its section, if the number can be chosen."""
        return self

    def has_losses(self, tire: Tire) -> bool:
        """Whether any compound has a loss factor."""
        return any((tire.loss_factor, *(part.loss_factor for part in tire.region)))

    def fingerprint(self, tire: Tire) -> str | None:
        """Hash of what a run takes from the section's files; None without files."""
        return None

    def described(self, tire: Tire) -> list[str]:
        """Lines for `check`: which parts of a file are used and which are not."""
        return []


SECTIONS: Registry[SectionKind] = Registry(
    "section", "tireroad.runs.scene.sections.kinds", SectionKind
)
section_kind = SECTIONS.register
