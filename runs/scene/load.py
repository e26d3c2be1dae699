"""Reads a scene from TOML, checks it completely and fills in every default.

`load` returns a `Scene` whose values have their types, lie in their ranges and do not contradict
each other, or raises one InputError that lists all problems: the key, its place and the remedy.
"""

import difflib
import re
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import Field, fields, replace
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Key, ParameterError, described
from tireroad.runs.scene import derived
from tireroad.runs.scene.chosen import drop_unused
from tireroad.runs.scene.plan import meets_road
from tireroad.runs.scene.raw import override, read_text
from tireroad.runs.scene.rules import scene as rules
from tireroad.runs.scene.schema import Table, fields_of, gathered, key_of, table_of, variant_of
from tireroad.runs.scene.source import Source, shortened
from tireroad.runs.scene.tables.cavity import filled
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.scene.walk import applies, every_field, names, owners

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,99}")


def load(
    path: Path | str,
    overrides: Sequence[str] = (),
    say: Callable[[str], object] = lambda remark: None,
    until: str | None = None,
) -> Scene:
    """The scene of a file, with `overrides` ("table.key=value", as for --set) applied.

    `say` gets a line for each thing in the file that the scene does not have as it stands there;
    `until`: the last stage that is to run.
    Raises InputError with all problems. Reads one file. Not collective.
    """
    path = Path(path)
    text = read_text(path)
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None
    except RecursionError:
        raise InputError(f"{path}: not a scene: tables nested too deep") from None
    changed = frozenset(override(raw, item) for item in overrides)
    unread = frozenset() if meets_road(until) else frozenset({("road", "file")})
    source = Source(path, text, changed, unread=unread)
    raw.setdefault("name", re.sub(r"[^A-Za-z0-9._-]", "-", path.stem).lstrip(".-") or "scene")
    drop_unused(Scene, raw, changed, say)
    derived.by_section(raw)
    scene = _table(Scene, raw, (), source)
    if not NAME.fullmatch(scene.name):
        source.add(
            ("name",), f"must be letters, digits, '.', '_', '-', not {described(scene.name)}"
        )
    scene = filled(scene)
    scene = replace(scene, tire=scene.tire.with_elements(scene.static.on_road))
    if "tire" not in source.broken():
        scene.tire.shape.check(scene.tire, source)
    if "tire" not in source.broken():
        scene = derived.with_speed(derived.with_damping(scene))
    scene = derived.with_outputs(derived.with_road(scene, say), say)
    scene = derived.with_modal(scene, until)
    if not source.broken() & {"tire", "modal"}:
        scene = derived.with_count(scene, raw, until, source, say)
    rules.check(scene, raw, source)
    source.refuse()
    return scene


def _table(of: type, raw: Any, path: tuple[str, ...], source: Source) -> Any:
    """Dataclass `of` from a raw table; bad values are noted and replaced by their defaults."""
    if not isinstance(raw, dict):
        source.add(path, _no_table(path, raw))
        return of()
    before = len(source.problems)
    values = {}
    for item in fields_of(of):
        if item.name in raw and variant_of(item) is None:
            values[item.name] = _field(item, raw[item.name], (*path, item.name), source)
    known = set(names(of))
    for item in fields(of):
        if variant_of(item) is not None:
            kind = _kind(of, item, values)
            values[item.name] = _variant(kind, raw, path, source)
            known |= set(names(kind))
    for name in raw:
        if name not in known:
            _unknown(of, path, name, values, source)
    values = gathered(of, {name: one for name, one in values.items() if one is not _WRONG})
    if len(source.problems) > before:
        return _without_checks(of, values)
    try:
        result = of(**values)
    except ParameterError as error:
        source.add((*path, error.parameter), error.reason)
        return of()
    _check_kinds(result, raw, path, source)
    return result


def _no_table(path: tuple[str, ...], raw: Any) -> str:
    """What a value that is not a table must be."""
    if isinstance(raw, list) and raw and all(isinstance(one, dict) for one in raw):
        header = ".".join(part for part in path if not part.isdigit())
        return f"must be written [{header}] in the scene, and once"
    return f"must be a table, not {described(raw)}"


_WRONG = object()


def _without_checks(of: type, values: dict[str, Any]) -> Any:
    """The table as far as it is valid, for the checks of other tables."""
    try:
        return of(**values)
    except (InputError, TypeError):
        return of()


def _kind(of: type, item: Field, values: dict[str, Any]) -> type:
    """The class selected by a key of the table; the default class if the name is invalid."""
    part = variant_of(item)
    default: Any = next(f.default for f in fields(of) if f.name == part.selector)
    selected = values.get(part.selector, default)
    return part.registry[default if selected is _WRONG else selected]


def _variant(kind: type, raw: dict, path: tuple[str, ...], source: Source) -> Any:
    """An object of the class from that class's own keys; _WRONG if it cannot be made."""
    before = len(source.problems)
    own = {
        f.name: _field(f, raw[f.name], (*path, f.name), source)
        for f in fields(kind)
        if f.name in raw
    }
    if len(source.problems) == before:
        try:
            return kind(**own)
        except ParameterError as error:
            if error.parameter in raw:
                source.add((*path, error.parameter), error.reason)
            else:
                source.add(path, f"needs {error.parameter}, which {error.reason}")
    return _WRONG


def _check_kinds(result: Any, raw: dict, path: tuple[str, ...], source: Source) -> None:
    """Note keys that belong to another kind of the same table."""
    for item in fields_of(result):
        key = key_of(item)
        if key and item.name in raw and not applies(key, result):
            selector, kinds = key.only_for
            _of_another_kind((*path, item.name), selector, kinds, getattr(result, selector), source)


def _of_another_kind(path, selector: str, kinds, this: Any, source: Source) -> None:
    source.add(path, f"belongs to {selector} = {' or '.join(kinds)}, and this is {this}")


def _field(item: Field, raw: Any, path: tuple[str, ...], source: Source) -> Any:
    part = table_of(item)
    return _nested(part, raw, path, source) if part else _key(key_of(item), raw, path, source)


def _nested(part: Table, raw: Any, path: tuple[str, ...], source: Source) -> Any:
    if not part.many:
        return _table(part.of, raw, path, source)
    if not isinstance(raw, list):
        source.add(path, f"must be written [[{'.'.join(path)}]] in the scene, one for each")
        return ()
    return tuple(_table(part.of, one, (*path, str(i)), source) for i, one in enumerate(raw))


def _key(key: Key, raw: Any, path: tuple[str, ...], source: Source) -> Any:
    try:
        value = key.read(raw)
    except ValueError as error:
        source.add(path, str(error))
        return _WRONG
    return _file(value, path, source) if key.is_file else value


def _file(name: str, path: tuple[str, ...], source: Source) -> Any:
    """The absolute path of a file; relative paths start at the scene's folder.

    A path given by --set is first looked for in the current folder, where shells complete it.
    """
    folders = [source.path.resolve().parent]
    if path in source.overridden:
        folders.insert(0, Path.cwd())
    try:
        given = Path(name).expanduser()
        candidates = [(folder / given).resolve() for folder in folders]
        file = next((one for one in candidates if one.is_file()), candidates[0])
        found, why = file.is_file(), ""
        if not found:
            file.stat()  # from Python 3.14 on is_file() does not raise for a name that is too long
    except (FileNotFoundError, NotADirectoryError):
        found, why = False, ""
    except (OSError, RuntimeError) as error:  # not a valid file name, or no such user
        cut = name if len(name) <= 60 else f"{name[:60]}…"
        found, file, why = False, Path(cut), f" ({getattr(error, 'strerror', error)})"
    if not found and path not in source.unread:
        source.add(path, f"names no file: {file}{why}")
        return _WRONG
    return str(file)


_OF_A_SWEEP = ("sweep", "axis", "member", "scene", "slurm")  # keys that a scene has not


def _everywhere(of: type, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """The paths of all keys and tables below dataclass `of`."""
    found = []
    for name, item in every_field(of).items():
        found.append((*path, name))
        part = table_of(item)
        if part:
            found += _everywhere(part.of, (*path, name))
    return found


def _unknown(of: type, path: tuple[str, ...], name: str, values: dict, source: Source) -> None:
    """Note an unknown key: one of another kind, or the nearest known one, here or elsewhere."""
    other = owners(of, name)
    if other is not None:
        selector, kinds = other
        default = next(f.default for f in fields(of) if f.name == selector)
        this = values.get(selector, default)
        if this is not _WRONG and this not in kinds:
            _of_another_kind((*path, name), selector, kinds, this, source)
        return
    if not path and name in _OF_A_SWEEP:
        text = f"unknown key {name}: a sweep is a file of its own, with scene = and [[axis]], for ./tireroad sweep (docs/how-to/sweep.md)"
        source.add_as_is((name,), text)
        return
    known = list(every_field(of))
    near = difflib.get_close_matches(name, known, 1, 0.6)
    hint = f"known here: {', '.join(known)}"
    if near:
        hint = f"did you mean {'.'.join((*path, near[0]))}?"
    else:
        elsewhere = [found for found in _everywhere(Scene) if found[-1] == name]
        if elsewhere:
            hint = f"did you mean {'.'.join(elsewhere[0])}? {hint}"
    source.add_as_is((*path, name), f"unknown key {shortened((*path, name))}; {hint}")
