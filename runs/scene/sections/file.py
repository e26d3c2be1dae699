"""`section = "file"`: an Abaqus deck, a Gmsh mesh or a section file (docs/how-to/own-tire.md)."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import choice, filename, flag, number, text, texts
from tireroad.runs.scene.schema import Source
from tireroad.runs.scene.tables.tire import (
    Parts,
    Proportions,
    SectionKind,
    changed,
    cords_of,
    losses_of,
    proportions_of,
    region_of,
    section_kind,
    spelt,
)

if TYPE_CHECKING:
    from tireroad.fem.decks.compounds import Rubber
    from tireroad.fem.decks.user_section import OwnSection, Wishes
    from tireroad.fem.sections.mesh2d import Ring, SectionMesh
    from tireroad.fem.tire.cords import Cords
    from tireroad.fem.tire.material import Material
    from tireroad.runs.scene.tables.tire import CordsTable, MaterialTable, TireTable


def _keys(tire: TireTable) -> FileSection:
    return cast("FileSection", tire.shape)


def own_section(tire: TireTable) -> OwnSection:
    """The section in the tire's file. Raises InputError, with file and line, for errors in it."""
    return _read(*_source(tire))


def own_ring(tire: TireTable) -> Ring:
    """The ring of that section in the scene's order and segments; cached per scene and file."""
    return _ring(*_source(tire), tire.order, tire.segments, tire.footprint_size)


def _source(tire: TireTable) -> tuple[Path, int, Wishes]:
    """The file, its modification time, and what is requested from it."""
    from tireroad.fem.decks.user_section import Wishes

    keys = _keys(tire)
    path = keys.name
    wishes = Wishes(
        inner=keys.inner,
        tread=keys.tread,
        rim=keys.rim,
        length_unit=keys.length_unit,
        mirror=keys.mirror,
        merge=keys.merge,
        materials=frozenset(r.name for r in tire.region if r.name and r.material is not None),
    )
    try:
        return path, path.stat().st_mtime_ns, wishes
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None


@lru_cache(maxsize=4)
def _read(path: Path, _: int, wishes: Wishes) -> OwnSection:
    from tireroad.fem.decks.user_section import read

    return read(path, wishes)


@lru_cache(maxsize=4)
def _ring(
    path: Path, stamp: int, wishes: Wishes, order: int, segments: int, footprint_size: float
) -> Ring:
    mesh = _read(path, stamp, wishes).mesh.of_order(order)
    return _revolved(mesh, segments, footprint_size)


def _revolved(mesh: SectionMesh, segments: int, footprint_size: float) -> Ring:
    """The section as a ring; its coarser companion has half as many elements around."""
    from tireroad.fem.sections.mesh2d import revolved
    from tireroad.fem.sections.torus import LEAST

    def coarser() -> Ring | None:
        half = segments // 2
        return _revolved(mesh, half, footprint_size) if half >= LEAST[0] else None

    return revolved(mesh, segments, footprint_size, coarser)


def fingerprint(tire: TireTable) -> str:
    """Hash of everything that the run takes from the tire's file."""
    own = own_section(tire)
    mesh = own.mesh
    faces = (mesh.outer, mesh.tread, mesh.inner, mesh.rim, *mesh.plies.values())
    digest = hashlib.sha256()
    for array in (mesh.nodes, mesh.cells, mesh.region, *faces):
        digest.update(np.ascontiguousarray(array).tobytes())
    plies = [{k: v for k, v in vars(ply).items() if k != "sides"} for ply in own.plies]
    digest.update(repr((mesh.regions, own.rubbers, plies)).encode())
    return digest.hexdigest()


def check_regions(tire: TireTable, own: OwnSection) -> None:
    """Check that every [[tire.region]] names a region of the file."""
    known = {name.upper() for name in own.mesh.regions}
    for place, region in enumerate(tire.region):
        if region.name is None or region.name.upper() not in known:
            shown = "has no name" if region.name is None else f'name = "{region.name}" is none'
            raise InputError(
                f"tire.region.{place} {shown} of the file's regions: {', '.join(own.mesh.regions)}"
            )


def check_cords(tire: TireTable, own: OwnSection) -> None:
    """Check that every [[tire.cords]] names a line of the file."""
    for place, cords in enumerate(spelt(tire.cords, own.mesh.plies)):
        if cords.name not in own.mesh.plies:
            known = ", ".join(own.mesh.plies) or "none"
            raise InputError(
                f'tire.cords.{place} name = "{cords.name}" is not a line of the file: {known}'
            )


def own_materials(tire: TireTable) -> dict[str, Material]:
    """Compound of each region by name: of [[tire.region]], else the file, else [tire.material]."""
    own = own_section(tire)
    return {
        name: _material(tire, name, rubber)
        for name, rubber in zip(own.mesh.regions, own.rubbers, strict=True)
    }


def _material(tire: TireTable, name: str, rubber: Rubber | None) -> Material:
    """The material of one region.

    Its properties in small motions are those that the [[tire.region]] states, else likewise
    those of the file's compound, else those of [tire].
    """
    return changed(_of_file(tire, rubber), region_of(tire, name))


def _of_file(tire: TireTable, rubber: Rubber | None) -> Material:
    """The compound of a region of the file, with what the file leaves open from [tire]."""
    from tireroad.fem.tire.material import Material, compound

    wall = _wall(tire)
    if rubber is None:
        return Material(law=wall.law, density=wall.density, **losses_of(tire, wall.law))
    density = wall.density if rubber.density is None else rubber.density
    material = compound(rubber.model, density, **rubber.coefficients)
    return replace(material, **losses_of(tire, material.law) | _small_motions(rubber))


def _wall(tire: TireTable) -> MaterialTable:
    assert tire.material is not None, "a file leaves materials to [tire.material]"
    return tire.material


def _small_motions(rubber: Rubber) -> dict[str, Any]:
    """Properties of a file's compound for small motions: a ratio not 1, a loss factor not 0, a spectrum."""
    small_motions = {
        "dynamic": rubber.dynamic,
        "loss_factor": rubber.loss_factor,
        "spectrum": rubber.spectrum,
    }
    neutral = {"dynamic": 1.0, "loss_factor": 0.0, "spectrum": None}
    return {key: value for key, value in small_motions.items() if value != neutral[key]}


def file_parts(tire: TireTable) -> Parts:
    """Compounds and cords of the file, as tables of a scene; of a region or line without, the scene's."""
    from tireroad.runs.scene.parts import compound_table, material_table

    own = own_section(tire)
    compounds, wall = {}, _wall(tire)
    for name, rubber in zip(own.mesh.regions, own.rubbers, strict=True):
        material = _of_file(tire, rubber)
        model = wall.model if rubber is None else rubber.model
        compounds[name] = compound_table(name, material.law, model, material.density, {})
    cords = {
        ply.name: {
            key: value for key, value in vars(ply).items() if key != "sides" and value is not None
        }
        | {"angle": _degrees(ply.angle)}
        for ply in own.plies
    }
    elsewhere = {"material": material_table(wall.law, wall.model, wall.density)}
    return Parts(compounds, cords, elsewhere, {})


def _degrees(angle: float) -> float:
    return round(float(np.degrees(angle)), 10)


def given_cords(tire: TireTable) -> list[CordsTable]:
    """The scene's [[tire.cords]], with names spelt as in the file."""
    return spelt(tire.cords, own_section(tire).mesh.plies)


def own_cords(tire: TireTable) -> list[Cords]:
    """The cords on the lines of the file: from [[tire.cords]] of that name, else from the file."""
    from tireroad.fem.tire.cords import Cords

    lines = {cords.name: cords_of(cords) for cords in given_cords(tire)}
    found = [
        Cords(**{key: value for key, value in vars(ply).items() if key != "sides"})
        for ply in own_section(tire).plies
        if ply.name not in lines
    ]
    return found + list(lines.values())


def described(tire: TireTable) -> list[str]:
    """Parts of the tire's file that are used and those that are not, for `check`."""
    own = own_section(tire)
    mesh = own.mesh
    lines = [f"tire from {_keys(tire).name.name}", *(f"  {line}" for line in own.used)]
    for name, rubber in zip(mesh.regions, own.rubbers, strict=True):
        lines.append(f"  region {name}: {_in_words(tire, name, rubber)}")
    lines += [
        f"  cords {ply.name}: {np.degrees(ply.angle):+.4g} deg, E {ply.youngs_modulus:.4g} Pa, area "
        f"{ply.area:.4g} m², spacing {ply.spacing:.4g} m, {len(ply.sides)} sides"
        for ply in own.plies
    ]
    lines += [f"  {note}" for note in own.notes]
    with_data = {ply.name for ply in own.plies} | {cords.name for cords in given_cords(tire)}
    lines += [
        f'  line {name}: no cords on it ([[tire.cords]] name = "{name}" lays some)'
        for name in mesh.plies
        if name not in with_data
    ]
    return lines + ["not used of the file", *(f"  {line}" for line in own.unused or ("nothing",))]


def _shown(value: float | tuple[float, ...]) -> str:
    return (
        f"{value:.4g}"
        if isinstance(value, float)
        else " ".join(f"{number:.4g}" for number in value)
    )


def _in_words(tire: TireTable, name: str, rubber: Rubber | None) -> str:
    region = region_of(tire, name)
    if region is not None and region.material is not None:
        return "material of the scene's [[tire.region]]"
    if rubber is None:
        return "no material in the file: that of [tire.material]"
    values = ", ".join(f"{key} {_shown(value)}" for key, value in rubber.coefficients.items())
    density = (
        f"density {rubber.density:.4g} kg/m³"
        if rubber.density is not None
        else "no density in the file: that of [tire.material]"
    )
    return f"{rubber.name}, {rubber.model}, {values}; {density}"


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
    merge: float = number(
        1e-6,
        "m",
        "nodes of the file nearer to each other than this are one; 0: none are",
        least=0,
        most=0.01,
    )
    mirror: bool = flag(
        False, "true: the file holds half the section, which ends on z = 0, and is mirrored"
    )

    @property
    def name(self) -> Path:
        """The path of the file."""
        return Path(self.file or self.mesh or "")

    def check(self, tire: TireTable, source: Source) -> None:
        if (self.file is None) == (self.mesh is None):
            source.add(("tire",), 'with section = "file" needs one of file = "…" and mesh = "…"')
            return
        try:
            own = own_section(tire)
            check_regions(tire, own)
            check_cords(tire, own)
        except InputError as error:
            source.add_as_is(("tire", "file"), str(error))

    def proportions(self, tire: TireTable) -> Proportions:
        return proportions_of(self.ring(tire), own_section(tire).mesh)

    def ring(self, tire: TireTable) -> Ring:
        return own_ring(tire)

    def parts(self, tire: TireTable) -> Parts:
        return file_parts(tire)

    def rubbers(self, tire: TireTable) -> dict[str, Material]:
        return own_materials(tire)

    def rubber(self, tire: TireTable) -> tuple[float, float, float]:
        """Values of the softest compound, in which the wall bends most."""
        soft = min(self.rubbers(tire).values(), key=lambda one: one.dynamic * one.law.youngs)
        return soft.dynamic * soft.law.youngs, soft.law.poisson, soft.density

    def cords(self, tire: TireTable) -> list[Cords]:
        return own_cords(tire)

    def angles(self, tire: TireTable) -> dict[str, float]:
        own = own_section(tire).plies
        angles = {line.name: line.angle for line in given_cords(tire)}
        return {ply.name: float(np.degrees(ply.angle)) for ply in own} | angles

    def coarser(self, tire: TireTable) -> FileSection:
        """The file's own elements: there are no others."""
        return self

    def fingerprint(self, tire: TireTable) -> str:
        return fingerprint(tire)

    def described(self, tire: TireTable) -> list[str]:
        return described(tire)
