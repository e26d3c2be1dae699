"""Cord angles in three-dimensional membranes, converted to angles from the section's meridian.

In a membrane the angle is measured from the local first direction 1 about the normal n: the cord
lies along cos a e_1 + sin a (n x e_1). Two systems are the same at every angle around: the default
one if x is the axle, where e_1 is the projection of global x (the meridian m towards larger x), and
a cylindrical one about the axle with its first axis as normal, where e_1 is e_theta. With n x m = s
e_theta, s = 1 or -1, the angle from m towards e_theta is s a in the first; in the second, as n x
e_theta = -s m, it is atan2(cos a, -s sin a).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tireroad.fem.decks.deck import Deck, Layer


def meridian_layers(deck: Deck, senses: dict[int, int], axis: int) -> tuple[Layer, ...]:
    """The layers with angles from the meridian, for lines that run to larger axial coordinates.

    `senses` is s for each membrane. Raises InputError for systems that vary around the axle.
    """
    return tuple(_layer(deck, layer, senses, axis) for layer in deck.layers)


def _layer(deck: Deck, layer: Layer, senses: dict[int, int], axis: int) -> Layer:
    labels = deck.element_sets.labels(layer.elements, layer.place).tolist()
    found = {senses[label] for label in labels if label in senses}
    if not found:
        return layer
    circumferential = _from_circumference(deck, layer, axis)
    angle = np.radians(layer.angle)
    slanted = abs(np.sin(2 * angle)) > 1e-9
    if len(found) > 1 and slanted:
        raise layer.place.error(
            f"the normals of the membranes of {layer.elements} do not all point to one side, so the angle of "
            f"{layer.name} is not clear"
        )
    sense = found.pop()
    if circumferential:
        angle = np.arctan2(
            circumferential * np.cos(angle), -sense * np.sin(angle) * circumferential
        )
    else:
        angle = sense * angle
    return replace(layer, angle=float(np.degrees(angle)))


def _from_circumference(deck: Deck, layer: Layer, axis: int) -> int:
    """0: angle from the meridian; 1 or -1: cylindrical system, axis along or against the axle."""
    if not layer.orientation:
        if axis == 0:
            return 0
        raise layer.place.error(
            f"cords {layer.name}: without ORIENTATION= their angle counts from the projection of x, which is "
            f"not the same around the axle {'xyz'[axis]}: give a cylindrical *ORIENTATION"
        )
    system = deck.orientations.get(layer.orientation)
    if system is None:
        raise layer.place.error(f"there is no *ORIENTATION, NAME={layer.orientation}")
    line = np.array(system.points[3:]) - np.array(system.points[:3])
    off = np.delete(np.array(system.points[:3]), axis)
    length = np.abs(line).max()
    about = length > 0 and np.abs(np.delete(line, axis)).max() < 1e-6 * length
    if not (system.system in ("CYLINDRICAL", "C") and about and not off.any()) or system.axis != 1:
        raise system.place.error(
            f"the system of cords {layer.name} must be cylindrical about the axle {'xyz'[axis]} with axis 1 as "
            "normal, so that their angle counts from the circumference"
        )
    if system.turn:
        raise system.place.error("a system with a further turn about its normal is not read")
    return 1 if line[axis] > 0 else -1
