"""A numerical claim of the thesis, the program's value, and whether they agree."""

from __future__ import annotations

import math
from dataclasses import dataclass

RELATIONS = ("equal", "below", "above")
UNEXPLAINED = "the cause is not known"


@dataclass(frozen=True, kw_only=True)
class Claim:
    """One figure of the thesis against one of this program.

    `thesis`: the thesis's value; `source`: where it stands. `relation` of `found` to it: "equal"
    within `tolerance` (a share of the thesis's value; absolute if that is 0), "below" or "above" by
    more than that. `because`: the reason if they differ. `right`: the value by another method,
    named in `by`, if the thesis is wrong or has no number; `found` is compared with it at the same
    tolerance. Raises ValueError for values that cannot be compared.
    """

    what: str
    unit: str
    thesis: float
    source: str
    found: float
    relation: str = "equal"
    tolerance: float = 0.0
    because: str = ""
    right: float | None = None
    by: str = ""

    def __post_init__(self) -> None:
        if self.relation not in RELATIONS:
            raise ValueError(f"{self.what}: a relation is one of {', '.join(RELATIONS)}")
        if not 0 <= self.tolerance < math.inf or not math.isfinite(self.thesis):
            raise ValueError(f"{self.what}: a tolerance of 0 or more, and a finite value")
        if not self.source:
            raise ValueError(f"{self.what}: where does the thesis say so?")

    @property
    def agrees(self) -> bool:
        """Whether this program's value agrees with the thesis; a non-finite value never does."""
        margin = _margin(self.thesis, self.tolerance)
        if not math.isfinite(self.found):
            return False
        if self.relation == "equal":
            return bool(abs(self.found - self.thesis) <= margin)
        if self.relation == "below":
            return bool(self.found < self.thesis - margin)
        return bool(self.found > self.thesis + margin)

    @property
    def is_right(self) -> bool | None:
        """Whether this program's value agrees with another method; None if there is none."""
        if self.right is None:
            return None
        return bool(abs(self.found - self.right) <= _margin(self.right, self.tolerance))

    @property
    def verdict(self) -> str:
        """ "agrees", or "differs because ..."."""
        return "agrees" if self.agrees else f"differs because {self.because or UNEXPLAINED}"


def _margin(value: float, tolerance: float) -> float:
    return tolerance * (abs(value) or 1.0)


def verdict(claims: tuple[Claim, ...]) -> str:
    """Verdict on a whole figure: "agrees" if all its claims do, else how many differ."""
    off = sum(not claim.agrees for claim in claims)
    return "agrees" if not off else f"differs in {off} of {len(claims)}"
