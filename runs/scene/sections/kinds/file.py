"""`section = "file"`: an Abaqus deck, a Gmsh mesh or a section file (docs/how-to/own-tire.md)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import choice, filename, flag, text, texts
from tireroad.runs.scene.sections import own_file
from tireroad.runs.scene.sections.kind import Proportions, SectionKind, section_kind
from tireroad.runs.scene.sections.parts import proportions_of
from tireroad.runs.scene.source import Source

if TYPE_CHECKING:
    from tireroad.fem.sections.ring import Ring
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import Material
    from tireroad.runs.scene.tables.tire import Tire


@section_kind("file", "a section read from a file")
class FileSection(SectionKind):
    """The section of a file, which also sets the elements along it and through the wall."""

    file: str | None = filename(
        "Abaqus deck (.inp), Gmsh mesh (.msh) or section file (.toml, docs/section-file.md)"
    )
    mesh: str | None = filename('same as file, and implies section = "file"')
    inner: str | None = text(None, "surface or node set that carries the inflation pressure")
    tread: str | None = text(None, "surface or node set that can touch the road")
    rim: tuple[str, ...] = texts("surfaces or node sets that are fixed to the wheel")
    length_unit: str = choice(
        "m",
        ("m", "mm", "in"),
        "length unit of the file; mm implies N, MPa and tonnes, in implies lbf and psi",
    )
    mirror: bool = flag(
        False, "true: the file holds half the section, which ends on z = 0, and is mirrored"
    )

    @property
    def name(self) -> Path:
        """The path of the file."""
        return Path(self.file or self.mesh or "")

    def check(self, tire: Tire, source: Source) -> None:
        if (self.file is None) == (self.mesh is None):
            source.add(("tire",), 'with section = "file" needs one of file = "…" and mesh = "…"')
            return
        try:
            own = own_file.own_section(tire)
            own_file.check_regions(tire, own)
            own_file.check_cords(tire, own)
        except InputError as error:
            source.add_as_is(("tire", "file"), str(error))

    def proportions(self, tire: Tire) -> Proportions:
        return proportions_of(self.ring(tire), own_file.own_section(tire).mesh)

    def ring(self, tire: Tire) -> Ring:
        return own_file.own_ring(tire)

    def rubbers(self, tire: Tire) -> dict[str, Material]:
        return own_file.own_materials(tire)

    def rubber(self, tire: Tire) -> tuple[float, float, float]:
        """Values of the softest compound, in which the wall bends most."""
        soft = min(self.rubbers(tire).values(), key=lambda one: one.dynamic * one.law.youngs)
        return soft.dynamic * soft.law.youngs, soft.law.poisson, soft.density

    def cords(self, tire: Tire) -> list[Cords]:
        return own_file.own_cords(tire)

    def angles(self, tire: Tire) -> dict[str, float]:
        own = own_file.own_section(tire).plies
        given = {line.name: line.angle for line in own_file.given_cords(tire)}
        return {ply.name: float(np.degrees(ply.angle)) for ply in own} | given

    def coarser(self, tire: Tire) -> FileSection:
        """The file's own elements: there are no others."""
        return self

    def has_losses(self, tire: Tire) -> bool:
        return any(one.loss_factor for one in self.rubbers(tire).values())

    def fingerprint(self, tire: Tire) -> str:
        return own_file.fingerprint(tire)

    def described(self, tire: Tire) -> list[str]:
        return own_file.described(tire)
