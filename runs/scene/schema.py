"""The schema of a scene: dataclasses of parameters (fem.parameters), of tables, and of variants.

A table's fields are made by the functions of `fem.parameters` and by `table`, `tables`, `points`,
`registered` and `variant`. They are the only description of the scene: reading, writing, `check`,
the key reference and the error messages all derive from them.

A variant is a class selected from a registry by a key of the same table, e.g. the road by
`road.kind`: its parameters are keys of that table, and the scene holds an object of that class. A
collection has one key per class of a registry, e.g. `output.impulse`: a switch, or a table if the
class has parameters.

A `Source` holds the origin of a scene's values, the line of each, and collects all problems.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import Field, dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import (
    Key,
    Limits,
    Parameters,
    Registry,
    choice,
    described,
    finite,
    flag,
    integer,
    key_of,
    number,
    parameter,
    text,
    vector,
)

HEADER = re.compile(r"^\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$")
ASSIGNMENT = re.compile(r"""^\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*[^\s=.]+)*)\s*=""")
Path_ = tuple[str, ...]
Where = Callable[[Path_, str], InputError]  # the error of a key, with its place in the file
_SHOWN = 30
P = TypeVar("P", bound=Parameters)

__all__ = [
    "Collection",
    "Collects",
    "Pitch",
    "Table",
    "Variant",
    "Variants",
    "choice",
    "collection",
    "fields_of",
    "flag",
    "gathered",
    "integer",
    "key_of",
    "number",
    "points",
    "registered",
    "table",
    "table_of",
    "tables",
    "text",
    "variant",
    "variant_of",
    "vector",
]


def parts(dotted: str) -> tuple[str, ...]:
    """The parts of a dotted key, without quotes and blanks."""
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def _paths(text: str) -> list[tuple[int, tuple[str, ...]]]:
    """Every header and assignment with its line number (from 1) and full path."""
    paths: list[tuple[int, tuple[str, ...]]] = []
    here: tuple[str, ...] = ()
    counts: dict[tuple[str, ...], int] = {}
    quoted = ""
    for line_number, line in enumerate(text.splitlines(), 1):
        if quoted:
            quoted = "" if quoted in line else quoted
            continue
        if match := HEADER.match(line):
            here = parts(match[2])
            if match[1] == "[[":
                counts[here] = counts.get(here, -1) + 1
                here = (*here, str(counts[here]))
            paths.append((line_number, here))
        elif match := ASSIGNMENT.match(line):
            paths.append((line_number, here + parts(match[1])))
            opened = [mark for mark in ('"""', "'''") if line.count(mark) == 1]
            quoted = opened[0] if opened else ""
    return paths


def line_of(text: str, path: tuple[str, ...]) -> int | None:
    """The line of `path` (table, …, key), or of the innermost table that contains it.

    A list of tables is where its first one is.
    """
    best: tuple[int, int] | None = None
    for line_number, place in _paths(text):
        if place == (*path, "0"):
            place = path
        if path[: len(place)] == place and (best is None or len(place) > best[1]):
            best = (line_number, len(place))
    return best[0] if best else None


@dataclass(frozen=True)
class Source:
    """The file, its text and the paths set by --set; `problems`: (path of the key, message).

    `unread`: the keys of files that the run will not read."""

    path: Path
    text: str
    overridden: frozenset[Path_] = frozenset()
    problems: list[tuple[Path_, str]] = field(default_factory=list)
    unread: frozenset[Path_] = frozenset()

    def where(self, path: Path_) -> str:
        """The file and line of a key, or the --set that gave it."""
        for length in range(len(path), 0, -1):
            if path[:length] in self.overridden:
                return f"--set {shortened(path[:length])}"
        if line := line_of(self.text, path):
            return f"{self.path}, line {line}"
        below = (given_path for given_path in self.overridden if given_path[: len(path)] == path)
        return f"--set {shortened(least)}" if (least := min(below, default=())) else f"{self.path}"

    def add(self, path: Path_, message: str) -> None:
        """Note a problem with a key."""
        self.problems.append((path, f"{self.where(path)}: {shortened(path)} {message}"))

    def add_as_is(self, path: Path_, message: str) -> None:
        """Note a problem whose message names the key itself."""
        self.problems.append((path, f"{self.where(path)}: {message}"))

    def error(self, path: Path_, message: str) -> InputError:
        """A single problem, as an exception."""
        return InputError(f"{self.where(path)}: {shortened(path)} {message}")

    def broken(self) -> set[str]:
        """The tables that have a problem."""
        return {path[0] for path, _ in self.problems if path}

    def refuse(self) -> None:
        """Raise InputError with all problems, if there are any."""
        messages = list(dict.fromkeys(message for _, message in self.problems))
        if len(messages) == 1:
            raise InputError(messages[0])
        if messages:
            listed = "\n".join(f"  {message}" for message in messages[:_SHOWN])
            more = len(messages) - _SHOWN
            rest = f"\n  and {more} more" if more > 0 else ""
            raise InputError(f"{len(messages)} errors in the scene\n{listed}{rest}")


def shortened(path: Path_) -> str:
    """A dotted key; parts too long to be valid keys are truncated."""
    return ".".join(part if len(part) <= 60 else f"{part[:57]}..." for part in path[:12])


@dataclass(frozen=True)
class Table:
    """A nested table of dataclass `of`; `many`: an array of tables; `optional`: may be absent."""

    of: type
    doc: str
    optional: bool = False
    many: bool = False


@dataclass(frozen=True)
class Variant:
    """Parameters of the class registered in `registry` under the value of the key `selector`."""

    selector: str
    registry: Registry


@dataclass(frozen=True)
class Collection:
    """One key per class of `registry`, by name."""

    registry: Registry

    def fields(self) -> Iterator[Field]:
        """Dataclass fields: a switch for a class without parameters, else an optional table."""
        for name in self.registry:
            of, doc = self.registry[name], self.registry.doc(name)
            item = table(of, doc, optional=True) if fields(of) else flag(False, doc)
            item.name = name
            yield item

    def gathered(self, values: dict[str, Any]) -> tuple[tuple[str, Any], ...]:
        """(name, object) for each key that is switched on or given as a table."""
        on = {name: value for name, value in values.items() if value not in (None, False)}
        return tuple(
            (name, self.registry[name]() if value is True else value) for name, value in on.items()
        )


@dataclass(frozen=True)
class Pitch:
    """Distances (m) between the points of a regular grid, along x and along y."""

    dx: float
    dy: float


def points(doc: str, *, least: float, most: float) -> Any:
    """A key for contact points: "nodes", "auto", or the pitch { dx = ..., dy = ... }, m."""
    limits = Limits(least=least, most=most)

    def read(value: Any) -> str | Pitch:
        if isinstance(value, Pitch) or (isinstance(value, str) and value in ("nodes", "auto")):
            return value
        if not isinstance(value, dict) or set(value) != {"dx", "dy"}:
            raise ValueError(
                f'must be "nodes", "auto" or {{ dx = 0.002, dy = 0.002 }}, not {described(value)}'
            )
        pitch = {}
        for name, length in value.items():
            try:
                pitch[name] = finite(length)
                limits.check(pitch[name], "m")
            except ValueError as error:
                raise ValueError(f"{name} {error}") from None
        return Pitch(**pitch)

    return parameter(
        Key(
            read=read,
            unit="m",
            doc=doc,
            values=f'"nodes", "auto" or {{dx, dy}}, {limits}',
            limits=limits,
        ),
        "auto",
    )


def table(of: type, doc: str, *, optional: bool = False) -> Any:
    """A nested table; if absent, None when optional, else all its defaults."""
    meta = {"table": Table(of, doc, optional)}
    return (
        field(default=None, metadata=meta) if optional else field(default_factory=of, metadata=meta)
    )


def tables(of: type, doc: str) -> Any:
    """An array of tables, as a tuple of `of`."""
    return field(default=(), metadata={"table": Table(of, doc, many=True)})


def registered(registry: Registry, default: str, doc: str) -> Any:
    """The name of a variant; the registry is read on each use, because a user may register more."""

    def read(value: Any) -> str:
        if not isinstance(value, str) or value not in registry:
            raise ValueError(f"must be one of {', '.join(registry)}, not {described(value)}")
        return value

    return parameter(Key(read=read, doc=doc, choices=registry), default)


def variant(selector: str, registry: Registry) -> Any:
    """The parameters of the class selected by the key `selector`; all its defaults if not given."""
    return field(default=None, metadata={"variant": Variant(selector, registry)})


def collection(registry: Registry) -> Any:
    """A tuple of (name, object), one per class of the registry that the scene has a key for."""
    return field(default=(), metadata={"collection": Collection(registry)})


class Collects(Parameters):
    """Base of tables with a collection: its names are also attributes, as the scene has them."""

    def __getattr__(self, name: str) -> Any:
        for item in fields(self):
            part = collection_of(item)
            if part is None or name.startswith("_") or name not in part.registry:
                continue
            absent = None if fields(part.registry[name]) else False
            value = dict(getattr(self, item.name)).get(name, absent)
            return absent is False and value is not False or value
        raise AttributeError(f"{type(self).__name__} has no {name}")


def collection_of(item: Field) -> Collection | None:
    """The collection of a field, or None."""
    return item.metadata.get("collection")


def fields_of(of: Any) -> Iterator[Field]:
    """The fields of a dataclass or its instance, with those of its collections in their place."""
    for item in fields(of):
        part = collection_of(item)
        yield from part.fields() if part else [item]


def gathered(of: type, values: dict[str, Any]) -> dict[str, Any]:
    """Constructor arguments from values by key; values of a collection are combined."""
    rest = dict(values)
    for item in fields(of):
        if part := collection_of(item):
            own = {name: rest.pop(name) for name in part.registry if name in rest}
            rest[item.name] = part.gathered(own)
    return rest


class Variants(Parameters):
    """Base of tables with variants: fills in the selected class's defaults if none is given."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for item in fields(self):
            part = variant_of(item)
            if part is None:
                continue
            name = getattr(self, part.selector)
            if getattr(self, item.name) is None:
                object.__setattr__(self, item.name, part.registry[name]())
            elif not isinstance(getattr(self, item.name), part.registry[name]):
                raise TypeError(f"{item.name} is not a {part.selector} = {name}")


def table_of(item: Field) -> Table | None:
    """The nested table of a field, or None."""
    return item.metadata.get("table")


def variant_of(item: Field) -> Variant | None:
    """The variant of a field, or None."""
    return item.metadata.get("variant")


def names(of: type) -> list[str]:
    """The keys and tables that dataclass `of` has in every variant, in order."""
    return [item.name for item in fields_of(of) if variant_of(item) is None]


def every_field(of: type) -> dict[str, Field]:
    """The keys and tables that dataclass `of` has in any variant, by name."""
    items = {}
    for item in fields_of(of):
        part = variant_of(item)
        if part is None:
            items[item.name] = item
            continue
        for kind in part.registry:
            items = every_field(part.registry[kind]) | items
    return items


def owners(of: type, name: str) -> tuple[str, list[str]] | None:
    """(selecting key, its values) of the variants that have a key; None if none has."""
    for item in fields(of):
        part = variant_of(item)
        kinds = part.registry.owners(name) if part else []
        if kinds:
            return part.selector, kinds
    return None


def entries(holder: Any) -> Iterator[tuple[Any, Field]]:
    """(object, field) of all keys and tables of a table, those of its variants in their place."""
    for item in fields_of(holder):
        if variant_of(item) is None:
            yield holder, item
        else:
            yield from entries(getattr(holder, item.name))


def walk(of: type, path: str = "") -> Iterator[tuple[str, type, Field, Key]]:
    """(dotted name, dataclass, field, key) of every key in every variant; [] marks arrays."""
    for item in fields_of(of):
        name = f"{path}.{item.name}" if path else item.name
        part, kinds, key = table_of(item), variant_of(item), key_of(item)
        if part is not None:
            yield from walk(part.of, f"{name}[]" if part.many else name)
        elif kinds is not None:
            for kind in kinds.registry:
                yield from walk(kinds.registry[kind], path)
        elif key is not None:
            yield name, of, item, key


def applies(key: Key, holder: Any) -> bool:
    """Whether a key applies to the kind selected in its table."""
    return key.only_for is None or getattr(holder, key.only_for[0]) in key.only_for[1]
