"""What a key of a scene may hold: its type, unit, range and choices, and how a value is checked.

A table of a scene is a frozen dataclass whose fields are made by `number`, `integer`, `flag`,
`choice`, `text`, `vector`, `points`, `table` and `tables`. Those fields are the only description of the
scene: reading, writing, `check` and the error messages all come from them.
"""

import math
from collections.abc import Callable
from dataclasses import Field, dataclass, field, fields
from typing import Any


@dataclass(frozen=True)
class Key:
    """One key: how to read a value, what to show of it, and which kinds of its table have it.

    `only_for` holds (name of the selecting key, its values) where a key belongs to some kinds only.
    """

    read: Callable[[Any], Any]
    unit: str
    doc: str
    allowed: str
    optional: bool = False
    only_for: tuple[str, tuple[str, ...]] | None = None


@dataclass(frozen=True)
class Table:
    """A nested table of dataclass `of`: `many` in an array, `optional` when it may be absent."""

    of: type
    doc: str
    optional: bool = False
    many: bool = False


def described(value: Any) -> str:
    """A value as the user wrote it, short enough for a message."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value[:60]}"'
    if isinstance(value, dict):
        return "a table"
    return str(value)[:60]


def _finite(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"must be a number, not {described(value)}")
    try:
        result = float(value)
    except OverflowError:
        raise ValueError("is too large a number") from None
    if not math.isfinite(result):
        raise ValueError(f"must be a finite number, not {described(value)}")
    return result


def _limits(least: float | None, above: float | None, most: float | None, below: float | None):
    """The check of a range, and the range in words."""
    low = f"≥ {least:g}" if least is not None else f"> {above:g}" if above is not None else ""
    high = f"≤ {most:g}" if most is not None else f"< {below:g}" if below is not None else ""
    words = ", ".join(part for part in (low, high) if part) or "any"

    def check(value: float, unit: str) -> None:
        inside = (
            (least is None or value >= least)
            and (above is None or value > above)
            and (most is None or value <= most)
            and (below is None or value < below)
        )
        if not inside:
            shown = f"{value:g} {unit}".rstrip(" -")
            raise ValueError(f"must be {words}{f' {unit}' if unit != '-' else ''}, not {shown}")

    return check, words


def _make(key: Key, default: Any) -> Any:
    return field(default=default, metadata={"key": key})


def number(
    default: float | None,
    unit: str,
    doc: str,
    *,
    least: float | None = None,
    above: float | None = None,
    most: float | None = None,
    below: float | None = None,
    word: str | None = None,
    only_for: tuple[str, tuple[str, ...]] | None = None,
) -> Any:
    """A finite real number (an integer is one, a bool is not), or the one `word` where given.

    A default of None makes the key optional: it may be absent.
    """
    check, words = _limits(least, above, most, below)

    def read(value: Any) -> float | str:
        if word is not None and value == word:
            return word
        if word is not None and isinstance(value, str):
            raise ValueError(f'must be a number or "{word}", not {described(value)}')
        result = _finite(value)
        check(result, unit)
        return result

    allowed = f'{words} or "{word}"' if word else words
    return _make(Key(read, unit, doc, allowed, default is None, only_for), default)


def integer(default: int | None, doc: str, *, least: int, most: int, only_for=None) -> Any:
    """A whole number between least and most."""
    check, words = _limits(least, None, most, None)

    def read(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise ValueError(f"must be a whole number, not {described(value)}")
        check(value, "-")
        return value

    return _make(Key(read, "-", doc, words, default is None, only_for), default)


def flag(default: bool, doc: str, *, only_for=None) -> Any:
    """true or false."""

    def read(value: Any) -> bool:
        if not isinstance(value, bool):
            raise ValueError(f"must be true or false, not {described(value)}")
        return value

    return _make(Key(read, "-", doc, "true, false", False, only_for), default)


def choice(default: str | None, choices: tuple[str, ...], doc: str, *, only_for=None) -> Any:
    """One of a few words; a default of None makes the key optional."""
    words = ", ".join(choices)

    def read(value: Any) -> str:
        if value not in choices:
            raise ValueError(f"must be one of {words}, not {described(value)}")
        return value

    return _make(Key(read, "-", doc, words, default is None, only_for), default)


def text(default: str | None, doc: str, *, only_for=None) -> Any:
    """Any text that is not empty; a default of None makes the key optional."""

    def read(value: Any) -> str:
        if not isinstance(value, str) or not value.strip() or "\0" in value:
            raise ValueError(f"must be a text, not {described(value)}")
        return value

    return _make(Key(read, "-", doc, "text", default is None, only_for), default)


def vector(default: tuple[float, ...], unit: str, doc: str, *, least=None, most=None) -> Any:
    """A list of as many finite numbers as the default has."""
    size = len(default)
    check, words = _limits(least, None, most, None)

    def read(value: Any) -> tuple[float, ...]:
        if not isinstance(value, list | tuple) or len(value) != size:
            raise ValueError(f"must be a list of {size} numbers, not {described(value)}")
        result = tuple(_finite(part) for part in value)
        for part in result:
            check(part, unit)
        return result

    return _make(Key(read, unit, doc, f"{size} numbers, {words}", False, None), default)


@dataclass(frozen=True)
class Pitch:
    """Distances (m) between the points of a regular grid, along x and along y."""

    dx: float
    dy: float


def points(doc: str, *, above: float, most: float) -> Any:
    """ "nodes", or the pitch { dx = ..., dy = ... } of a grid in m."""
    check, words = _limits(None, above, most, None)

    def read(value: Any) -> str | Pitch:
        if value == "nodes":
            return "nodes"
        if not isinstance(value, dict) or set(value) != {"dx", "dy"}:
            raise ValueError(
                f'must be "nodes" or {{ dx = 0.002, dy = 0.002 }}, not {described(value)}'
            )
        pitch = Pitch(_finite(value["dx"]), _finite(value["dy"]))
        check(pitch.dx, "m")
        check(pitch.dy, "m")
        return pitch

    return _make(Key(read, "m", doc, f'"nodes" or {{dx, dy}}, {words}', False, None), "nodes")


def table(of: type, doc: str, *, optional: bool = False) -> Any:
    """A nested table; absent it is None where optional, else all its defaults."""
    meta = {"table": Table(of, doc, optional)}
    return (
        field(default=None, metadata=meta) if optional else field(default_factory=of, metadata=meta)
    )


def tables(of: type, doc: str) -> Any:
    """An array of tables, a tuple of `of`."""
    return field(default=(), metadata={"table": Table(of, doc, many=True)})


def key_of(item: Field) -> Key | None:
    return item.metadata.get("key")


def table_of(item: Field) -> Table | None:
    return item.metadata.get("table")


def names(of: type) -> list[str]:
    """The keys and tables that dataclass `of` has, in their order."""
    return [item.name for item in fields(of)]
