"""Choices of what a scene leaves open, in one list, `CHOICES`: by its other tables, in this order.

A choice is a function of the scene so far and of what was `SceneFile`. Those that depend on each other
stand in the order in which they do: the mesh before the number of modes that it has.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from tireroad.contact.choices import USABLE
from tireroad.contact.tread.laws.elastic import FREQUENCY, ElasticLayer, ElasticTread
from tireroad.fem.parameters import second_digit
from tireroad.fem.sections.mesh2d import crown_layer
from tireroad.fem.tire.material import REFERENCE, wlf
from tireroad.runs.scene.plan import skipped
from tireroad.runs.scene.schema import Pitch, Source
from tireroad.runs.scene.tables.contact import TREAD_RUBBER
from tireroad.runs.scene.tables.scene import (
    DampingTable,
    ModalTable,
    RoadTable,
    Scene,
)
from tireroad.runs.scene.tables.tire import CavityTable

Say = Callable[[str], object]
TIRE, MODES = frozenset({"tire"}), frozenset({"tire", "modal"})

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


@dataclass(frozen=True)
class SceneFile:
    """The `raw` tables of a scene's file, the last stage `until`, its `source` and who is told (`say`)."""

    raw: dict[str, Any]
    until: str | None
    source: Source
    say: Say

    def keys(self, table: str) -> dict[str, Any]:
        """The keys of a table that the scene gives."""
        return keys if isinstance(keys := self.raw.get(table), dict) else {}


def air(scene: Scene, file: SceneFile) -> Scene:
    """Air in the cavity by default, for every section but the torus of the thesis."""
    tire = scene.tire
    if not tire.shape.air or tire.cavity is not None:
        return scene
    return replace(scene, tire=replace(tire, cavity=CavityTable()))


def friction(scene: Scene, file: SceneFile) -> Scene:
    """The friction of a dry road where the tread shears, unless the static state has its own."""
    assert scene.contact is not None
    if scene.static.friction is not None:
        return scene
    return replace(scene, contact=scene.contact.by_default())


def by_band(scene: Scene, file: SceneFile) -> Scene:
    """Choose by accuracy.up_to what a scene leaves open: mesh, modes, step. Points follow later (points)."""
    tables = {name: file.keys(name) for name in ("modal", "rotation", "time", "tire")}
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
        file.say(f"accuracy.up_to = {scene.accuracy.up_to:g} Hz chooses " + "; ".join(chosen))
    return scene


def has_band(scene: Scene, file: SceneFile) -> bool:
    """Whether accuracy.up_to chooses what the scene leaves open; a search chooses for itself."""
    method = scene.rotation.method if scene.rotation else "projected"
    stated = "up_to" in file.keys("accuracy") and method == "projected"
    return scene.in_contact and stated and not scene.accuracy.searches


def mesh(scene: Scene, file: SceneFile) -> Scene:
    """Set the mesh keys that are open; on a road, elements are smaller at the footprint."""
    return replace(scene, tire=scene.tire.with_elements(scene.static.on_road))


def points(scene: Scene, file: SceneFile) -> Scene:
    """`ON_A_WAVE` contact points on the shortest wave, where that is closer than `CLOSE`.

    `contact.points = "auto"` else (contact.patch).
    """
    contact, rotation = scene.contact, scene.rotation
    if "points" in file.keys("contact") or contact is None or contact.on_nodes:
        return scene
    if rotation is None or not rotation.speed:
        return scene
    speed = rotation.speed * scene.tire.proportions().outer_radius
    wave = speed / scene.accuracy.up_to
    if wave / ON_A_WAVE >= CLOSE:
        return scene
    pitch = _unheard(wave / ON_A_WAVE, speed, scene)
    file.say(
        f"accuracy.up_to chooses contact.points = {pitch:g} m, {wave / pitch:.2g} to the shortest wave"
    )
    return replace(scene, contact=replace(contact, points=Pitch(pitch, pitch)))


def _unheard(target: float, speed: float, scene: Scene) -> float:
    """The pitch (m), two digits of it, nearest to the `target` whose passing is not heard.

    Points pass at speed / pitch; that and its harmonics, sampled by the steps, must not return inside
    the band, neither in the run nor in its companions with twice the step and twice the pitch.
    """
    digit = second_digit(target)
    first, top = math.floor(target / digit), UNHEARD * BAND_EDGE * scene.accuracy.up_to
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


def tread_rubber(scene: Scene, file: SceneFile) -> Scene:
    """Rubber of the contact of a radial tire where the scene leaves it open: as much stiffer as its tread."""
    contact = scene.contact
    assert contact is not None
    stiffer = scene.tire.shape.tread_over_own(scene.tire, scene.temperature)
    if stiffer is None or "youngs_modulus" in file.keys("contact"):
        return scene
    if not isinstance(contact.law, ElasticTread):
        return scene
    modulus = float(f"{TREAD_RUBBER * stiffer:.6g}")
    times = (
        f", {stiffer:.4g} times that of a usual tread as the tire's own is" if stiffer != 1 else ""
    )
    file.say(f"contact.youngs_modulus = {modulus:g} Pa, of tread rubber{times}")
    return replace(
        scene, contact=replace(contact, law=replace(contact.law, youngs_modulus=modulus))
    )


def own_tread(scene: Scene, file: SceneFile) -> Scene:
    """A contact that counts only for what the elements do not resolve of the tire's tread, where the scene leaves the tread open."""
    contact, tire = scene.contact, scene.tire
    assert contact is not None
    if {"tread", "in_series"} & file.keys("contact").keys():
        return scene
    if contact.on_nodes or contact.has_bristles or not isinstance(contact.law, ElasticLayer):
        return scene
    section = tire.shape.ring(tire).section
    region, thickness = crown_layer(section)
    rubber = tire.shape.rubbers(tire)[section.regions[region]].at(scene.temperature)
    rolls = scene.rotation is not None and (scene.rotation.speed or scene.rotation.travel_speed)
    loss = rubber.loss(FREQUENCY) if rolls else 0.0  # of a tire that stands, the slow poles have it
    own = {"thickness": float(f"{thickness:.4g}"), "loss_factor": float(f"{loss:.3g}")}
    if tire.section != "radial":
        own["youngs_modulus"] = float(f"{rubber.dynamic * rubber.law.youngs:.4g}")
    changes = {key: value for key, value in own.items() if key not in file.keys("contact")}
    law = replace(contact.law, **changes)
    file.say(
        f"contact.in_series = false: of the tire's tread, {1e3 * law.thickness:.3g} mm of {1e-6 * law.youngs_modulus:.3g} MPa and a "
        f"loss factor of {law.loss_factor:.3g}, the contact counts what the elements do not resolve"
    )
    return replace(scene, contact=replace(contact, law=law, in_series=False))


def warmth(scene: Scene, file: SceneFile) -> Scene:
    """Say what another temperature than that of the compounds makes of pressure and moduli."""
    if scene.temperature != REFERENCE:
        file.say(
            f"temperature = {scene.temperature:g} °C: {scene.static.inflation / 1e3:.4g} kPa at {REFERENCE:g} °C are "
            f"{scene.inflation / 1e3:.4g} kPa; rubber has at f the moduli that it has there at "
            f"{wlf(scene.temperature):.3g} f"
        )
    return scene


def wheel_speed(scene: Scene, file: SceneFile) -> Scene:
    """Set the wheel's speed for a travel speed until the static state gives its rolling radius."""
    rotation = scene.rotation
    assert rotation is not None
    if rotation.travel_speed is None:
        return scene
    speed = rotation.travel_speed / (
        rotation.rolling_radius or scene.tire.proportions().outer_radius
    )
    return replace(scene, rotation=replace(rotation, speed=speed))


def damping(scene: Scene, file: SceneFile) -> Scene:
    """Set the default proportional damping if neither it nor a compound's loss factor is given."""
    if scene.damping is not None or scene.tire.shape.has_losses(scene.tire):
        return scene
    return replace(scene, damping=DampingTable())


def flat_road(scene: Scene, file: SceneFile) -> Scene:
    """Set a flat road where there is contact with none given."""
    if scene.road is not None:
        return scene
    file.say("no [road]: it is flat")
    return replace(scene, road=RoadTable())


def outputs(scene: Scene, file: SceneFile) -> Scene:
    """Leave out what is asked of driven points where there are none."""
    kinds = tuple(
        output for output in scene.output.kinds if scene.force or output[1].of != "points"
    )
    if len(kinds) == len(scene.output.kinds):
        return scene
    lost = [f"output.{name}" for name, kind in scene.output.kinds if (name, kind) not in kinds]
    file.say(f"no [[force]], hence no driven points: {', '.join(lost)} left out")
    return replace(scene, output=replace(scene.output, kinds=kinds))


def with_modal(scene: Scene, until: str | None) -> Scene:
    """Set the default [modal] where something needs modes, or the run is to end with them."""
    needed = scene.contact, scene.force, scene.rotation, scene.axle.kind != "fixed"
    if scene.modal is None and (any(needed) or until in ("modes", "rotating")):
        return replace(scene, modal=ModalTable())
    return scene


def count_of_modes(scene: Scene, file: SceneFile) -> Scene:
    """Fit the default number of modes to the mesh; note a given one that the mesh does not have.

    A given number is judged only if the modes will be computed.
    """
    modal = scene.modal
    assert modal is not None
    if modal.up_to is not None:
        return scene
    count, free = modal.count, scene.tire.free_unknowns()
    if count < free:
        return scene
    if "count" not in file.keys("modal"):
        file.say(
            f"modal.count is {free - 1}, all the modes that the mesh has, not {count} as by default"
        )
        return replace(scene, modal=replace(modal, count=free - 1))
    if "modes" not in skipped(scene, file.until):
        text = f"= {count} must be less than the {free} free unknowns of the mesh"
        file.source.add(("modal", "count"), text)
    return scene


class Choice(NamedTuple):
    """A choice for scenes that have the table `of` and for which `where` holds; left out where a table it is made `by` is wrong."""

    make: Callable[[Scene, SceneFile], Scene]
    by: frozenset[str] = frozenset()
    of: str = "tire"
    where: Callable[[Scene, SceneFile], bool] | None = None


CHOICES = (
    Choice(air),
    Choice(friction, of="contact"),
    Choice(by_band, where=has_band),
    Choice(mesh),
    Choice(damping, TIRE),
    Choice(warmth),
    Choice(tread_rubber, TIRE, of="contact"),
    Choice(own_tread, TIRE, of="contact"),
    Choice(wheel_speed, TIRE, of="rotation"),
    Choice(points, TIRE, where=has_band),
    Choice(flat_road, of="contact"),
    Choice(outputs),
    Choice(lambda scene, file: with_modal(scene, file.until)),
    Choice(count_of_modes, MODES, of="modal"),
)


def chosen(scene: Scene, file: SceneFile) -> Scene:
    """The scene with everything chosen that it leaves open."""
    for choice in CHOICES:
        concerned = getattr(scene, choice.of) is not None and (
            choice.where is None or choice.where(scene, file)
        )
        if concerned and not choice.by & file.source.broken():
            scene = choice.make(scene, file)
    return scene
