"""Free factors of the built-in tire, by which it becomes another: what `tireroad fit` chooses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from tireroad.fem.sections.construction import Construction
from tireroad.fem.sections.radial import radial

PLAUSIBLE = 1.5  # a factor beyond it, or under its inverse, is said

# What the parameters multiply, as keys of [tire.scale].
_RUBBERS = ("tread", "skim", "ply", "sidewall", "apex", "bead")
SCALED = {
    "density": ("compounds density",),
    "tread": ("tread",),
    "skim": ("skim",),
    "sidewall": ("sidewall", "ply"),
    "apex": ("apex",),
    "carcass": ("carcass",),
    "dynamic": ("compounds dynamic",),
    "tread loss": ("tread loss factor",),
    "other loss": tuple(f"{name} loss factor" for name in _RUBBERS if name != "tread"),
}


@dataclass(frozen=True)
class Parameter:
    """A free factor of the built-in tire: name, `spread` (the factor at one standard deviation), range, what it
    multiplies, and whether the tire on the road, standing, depends on it (`on_road`)."""

    name: str
    spread: float
    least: float
    most: float
    doc: str
    on_road: bool = True

    @property
    def deviation(self) -> float:
        """Standard deviation of its logarithm among tires."""
        return math.log(self.spread)


# Spreads from the ranges of docs/radial-tire.md.
PARAMETERS = (
    Parameter("density", 1.15, 0.6, 1.6, "densities of all compounds", on_road=False),
    Parameter("tread", 1.25, 0.4, 3.0, "modulus of the tread"),
    Parameter("skim", 1.25, 0.4, 3.0, "modulus of the belt skim"),
    Parameter("sidewall", 1.5, 0.2, 4.0, "moduli of sidewall and ply rubber"),
    Parameter("apex", 1.3, 0.1, 4.0, "modulus of the apex"),
    Parameter("carcass", 1.5, 0.2, 5.0, "modulus of the carcass cords"),
    Parameter(
        "dynamic", 1.25, 0.87, 1.7, "dynamic over static modulus of all compounds", on_road=False
    ),
)


def construction(
    size: str, factors: Mapping[str, float], rim_width: float | None = None
) -> Construction:
    """The built-in construction of a size with factors by parameter, its compounds as they fill their layers."""
    tire = radial(size, rim_width=rim_width)
    own = {
        "tread": "tread",
        "skim": "skim",
        "apex": "apex",
        "sidewall": "sidewall",
        "ply": "sidewall",
    }
    compounds = {}
    for name, values in tire.compounds.items():
        loss = factors.get("tread loss" if name == "tread" else "other loss", 1.0)
        compounds[name] = dict(values) | {
            "youngs_modulus": values["youngs_modulus"] * factors.get(own.get(name, ""), 1.0),
            "density": values["density"] * factors.get("density", 1.0),
            "dynamic": values["dynamic"] * factors.get("dynamic", 1.0),
            "loss_factor": values["loss_factor"] * loss,
        }
    cords = [
        replace(line, youngs_modulus=line.youngs_modulus * factors.get("carcass", 1.0))
        if line.name == "carcass"
        else line
        for line in tire.cords
    ]
    return replace(tire, compounds=compounds, cords=cords)
