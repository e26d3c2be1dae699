"""Rules beyond single keys: contradictions between tables, combinations not supported, the road's length."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from tireroad.contact.roads.grid import Grid
from tireroad.contact.roads.kinds.shapes import Edges
from tireroad.contact.roads.road import placed
from tireroad.contact.roads.under_tire import Road, begun_at, is_level, moved_start, shown
from tireroad.fem.errors import InputError
from tireroad.greens.residuals import names, residual_of
from tireroad.runs.scene.outputs import Output, check_steps
from tireroad.runs.scene.road_cache import road_of
from tireroad.runs.scene.schema import Source, Where
from tireroad.runs.scene.tables.contact import ContactTable, PatternTable, TimeTable, check_tread
from tireroad.runs.scene.tables.scene import (
    ModalTable,
    OutputTable,
    PointForceTable,
    RoadTable,
    RotationTable,
    Scene,
    SoundTable,
    StaticTable,
    check_accuracy,
    check_axle,
    check_motion,
    check_stiffness,
    confined,
    has_air,
)
from tireroad.runs.scene.tables.tire import Raw, TireTable

# Least ratio of a pressed tire's effective rolling radius to its outer radius, and farthest reach
# of the patch ahead of the axle, m: only what a run would certainly refuse is refused here.
LEAST_RADIUS = 0.85
AHEAD = 0.5
# Half the width of road, and length, that `check` looks at for relief, m.
BESIDE, LOOKED = 0.5, 20.0


# Least ratio of an inside drum's radius to the tire's outer radius that leaves room to press it.
_ROOM = 1.15
MOST_SPEEDS = 10_000


def check_shape(tire: TireTable, scene: Scene, raw: Raw, error: Where) -> None:
    """Raise an error for a drum too small for the tire, or held modes without a level plane."""
    road, camber = scene.road, scene.static.camber
    drum = road.drum_radius if road else None
    outer = tire.proportions().outer_radius
    if drum is not None and road.drum == "inside" and drum < _ROOM * outer:
        raise error(
            ("road", "drum_radius"),
            f"= {drum:g} m leaves no room inside for a tire of {outer:g} m: at least {_ROOM * outer:.3g} m",
        )
    if scene.modes.road == "held" and (drum is not None or camber):
        raise error(
            ("modal", "road"),
            '= "held" holds the nodes in height, on a level road: take "forces", or static.camber = 0 deg '
            "and no road.drum_radius",
        )


def check_road(scene: Scene) -> None:
    """Raise InputError if the road's file is unusable or certainly too short. Not collective.

    A road in a text file is read completely.
    """
    if scene.road is None:
        return
    road = road_of(scene.road.surface)
    if scene.contact is not None and scene.time is not None:
        _check_extent(scene, road)


def remarks(scene: Scene) -> list[str]:
    """Remarks of `check` on a road that can be driven on."""
    if scene.road is None or scene.contact is None:
        return []
    road = road_of(scene.road.surface)
    start = begun_at(road, scene.road.start)
    notes = [f"road: {moved_start(start)}"] if start != (scene.road.start or 0.0) else []
    if scene.motion.kind != "linear" and not any(confined(scene)):
        notes.append(
            "large motions: their training is not part of the estimated time; it took four minutes of CPU for a bar under a passenger "
            "tire of 19,488 unknowns"
        )
    end = start + AHEAD + least_travel(scene) / LEAST_RADIUS
    if least_travel(scene) == 0.0:
        notes += [f"warning: {text}" for text in never_met(scene.road)]
    elif scene.road.kind != "flat" and _level(scene.road, road, start, end):
        notes.append(f"warning: {without_relief(scene.road, start, end)}")
    elif (place := foot(scene.road)) is not None and start < place < start + scene.road.run_in:
        notes.append(f"warning: {within_run_in(scene.road, place)}")
    return notes


def never_met(road: RoadTable) -> list[str]:
    """A warning of a road with heights under a wheel that stands, at the start of the run-in."""
    if road.kind == "flat" and not road.offset:
        return []
    return [
        "the wheel stands: it meets a road by rolling out of its run-in, so that the heights of this one and "
        "road.offset have no effect; give [rotation] a speed, or move the whole road by [road.motion]"
    ]


def foot(road: RoadTable) -> float | None:
    """The foot (m) of a step's or cleat's first edge; None for other roads, and on a drum."""
    if isinstance(road.surface, Edges) and road.drum_radius is None:
        return road.surface.position
    return None


def within_run_in(road: RoadTable, place: float, share: float | None = None) -> str:
    """A warning of an obstacle at x = `place` (m) that is met at a `share` of its height only, or with an edge that it has not."""
    if road.run_in == 0.0:
        return (
            f"the {road.kind} begins at x = {shown(place)} m, under the tire at rest, where the road is level: what of it lies ahead of the "
            "foremost contact point is met as a step; raise road.position"
        )
    met = "less" if share is None else f"{100 * share:.2g} %"
    return (
        f"the {road.kind} at x = {shown(place)} m lies in the run-in, over which the road grows from flat: it is "
        f"met at {met} of its height; raise road.position, or shorten road.run_in ({road.run_in:g} m; 0: none)"
    )


def _level(table: RoadTable, road: Road, start: float, end: float) -> bool:
    """Whether a road has one height from `start` to `end` (m), on both sides of the tire's path.

    Of a long road only `LOOKED` m are looked at: bounds of files and textures take time.
    """
    if end - start > LOOKED and not isinstance(table.surface, Edges):
        return False
    whole = placed(road, table.surface, table).road  # on a drum it repeats
    beside = table.lateral - BESIDE, table.lateral + BESIDE
    return all(is_level(whole, start, last, *beside) for last in (min(start + 2.0, end), end))


def without_relief(road: RoadTable, first: float, last: float) -> str:
    """A warning of a road that has the same height all over the run, from `first` to `last` (m)."""
    key = "road.position, road.start" if hasattr(road.surface, "position") else "road.start"
    return (
        f'the road (kind = "{road.kind}") has no relief under the run, which passes over x = {shown(first)} to '
        f"{shown(last)} m: nothing on it moves the tire; change {key} or time.duration"
    )


def _check_extent(scene: Scene, road: Road) -> None:
    table, source = scene.road, getattr(road, "source", "road")
    (x0, x1), (y0, y1) = road.extent
    if not y0 <= table.lateral <= y1:
        raise InputError(
            f"{source}: road.lateral = {table.lateral:g} m lies beside the road, which has y from "
            f"{y0:.4g} to {y1:.4g} m"
        )
    start, travel = begun_at(road, table.start), least_travel(scene)
    # The first place needed is under the front of the patch.
    if start + travel > x1 or start + AHEAD < x0:
        raise InputError(
            f"{source}: the run needs the road from x = {shown(start)} to about "
            f"{shown(start + travel)} m (rotation.speed, tire.outer_radius, time.duration), and it "
            f"has {shown(x0)} to {shown(x1)} m; change [road] start, shorten [time] duration, or continue it "
            'by end = "mirror"'
        )
    if isinstance(road, Grid) and travel > AHEAD and table.drum_radius is None:
        # Refuses holes under the middle of the tire, before anything is solved.
        road.prepare(start + AHEAD, start + travel, table.lateral, table.lateral)


def least_travel(scene: Scene) -> float:
    """Distance (m) rolled in the run, estimated low because the static state is not known yet."""
    rotation, time = scene.rotation, scene.time
    if rotation is None or time is None:
        return 0.0
    radius = rotation.rolling_radius or LEAST_RADIUS * scene.tire.proportions().outer_radius
    travel = rotation.speed * radius * time.duration
    return travel if math.isfinite(travel) else 0.0


def full_matrices(rotation: RotationTable, scene: Scene, raw: Raw, error: Where) -> None:
    """Raise an error for states of the full matrices without [damping] or with moduli that vary."""
    if rotation.method != "full":
        return
    if scene.damping is None:
        advice = "needs a full damping matrix, which loss factors do not give: add [damping]"
        raise error(("rotation", "method"), f'= "full" {advice}')
    if scene.tire.shape.varies(scene.tire):
        advice = "needs moduli that do not depend on frequency: set exponent = 0 in [[tire.region]]"
        raise error(("rotation", "method"), f'= "full" {advice}')


def check_outputs(
    output: OutputTable, scene: Scene, raw: Raw, error: Where
) -> Iterator[InputError]:
    """The error of each kind of output at the driven points, checked against the scene."""
    for name, kind in output.kinds:
        try:
            _check_kind(scene, kind, ("output", name), error)
        except InputError as problem:
            yield problem


def _check_kind(scene: Scene, kind: Output, path: tuple[str, ...], error: Where) -> None:
    if kind.of == "contact" and not scene.in_contact:
        raise error(
            path, "is of the forces of the road: add [contact], [time], and load (N) to [static]"
        )
    kind.check(scene, path, error)


def check_campbell(rotation: RotationTable, scene: Scene, raw: Raw, error: Where) -> None:
    """Check that the Campbell diagram has at least one speed and not too many."""
    campbell = rotation.campbell
    if campbell is not None:
        path = "rotation", "campbell", "step"
        check_steps(path, "speeds", campbell.to, campbell.step, "rad/s", error, most=MOST_SPEEDS)


def check_vibration(
    output: OutputTable, scene: Scene, raw: Raw, error: Where
) -> Iterator[InputError]:
    """Check what the motion of the whole tire needs, in frequency and in time."""
    rotation = scene.rotation
    full = rotation is not None and rotation.speed and rotation.method == "full"
    for key in ("vibration", "fields"):
        path = "output", key
        if not getattr(output, key):
            continue
        if scene.time is None or not (scene.force or scene.in_contact):
            yield error(path, "needs forces in time: add [time] with [contact] or a [[force]]")
        if full:
            yield error(path, 'is seen through the modes: take rotation.method = "projected"')
    if output.vibration and scene.in_contact and not output.spectra:
        yield error(
            ("output", "vibration"), "needs output.spectra, which find the run-in and the limit"
        )


def check_sound(sound: SoundTable, scene: Scene, raw: Raw, error: Where) -> Iterator[InputError]:
    """Check that there is a plane road, and vibrations seen through the modes."""
    rotation = scene.rotation
    if not scene.static.on_road:
        yield error(("sound", "microphones"), "are over the road: give [static] a load (N)")
    if sound.wheel == "open" and sound.wheel_depth:
        yield error(
            ("sound", "wheel_depth"), 'is that of discs, which wheel = "open" does not have'
        )
    if scene.road is not None and scene.road.drum_radius is not None:
        yield error(("road", "drum_radius"), "is not possible with [sound], whose road is a plane")
    if rotation is not None and rotation.speed and rotation.method == "full":
        yield error(("sound", "microphones"), 'hear the modes: take rotation.method = "projected"')
    if scene.in_contact and not scene.output.spectra:
        yield error(("output", "spectra"), "find the run-in and the limit of [sound]: take them in")


def check(scene: Scene, raw: Raw, source: Source) -> None:
    """Note contradictions between keys or tables.

    A rule is skipped if a table that it reads has a problem: what it found might be a consequence.
    It yields errors that do not depend on each other, and raises one that ends it.
    """
    broken = source.broken()
    for rule in RULES:
        table = getattr(scene, rule.of)
        if not table or broken & {rule.of, *rule.reads}:
            continue
        try:
            for error in rule.check(table, scene, raw, source.error) or ():
                source.problems.append(((), str(error)))
        except InputError as error:
            source.problems.append(((), str(error)))


def _static(static: StaticTable, scene: Scene, raw: Raw, error: Where) -> None:
    places = [key for key in ("load", "deflection", "road_height") if key in raw.get("static", {})]
    if len(places) > 1:
        raise error(
            ("static", places[1]), f"and {places[0]} place the road twice: keep one of them"
        )


def _rotation(rotation: RotationTable, scene: Scene, raw: Raw, error: Where) -> None:
    speed = raw.get("rotation", {}).get("speed")
    if rotation.travel_speed is not None and speed not in (None, rotation.speed):
        raise error(
            ("rotation", "travel_speed"), "and speed give the wheel's speed twice: keep one of them"
        )
    if not any(rotation.window):
        return
    low, high = rotation.window
    if low >= high:
        raise error(("rotation", "window"), f"= [{low:g}, {high:g}] Hz must ascend")
    if rotation.method != "full":
        raise error(
            ("rotation", "window"), 'is of method = "full": the projected one finds all states'
        )


def _modes(modal: ModalTable, scene: Scene, raw: Raw, error: Where) -> None:
    static, rotation = scene.static, scene.rotation
    if modal.road == "held" and not static.on_road:
        raise error(("modal", "road"), '= "held" needs a road: add load (N) to [static]')
    for key, why in barred_from_contact(modal.rim, modal.road) if scene.in_contact else ():
        raise error(("modal", key), why)
    if modal.rim == "fixed" or rotation is None or rotation.speed == 0:
        return
    if rotation.method == "full":
        raise error(
            ("rotation", "method"),
            '= "full" is solved about K^-1, which a free rim does not have: take "projected"',
        )
    if not static.steady_rolling:
        raise error(
            ("static", "steady_rolling"),
            "= false leaves out the centrifugal tension that keeps a free turning wheel upright",
        )
    if scene.damping and scene.damping.mass:
        raise error(
            ("damping", "mass"),
            f"= {scene.damping.mass:g} 1/s acts against a wheel that turns about a fixed axle; a free one"
            " would be driven round by it: take 0, and damping.stiffness (s) instead",
        )
    if not residual_of(scene.greens.residual).of_free_rim:
        raise error(
            ("greens", "residual"),
            f'= "{scene.greens.residual}" needs the static answer of the turning tire, which with a'
            f" free rim does not exist: take {names(static=False)}",
        )


def barred_from_contact(rim: str, road: str) -> Iterator[tuple[str, str]]:
    """Why modes with this `rim` and `road` cannot carry a time loop in contact: (key, reason)."""
    if road == "held":
        yield (
            "road",
            '= "held" fixes the nodes whose contact is to be computed: [contact] needs "forces"',
        )
    if rim == "free":
        yield "rim", '= "free" leaves nothing to carry the load: [contact] needs "fixed"'


def _force(
    forces: Sequence[PointForceTable], scene: Scene, raw: Raw, error: Where
) -> Iterator[InputError]:
    for number, force in enumerate(forces):
        if not any(force.direction):
            yield error(("force", str(number), "direction"), "must not be all zeros")
        bead = scene.tire.proportions().half_angle
        if abs(force.arc) >= bead:
            yield error(
                ("force", str(number), "arc"),
                f"= {force.arc:g} deg lies beyond the bead at {bead:g} deg",
            )
        elif abs(force.arc) + force.spread[1] > bead:
            yield error(
                ("force", str(number), "spread"),
                f"= {list(force.spread)} deg on both sides of arc = {force.arc:g} deg reaches beyond the bead "
                f"at {bead:g} deg: its second number may be {bead - abs(force.arc):.4g} at most",
            )


def _states(rotation: RotationTable, scene: Scene, raw: Raw, error: Where) -> None:
    residual = scene.greens.residual
    full = rotation.speed > 0 and rotation.method == "full"
    if full and residual_of(residual).joins:
        raise error(
            ("greens", "residual"),
            f'= "{residual}" completes the modes: it needs rotation.method = "projected"',
        )


def _contact(contact: ContactTable, scene: Scene, raw: Raw, error: Where) -> None:
    static, rotation = scene.static, scene.rotation
    if static.friction is not None and contact.has_friction:
        raise error(
            ("static", "friction"),
            "and contact.friction or the bristles of contact.brush_stiffness carry the same horizontal forces: keep one of "
            "them",
        )
    standing = rotation is None or rotation.speed == 0
    has_friction = static.friction is not None
    check_tread(contact, standing, error, has_friction)
    if rotation is not None and rotation.free_rolling and contact.friction == 0:
        raise error(
            ("rotation", "free_rolling"),
            "does not exist with contact.friction = 0: any slip is free",
        )
    for key, pulls in (
        ("free_rolling", contact.has_friction),
        ("slip_angle", contact.has_friction or has_friction),
    ):
        if rotation is not None and getattr(rotation, key) and (not pulls or standing):
            raise error(
                ("rotation", key),
                "needs contact.friction or contact.brush_stiffness_per_area (N/m³), without which no road pulls on the "
                "tire, and a wheel that turns",
            )


def _time(time: TimeTable, scene: Scene, raw: Raw, error: Where) -> None:
    if isinstance(time.step, str):
        return
    if time.step > time.duration:
        raise error(
            ("time", "step"),
            f"= {time.step:g} s must not be more than duration = {time.duration:g} s",
        )
    if time.duration / time.step > 1e8:
        raise error(
            ("time", "step"),
            f"= {time.step:g} s makes {time.duration / time.step:.3g} steps; at most 1e8",
        )


def check_pattern(pattern: PatternTable, scene: Scene, raw: Raw, error: Where) -> None:
    """Raise an error for an invalid pattern, or for one without a grid that resolves it."""
    if scene.contact is None or scene.contact.on_nodes:
        raise error(
            ("pattern",), "needs [contact] on a grid that sees it: contact.points = { dx, dy } (m)"
        )
    if bool(pattern.groove) == (pattern.file is not None):
        raise error(("pattern",), "needs either [[pattern.groove]] or file")
    if not pattern.pitch_lengths:
        raise error(("pattern", "pitch_lengths"), "must have one number at least")
    for number_, groove in enumerate(pattern.groove):
        if groove.span[0] >= groove.span[1]:
            raise error(("pattern", "groove", str(number_), "span"), "must ascend")


def check_cavity(tire: TireTable, scene: Scene, raw: Raw, error: Where) -> None:
    """Raise an error for what is not available with air."""
    if not has_air(scene):
        return
    rotation, residual = scene.rotation, scene.greens.residual
    if rotation is not None and rotation.speed and rotation.method == "full":
        raise error(
            ("rotation", "method"),
            '= "full" knows no air: take "projected", or tire.cavity.gas = "none"',
        )
    used = bool(scene.force) or scene.contact is not None
    if used and scene.modes.rim == "free" and not residual_of(residual).of_free_rim:
        raise error(
            ("greens", "residual"),
            f'= "{residual}" of a free rim knows no air: take {names(static=False)}, or '
            'tire.cavity.gas = "none"',
        )


class Rule(NamedTuple):
    """A rule for the table `of` of a scene, where that has one; `reads`: the other tables that it looks at."""

    check: Callable[[Any, Scene, Raw, Where], Iterable[InputError] | None]
    of: str
    reads: tuple[str, ...] = ()


RULES = (
    Rule(_static, "static"),
    Rule(_rotation, "rotation"),
    Rule(
        _modes,
        "modes",
        ("modal", "static", "rotation", "contact", "time", "damping", "greens"),
    ),
    Rule(full_matrices, "rotation", ("damping", "output", "tire")),
    Rule(_contact, "contact", ("static", "rotation")),
    Rule(
        check_outputs,
        "output",
        ("force", "modal", "axle", "tire", "damping", "contact", "time", "static"),
    ),
    Rule(check_campbell, "rotation"),
    Rule(_force, "force", ("output", "contact", "time", "tire")),
    Rule(_states, "rotation", ("greens",)),
    Rule(check_stiffness, "stiffness", ("static",)),
    Rule(check_cavity, "tire", ("rotation", "modal", "greens")),
    Rule(check_pattern, "pattern", ("contact",)),
    Rule(check_axle, "axle", ("modal", "rotation", "greens", "output", "static")),
    Rule(check_vibration, "output", ("time", "contact", "static", "force", "rotation")),
    Rule(check_sound, "sound", ("road", "rotation", "static", "output", "contact", "time")),
    Rule(check_shape, "tire", ("static", "road", "modal")),
    Rule(_time, "time"),
    Rule(
        check_motion,
        "motion",
        ("greens", "rotation", "time", "road", "static", "accuracy", "sound", "output", "contact"),
    ),
    Rule(check_accuracy, "accuracy", ("contact", "road", "time", "static", "output", "force")),
)
