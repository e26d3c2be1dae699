"""A tire from a file: read once, checked against the scene, and the sizes that other keys need of it."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.runs.scene.source import Source
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.scene.tables.tire import Region, Tire

if TYPE_CHECKING:
    from tireroad.fem.decks.own import OwnSection, Wishes
    from tireroad.fem.sections.ring import Ring


def with_own_section(scene: Scene, source: Source) -> Scene:
    """The scene with the sizes of its file's section in the keys of the torus, for all that counts by them.

    They are not written back. What is wrong with the file is noted in `source`.
    """
    tire = scene.tire
    if tire.section != "file":
        return scene
    if tire.file is None:
        source.add(("tire",), 'with section = "file" needs file = "…"')
        return scene
    try:
        own = own_section(tire)
        _check_regions(tire, own)
        _check_cords(tire, own)
    except InputError as error:
        source.add_as_is(("tire", "file"), str(error))
        return scene
    return replace(scene, tire=replace(tire, **_sizes(tire, own)))


def _sizes(tire: Tire, own: OwnSection) -> dict:
    """Keys of the torus with values of the section."""
    ring, nodes = own_ring(tire), own.mesh.nodes
    return {
        "outer_radius": float(nodes[:, 0].max()),
        "minor_radius": ring.height / 2,
        "thickness": ring.thickness,
        "half_angle": float(np.degrees(np.abs(ring.arc_corners).max())),
        "elements_arc": len(own.mesh.outer),
        "elements_thickness": max(1, round(len(own.mesh.cells) / len(own.mesh.outer))),
    }


def own_section(tire: Tire) -> OwnSection:
    """The section of the tire's file. InputError, with file and line, for what is wrong in it."""
    from tireroad.fem.decks.own import Wishes

    path = Path(tire.file)
    wishes = Wishes(
        inner=tire.inner,
        tread=tire.tread,
        rim=tire.rim,
        length_unit=tire.length_unit,
        mirror=tire.mirror,
        materials=frozenset(r.name for r in tire.region if r.name and r.material is not None),
    )
    try:
        stamp = path.stat().st_mtime_ns
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None
    return _read(path, stamp, wishes)


@lru_cache(maxsize=4)
def _read(path: Path, _: int, wishes: Wishes) -> OwnSection:
    from tireroad.fem.decks.own import read

    return read(path, wishes)


def own_ring(tire: Tire) -> Ring:
    """The section of the file revolved, of the scene's order, as many elements around as it says."""
    from tireroad.fem.sections.ring import Ring, section_angles, wall_thickness
    from tireroad.fem.sections.torus import LEAST, ring_corners

    mesh = own_section(tire).mesh.of_order(tire.order)

    def ring(segments: int) -> Ring:
        return Ring(
            section=mesh,
            ring_corners=ring_corners(segments, tire.footprint_size),
            arc_corners=section_angles(mesh),
            thickness=wall_thickness(mesh),
            height=float(np.ptp(mesh.nodes[:, 0])),
            coarser=lambda: ring(segments // 2) if segments // 2 >= LEAST[0] else None,
        )

    return ring(tire.segments)


def own_free_unknowns(tire: Tire) -> int:
    """Displacement unknowns without those held by the rim; 1 where the file cannot be read."""
    try:
        mesh = own_section(tire).mesh.of_order(tire.order)
    except (InputError, TypeError):  # noted where the file is read first
        return 1
    free = len(mesh.nodes) - len(np.unique(mesh.side(mesh.rim)))
    return 3 * tire.segments * tire.order * free


def fingerprint(tire: Tire) -> str | None:
    """A hash of all that the run takes from the tire's file; None without one."""
    if tire.section != "file":
        return None
    own = own_section(tire)
    mesh = own.mesh
    faces = (mesh.outer, mesh.tread, mesh.inner, mesh.rim, *mesh.plies.values())
    found = hashlib.sha256()
    for array in (mesh.nodes, mesh.cells, mesh.region, *faces):
        found.update(np.ascontiguousarray(array).tobytes())
    plies = [{k: v for k, v in vars(ply).items() if k != "sides"} for ply in own.plies]
    found.update(repr((mesh.regions, own.rubbers, plies)).encode())
    return found.hexdigest()


def file_has_losses(tire: Tire) -> bool:
    """Whether a compound of the tire's file has a loss factor."""
    if tire.section != "file" or tire.file is None:
        return False
    try:
        return any(rubber and rubber.loss_factor for rubber in own_section(tire).rubbers)
    except InputError:  # noted where the file is read first
        return False


def region_of(tire: Tire, name: str) -> Region | None:
    """The scene's [[tire.region]] of a region of the file."""
    return next((r for r in tire.region if r.name and r.name.upper() == name.upper()), None)


def _check_regions(tire: Tire, own: OwnSection) -> None:
    """That every [[tire.region]] names one of the file."""
    known = {name.upper() for name in own.mesh.regions}
    for number, region in enumerate(tire.region):
        if region.name is None or region.name.upper() not in known:
            shown = "has no name" if region.name is None else f'name = "{region.name}" is none'
            raise InputError(
                f"tire.region.{number} {shown} of the file's regions: {', '.join(own.mesh.regions)}"
            )


def _check_cords(tire: Tire, own: OwnSection) -> None:
    """That every [[tire.cords]] names a line of the file, and every line without data has cords."""
    for number, cords in enumerate(tire.cords):
        if cords.name not in own.mesh.plies:
            known = ", ".join(own.mesh.plies) or "none"
            raise InputError(
                f'tire.cords.{number} name = "{cords.name}" is no line of the file: {known}'
            )


def described(tire: Tire) -> list[str]:
    """What of the tire's file is used and what is not, for `check`; empty without a file."""
    if tire.section != "file":
        return []
    own = own_section(tire)
    mesh = own.mesh
    lines = [f"tire from {Path(tire.file).name}", *(f"  {line}" for line in own.used)]
    for name, rubber in zip(mesh.regions, own.rubbers, strict=True):
        lines.append(f"  region {name}: {_material(tire, name, rubber)}")
    lines += [
        f"  cords {ply.name}: {np.degrees(ply.angle):+.4g} deg, E {ply.youngs_modulus:.4g} Pa, area "
        f"{ply.area:.4g} m², spacing {ply.spacing:.4g} m, {len(ply.sides)} sides"
        for ply in own.plies
    ]
    lines += [f"  {note}" for note in own.notes]
    with_data = {ply.name for ply in own.plies} | {cords.name for cords in tire.cords}
    lines += [
        f'  line {name}: no cords on it ([[tire.cords]] name = "{name}" lays some)'
        for name in mesh.plies
        if name not in with_data
    ]
    return lines + ["not used of the file", *(f"  {line}" for line in own.unused or ("nothing",))]


def _material(tire: Tire, name: str, rubber) -> str:
    region = region_of(tire, name)
    if region is not None and region.material is not None:
        return "material of the scene's [[tire.region]]"
    if rubber is None:
        return "no material in the file: that of [tire.material]"
    values = ", ".join(f"{key} {value:.4g}" for key, value in rubber.coefficients.items())
    density = (
        f"density {rubber.density:.4g} kg/m³"
        if rubber.density is not None
        else "no density in the file: that of [tire.material]"
    )
    return f"{rubber.name}, {rubber.model}, {values}; {density}"
