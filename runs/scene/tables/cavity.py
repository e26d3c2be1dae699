"""The table [tire.cavity]: keys, when air is included by default, and incompatible settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from tireroad.fem.errors import InputError
from tireroad.runs.scene.schema import choice, number

if TYPE_CHECKING:
    from tireroad.runs.scene.tables.scene import Scene

Where = Callable[[tuple[str, ...], str], InputError]


@dataclass(frozen=True)
class Cavity:
    gas: str = choice(
        "air",
        ("air", "none"),
        "gas in the tire; none: neither its mass nor its resonances are modelled",
    )
    temperature: float = number(293.15, "K", "temperature of the gas", least=150, most=1000)
    loss_factor: float | None = number(
        None,
        "-",
        "loss factor of the acoustic waves; absent: from friction at the walls",
        least=0,
        most=1,
    )
    up_to: float | None = number(
        None,
        "Hz",
        "highest frequency of its modes; absent: all of up to eight waves around the ring, about 1700 Hz",
        least=1,
        most=5000,
    )


def filled(scene: Scene) -> Scene:
    """The scene with air included by default, for every section but the torus of the thesis."""
    tire = scene.tire
    if not tire.shape.air or tire.cavity is not None:
        return scene
    return replace(scene, tire=replace(tire, cavity=Cavity()))


def has_air(scene: Scene) -> bool:
    """Whether the air in the tire is modelled."""
    return scene.tire.cavity is not None and scene.tire.cavity.gas != "none"


def check_cavity(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """Raise an error for what is not available with air."""
    if not has_air(scene):
        return
    rotation, residual = scene.rotation, scene.greens.residual
    if rotation is not None and rotation.speed and rotation.method == "full":
        raise error(
            ("rotation", "method"),
            '= "full" knows no air: take "projected", or tire.cavity.gas = "none"',
        )
    used = bool(scene.force) or scene.contact is not None
    if used and scene.modes.rim == "free" and residual not in ("none", "attachment"):
        raise error(
            ("greens", "residual"),
            f'= "{residual}" of a free rim knows no air: take "attachment" or "none", or '
            'tire.cavity.gas = "none"',
        )
