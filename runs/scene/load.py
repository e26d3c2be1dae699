"""Reads a scene from TOML, checks it completely and fills in every default.

`load` returns a `Scene` whose values have their types, lie in their ranges and do not contradict
each other, or raises one InputError that lists all problems: the key, its place and the remedy.

Keys of the file that are of no use to a variant chosen by --set are dropped: with
`--set road.kind=flat` the keys of a sine would be errors, and every one of them would have to be
removed on the command line too.
"""

import difflib
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import Field, fields, replace
from pathlib import Path
from typing import Any

from tireroad.contact.choices import USABLE
from tireroad.contact.tread.laws.elastic import ElasticTread
from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Key, ParameterError, described, second_digit
from tireroad.runs.files.names import scene_name
from tireroad.runs.scene import rules
from tireroad.runs.scene.parts import with_parts
from tireroad.runs.scene.plan import meets_road, skipped
from tireroad.runs.scene.resolved import literal
from tireroad.runs.scene.schema import (
    Path_,
    Pitch,
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
    DampingTable,
    ModalTable,
    RoadTable,
    Scene,
    filled,
    rubbed,
)
from tireroad.runs.scene.tables.tire import SECTIONS, TireTable, check_series

LARGEST = 1_000_000

Say = Callable[[str], object]
BAND_EDGE = 10**0.05  # upper edge of a third octave over its middle
# Of the band's upper edge: damped forces are off by 3/16 (2 pi / 16)^2 = 2.9 % there, 0.25 dB; on a rough road
# linear ones chatter.
STEPS_A_PERIOD = 16
SCHEME = "damped"
LOOSER = 0.01  # rotation.shape_tolerance where errors count in dB: docs/verification/band.md
# Points on the shortest wave, where that is closer than the nodes of a mesh lead to: within 1.2 dB of points 0.7
# times as far apart in every third octave from 79 Hz to 1 kHz, where those at half the nodes' distance (3.8 mm) are
# 0.6 to 3.7 dB too loud (205/60 R15 at 80 km/h on two-slope; docs/verification/band.md).
ON_A_WAVE, CLOSE = 8.0, 4e-3  # -, m
UNHEARD = 1.2  # times the band's upper edge: the rolling radius is not known yet
COARSE_UP_TO = 450.0  # Hz: to there 24 segments of 16 elements carry the waves of a radial tire
TREAD_RUBBER = (
    1e7  # Pa: contact.youngs_modulus of a radial tire, whose own tread is taken for usual
)
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


def by_section(raw: dict[str, Any]) -> None:
    """Set what follows from the kind of section: a mesh's section, a section's tread."""
    tire, contact = raw.get("tire"), raw.get("contact")
    if not isinstance(tire, dict):
        return
    if "mesh" in tire:
        tire.setdefault("section", "file")
    kind = tire.get("section")
    if isinstance(contact, dict) and isinstance(kind, str) and kind in SECTIONS:
        contact.setdefault("tread", SECTIONS[kind].tread_law)


def with_merged(scene: Scene, raw: dict[str, Any], source: Source, say: Say) -> Scene:
    """Merge the stated compounds and cords into those of the tire, once [tire] is found right."""
    if "tire" in source.broken():
        return scene
    check_series(scene.tire, source)
    scene.tire.shape.check(scene.tire, source)
    given = _keys_in(raw, "tire")
    stated = scene.tire.shape.built_in or {"region", "cords"} & given.keys()
    if "tire" in source.broken() or not stated:
        return scene

    def read(merged: dict[str, Any]) -> TireTable:
        return _table(TireTable, merged, ("tire",), source)

    return replace(scene, tire=with_parts(scene.tire, given, read, source, say))


def with_band(scene: Scene, raw: dict[str, Any], say: Say) -> Scene:
    """Choose by accuracy.up_to, where a scene gives it, what it leaves open: mesh, modes, step.

    A search chooses for itself. Points follow later (with_points).
    """
    tables = {name: _keys_in(raw, name) for name in ("modal", "rotation", "time", "tire")}
    if not _by_band(scene, raw):
        return scene
    top, chosen = BAND_EDGE * scene.accuracy.up_to, []
    if not {"count", "up_to"} & set(tables["modal"]):
        highest = 10.0 * math.ceil(top / USABLE / 10)
        scene = replace(scene, modal=replace(scene.modes, up_to=highest))
        chosen.append(f"modal.up_to = {highest:g} Hz, of which {USABLE:.0%} are an answer")
    rotation = scene.rotation
    if rotation and scene.joins_shapes and "shape_tolerance" not in tables["rotation"]:
        scene = replace(scene, rotation=replace(rotation, shape_tolerance=LOOSER))
        chosen.append(f"rotation.shape_tolerance = {LOOSER:g}")
    assert scene.time is not None, "there is contact in time"
    if "step" not in tables["time"]:
        step = float(f"{1 / (STEPS_A_PERIOD * top):.2g}")
        scene = replace(scene, time=replace(scene.time, step=step))
        chosen.append(f"time.step = {step:g} s, {STEPS_A_PERIOD} to a period")
    if "scheme" not in tables["time"]:
        scene = replace(scene, time=replace(scene.time, scheme=SCHEME))
        chosen.append(f'time.scheme = "{SCHEME}"')
    open_mesh = not {"segments", "elements_arc"} & set(tables["tire"])
    if scene.tire.section == "radial" and open_mesh and scene.accuracy.up_to <= COARSE_UP_TO:
        tire = replace(scene.tire, segments=24, shape=scene.tire.shape.elements_along(16))
        scene = replace(scene, tire=tire)
        chosen.append(
            "tire.segments = 24 and tire.elements_arc = 16, which carry waves to that frequency"
        )
    if chosen:
        say(f"accuracy.up_to = {scene.accuracy.up_to:g} Hz chooses " + "; ".join(chosen))
    return scene


def _keys_in(raw: dict[str, Any], name: str) -> dict[str, Any]:
    """The keys of a table that the scene gives."""
    return found if isinstance(found := raw.get(name), dict) else {}


def _by_band(scene: Scene, raw: dict[str, Any]) -> bool:
    """Whether accuracy.up_to chooses what the scene leaves open."""
    method = scene.rotation.method if scene.rotation else "projected"
    given = "up_to" in _keys_in(raw, "accuracy") and method == "projected"
    return scene.in_contact and given and not scene.accuracy.searches


def with_points(scene: Scene, raw: dict[str, Any], say: Say) -> Scene:
    """`ON_A_WAVE` contact points on the shortest wave, where that is closer than `CLOSE`.

    `contact.points = "auto"` else (contact.patch).
    """
    contact, rotation = scene.contact, scene.rotation
    if not _by_band(scene, raw) or "points" in _keys_in(raw, "contact"):
        return scene
    if contact is None or contact.on_nodes or rotation is None or not rotation.speed:
        return scene
    speed = rotation.speed * scene.tire.proportions().outer_radius
    wave = speed / scene.accuracy.up_to
    if wave / ON_A_WAVE >= CLOSE:
        return scene
    pitch = _unheard(wave / ON_A_WAVE, speed, scene)
    say(
        f"accuracy.up_to chooses contact.points = {pitch:g} m, {wave / pitch:.2g} to the shortest wave"
    )
    return replace(scene, contact=replace(contact, points=Pitch(pitch, pitch)))


def _unheard(wanted: float, speed: float, scene: Scene) -> float:
    """The pitch (m), two digits of it, nearest to the `wanted` one whose passing is not heard.

    Points pass at speed / pitch; that and its harmonics, sampled by the steps, must not return inside
    the band, neither in the run nor in its companions with twice the step and twice the pitch.
    """
    digit = second_digit(wanted)
    first, top = math.floor(wanted / digit), UNHEARD * BAND_EDGE * scene.accuracy.up_to
    steps = scene.time.step if scene.time else "auto"
    if isinstance(steps, str):
        return round(first * digit, 9)
    rates = 1 / steps, 0.5 / steps

    def heard(pitch: float) -> bool:
        passing = (k * speed / pitch for k in (0.5, 1.0, 1.5, 2.0, 3.0))
        return any(abs(f - rate * round(f / rate)) < top for f in passing for rate in rates)

    tried = sorted(range(max(first // 2, 1), 2 * first), key=lambda count: abs(count - first))
    count = next((count for count in tried if not heard(count * digit)), first)
    return round(count * digit, 9)


def with_tread_rubber(scene: Scene, raw: dict[str, Any], say: Say) -> Scene:
    """Rubber of the contact of a radial tire where the scene leaves it open: as much stiffer as its tread."""
    contact, stiffer = scene.contact, scene.tire.shape.tread_over_own(scene.tire)
    if contact is None or stiffer is None or "youngs_modulus" in _keys_in(raw, "contact"):
        return scene
    if not isinstance(contact.law, ElasticTread):
        return scene
    modulus = float(f"{TREAD_RUBBER * stiffer:.6g}")
    times = (
        f", {stiffer:.4g} times that of a usual tread as the tire's own is" if stiffer != 1 else ""
    )
    say(f"contact.youngs_modulus = {modulus:g} Pa, of tread rubber{times}")
    return replace(
        scene, contact=replace(contact, law=replace(contact.law, youngs_modulus=modulus))
    )


def with_speed(scene: Scene) -> Scene:
    """Set the wheel's speed for a travel speed until the static state gives its rolling radius."""
    rotation = scene.rotation
    if rotation is None or rotation.travel_speed is None:
        return scene
    speed = rotation.travel_speed / (
        rotation.rolling_radius or scene.tire.proportions().outer_radius
    )
    return replace(scene, rotation=replace(rotation, speed=speed))


def with_damping(scene: Scene) -> Scene:
    """Set the default proportional damping if neither it nor a compound's loss factor is given."""
    loses = scene.tire.shape.has_losses(scene.tire)
    return replace(scene, damping=DampingTable()) if scene.damping is None and not loses else scene


def with_road(scene: Scene, say: Say) -> Scene:
    """Set a flat road where there is contact with none given."""
    if scene.contact is None or scene.road is not None:
        return scene
    say("no [road]: it is flat")
    return replace(scene, road=RoadTable())


def with_outputs(scene: Scene, say: Say) -> Scene:
    """Leave out what is asked of driven points where there are none."""
    kept = tuple(one for one in scene.output.kinds if scene.force or one[1].of != "points")
    if len(kept) == len(scene.output.kinds):
        return scene
    lost = [f"output.{name}" for name, kind in scene.output.kinds if (name, kind) not in kept]
    say(f"no [[force]], hence no driven points: {', '.join(lost)} left out")
    return replace(scene, output=replace(scene.output, kinds=kept))


def with_modal(scene: Scene, until: str | None) -> Scene:
    """Set the default [modal] where something needs modes, or the run is to end with them."""
    needed = scene.contact, scene.force, scene.rotation, scene.axle.kind != "fixed"
    if scene.modal is None and (any(needed) or until in ("modes", "rotating")):
        return replace(scene, modal=ModalTable())
    return scene


def with_count(
    scene: Scene, raw: dict[str, Any], until: str | None, source: Source, say: Say
) -> Scene:
    """Fit the default number of modes to the mesh; note a given one that the mesh does not have.

    A given number is judged only if the modes will be computed.
    """
    modal = scene.modal
    if modal is None or modal.up_to is not None:
        return scene
    count, free = modal.count, scene.tire.free_unknowns()
    if count < free:
        return scene
    if "count" not in raw.get("modal", {}):
        say(
            f"modal.count is {free - 1}, all the modes that the mesh has, not {count} as by default"
        )
        return replace(scene, modal=replace(modal, count=free - 1))
    if "modes" not in skipped(scene, until):
        text = f"= {count} must be less than the {free} free unknowns of the mesh"
        source.add(("modal", "count"), text)
    return scene


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
    drop_unused(Scene, raw, changed, say)
    by_section(raw)
    scene = _table(Scene, raw, (), source)
    if not NAME.fullmatch(scene.name):
        source.add(
            ("name",), f"must be letters, digits, '.', '_', '-', not {described(scene.name)}"
        )
    scene = with_merged(scene, raw, source, say)
    scene = with_band(rubbed(filled(scene)), raw, say)
    scene = replace(scene, tire=scene.tire.with_elements(scene.static.on_road))
    if "tire" not in source.broken():
        scene = with_tread_rubber(with_damping(scene), raw, say)
        scene = with_points(with_speed(scene), raw, say)
    scene = with_outputs(with_road(scene, say), say)
    scene = with_modal(scene, until)
    if not source.broken() & {"tire", "modal"}:
        scene = with_count(scene, raw, until, source, say)
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
    """Description of a value that must not be a table."""
    if isinstance(raw, list) and raw and all(isinstance(one, dict) for one in raw):
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
    if (*path, name) in _DROPPED:
        source.add((*path, name), f"was dropped: {_DROPPED[(*path, name)]}")
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
