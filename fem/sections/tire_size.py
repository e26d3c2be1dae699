"""Sizes of passenger tires like 205/60 R15."""

from __future__ import annotations

import re
from dataclasses import dataclass

from tireroad.fem.errors import InputError

_SIZE = re.compile(r"\s*(\d{3})\s*/\s*(\d{2})\s*Z?R\s*(\d{2})\s*", re.IGNORECASE)


@dataclass(frozen=True)
class Size:
    """Section `width`, section `height` and `rim` radius, all in m."""

    width: float
    height: float
    rim: float


def size(text: str) -> Size:
    """Parse 205/60 R15: section width in mm, height over width in %, rim diameter in inches.

    Raises InputError for another format or a size out of range."""
    found = _SIZE.fullmatch(text)
    if not found:
        raise InputError(f'tire.size = "{text[:40]}": must be like "205/60 R15"')
    width, ratio, inches = (int(part) for part in found.groups())
    if not (125 <= width <= 355 and 25 <= ratio <= 85 and 10 <= inches <= 24):
        raise InputError(
            f'tire.size = "{text[:40]}": from 125 to 355 mm wide, 25 to 85 % high, on rims of 10 to 24 inches'
        )
    return Size(width / 1e3, width * ratio / 1e5, inches * 0.0254 / 2)
