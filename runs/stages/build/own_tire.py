"""Materials and cords of a tire from a file: the file's, and the scene's where it names them."""

from __future__ import annotations

import numpy as np

from tireroad.fem.decks.compounds import Rubber
from tireroad.fem.tire.cords import Cords
from tireroad.fem.tire.material import Material, compound
from tireroad.runs.scene.extent.own_tire import own_section, region_of
from tireroad.runs.scene.tables.tire import Tire


def own_materials(tire: Tire) -> dict[str, Material]:
    """The compound of each region by name: of [[tire.region]], else of the file, else [tire.material]."""
    own = own_section(tire)
    return {
        name: _material(tire, name, rubber)
        for name, rubber in zip(own.mesh.regions, own.rubbers, strict=True)
    }


def _material(tire: Tire, name: str, rubber: Rubber | None) -> Material:
    """The material of one region.

    A [[tire.region]] of it gives its dynamic modulus and loss factor where they are not 1 and 0.
    """
    region = region_of(tire, name)
    change = {"dynamic": tire.dynamic, "loss_factor": tire.loss_factor}
    if rubber is not None:
        change = {"dynamic": rubber.dynamic, "loss_factor": rubber.loss_factor}
    if region is not None:
        change |= {"dynamic": region.dynamic} if region.dynamic != 1 else {}
        change |= {"loss_factor": region.loss_factor} if region.loss_factor else {}
    if region is not None and region.material is not None:
        return Material(region.material.law, region.material.density, **change)
    if rubber is None:
        return Material(tire.material.law, tire.material.density, **change)
    density = tire.material.density if rubber.density is None else rubber.density
    return compound(rubber.model, density, **rubber.coefficients, **change)


def own_cords(tire: Tire) -> list[Cords]:
    """The cords on the lines of the file: of [[tire.cords]] by name, else of the file."""
    given = {cords.name: cords for cords in tire.cords}
    found = [
        Cords(**{key: value for key, value in vars(ply).items() if key != "sides"})
        for ply in own_section(tire).plies
        if ply.name not in given
    ]
    for cords in given.values():
        values = {k: v for k, v in vars(cords).items() if k not in ("depth", "arc", "angle")}
        found.append(Cords(angle=float(np.radians(cords.angle)), **values))
    return found
