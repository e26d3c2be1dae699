"""Generates the key reference of the documentation from the scene's schema.

  ./tireroad python docs/scene_keys.py docs/keys.md

A test compares the file in the repository with the output.
"""

import sys
from collections.abc import Iterator
from dataclasses import Field, fields
from pathlib import Path

from tireroad.fem.parameters import Key
from tireroad.runs.scene.resolved import literal
from tireroad.runs.scene.schema import Variant, fields_of, key_of, table_of, variant_of
from tireroad.runs.scene.tables.scene import Scene

HEAD = """\
# Keys of a scene

All keys of a scene file with default, unit, range and meaning. The page is generated from the schema by
`./tireroad python docs/scene_keys.py docs/keys.md`; `tireroad check SCENE.toml` prints the same for the keys
of one scene, with their values. Times are in s, lengths in m, forces in N, stresses in Pa, speeds of rotation in
rad/s. An absent key has its default. A table marked "absent by default" is optional, and the stage that needs it
does not run without it. An unknown key is an error. In `--set` and in sweeps, tables that can be repeated are counted
from 0: `force.1.amplitude` belongs to the second `[[force]]`, `tire.cords.0.angle` to the first `[[tire.cords]]`.
"""
COLUMNS = "| key | default | unit | values | meaning |\n|---|---|---|---|---|\n"


def reference() -> str:
    """The whole page in Markdown."""
    return HEAD + "".join(_tables(Scene, "", "scene", False, {}))


def _tables(of: type, path: str, doc: str, many: bool, written: dict[type, str]) -> Iterator[str]:
    """A table of keys, its variants, its nested tables; one `written` before is only named."""
    name = f"`[[{path}]]`" if many else f"`[{path}]`" if path else "At the top"
    own = [(item, key_of(item)) for item in fields_of(of) if key_of(item)]
    yield f"\n## {name}\n\n{doc[0].upper()}{doc[1:]}.\n"
    if of in written:
        yield f"\nThe keys are those of `[{written[of]}]`.\n"
        return
    written[of] = path
    yield f"\n{COLUMNS}"
    yield from (_row(item, key) for item, key in own)
    for item in fields(of):
        part = variant_of(item)
        if part is not None:
            yield from _variants(part, path)
    for item in fields_of(of):
        table = table_of(item)
        if table is not None:
            inner = f"{path}.{item.name}" if path else item.name
            about = f"{table.doc}; absent by default" if table.optional else table.doc
            yield from _tables(table.of, inner, about, table.many, written)


def _variants(part: Variant, path: str) -> Iterator[str]:
    """The additional keys of each kind of a table."""
    for name in part.registry:
        own = [(item, key_of(item)) for item in fields(part.registry[name]) if key_of(item)]
        doc = part.registry.doc(name)
        yield f'\n### `{path}.{part.selector} = "{name}"`\n\n{doc[0].upper()}{doc[1:]}.\n'
        if own:
            yield f"\n{COLUMNS}"
            yield from (_row(item, key) for item, key in own)


def _row(item: Field, key: Key) -> str:
    default = "absent" if item.default is None else f"`{literal(item.default)}`"
    only = ""
    if key.only_for:
        selector, kinds = key.only_for
        only = f" (`{selector}` = {' or '.join(kinds)})"
    unit = "" if key.unit == "-" else key.unit
    cells = f"`{item.name}`", default, unit, key.allowed, f"{key.doc}{only}"
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference(), encoding="utf-8")
