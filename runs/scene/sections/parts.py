"""Shared by the kinds of section: cords and compounds of a scene's tables, sizes of a ring."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tireroad.runs.scene.tables.tire import Proportions

if TYPE_CHECKING:
    from tireroad.fem.decks.compounds import Rubber
    from tireroad.fem.sections.mesh2d import SectionMesh
    from tireroad.fem.sections.ring import Ring
    from tireroad.fem.tire.cords import Cords
    from tireroad.runs.scene.tables.tire import Cords as Line
    from tireroad.runs.scene.tables.tire import Region, Tire


def cords_of(line: Line) -> Cords:
    """The cords of a [[tire.cords]], without their place in the section."""
    from tireroad.fem.tire.cords import Cords

    values = {k: v for k, v in vars(line).items() if k not in ("depth", "arc", "angle")}
    return Cords(angle=float(np.radians(line.angle)), **values)


def spelt(lines: Sequence[Line], names: Iterable[str]) -> list[Line]:
    """The [[tire.cords]] with names spelt as the section's plies are."""
    own = {name.upper(): name for name in names}
    return [replace(line, name=own.get(line.name.upper(), line.name)) for line in lines]


def region_of(tire: Tire, name: str) -> Region | None:
    """The scene's [[tire.region]] of that name, or None."""
    return next((r for r in tire.region if r.name and r.name.upper() == name.upper()), None)


def losses_of(part: Region | Rubber | None) -> dict[str, float]:
    """Dynamic modulus and loss factor of a region or a file's compound, if not 1 and 0."""
    given = {} if part is None else {"dynamic": part.dynamic, "loss_factor": part.loss_factor}
    neutral = {"dynamic": 1.0, "loss_factor": 0.0}
    return {key: value for key, value in given.items() if value != neutral[key]}


def proportions_of(ring: Ring, drawn: SectionMesh) -> Proportions:
    """Sizes of a ring from its section as drawn, of any element order."""
    return Proportions(
        outer_radius=float(drawn.nodes[:, 0].max()),
        height=ring.height / 2,
        thickness=ring.thickness,
        half_angle=float(np.degrees(np.abs(ring.arc_corners).max())),
        along=len(drawn.outer),
        through=max(1, round(len(drawn.cells) / len(drawn.outer))),
    )
