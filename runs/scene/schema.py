"""The tables of a scene: dataclasses of parameters (fem.parameters), of tables, and of variants.

A table's fields are made by the functions of `fem.parameters` and by `table`, `tables`, `points`,
`registered` and `variant`. They are the only description of the scene: reading, writing, `check`, the
key reference and the error messages all come from them.

A variant is a class found in a registry by a key of the same table, e.g. the road by `road.kind`: its
parameters are keys of that table, and the scene holds an object of that class.
"""

from collections.abc import Iterator
from dataclasses import Field, dataclass, field, fields
from typing import Any

from tireroad.fem.keys import Key, Limits, described, finite, key_of
from tireroad.fem.parameters import (
    Parameters,
    choice,
    flag,
    integer,
    number,
    parameter,
    text,
    vector,
)
from tireroad.fem.registry import Registry


@dataclass(frozen=True)
class Table:
    """A nested table of dataclass `of`: `many` in an array, `optional` when it may be absent."""

    of: type
    doc: str
    optional: bool = False
    many: bool = False


@dataclass(frozen=True)
class Variant:
    """Parameters of the class that `registry` has under the value of the key `selector`."""

    selector: str
    registry: Registry


@dataclass(frozen=True)
class Pitch:
    """Distances (m) between the points of a regular grid, along x and along y."""

    dx: float
    dy: float


def points(doc: str, *, least: float, most: float) -> Any:
    """ "nodes", or the pitch { dx = ..., dy = ... } of a grid in m."""
    limits = Limits(least=least, most=most)

    def read(value: Any) -> str | Pitch:
        if value == "nodes" or isinstance(value, Pitch):
            return value
        if not isinstance(value, dict) or set(value) != {"dx", "dy"}:
            raise ValueError(
                f'must be "nodes" or {{ dx = 0.002, dy = 0.002 }}, not {described(value)}'
            )
        pitch = {}
        for name, given in value.items():
            try:
                pitch[name] = finite(given)
                limits.check(pitch[name], "m")
            except ValueError as error:
                raise ValueError(f"{name} {error}") from None
        return Pitch(**pitch)

    return parameter(
        Key(read=read, unit="m", doc=doc, values=f'"nodes" or {{dx, dy}}, {limits}', limits=limits),
        "nodes",
    )


def table(of: type, doc: str, *, optional: bool = False) -> Any:
    """A nested table; absent it is None where optional, else all its defaults."""
    meta = {"table": Table(of, doc, optional)}
    return (
        field(default=None, metadata=meta) if optional else field(default_factory=of, metadata=meta)
    )


def tables(of: type, doc: str) -> Any:
    """An array of tables, a tuple of `of`."""
    return field(default=(), metadata={"table": Table(of, doc, many=True)})


def registered(registry: Registry, default: str, doc: str) -> Any:
    """The name of a variant; which there are is looked up each time, as a user may register one."""

    def read(value: Any) -> str:
        if not isinstance(value, str) or value not in registry:
            raise ValueError(f"must be one of {', '.join(registry)}, not {described(value)}")
        return value

    return parameter(Key(read=read, doc=doc, choices=registry), default)


def variant(selector: str, registry: Registry) -> Any:
    """The parameters of the class named by the key `selector`; all its defaults where not given."""
    return field(default=None, metadata={"variant": Variant(selector, registry)})


class Variants(Parameters):
    """Base of tables with variants: puts the named class's defaults where none is given."""

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
                raise TypeError(f"{item.name} is no {part.selector} = {name}")


def table_of(item: Field) -> Table | None:
    """The nested table of a field, None where it is none."""
    return item.metadata.get("table")


def variant_of(item: Field) -> Variant | None:
    """The variant of a field, None where it is none."""
    return item.metadata.get("variant")


def names(of: type) -> list[str]:
    """The keys and tables that dataclass `of` has in every variant, in their order."""
    return [item.name for item in fields(of) if variant_of(item) is None]


def every_field(of: type) -> dict[str, Field]:
    """The keys and tables that dataclass `of` has in any variant, by name."""
    found = {}
    for item in fields(of):
        part = variant_of(item)
        if part is None:
            found[item.name] = item
            continue
        for kind in part.registry:
            found = every_field(part.registry[kind]) | found
    return found


def owners(of: type, name: str) -> tuple[str, list[str]] | None:
    """(selecting key, its values) of the variants that have a key; None where none has."""
    for item in fields(of):
        part = variant_of(item)
        kinds = part.registry.owners(name) if part else []
        if kinds:
            return part.selector, kinds
    return None


def entries(holder: Any) -> Iterator[tuple[Any, Field]]:
    """(object, field) of all keys and tables of a table, those of its variants in their place."""
    for item in fields(holder):
        if variant_of(item) is None:
            yield holder, item
        else:
            yield from entries(getattr(holder, item.name))


def walk(of: type, path: str = "") -> Iterator[tuple[str, type, Field, Key]]:
    """(dotted name, dataclass, field, description) of every key in every variant; [] marks arrays."""
    for item in fields(of):
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
    """Whether a key belongs to the kind that its table is."""
    return key.only_for is None or getattr(holder, key.only_for[0]) in key.only_for[1]


__all__ = [
    "Pitch",
    "Table",
    "Variant",
    "Variants",
    "applies",
    "choice",
    "entries",
    "every_field",
    "flag",
    "integer",
    "key_of",
    "names",
    "number",
    "owners",
    "points",
    "registered",
    "table",
    "table_of",
    "tables",
    "text",
    "variant",
    "variant_of",
    "vector",
    "walk",
]
