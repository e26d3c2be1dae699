"""Drops keys of the file that are of no use to a variant chosen by --set.

A scene with `kind = "sine"` has the sine's keys. With `--set road.kind=flat` these would be errors,
and every one of them would have to be removed on the command line too.
"""

from collections.abc import Callable, Iterator, Set
from dataclasses import fields
from typing import Any

from tireroad.runs.scene.resolved import literal
from tireroad.runs.scene.schema import fields_of, key_of, table_of, variant_of
from tireroad.runs.scene.source import Path_, shortened
from tireroad.runs.scene.walk import every_field, names


def drop_unused(
    of: type, raw: Any, changed: Set[Path_], say: Callable[[str], object], path: Path_ = ()
) -> None:
    """Remove from `raw`, a table of dataclass `of`, what a variant chosen by --set does not use.

    `changed`: paths given by --set; their keys are kept, for the checks to refuse. `say` gets a
    line for each variant that lost keys.
    """
    if not isinstance(raw, dict):
        return
    for selector, kind, unused in _selected(of, raw):
        lost = [one for one in unused if one in raw and not _given((*path, one), changed)]
        if lost and (*path, selector) in changed:
            for name in lost:
                del raw[name]
            listed = ", ".join(shortened((*path, name)) for name in lost)
            verb = "is" if len(lost) == 1 else "are"
            say(f"{listed} {verb} not used with {selector} = {literal(kind)}, which --set chose")
    for name, item in every_field(of).items():
        table, inner = table_of(item), raw.get(name)
        if table is None:
            continue
        many = enumerate(inner) if isinstance(inner, list) else ()
        drop_unused(table.of, inner, changed, say, (*path, name))
        for number, one in many:
            drop_unused(table.of, one, changed, say, (*path, name, str(number)))


def _selected(of: type, raw: dict[str, Any]) -> Iterator[tuple[str, str, list[str]]]:
    """(selecting key, its value, keys of a table that this value does not use)."""
    defaults = {item.name: item.default for item in fields(of)}
    unused: dict[str, list[str]] = {}
    for item in fields_of(of):
        part, key = variant_of(item), key_of(item)
        if part is not None:
            kind = raw.get(part.selector, defaults[part.selector])
            if isinstance(kind, str) and kind in part.registry:
                law = part.registry[kind]
                own = {*names(of), *names(law)}
                others = [name for name in raw if name not in own and part.registry.owners(name)]
                yield part.selector, kind, [*others, *getattr(law, "without", ())]
        elif key is not None and key.only_for is not None:
            selector, kinds = key.only_for
            if raw.get(selector, defaults[selector]) not in kinds:
                unused.setdefault(selector, []).append(item.name)
    for selector, lost in unused.items():
        yield selector, raw.get(selector, defaults[selector]), lost


def _given(path: Path_, changed: Set[Path_]) -> bool:
    """Whether --set gave a key, a part of it, or the table that holds it."""
    return any(path[: len(one)] == one or one[: len(path)] == path for one in changed)
