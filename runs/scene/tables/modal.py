"""The table [modal]: which modes are extracted."""

from dataclasses import dataclass
from typing import Any

from tireroad.fem.parameters import choice, integer, number


@dataclass(frozen=True)
class Modal:
    count: int = integer(500, "number of modes, from the lowest", least=1, most=100000)
    up_to: float | None = number(
        None, "Hz", "all modes below this frequency, instead of count", least=1e-3, most=1e6
    )
    rim: str = choice(
        "fixed",
        ("fixed", "free"),
        "bead faces: fixed, or one massless rigid body that is free",
    )
    road: str = choice(
        "forces",
        ("forces", "held"),
        "road in the modes: replaced by its static forces, or the touching nodes held in height",
    )

    @property
    def on_axle_alone(self) -> bool:
        """Whether the axle alone carries what acts on the tire: its rim is fixed, no other node is held."""
        return (self.rim, self.road) == ("fixed", "forces")

    @property
    def asked(self) -> dict[str, Any]:
        """`count` or `up_to` (Hz), whichever decides; the other is None."""
        return {"count": None if self.up_to else self.count, "up_to": self.up_to}
