"""The table [sound]: microphones beside the tire, and the air around it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tireroad.fem.parameters import (
    Key,
    Limits,
    choice,
    described,
    finite,
    flag,
    number,
    parameter,
)
from tireroad.greens.absorbing_road import PorousLayer
from tireroad.runs.scene.schema import table

MICROPHONES = ("cpx", "obsi", "pass-by")
SQUEEZED = (
    700.0  # Hz: lower end of the first third octave in which the air of the footprint matters
)
HEARD = 1130.0  # Hz: the end of the third octave of 1 kHz


def _microphones() -> Any:
    """Names of `MICROPHONES`, and places of three coordinates."""
    limits = Limits(-1000.0, 1000.0)

    def read(value: Any) -> tuple[str | tuple[float, ...], ...]:
        if isinstance(value, str):
            value = (value,)
        if not isinstance(value, list | tuple) or not value:
            raise ValueError(f"must be a list of names and places, not {described(value)}")
        return tuple(one(part) for part in value)

    def one(part: Any) -> str | tuple[float, ...]:
        if isinstance(part, str):
            if part not in MICROPHONES:
                raise ValueError(
                    f"must be of {', '.join(MICROPHONES)} or [x, y, z], not {described(part)}"
                )
            return part
        if not isinstance(part, list | tuple) or len(part) != 3:
            raise ValueError(f"must be of names or places [x, y, z], not {described(part)}")
        place = tuple(finite(x) for x in part)
        for x in place:
            limits.check(x, "m")
        if place[2] < 0:
            raise ValueError(
                f"must be over the road, z ≥ 0 m: {described(list(place))} lies under it"
            )
        return place

    key = Key(
        read=read,
        unit="m",
        doc="microphones: cpx, the two mandatory ones of ISO 11819-2; obsi, the pairs of AASHTO T 360; pass-by, "
        "7.5 m beside; or x forward, y left along the axle, z over the road under the axle",
        values=f"names ({', '.join(MICROPHONES)}) or [x, y, z]",
    )
    return parameter(key, ("cpx",))


@dataclass(frozen=True)
class SoundTable:
    microphones: tuple[str | tuple[float, ...], ...] = _microphones()
    temperature: float = number(293.15, "K", "temperature of the air outside", least=200, most=350)
    up_to: float | None = number(
        None,
        "Hz",
        "highest frequency; absent: 0.8 of modal.up_to, at most 1130 Hz, the end of the third octave of 1 kHz",
        least=50,
        most=3000,
    )
    wheel: str = choice(
        "disc",
        ("disc", "open"),
        "disc: the wheel is closed on both sides; open: air passes through, between the beads lies the rim's barrel",
    )
    wheel_depth: float = number(
        0.0, "m", "depth of the wheel's discs behind the beads", least=0, most=0.2
    )
    leak: float = number(
        0.0,
        "m",
        "height of the contact over the acoustic plane: a gap that texture and grooves leave",
        least=0,
        most=0.02,
    )
    air: bool | None = flag(
        None,
        "with the air that tread and texture squeeze out of the footprint, over its edge and through its grooves; false: "
        f"the vibrations alone; absent: true where the sound reaches {SQUEEZED:g} Hz, below which they are 10 dB louder. Of contact points on a "
        "grid only",
    )
    road: PorousLayer | None = table(
        PorousLayer, "a road that absorbs: a porous layer; absent: rigid", optional=True
    )
