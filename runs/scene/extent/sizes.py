"""How large the parts of a scene will become, reckoned before anything is computed.

Modes by the density of a thin shell in bending, contact points by the footprint, steps by what the
automatic step resolves. Each is an estimate within a factor of two or so of what a run finds.
"""

import math
from dataclasses import dataclass

from tireroad.fem.errors import InputError
from tireroad.runs.scene.rules.road import least_travel, made
from tireroad.runs.scene.schema import Pitch
from tireroad.runs.scene.tables.scene import Scene

TURN = 0.3  # radians of the fastest mode in an automatic step, 200 steps at least (stages.build.stepping)
MARGIN = 5e-3  # m: the reach of the patch beyond the road's height (stages.greens)


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """`free` unknowns, `modes`, `points` of contact on `nodes`, time `steps`, `frequencies` of
    receptances, `speeds` of a Campbell diagram, `driven` points."""

    free: int
    modes: int
    nodes: int
    points: int
    steps: int
    frequencies: int
    speeds: int
    driven: int


def sizes(scene: Scene) -> Sizes:
    """The sizes of a scene."""
    free = scene.tire.free_unknowns()
    modes = _modes(scene, free)
    nodes, points = _points(scene, free)
    receptance, rotation = scene.output.receptance, scene.rotation
    campbell = rotation.campbell if rotation else None
    return Sizes(
        free=free,
        modes=modes,
        nodes=nodes,
        points=points,
        steps=_steps(scene, modes),
        frequencies=round(receptance.to / receptance.step) if receptance else 0,
        speeds=round(campbell.to / campbell.step) + 1 if campbell else 0,
        driven=len(scene.force),
    )


def _plate(scene: Scene) -> tuple[float, float]:
    """Area (m²) of the wall, and its mass per area over its bending stiffness (s²/m⁴)."""
    tire, material = scene.tire.proportions(), scene.tire.material
    middle = tire.outer_radius - 0.5 * tire.height
    area = 2 * math.pi * middle * 2 * math.radians(tire.half_angle) * tire.height
    law = material.law
    bending = law.youngs * tire.thickness**3 / (12 * (1 - law.poisson**2))
    return area, material.density * tire.thickness / bending


def _modes(scene: Scene, free: int) -> int:
    """Number of modes; below a frequency as of a flat plate: N = A k²/4π, k⁴ = ω² ρh/D."""
    if scene.modal.up_to is None:
        return scene.modal.count
    area, softness = _plate(scene)
    omega = 2 * math.pi * scene.modal.up_to
    return max(min(int(area * omega * math.sqrt(softness) / (4 * math.pi)), free // 3), 1)


def highest_frequency(scene: Scene, modes: int) -> float:
    """Frequency (Hz) of the highest mode, by the same density."""
    if scene.modal.up_to is not None:
        return scene.modal.up_to
    area, softness = _plate(scene)
    return 4 * math.pi * modes / (area * math.sqrt(softness)) / (2 * math.pi)


def road_height(scene: Scene) -> float:
    """Height (m) of the road over its datum in the first metres, and of its motion."""
    motion = scene.road.motion
    lift = abs(motion.amplitude) if motion.kind != "none" else 0.0
    surface, start = scene.road.surface, scene.road.start
    side = 0.1 + abs(scene.road.lateral)
    strip = start, start + min(least_travel(scene), 2.0) + 0.1, -side, side
    try:
        road = made(surface)
        high, low = road.highest(*strip), road.lowest(*strip)
    except InputError:
        return lift
    level = 0.5 * (high + low) if getattr(surface, "datum", "zero") == "mean" else 0.0
    return max(high - level + scene.road.offset, 0.0) + lift


def _points(scene: Scene, free: int) -> tuple[int, int]:
    """Nodes and points of the patch: where a torus is within reach of the road."""
    if scene.contact is None:
        return 0, 0
    static, contact, mesh = scene.static, scene.contact, scene.tire
    tire = mesh.proportions()
    round_ = math.sqrt(tire.outer_radius * tire.height)
    reach = contact.reach or 1.5 * road_height(scene) + MARGIN
    deflection = static.deflection or 0.01
    if static.load is not None and static.inflation > 0:
        # A membrane carries its load by the pressure on the area that is pressed flat.
        deflection = min(static.load / (2 * math.pi * static.inflation * round_), tire.height)
    area = 2 * math.pi * (reach + deflection) * round_
    graded = math.sqrt(mesh.footprint_size)  # the patch reaches beyond the finest elements
    around = 2 * math.pi * tire.outer_radius / (mesh.segments * mesh.order) * graded
    along = 2 * math.radians(tire.half_angle) * tire.height
    along *= graded / (tire.along * mesh.order)
    nodes = max(min(int(area / (around * along)), free // 6), 9)
    pitch = contact.points
    return nodes, int(area / (pitch.dx * pitch.dy)) if isinstance(pitch, Pitch) else nodes


def _steps(scene: Scene, modes: int) -> int:
    """Number of time steps, those of an automatic step as the run will choose it."""
    time = scene.time
    if time is None:
        return 0
    if not isinstance(time.step, str):
        return math.ceil(time.duration / time.step)
    step = min(time.duration / 200, TURN / (2 * math.pi * highest_frequency(scene, modes)))
    travel = least_travel(scene)
    if scene.contact is not None and travel > 0:
        step = min(step, made(scene.road.surface).spacing / 8 / (travel / time.duration))
    fastest = max((force.frequency for force in scene.force), default=0.0)
    if scene.road is not None and scene.road.motion.kind == "sine":
        fastest = max(fastest, scene.road.motion.frequency)
    return math.ceil(time.duration / min(step, 1 / (16 * fastest) if fastest else math.inf))
