"""Iterates over the tables of a scene and their keys, in all variants."""

from collections.abc import Iterator
from dataclasses import Field, fields
from typing import Any

from tireroad.fem.parameters import Key, key_of
from tireroad.runs.scene.schema import fields_of, table_of, variant_of


def names(of: type) -> list[str]:
    """The keys and tables that dataclass `of` has in every variant, in order."""
    return [item.name for item in fields_of(of) if variant_of(item) is None]


def every_field(of: type) -> dict[str, Field]:
    """The keys and tables that dataclass `of` has in any variant, by name."""
    found = {}
    for item in fields_of(of):
        part = variant_of(item)
        if part is None:
            found[item.name] = item
            continue
        for kind in part.registry:
            found = every_field(part.registry[kind]) | found
    return found


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
