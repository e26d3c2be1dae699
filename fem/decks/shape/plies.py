"""The cords of a deck on the sides of a section's cells: course, angle and data of each ply.

In an axisymmetric membrane Abaqus measures the cord angle a from the meridian, the direction t from
the element's first node to its second, positive about the normal, which is t rotated by 90 degrees
in the (r, z) plane: the cord lies along cos a t + sin a e_theta, e_theta right-handed about z. At
the lowest point e_theta is -x, so relative to a chain that runs along s t (s = 1 or -1) the cord
lies along -sin a e_x + s cos a e_chain: the angle from the circumference is atan2(s cos a, -sin a).
A line has no sense of direction, so the angle is reduced to between -90 and 90 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tireroad.fem.decks.compounds import CordMaterial
from tireroad.fem.decks.deck import Layer
from tireroad.fem.decks.shape.chains import along, ends, forward, strings, with_origin
from tireroad.fem.decks.shape.quad_split import Quads
from tireroad.fem.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Ply:
    """Cords on one chain of sides, in SI: `angle` in rad from +x at the lowest point towards the
    chain's end; the others as in `Cords`.
    """

    name: str
    sides: np.ndarray
    angle: float
    youngs_modulus: float
    area: float
    spacing: float
    density: float
    compression: float


@dataclass(frozen=True)
class Laid:
    """The membranes of a set: numbers of the deck's edges they lie on, and middles (k, 2) and
    directions (k, 2) of their elements from first to last node.
    """

    numbers: np.ndarray
    middles: np.ndarray
    directions: np.ndarray

    def mirrored(self) -> Laid:
        """With the other half, turned by 180 deg about the vertical so that cords continue."""
        return Laid(
            self.numbers,
            np.concatenate([self.middles, self.middles * [1, -1]]),
            np.concatenate([self.directions, self.directions * [-1, 1]]),
        )


def plies(
    quads: Quads, laid: Laid, layer: Layer, material: CordMaterial, length: float
) -> list[Ply]:
    """The plies of one cord layer: one per unbroken line, more if the angle varies along it."""
    sides = with_origin(quads, laid.numbers)
    found, branches = strings(ends(quads, sides))
    if branches:
        r, y = quads.points[branches[0]]
        raise layer.place.error(
            f"the membranes of {layer.elements} branch at r = {r:.5g}, z = {y:.5g}: make a set of each line"
        )
    made = []
    for line in found:
        chain = forward(quads, sides[line])
        sense = _sense(quads, chain, laid, layer)
        for part in [chain] if layer.geometry == "CONSTANT" else np.split(chain, len(chain)):
            made.append(_ply(quads, part, layer, material, length, sense))
    if len(made) > 1:
        made = [replace(one, name=f"{one.name} ({n + 1})") for n, one in enumerate(made)]
    return made


def _ply(
    quads: Quads, sides: np.ndarray, layer: Layer, material: CordMaterial, length: float, sense: int
) -> Ply:
    r = quads.points[ends(quads, sides).ravel(), 0].mean()
    angle, spacing = _geometry(layer, r)
    return Ply(
        name=layer.name,
        sides=sides,
        angle=from_circumference(angle, sense),
        youngs_modulus=material.youngs_modulus,
        area=layer.area * length**2,
        spacing=spacing * length,
        density=material.density,
        compression=material.compression,
    )


def _geometry(layer: Layer, r: float) -> tuple[float, float]:
    """(angle from the meridian in rad, spacing in the deck's length unit) at radius r.

    Lifting keeps the number of cords around: with the angle b from the circumference and the
    extension e, cos b = r / (r0 (1 + e)) cos b0 and s = s0 (r / r0) sin b / sin b0.
    """
    angle = np.radians(layer.angle)
    if layer.geometry == "ANGULAR":
        return angle, r * np.radians(layer.spacing)
    if layer.geometry == "CONSTANT":
        return angle, layer.spacing
    if layer.radius <= 0 or layer.extension <= -1:
        raise layer.place.error(
            f"cords {layer.name}: a lifted layer needs a radius > 0 as last number"
        )
    cosine = r / (layer.radius * (1 + layer.extension)) * np.sin(angle)
    if abs(cosine) >= 1 or abs(np.cos(angle)) < 1e-9:
        raise layer.place.error(
            f"cords {layer.name}: cannot be lifted from r = {layer.radius:g} to r = {r:g}"
        )
    lifted = np.arcsin(cosine)
    return float(lifted), layer.spacing * r / layer.radius * np.cos(lifted) / np.cos(angle)


def from_circumference(angle: float, sense: int) -> float:
    """Angle from the meridian (rad) converted to one from the circumference, (-pi/2, pi/2]."""
    turned = float(np.arctan2(sense * np.cos(angle), -np.sin(angle)))
    turned -= np.pi * np.ceil(turned / np.pi - 0.5)
    return 0.0 if abs(turned) < 1e-12 else turned


def _sense(quads: Quads, chain: np.ndarray, laid: Laid, layer: Layer) -> int:
    """1 if the membranes run with the chain, -1 if against it."""
    points = quads.points[along(ends(quads, chain))]
    middles, steps = (points[1:] + points[:-1]) / 2, np.diff(points, axis=0)
    distance = np.linalg.norm(middles[:, None] - laid.middles, axis=2)
    with_it = (steps * laid.directions[distance.argmin(axis=1)]).sum(axis=1) > 0
    slanted = abs(np.sin(2 * np.radians(layer.angle))) > 1e-9
    if slanted and with_it.any() != with_it.all():
        raise InputError(
            f"{layer.place}: the membranes of {layer.elements} do not all run in one direction, so the angle "
            f"of {layer.name} is not clear: number their nodes from one end to the other"
        )
    return 1 if with_it.mean() > 0.5 else -1
