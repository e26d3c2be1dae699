"""A section file (docs/section-file.md), converted like other mesh files."""

from __future__ import annotations

from pathlib import Path

from tireroad.fem.decks.compounds import Rubber
from tireroad.fem.decks.shape.plies import Ply
from tireroad.fem.errors import InputError
from tireroad.fem.sections.construction import Construction, CordLine
from tireroad.fem.sections.mesh2d import SectionMesh
from tireroad.fem.sections.section_file import read

ELEMENTS = 26  # bead to bead, as in the built-in radial tire


def drawn(path: Path) -> tuple[SectionMesh, tuple[Rubber, ...], tuple[Ply, ...]]:
    """Mesh of order 2, compound of each region, cords. Raises InputError with the file's name."""
    construction = read(path)
    try:
        mesh = construction.section(ELEMENTS)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    rubbers = tuple(_rubber(construction, name) for name in mesh.regions)
    return mesh, rubbers, tuple(_ply(line, mesh) for line in construction.cords)


def _rubber(construction: Construction, name: str) -> Rubber:
    values = construction.compounds[name]
    coefficients = {key: values[key] for key in ("youngs_modulus", "poisson_ratio")}
    return Rubber(
        name=name,
        model="neo-hookean",
        coefficients=coefficients,
        density=values["density"],
        dynamic=values["dynamic"],
        loss_factor=values["loss_factor"],
    )


def _ply(line: CordLine, mesh: SectionMesh) -> Ply:
    given = {key: value for key, value in vars(line).items() if key not in ("under", "to")}
    return Ply(sides=mesh.plies[line.name], **given)
