"""Sizes of the parts of a scene, estimated before anything is computed.

Modes from their density in a shell under tension, contact points from the footprint, steps from the
automatic step. Each is within a factor of about two of what a run finds.
"""

import math
from dataclasses import dataclass

import numpy as np

from tireroad.contact.patch import ON_A_NODE
from tireroad.contact.roads.kinds.obstacle import Edges
from tireroad.contact.roads.placement import begun_at
from tireroad.fem.errors import InputError
from tireroad.fem.sections.mesh2d import SectionMesh
from tireroad.runs.scene.extent.wall import wall_of
from tireroad.runs.scene.rules.road import least_travel, made
from tireroad.runs.scene.schema import Pitch
from tireroad.runs.scene.tables.scene import Scene

TURN = 0.3  # radians of the fastest mode per automatic step (stages.build.rolling.stepping)
LEAST_STEPS = 200  # of an automatic step (ibid.)
SHAPES = 0.7, 0.1  # rotation shapes per mode: with cords, and without (modal.rotation_shapes)
# The fastest state with rotation shapes, over the highest mode: 1.3 to 2.5, on average 1.75, in 35
# runs of tori with 8 to 300 modes at 20 to 100 rad/s and of a belted tire (2026-11-25).
FASTEST_SHAPE = 1.75
# Footprint over what a membrane with the same load would flatten: 0.58 in a torus, 0.66 in the radial
# tire of passenger.toml.
PRESSED = 0.6
MARGIN = 5e-3  # m: reach of the patch beyond the road's height (stages.greens)


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """Sizes of a scene.

    `free` unknowns; `modes`; `coordinates`: modes plus the rotation shapes that join them; contact
    `points` on `nodes`, `touching` at rest; time `steps`; `frequencies` of receptances; `speeds` of a Campbell diagram;
    `driven` points.
    """

    free: int
    modes: int
    coordinates: int
    nodes: int
    points: int
    touching: int
    steps: int
    frequencies: int
    speeds: int
    driven: int


def sizes(scene: Scene) -> Sizes:
    """The sizes of a scene."""
    free = scene.tire.free_unknowns()
    modes = _modes(scene, free)
    nodes, points, touching = _points(scene, free)
    rotation = scene.rotation
    campbell = rotation.campbell if rotation else None
    return Sizes(
        free=free,
        modes=modes,
        coordinates=modes + _shapes(scene, modes),
        nodes=nodes,
        points=points,
        touching=touching,
        steps=_steps(scene, modes),
        frequencies=sum(kind.frequencies() for _, kind in scene.output.kinds),
        speeds=round(campbell.to / campbell.step) + 1 if campbell else 0,
        driven=len(scene.force),
    )


def _modes(scene: Scene, free: int) -> int:
    """Number of modes."""
    if scene.modes.up_to is None:
        return scene.modes.count
    return max(min(int(wall_of(scene).modes_below(scene.modes.up_to)), free // 3), 1)


def _shapes(scene: Scene, modes: int) -> int:
    """Number of rotation shapes that join the modes."""
    if not scene.joins_shapes or not scene.rotation.speed:
        return 0
    return int(SHAPES[not scene.tire.shape.angles(scene.tire)] * modes)


def highest_frequency(scene: Scene, modes: int) -> float:
    """Frequency (Hz) of the highest mode, from the same mode density."""
    return scene.modes.up_to or wall_of(scene).frequency_of(modes)


def fastest_state(scene: Scene, modes: int) -> float:
    """Largest absolute eigenvalue (1/s) of the wheel's states: of a rotation shape if they join.

    Of two real eigenvalues of an overdamped state it is the larger. Those of a moving wheel on
    stiff springs are left out.
    """
    rotation, damping = scene.rotation, scene.damping
    if rotation and rotation.method == "full":
        modes = rotation.count
    rate = 2 * math.pi * highest_frequency(scene, modes)
    if rotation and rotation.speed and scene.joins_shapes:
        rate *= FASTEST_SHAPE
    half = 0.5 * (damping.mass + damping.stiffness * rate**2) if damping else 0.0
    return half + math.sqrt(half**2 - rate**2) if half > rate else rate


def road_height(scene: Scene) -> float:
    """Height (m) of the road above its datum in the first metres, plus its motion's amplitude."""
    motion = scene.road.motion
    lift = abs(motion.amplitude) if motion.kind != "none" else 0.0
    surface, side = scene.road.surface, 0.1 + abs(scene.road.lateral)
    try:
        road = made(surface)
        start = begun_at(road, scene.road.start)
        # Bounds of a long texture take time; those of a single obstacle do not.
        travel = least_travel(scene)
        travel = travel if isinstance(surface, Edges) else min(travel, 2.0)
        strip = start, start + travel + 0.1, -side, side
        high, low = road.highest(*strip), road.lowest(*strip)
    except InputError:
        return lift
    if not math.isfinite(high - low):  # heights that are missing, which the run refuses
        return lift
    level = 0.5 * (high + low) if getattr(surface, "datum", "zero") == "mean" else 0.0
    return max(high - level + scene.road.offset, 0.0) + lift


def road_memory(scene: Scene) -> dict[str, float]:
    """Bytes taken while the road is made, if significant."""
    try:
        taken = getattr(made(scene.road.surface), "making", 0.0)
    except InputError:
        return {}
    return {"making the road": taken} if taken else {}


def _points(scene: Scene, free: int) -> tuple[int, int, int]:
    """Nodes and points of the patch, where the tire is within reach of the road, and points that
    touch."""
    if not scene.in_contact:
        return 0, 0, 0
    static, contact, mesh, tire = scene.static, scene.contact, scene.tire, scene.tire.proportions()
    round_ = math.sqrt(tire.outer_radius * tire.height)
    reach = contact.reach or 1.5 * road_height(scene) + MARGIN
    deflection = static.deflection or 0.01
    if static.load is not None and static.inflation > 0:
        # A membrane carries its load by the pressure on the flattened area.
        deflection = min(static.load / (2 * math.pi * static.inflation * round_), tire.height)
    section = mesh.ring().section
    area = _area_within(section, reach + deflection)
    share = PRESSED * _area_within(section, deflection) / area
    graded = math.sqrt(mesh.footprint_size)  # the patch extends beyond the finest elements
    around = 2 * math.pi * tire.outer_radius / (mesh.segments * mesh.order) * graded
    along = 2 * math.radians(tire.half_angle) * tire.height
    along *= graded / (tire.along * mesh.order)
    within = area / (around * along)
    nodes = max(min(int(within), free // 6), 9)
    if contact.on_nodes:
        return nodes, nodes, int(share * nodes)
    # A grid is carried by all nodes of the elements that it meets: one more element, half of it on
    # either side, and the node that closes the row.
    carrying = max(min(int((math.sqrt(within) + mesh.order + 1) ** 2), free // 6), 9)
    pitch = contact.points
    points = area / (pitch.dx * pitch.dy) if isinstance(pitch, Pitch) else ON_A_NODE**2 * nodes
    return carrying, int(points), int(share * points)


def _area_within(section: SectionMesh, depth: float) -> float:
    """Area (m²) of the undeformed outer face cut off by a plane `depth` (m) above its lowest point.

    Integrates the chord 2 sqrt(2 r (depth - fall)) over the section; for a torus 2 pi depth sqrt(R
    r).
    """
    r, y = section.nodes[section.chain(section.outer)].T
    chord = 2 * np.sqrt(2 * r * np.clip(depth - (r.max() - r), 0.0, None))
    return float((np.diff(y) * (chord[1:] + chord[:-1]) / 2).sum())


def _steps(scene: Scene, modes: int) -> int:
    """Number of time steps; for an automatic step, as the run will choose it."""
    time = scene.time
    if time is None:
        return 0
    if not isinstance(time.step, str):
        return math.ceil(time.duration / time.step)
    step = min(time.duration / LEAST_STEPS, TURN / fastest_state(scene, modes))
    travel = least_travel(scene)
    if scene.in_contact and travel > 0:
        spacing, points = made(scene.road.surface).spacing, scene.contact.points
        spacing = max(spacing, points.dx) if isinstance(points, Pitch) else spacing
        step = min(step, spacing / 8 / (travel / time.duration))
    return math.ceil(time.duration / min(step, _shortest_period(scene) / 16))


def _shortest_period(scene: Scene) -> float:
    """Shortest period (s) of the forces and of the road's motion; infinite if there is none."""
    periods = [1 / force.frequency for force in scene.force if force.frequency]
    motion = scene.road.motion if scene.road else None
    if motion and motion.kind == "sine":
        periods.append(1 / motion.frequency)
    elif motion and motion.kind == "ramp":
        periods.append(motion.duration)
    return min(periods, default=math.inf)
