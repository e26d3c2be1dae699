"""Sizes of the parts of a scene, estimated before anything is computed.

Modes from their density in a shell under tension, contact points from the footprint, steps from the
automatic step. Each is within a factor of about two of what a run finds.
"""

import math
from dataclasses import dataclass

import numpy as np

from tireroad.contact.choices import LEAST_STEPS, TURN
from tireroad.contact.patch import ON_A_NODE
from tireroad.contact.roads.kinds.shapes import Edges
from tireroad.contact.roads.under_tire import begun_at
from tireroad.fem.errors import InputError
from tireroad.fem.sections.mesh2d import SectionMesh
from tireroad.fem.wheel import SHAPE_TOLERANCE
from tireroad.runs.scene.road_cache import road_of
from tireroad.runs.scene.rules import least_travel
from tireroad.runs.scene.schema import Pitch
from tireroad.runs.scene.tables.scene import Scene

DIRECTIONS = 16  # of waves, over a quarter turn

# Rotation shapes of a tire with cords: 28 of 60 modes, 55 of 120, 133 of 268, 455 of 1813 with the default
# tolerance, 240 of 1813 with five times that; and per mode of one without.
CORDED, PLAIN = 1.2, 0.1
# The fastest state with rotation shapes, over the highest mode: 1.3 to 2.5, on average 1.75, in 35
# runs of tori with 8 to 300 modes at 20 to 100 rad/s and of a belted tire (2026-11-25).
FASTEST_SHAPE = 1.75
# Footprint over what a membrane with the same load would flatten: 0.58 in a torus, 0.66 in the radial
# tire of passenger.toml.
PRESSED = 0.6
MARGIN = 5e-3  # m: reach of the patch beyond the road's height (stages.greens)


@dataclass(frozen=True)
class ModeDensity:
    """N = A/4π (k² + s² ω (ω - ω_s)) modes up to ω, k² averaged over the directions of waves.

    k is the wave number of bending waves in a shallow shell (Donnell), ρh (ω² - ω_c²) = B k⁴ + T k²,
    and s² the sum of the squared slownesses of the two in-plane waves. Cords make one of them too fast
    to count; the other shears the rubber of the walls, between whose edges it has to fit: from ω_s on,
    one wave on the section's height (radial tire to 570, 800, 1000, 1400 Hz: 249, 583, 937, 1813 modes;
    this gives 258, 538, 778, 1443). A wave across which the wall is curved stretches it, and there is none below its
    ω_c = c (cos²θ / r + sin²θ / R), where c is the speed of sound in a rod, r and R the radii of the
    section and of the crown, θ the direction from the circumference (318 Hz at θ = 0 in a torus of
    48 MPa and r = 0.1 m, whose 60th mode is at 313 Hz: 294 Hz by this, 210 Hz in a flat plate).

    `area` A m², `mass` ρh kg/m², `bending` B N m, `tension` T N/m, `slowness2` s² (s/m)², `fitting` ω_s
    1/s, `curved2` ω_c² (1/s²) by direction.
    """

    area: float
    mass: float
    bending: float
    tension: float
    slowness2: float
    fitting: float
    curved2: np.ndarray

    def modes_below(self, frequency: float) -> float:
        """Number of modes below a frequency (Hz)."""
        omega2 = (2 * math.pi * frequency) ** 2
        driving = self.mass * np.maximum(omega2 - self.curved2, 0.0)
        root = np.sqrt(self.tension**2 + 4 * self.bending * driving)
        k2 = float(np.mean((root - self.tension) / (2 * self.bending)))
        omega = 2 * math.pi * frequency
        inside = self.slowness2 * omega * max(omega - self.fitting, 0.0)
        return self.area * (k2 + inside) / (4 * math.pi)

    def frequency_of(self, modes: float) -> float:
        """Frequency (Hz) below which there are that many modes, by bisection in its logarithm."""
        low, high = 1e-3, 1e9
        while high > 1.001 * low:
            middle = math.sqrt(low * high)
            low, high = (middle, high) if self.modes_below(middle) < modes else (low, middle)
        return low


def wall_of(scene: Scene) -> ModeDensity:
    """The wall, from the section's height and thickness; tension as in a circle of that radius.

    With cords its bending waves are those of a flat plate: cords hinder the stretching of rubber, and
    give way to waves that do not stretch them.
    """
    tire, shape = scene.tire.proportions(), scene.tire.shape
    youngs, poisson, density = shape.rubber(scene.tire)
    shear, stretch = (density * part / youngs for part in (2 * (1 + poisson), 1 - poisson**2))
    middle = tire.outer_radius - 0.5 * tire.height
    cords = bool(shape.angles(scene.tire))
    theta = (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS * math.pi / 2
    curved = np.cos(theta) ** 2 / tire.height + np.sin(theta) ** 2 / tire.outer_radius
    return ModeDensity(
        area=2 * math.pi * middle * 2 * math.radians(tire.half_angle) * tire.height,
        mass=density * tire.thickness,
        bending=youngs * tire.thickness**3 / (12 * (1 - poisson**2)),
        tension=scene.inflation * tire.height,
        slowness2=shear if cords else shear + stretch,
        fitting=math.pi / (math.sqrt(shear) * tire.height) if cords else 0.0,
        curved2=np.zeros(DIRECTIONS) if cords else youngs / density * curved**2,
    )


def factor(free: float, through: int, order: int) -> float:
    """Bytes of one triangle of a factor; `free` unknowns, `through` elements through the wall.

    That of nested dissection on a surface: 31/4 N log2 N entries for N columns of nodes (George
    1973, doi 10.1137/0710032), each a dense block of the unknowns of one column. For 27,225 and
    59,697 unknowns of second order MUMPS took 84 and 194 MB; this gives 88 and 211 MB.
    """
    block = unknowns_through(through, order)
    columns = max(free / block, 2.0)
    return 4.0 * 7.75 * columns * math.log2(columns) * block**2


def matrices(count: int, free: float, through: int, order: int) -> float:
    """Bytes of `count` sparse matrices of the same mesh."""
    coupled = _layers_coupled(through, order) * _columns_coupled(order)
    return 12.0 * count * (3 * free) * coupled


def unknowns_through(through: int, order: int) -> int:
    """Unknowns of a column of nodes."""
    return 3 * (through * order + 1)


def _columns_coupled(order: int) -> float:
    """Columns of nodes sharing an element with a given one, averaged over an element's columns."""
    own = np.full(order, order + 1.0)  # inside an element
    own[0] = 2 * order + 1  # between two elements
    return float(np.outer(own, own).mean())


def _layers_coupled(through: int, order: int) -> float:
    """Nodes of one column that share an element with a given one, on average."""
    inside = through * (order - 1) * (order + 1)
    return (inside + 2 * (order + 1) + (through - 1) * (2 * order + 1)) / (through * order + 1)


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
    if not scene.tire.shape.angles(scene.tire):
        return int(PLAIN * modes)
    looser = scene.rotation.shape_tolerance / SHAPE_TOLERANCE
    return int(CORDED * modes**0.8 * looser**-0.4)


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
        road = road_of(surface)
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
        taken = getattr(road_of(scene.road.surface), "making", 0.0)
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
    if static.load is not None and scene.inflation > 0:
        # A membrane carries its load by the pressure on the flattened area.
        deflection = min(static.load / (2 * math.pi * scene.inflation * round_), tire.height)
    section = mesh.ring().section
    area = _area_within(section, reach + deflection)
    share = PRESSED * _area_within(section, deflection) / area
    graded = math.sqrt(mesh.footprint_size)  # the patch extends beyond the finest elements
    around = 2 * math.pi * tire.outer_radius / (mesh.segments * mesh.order) * graded
    within = area / (around * _between(section, reach + deflection))
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


def _between(section: SectionMesh, depth: float) -> float:
    """Mean distance (m) across of neighbouring nodes of the outer face below such a plane."""
    r, y = section.nodes[section.chain(section.outer)].T
    inside = r.max() - r < depth
    return float(np.ptp(y[inside]) / max(int(inside.sum()) - 1, 1)) or float(
        np.abs(np.diff(y)).max()
    )


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
        spacing, points = road_of(scene.road.surface).spacing, scene.contact.points
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
