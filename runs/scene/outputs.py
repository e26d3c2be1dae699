"""Base of the kinds of output: own keys, and curves from the driven points or the contact.

A new kind is one file in runs.stages.outputs, or a class in a user's script. `[output]`, `check`,
the key reference and the range tests derive from it: a class without parameters is a switch,
`output.impulse = true`; one with parameters is a table, `[output.receptance]`.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from tireroad.fem.parameters import Parameters, Registry
from tireroad.runs.scene.schema import Where

Curves = dict[str, tuple[np.ndarray, str]]

MOST_FREQUENCIES = 1_000_000


class Output(Parameters):
    """Base class of the kinds of output.

    `of`: "points" for the driven points, which needs a [[force]], or "contact". `check` reports
    what a scene lacks; `curves` is given what the run computed at the points
    (runs.stages.response.Driven) and where to note figures (runs.stages.stage.Record). Their types are not imported: a scene knows nothing of the stages.
    """

    owner = "output"
    of: ClassVar[str] = "points"

    def check(self, scene: Any, path: tuple[str, ...], error: Where) -> None:
        """Raise error((*path, key), reason) if the rest of the scene does not allow this output."""

    def frequencies(self) -> int:
        """Number of frequencies at which responses between all driven points are computed."""
        return 0

    def numbers(self, points: int) -> int:
        """Values per time step that it adds to the file, for that many driven points."""
        return 0

    def curves(self, seen: Any, record: Any) -> Curves:
        """(values, unit) by name in response.h5; figures go into the record. Collective."""
        raise NotImplementedError


def check_steps(
    path: tuple[str, ...], what: str, to: float, step: float, unit: str, error: Where, *, most: int
) -> None:
    """Check that a step into a range from 0 gives at least one value and at most `most`."""
    if step > to:
        raise error(path, f"= {step:g} {unit} must not be more than to = {to:g} {unit}")
    if to / step > most:
        raise error(
            path,
            f"= {step:g} {unit} makes {to / step:.3g} {what} up to to = {to:g} {unit}, "
            f"more than {most}: take a larger step",
        )


OUTPUTS: Registry[Output] = Registry("output", "tireroad.runs.stages.outputs", Output)
