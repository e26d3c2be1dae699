"""The kinds of residual flexibility, by which a response represents its truncated modes.

A kind is declared here with all that others ask of it; `greens.responses.make_response` forms it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from tireroad.fem.errors import InputError


@dataclass(frozen=True)
class Residual:
    """One kind.

    `static`: the static flexibility of the truncated modes is added to the states' response; it
    responds at once, as a delta(t) or, of a `pulse`, as a pulse one step long (thesis (C.4));
    `joins`: the static shapes under the loads join the modes with their inertia, for which the modes
    are needed on all unknowns. A kind without either has the states alone.
    """

    static: bool = False
    pulse: bool = False
    joins: bool = False

    @property
    def solves(self) -> bool:
        """Whether the static problem of the rotating tire is solved for it."""
        return self.static or self.joins

    @property
    def of_free_rim(self) -> bool:
        """Whether it exists for a tire with a free rim, which has no static answer while it turns."""
        return not self.static


RESIDUALS: Mapping[str, Residual] = {
    "none": Residual(),
    "dirac": Residual(static=True, pulse=True),
    "static": Residual(static=True),
    "attachment": Residual(joins=True),
}


def residual_of(name: str) -> Residual:
    """The kind of this name. InputError for one that is unknown."""
    if name not in RESIDUALS:
        raise InputError(f'greens.residual = "{name}" is unknown: take {", ".join(RESIDUALS)}')
    return RESIDUALS[name]


def names(**asked: bool) -> str:
    """Names of the kinds with these properties, as `take` lists them in a message."""
    fit = [
        f'"{name}"'
        for name, kind in RESIDUALS.items()
        if all(getattr(kind, key) == value for key, value in asked.items())
    ]
    return " or ".join(fit[::-1])
