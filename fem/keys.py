"""Description of one parameter: unit, meaning and range, and how a value is read.

All packages may import this module; it needs only the standard library.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import Field, dataclass, fields
from numbers import Integral, Real
from typing import Any

OnlyFor = tuple[str, tuple[str, ...]] | None


@dataclass(frozen=True)
class Limits:
    """A closed range; None: no limit. The lower limit of a size is the least sensible value."""

    least: float | None = None
    most: float | None = None

    def __str__(self) -> str:
        low = f"≥ {self.least:g}" if self.least is not None else ""
        high = f"≤ {self.most:g}" if self.most is not None else ""
        return ", ".join(part for part in (low, high) if part) or "any"

    def check(self, value: float, unit: str) -> None:
        """Raises ValueError for a value outside the range."""
        inside = (self.least is None or value >= self.least) and (
            self.most is None or value <= self.most
        )
        if not inside:
            # The "g" format overflows for very large integers.
            written = f"{value:g}" if isinstance(value, float) else described(value)
            shown = f"{written} {unit}".rstrip(" -")
            raise ValueError(f"must be {self}{f' {unit}' if unit != '-' else ''}, not {shown}")


@dataclass(frozen=True, kw_only=True)
class Key:
    """One parameter: how to read a value, its unit, meaning and allowed values.

    `values` describes in words what is allowed, unless `choices` lists the allowed words; `limits`:
    range of numbers; `optional`: may be absent (None); `is_file`: a file name; `is_whole`: an integer;
    `only_for`: (name of the selecting key, its values) for a parameter that only some kinds of its
    table have.
    """

    read: Callable[[Any], Any]
    unit: str = "-"
    doc: str
    values: str = ""
    optional: bool = False
    only_for: OnlyFor = None
    limits: Limits | None = None
    choices: Iterable[str] = ()
    is_file: bool = False
    is_whole: bool = False

    @property
    def allowed(self) -> str:
        """The allowed values, in words."""
        return self.values or ", ".join(self.choices)


def key_of(item: Field) -> Key | None:
    """The description of a field; None if it is not a parameter."""
    return item.metadata.get("key")


def keys(of: type) -> Iterator[tuple[Field, Key]]:
    """The parameters of a dataclass, in order."""
    for item in fields(of):
        key = key_of(item)
        if key is not None:
            yield item, key


def described(value: Any) -> str:
    """A value as the user wrote it, shortened for a message."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value[:60]}"'
    if isinstance(value, dict):
        return "a table"
    return str(value)[:60]


def whole(value: Any) -> int:
    """A whole number, also of numpy, as an int (not bool); else raises ValueError."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise ValueError(f"must be a whole number, not {described(value)}")
    return int(value)


def finite(value: Any) -> float:
    """A finite real number, also of numpy, as a float (not bool); else raises ValueError."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ValueError(f"must be a number, not {described(value)}")
    try:
        result = float(value)
    except OverflowError:
        raise ValueError("is too large a number") from None
    if not math.isfinite(result):
        raise ValueError(f"must be a finite number, not {described(value)}")
    return result
