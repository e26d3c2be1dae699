"""The table [pattern] of the tread, and incompatible settings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Limits, filename, numbers
from tireroad.runs.scene.schema import choice, integer, number, tables, vector

if TYPE_CHECKING:
    from tireroad.runs.scene.tables.scene import Scene

Where = Callable[[tuple[str, ...], str], InputError]


@dataclass(frozen=True)
class Groove:
    direction: str = choice(
        "lateral",
        ("lateral", "circumferential"),
        "lateral: one in each pitch; circumferential: around the tire",
    )
    position: float = number(
        0.0,
        "-",
        "position in its pitch, 0 to 1; of a circumferential groove y in m",
        least=-1,
        most=1,
    )
    width: float = number(0.004, "m", "width between the middles of the flanks", least=1e-6, most=1)
    depth: float = number(0.008, "m", "depth under the outer face", least=1e-6, most=0.1)
    flank: float = number(
        0.001,
        "m",
        "width of a flank, over which the groove reaches its depth",
        least=1e-5,
        most=0.1,
    )
    angle: float = number(
        0.0,
        "deg",
        "angle of a lateral groove to the direction of the axle; positive: its right side (y < 0) enters the "
        "footprint first",
        least=-80,
        most=80,
    )
    span: tuple[float, float] = vector(
        (-1.0, 1.0), "m", "range of y covered by a lateral groove", least=-10, most=10
    )


@dataclass(frozen=True)
class PatternTable:
    pitches: int = integer(
        60, "number of pitches around the tire, for the lateral grooves", least=1, most=2000
    )
    pitch_lengths: tuple[float, ...] = numbers(
        "relative lengths of the pitches, in random order; one value: all equal",
        "-",
        Limits(least=0.2, most=5),
        (1.0,),
    )
    seed: int = integer(1, "seed of their random order", least=0, most=2**31)
    file: str | None = filename(
        "depths in place of grooves: .npz with depth (n, m) m around the tire and y (m) m, or an image (.png) from "
        "white, the outer face, to black, the full depth, its width around the tire"
    )
    depth: float = number(
        0.008, "m", "depth that black stands for in an image", least=1e-6, most=0.1
    )
    width: float = number(0.15, "m", "width of an image, across the tire", least=1e-6, most=10)
    groove: tuple[Groove, ...] = tables(Groove, "a groove of the tread")


def check_pattern(scene: Scene, raw: dict[str, Any], error: Where) -> None:
    """Raise an error for an invalid pattern, or for one without a grid that resolves it."""
    wanted = scene.pattern
    if wanted is None:
        return
    if scene.contact is None or scene.contact.on_nodes:
        raise error(
            ("pattern",), "needs [contact] on a grid that sees it: contact.points = { dx, dy } (m)"
        )
    if bool(wanted.groove) == (wanted.file is not None):
        raise error(("pattern",), "needs either [[pattern.groove]] or file")
    if not wanted.pitch_lengths:
        raise error(("pattern", "pitch_lengths"), "must have one number at least")
    for number_, groove in enumerate(wanted.groove):
        if groove.span[0] >= groove.span[1]:
            raise error(("pattern", "groove", str(number_), "span"), "must ascend")
