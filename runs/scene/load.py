"""Reads a scene from TOML and checks it completely; scene.choices fills in what it leaves open.

`load` returns a `Scene` whose values have their types, lie in their ranges and do not contradict
each other, or raises one InputError that lists all problems: the key, its place and the remedy.

Keys of the file that are of no use to a variant chosen by --set are dropped: with
`--set road.kind=flat` the keys of a sine would be errors, and every one of them would have to be
removed on the command line too.
"""

import difflib
import re
import tomllib
from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import Field, fields, replace
from pathlib import Path
from typing import Any

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Key, ParameterError, described
from tireroad.runs.files.names import scene_name
from tireroad.runs.scene import rules
from tireroad.runs.scene.choices import SceneFile, chosen
from tireroad.runs.scene.parts import with_parts
from tireroad.runs.scene.plan import meets_road
from tireroad.runs.scene.resolved import literal
from tireroad.runs.scene.schema import (
    Path_,
    Source,
    Table,
    applies,
    every_field,
    fields_of,
    gathered,
    key_of,
    names,
    owners,
    parts,
    shortened,
    table_of,
    variant_of,
)
from tireroad.runs.scene.tables.scene import (
    Scene,
)
from tireroad.runs.scene.tables.tire import SECTIONS, TireTable, check_series

LARGEST = 1_000_000

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,99}")
_WRONG = object()
_OF_A_SWEEP = ("sweep", "axis", "member", "scene", "slurm")  # keys that a scene has not
_DROPPED: dict[tuple[str, ...], str] = {
    ("greens", "choice"): "greens.dynamic takes the states that participate most; remove it",
    ("output", "velocity"): "take the derivative of displacement in response.h5",
    ("output", "acceleration"): "take the second derivative of displacement in response.h5",
}


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
    path = parts(dotted)
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
        lost = [name for name in unused if name in raw and not _given((*path, name), changed)]
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
    unused: dict[str, list[str]] = {}
    for item in fields_of(of):
        part, key = variant_of(item), key_of(item)
        if part is not None:
            kind = raw.get(part.selector, getattr(of, part.selector))
            if isinstance(kind, str) and kind in part.registry:
                law = part.registry[kind]
                own = {*names(of), *names(law)}
                others = [name for name in raw if name not in own and part.registry.owners(name)]
                yield part.selector, kind, [*others, *getattr(law, "without", ())]
        elif key is not None and key.only_for is not None:
            selector, kinds = key.only_for
            if raw.get(selector, getattr(of, selector)) not in kinds:
                unused.setdefault(selector, []).append(item.name)
    for selector, lost in unused.items():
        yield selector, raw.get(selector, getattr(of, selector)), lost


def _given(path: Path_, changed: Set[Path_]) -> bool:
    """Whether --set gave a key, a part of it, or the table that holds it."""
    return any(
        path[: len(path_given)] == path_given or path_given[: len(path)] == path
        for path_given in changed
    )


def by_section(raw: dict[str, Any]) -> dict[str, Any]:
    """The tables with what follows from the kind of section: a mesh's section, a section's tread."""
    tire, contact = raw.get("tire"), raw.get("contact")
    if not isinstance(tire, dict):
        return raw
    if "mesh" in tire:
        tire = {"section": "file"} | tire
    kind = tire.get("section")
    if isinstance(contact, dict) and isinstance(kind, str) and kind in SECTIONS:
        contact = {"tread": SECTIONS[kind].tread_law} | contact
    return raw | {"tire": tire} | ({} if contact is None else {"contact": contact})


def with_merged(scene: Scene, file: SceneFile) -> Scene:
    """Merge the stated compounds and cords into those of the tire, once [tire] is found right."""
    source = file.source
    if "tire" in source.broken():
        return scene
    check_series(scene.tire, source)
    scene.tire.shape.check(scene.tire, source)
    tire = file.keys("tire")
    stated = scene.tire.shape.built_in or {"region", "cords"} & tire.keys()
    if "tire" in source.broken() or not stated:
        return scene

    def read(merged: dict[str, Any]) -> TireTable:
        return _table(TireTable, merged, ("tire",), source)

    return replace(scene, tire=with_parts(scene.tire, tire, read, source, file.say))


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
    raw.setdefault("name", scene_name(path.stem))
    if changed:
        drop_unused(Scene, raw, changed, say)
    filled = by_section(raw)
    scene = _table(Scene, filled, (), source)
    if not NAME.fullmatch(scene.name):
        source.add(
            ("name",), f"must be letters, digits, '.', '_', '-', not {described(scene.name)}"
        )
    file = SceneFile(raw, until, source, say)
    scene = chosen(with_merged(scene, file), file)
    rules.check(scene, filled, source)
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
    values = gathered(of, {name: value for name, value in values.items() if value is not _WRONG})
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
    """Description of a value that must not be a table."""
    if isinstance(raw, list) and raw and all(isinstance(item, dict) for item in raw):
        header = ".".join(part for part in path if not part.isdigit())
        return f"must be written [{header}] in the scene, and once"
    return f"must be a table, not {described(raw)}"


def _without_checks(of: type, values: dict[str, Any]) -> Any:
    """The table as far as it is valid, for the checks of other tables."""
    try:
        return of(**values)
    except (InputError, TypeError):
        return of()


def _kind(of: type, item: Field, values: dict[str, Any]) -> type:
    """The class selected by a key of the table; the default class if the name is invalid."""
    part = variant_of(item)
    default = getattr(of, part.selector)
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
    source.add(path, f"is only valid for {selector} = {' or '.join(kinds)} (here: {this})")


def _field(item: Field, raw: Any, path: tuple[str, ...], source: Source) -> Any:
    part = table_of(item)
    return _nested(part, raw, path, source) if part else _key(key_of(item), raw, path, source)


def _nested(part: Table, raw: Any, path: tuple[str, ...], source: Source) -> Any:
    if not part.many:
        return _table(part.of, raw, path, source)
    if not isinstance(raw, list):
        source.add(path, f"must be written [[{'.'.join(path)}]] in the scene, one for each")
        return ()
    return tuple(_table(part.of, item, (*path, str(i)), source) for i, item in enumerate(raw))


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
        file = next((candidate for candidate in candidates if candidate.is_file()), candidates[0])
        is_file, why = file.is_file(), ""
        if not is_file:
            file.stat()  # from Python 3.14 on is_file() does not raise for a name that is too long
    except (FileNotFoundError, NotADirectoryError):
        is_file, why = False, ""
    except (OSError, RuntimeError) as error:  # not a valid file name, or no such user
        cut = name if len(name) <= 60 else f"{name[:60]}…"
        is_file, file, why = False, Path(cut), f" ({getattr(error, 'strerror', error)})"
    if not is_file and path not in source.unread:
        source.add(path, f"names no file: {file}{why}")
        return _WRONG
    return str(file)


def _everywhere(of: type, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    """The paths of all keys and tables below dataclass `of`."""
    paths = []
    for name, item in every_field(of).items():
        paths.append((*path, name))
        part = table_of(item)
        if part:
            paths += _everywhere(part.of, (*path, name))
    return paths


def _unknown(of: type, path: tuple[str, ...], name: str, values: dict, source: Source) -> None:
    """Note an unknown key: one of another kind, or the nearest known one, here or elsewhere."""
    other = owners(of, name)
    if other is not None:
        selector, kinds = other
        this = values.get(selector, getattr(of, selector))
        if this is not _WRONG and this not in kinds:
            _of_another_kind((*path, name), selector, kinds, this, source)
        return
    if not path and name in _OF_A_SWEEP:
        text = f"unknown key {name}: a sweep is a file of its own, with scene = and [[axis]], for ./tireroad sweep (docs/how-to/sweep.md)"
        source.add_as_is((name,), text)
        return
    if (*path, name) in _DROPPED:
        source.add((*path, name), f"was dropped: {_DROPPED[(*path, name)]}")
        return
    known = list(every_field(of))
    near = difflib.get_close_matches(name, known, 1, 0.6)
    hint = f"known here: {', '.join(known)}"
    if near:
        hint = f"did you mean {'.'.join((*path, near[0]))}?"
    else:
        elsewhere = [place for place in _everywhere(Scene) if place[-1] == name]
        if elsewhere:
            hint = f"did you mean {'.'.join(elsewhere[0])}? {hint}"
    source.add_as_is((*path, name), f"unknown key {shortened((*path, name))}; {hint}")
