"""The resolved scene as text: every default written out, with unit and meaning of each key."""

import json
import tomllib
from math import isfinite
from typing import Any

from tireroad.fem.parameters import Key
from tireroad.runs.files.names import HEADER
from tireroad.runs.scene.schema import Pitch, applies, entries, key_of, table_of
from tireroad.runs.scene.tables.scene import Scene


def literal(value: Any) -> str:
    """A value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple | list):
        return f"[{', '.join(literal(part) for part in value)}]"
    if isinstance(value, dict):
        pairs = (f"{literal(key)} = {literal(part)}" for key, part in value.items())
        return f"{{ {', '.join(pairs)} }}"
    if isinstance(value, Pitch):
        return f"{{ dx = {literal(value.dx)}, dy = {literal(value.dy)} }}"
    if isinstance(value, float):
        text = repr(value)
        return text if "." in text or "e" in text or not isfinite(value) else f"{text}.0"
    return str(value)


def note(key: Key) -> str:
    """Unit, range and meaning of a key, as a comment."""
    unit = "" if key.unit == "-" else key.unit
    return "; ".join(part for part in (unit, key.allowed, key.doc) if part)


def _lines(holder: Any, path: str) -> list[str]:
    """The keys of one table, then its nested tables."""
    own, below = [], []
    for owner, item in entries(holder):
        value = getattr(owner, item.name)
        part = table_of(item)
        inner = f"{path}.{item.name}" if path else item.name
        if part is None:
            key = key_of(item)
            if not applies(key, owner):
                continue
            if value is None:
                own.append(f"# {item.name} absent  # {note(key)}")
            else:
                own.append(f"{item.name} = {literal(value)}  # {note(key)}")
        elif part.many:
            for one in value:
                below += ["", f"[[{inner}]]  # {part.doc}", *_lines(one, inner)]
        elif value is None:
            below += ["", f"# [{inner}] absent: {part.doc}"]
        else:
            below += ["", f"[{inner}]  # {part.doc}", *_lines(value, inner)]
    return own + below


def as_toml(table: Any) -> dict[str, Any]:
    """One table of a scene as TOML has it."""
    return tomllib.loads("\n".join(["[table]", *_lines(table, "table")]))["table"]


def dumps(scene: Scene) -> str:
    """The scene as TOML; `load` reads it back to an equal scene."""
    return "\n".join([HEADER, *_lines(scene, "")]) + "\n"
