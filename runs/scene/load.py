"""A scene: read from TOML, checked in full, written back with every default.

`load` ends with a `Scene` in which every value has its type and lies in its range and no two tables
contradict each other, or with one InputError that names the key, where it stands and what to do.
"""

import difflib
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.runs.scene import locate, rules
from tireroad.runs.scene.schema import Key, Table, described, key_of, names, table_of
from tireroad.runs.scene.tables import Scene
from tireroad.runs.scene.tire_section import with_elements

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,99}")
LARGEST = 1_000_000


@dataclass(frozen=True)
class Source:
    """Where the values come from, for messages: the file, its text, the paths set by --set."""

    path: Path
    text: str
    overridden: frozenset[tuple[str, ...]] = frozenset()

    def where(self, path: tuple[str, ...]) -> str:
        for length in range(len(path), 0, -1):
            if path[:length] in self.overridden:
                return f"--set {'.'.join(path[:length])}"
        line = locate.line_of(self.text, path)
        return f"{self.path}, line {line}" if line else f"{self.path}"

    def error(self, path: tuple[str, ...], message: str) -> InputError:
        return InputError(f"{self.where(path)}: {'.'.join(path)} {message}")


def load(path: Path | str, overrides: Sequence[str] = ()) -> Scene:
    """The scene of a file with `overrides` ("table.key=value", as of --set) laid over it.

    Raises InputError for all that is wrong with it. Not collective; reads one file.
    """
    path = Path(path)
    text = _text(path)
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None
    except RecursionError:
        raise InputError(f"{path}: not a scene: tables nested too deep") from None
    changed = frozenset(_override(raw, item) for item in overrides)
    source = Source(path, text, changed)
    raw.setdefault("name", re.sub(r"[^A-Za-z0-9._-]", "-", path.stem).lstrip(".-") or "scene")
    rules.refuse_later(raw, source.error)
    scene = _table(Scene, raw, (), source)
    if not NAME.fullmatch(scene.name):
        raise source.error(
            ("name",), f"must be letters, digits, '.', '_', '-', not {described(scene.name)}"
        )
    scene = with_elements(_with_road_file(scene, source))
    rules.check(scene, raw, source.error)
    return scene


def _text(path: Path) -> str:
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
    """A value of --set: TOML where it is TOML, else the text itself."""
    try:
        read = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return text
    return read["value"] if len(read) == 1 else text


def _override(raw: dict[str, Any], item: str) -> tuple[str, ...]:
    """Lay one `table.key=value` over the raw scene; an empty value takes the key away."""
    dotted, equals, value = item.partition("=")
    path = locate.parts(dotted)
    if not equals or not all(path):
        raise InputError(f"--set {item}: must be table.key=value, e.g. static.load=400")
    here: Any = raw
    for depth, part in enumerate(path):
        last = depth == len(path) - 1
        if isinstance(here, list):
            if not part.isdigit() or int(part) >= len(here):
                name = ".".join(path[:depth])
                raise InputError(f"--set {dotted}: {name} has the numbers 0 to {len(here) - 1}")
            part = int(part)
        elif not isinstance(here, dict):
            raise InputError(f"--set {dotted}: {'.'.join(path[:depth])} is not a table")
        if not last:
            here = here[part] if isinstance(here, list) else here.setdefault(part, {})
        elif value.strip():
            here[part] = _value(value.strip())
        elif isinstance(here, list):
            del here[part]
        else:
            here.pop(part, None)
    return path


def _table(of: type, raw: Any, path: tuple[str, ...], source: Source) -> Any:
    """Dataclass `of` from a raw table: unknown keys, then values, then keys of other kinds."""
    if not isinstance(raw, dict):
        raise source.error(path, f"must be a table, not {described(raw)}")
    known = names(of)
    for name in raw:
        if name not in known:
            raise _unknown(of, path, name, source)
    values: dict[str, Any] = {}
    for item in fields(of):
        if item.name in raw:
            inner = (*path, item.name)
            part = table_of(item)
            given = raw[item.name]
            values[item.name] = (
                _nested(part, given, inner, source)
                if part
                else _key(key_of(item), given, inner, source)
            )
    result = of(**values)
    for item in fields(of):
        key = key_of(item)
        if key and item.name in raw and not applies(key, result):
            selector, kinds = key.only_for
            raise source.error(
                (*path, item.name),
                f"belongs to {selector} = {' or '.join(kinds)},"
                f" and this is {getattr(result, selector)}",
            )
    return result


def applies(key: Key, holder: Any) -> bool:
    """Whether a key belongs to the kind that its table is."""
    return key.only_for is None or getattr(holder, key.only_for[0]) in key.only_for[1]


def _nested(part: Table, raw: Any, path: tuple[str, ...], source: Source) -> Any:
    if not part.many:
        return _table(part.of, raw, path, source)
    if not isinstance(raw, list):
        raise source.error(path, f"must be written [[{'.'.join(path)}]], one for each")
    return tuple(_table(part.of, one, (*path, str(i)), source) for i, one in enumerate(raw))


def _key(key: Key, raw: Any, path: tuple[str, ...], source: Source) -> Any:
    try:
        return key.read(raw)
    except ValueError as error:
        raise source.error(path, str(error)) from None


def _everywhere(of: type, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """The paths of all keys and tables below dataclass `of`."""
    found = []
    for item in fields(of):
        found.append((*path, item.name))
        part = table_of(item)
        if part:
            found += _everywhere(part.of, (*path, item.name))
    return found


def _unknown(of: type, path: tuple[str, ...], name: str, source: Source) -> InputError:
    """The nearest known key of the same table, or the same key where it stands in another table."""
    near = difflib.get_close_matches(name, names(of), 1, 0.6)
    if near:
        hint = f"did you mean {'.'.join((*path, near[0]))}?"
    else:
        elsewhere = [found for found in _everywhere(Scene) if found[-1] == name]
        hint = (
            f"did you mean {'.'.join(elsewhere[0])}?"
            if elsewhere
            else f"known here: {', '.join(names(of))}"
        )
    dotted = ".".join((*path, name))
    return InputError(f"{source.where((*path, name))}: unknown key {dotted}; {hint}")


def _with_road_file(scene: Scene, source: Source) -> Scene:
    """The road's file as an absolute path; relative ones start at the scene's folder.

    One given by --set is first looked for from the current folder, as shells complete it there.
    """
    if scene.road is None or scene.road.kind not in ("grid", "crg"):
        return scene
    if scene.road.file is None:
        raise source.error(("road",), f'of kind "{scene.road.kind}" needs file = "…"')
    given = Path(scene.road.file).expanduser()
    folders = [source.path.resolve().parent]
    if ("road", "file") in source.overridden:
        folders.insert(0, Path.cwd())
    candidates = [(folder / given).resolve() for folder in folders]
    file = next((one for one in candidates if one.is_file()), candidates[0])
    if not file.is_file():
        raise source.error(("road", "file"), f"names no file: {file}")
    return replace(scene, road=replace(scene.road, file=str(file)))
