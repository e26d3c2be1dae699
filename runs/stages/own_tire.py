"""Materials and cords of a tire from a file: the file's, and the scene's where it names them."""

from __future__ import annotations

import numpy as np

from tireroad.fem.tire.cords import Cords
from tireroad.fem.tire.material import Material
from tireroad.runs.scene.own_tire import own_section, region_of
from tireroad.runs.scene.tire_tables import Tire


def own_materials(tire: Tire) -> dict[str, Material]:
    """The compound of each region by name: of [[tire.region]], else of the file, else [tire.material]."""
    own = own_section(tire)
    found = {}
    for name, rubber in zip(own.mesh.regions, own.rubbers, strict=True):
        region = region_of(tire, name)
        if region is not None and region.material is not None:
            found[name] = Material(**vars(region.material))
        elif rubber is None:
            found[name] = Material(**vars(tire.material))
        else:
            density = tire.material.density if rubber.density is None else rubber.density
            found[name] = Material(model=rubber.model, density=density, **rubber.coefficients)
    return found


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
