"""A scene before its checks: the text of its file, and single keys overridden by --set."""

import tomllib
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.runs.scene import locate

LARGEST = 1_000_000


def read_text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
    except FileNotFoundError:
        raise InputError(f"{path}: no such scene file") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if len(data) > LARGEST:
        raise InputError(f"{path}: not a scene: more than {LARGEST / 1e6:g} MB")
    try:
        return data.decode("utf-8").removeprefix("\ufeff")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise InputError(f"{path}, line {line}: not UTF-8 text") from None


def _value(text: str) -> Any:
    """A value of --set: parsed as TOML if possible, else the text itself."""
    try:
        read = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return read["value"] if len(read) == 1 else text


def override(raw: dict[str, Any], item: str) -> tuple[str, ...]:
    """Apply one `table.key=value`; an empty value removes the key. Returns the key's path."""
    dotted, equals, value = item.partition("=")
    path = locate.parts(dotted)
    if not equals or not all(path):
        raise InputError(f"--set {item[:80]}: must be table.key=value, e.g. static.load=400")
    here: Any = raw
    at: Any  # a key of a table, or a number in an array of tables
    for depth, part in enumerate(path):
        last, at = depth == len(path) - 1, part
        if isinstance(here, list):
            if not part.isdigit() or int(part) >= len(here):
                name = ".".join(path[:depth])
                raise InputError(f"--set {dotted}: {name} has the numbers 0 to {len(here) - 1}")
            at = int(part)
        elif not isinstance(here, dict):
            raise InputError(f"--set {dotted}: {'.'.join(path[:depth])} is not a table")
        if not last:
            here = here[at] if isinstance(here, list) else here.setdefault(part, {})
        elif value.strip():
            here[at] = _value(value.strip())
        elif isinstance(here, list):
            del here[at]
        else:
            here.pop(part, None)
    return path
