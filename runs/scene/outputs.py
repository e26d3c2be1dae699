"""What a kind of output is: its own keys, and the curves that follow from the driven points or the contact.

A new kind is one file in runs.stages.outputs, or a class in a user's own script. `[output]`, `check`, the key
reference and the range tests follow from it: a class without parameters is a switch, `output.impulse = true`,
one with parameters a table, `[output.receptance]`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Parameters
from tireroad.fem.registry import Registry

if TYPE_CHECKING:
    from tireroad.runs.scene.tables.scene import Scene
    from tireroad.runs.stages.base.record import Record
    from tireroad.runs.stages.build.driven import Driven

Curves = dict[str, tuple[np.ndarray, str]]
Where = Callable[[tuple[str, ...], str], InputError]

MOST_FREQUENCIES = 1_000_000


class Output(Parameters):
    """Base of the kinds of output.

    `of`: whether it is of the driven "points", hence needs a [[force]], or of the "contact"; `in_contact`: whether
    a scene with [contact] can have it. `check` says what a scene lacks.
    """

    owner = "output"
    of: ClassVar[str] = "points"
    in_contact: ClassVar[bool] = True

    def check(self, scene: Scene, path: tuple[str, ...], error: Where) -> None:
        """Raise error((*path, key), reason) where the rest of the scene does not go with it."""

    def frequencies(self) -> int:
        """Number of frequencies at which all driven points answer to each other."""
        return 0

    def numbers(self, points: int) -> int:
        """Numbers that each time step adds to the file, with so many driven points."""
        return 0

    def curves(self, seen: Driven, record: Record) -> Curves:
        """(values, unit) by the name in response.h5; figures for the reader go to the record. Collective."""
        raise NotImplementedError


def check_steps(
    path: tuple[str, ...], what: str, to: float, step: float, unit: str, error: Where, *, most: int
) -> None:
    """A step into a range from 0 that makes neither none nor too many of what is counted."""
    if step > to:
        raise error(path, f"= {step:g} {unit} must not be more than to = {to:g} {unit}")
    if to / step > most:
        raise error(
            path,
            f"= {step:g} {unit} makes {to / step:.3g} {what} up to to = {to:g} {unit}, "
            f"more than {most}: take a larger step",
        )


OUTPUTS: Registry[Output] = Registry("output", "tireroad.runs.stages.outputs", Output)
