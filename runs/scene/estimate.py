"""Estimates of a scene's memory, disk and time before anything is computed, and what the machine has."""

from dataclasses import dataclass, replace

from tireroad.contact.choices import DENSE_POINTS, USABLE, by_product
from tireroad.contact.results.chance import asked, planned
from tireroad.greens.residuals import residual_of
from tireroad.greens.schemes import keeps_history
from tireroad.runs.scene.plan import meets_road, skipped
from tireroad.runs.scene.sizes import (
    Sizes,
    factor,
    highest_frequency,
    matrices,
    road_memory,
    sizes,
    unknowns_through,
)
from tireroad.runs.scene.tables.scene import Scene

TANGENTS = 4
"""Matrices held in the static state: the whole ring's tangent, half of it folded, index maps."""
COLUMNS = 250
"""Columns of a tangent's inverse that solving the contact set takes, held twice.

At most 400 (fem.static.tangent). A torus of 220,500 unknowns took 2.3 GB on each of two
processes; the estimate is 1.8, 1.4 without them. Released before the modes.
"""
HIGHEST = 3
"""Highest element order, as in fem.static.load_error, which is not imported just to estimate."""
LOAD_ERROR = "estimate of the load's error"
FRICTION = "static friction"
DAMPING = "static damping by the stiffness"
WIDE = 3.5
"""Time of a static state whose tangent holds this damping over that of one without, as measured with
8,316, 13,860 and 23,760 unknowns (3.0, 4.1, 3.7)."""
_WEAK = 0.5  # as in fem.static.equilibrium, which is not imported just to estimate
# Tangents with friction, as counted on the built-in tire with 25,056 and 40,176 unknowns: a rolling
# tire takes 7 or 8 with its friction, 13 or 14 to find its free travel and 8 with its slip; a
# standing one 6 or 7 a step, and 4 for its load.
_ROLLING, _TRAVEL, _SLIP, _STEP, _LOAD = 8, 13, 8, 7, 4

# Error bars, of the time of all else: 0.49 in torus.toml and 0.35 in passenger.toml
# (2026-11-24); the stage bounds its window to keep them below a half.
_BARS = 0.42
# The load's error by finer meshes, of the time of the static state: 1.8 of 9,828 and of 29,700
# unknowns (2026-11-25). The companion runs of error bars go without it.
_LOAD_ERROR = 1.8
# s a step of the horizontal forces: some turns of Newton steps with products between all points that touch.
# Measured with a tread that shears (2026-11-28): 0.3 ms with 81 points that touch, a torus, 0.7 ms with 100, passenger tires;
# with a brush alone 0.3 ms with 81. All at once (2026-11-30): 14.5 ms with 610, 45 ms with 1,770.
_SHEARED, _SHEARED_PAIR, _BRISTLES = 3e-4, 2.2e-8, 3e-4
AT_ONCE = 2.1e-5
"""s a step and point that touches, of normal and horizontal forces at once."""
# One tangent with friction, of the frictionless static state: its factor has two triangles, and is
# of the whole ring. Measured on the built-in tire (2026-11-25): 0.2 standing, 0.24 and 0.26 rolling.
_RUBBING = 0.25
PACKED = 0.3
"""Size of contact.h5 relative to its raw numbers: most forces are 0 (measured: 0.24 on stones, 0.29
on texture)."""
REPORT = 1.6e6
"""Bytes of report.html and the text files: 0.9 to 2.1 MB in twenty runs (2026-11-25)."""
HEADER = 3e4
"""Bytes of a file's scene, settings and empty datasets."""
RELAXING, ROLLED_OUT = 0.8, 0.07
"""Poles of slow rubber over loads of the patch, of a tire that stands (435 of 549 loads) and of one that rolls at 80 km/h (55 of
741 in quickstart.toml)."""
SOFTENED = 12
"""Matrices between all loads of the patch held while slow rubber is found (greens.slow)."""
INSTANTS = 400
"""Instants of the outer face in motion.h5 at most (runs.stages.vibration)."""
MOST_OF_VIBRATION = 2e8
"""Bytes of the outer face's spectra in vibration.h5 at most (runs.stages.vibration)."""

PROGRAM = 2.1e8
"""Bytes of one process with all libraries loaded and the mesh made (measured)."""
MATRICES = 5
"""Sparse matrices held at peak: K, its scaled copy and parts, those of rotation (measured,
including the rest: 0.6 to 0.83 GB for torus.toml, 1.1 to 1.4 GB for passenger.toml, 2.3 to 2.8
GB for a passenger tire of 102,060 unknowns on one process, 1.6 to 1.8 GB on each of two)."""
BASES = 3
"""Copies of all modes held at peak: slices, the sorted vectors, their products."""
ANSWERS = 6 * 64
"""Columns held while solving for the flexibility of the patch (fem.matrices.compliance.solve_parts):
loads, solutions, copies."""
SHAPES = 3
"""Full-length columns per force on the patch held at peak, with attachment modes; other residuals
hold only values at the patch."""
BLOCK = 512
"""Steps of contact results held between two writes (runs.stages.contact_file)."""
PIECE = 64
"""Steps of which the work is computed at a time (contact.results.energy)."""
PIVOT, PIVOTED, USUAL = 5, 2, 3
"""Copies of the matrix of the usual set during pivoting and afterwards (contact.solver.active_set), and its
size over the number of points that touch at rest: 3,094 of 958 (2026-11-25)."""
SLIPPING = 16
"""Copies of the matrix of the touching points while the largest unique friction is found: the tread's
kernels and their indices 7, the normal forces' 1, of twice its width the lifts 2, the coupling 1, its
singular values 1 (contact.solver.stick_slip). Not during pivoting."""

STATES, HELD = 300, 5
"""States of a training of large motions, half-turned copies included (70 to 300 on bars), and copies held of their fields: motions,
answers, forces and what is made of both (runs.stages.training)."""

FOOTPRINT = "columns of the footprint"
TRAINING = "training of large motions"
FACTOR = "factor of the stiffness"
SLOW = "slow rubber"

# Keys that determine the size of each part.
KEYS = {
    "matrices": "tire.segments, tire.elements_arc, tire.elements_thickness, tire.order",
    FACTOR: "tire.segments, tire.elements_arc, tire.elements_thickness, tire.order",
    LOAD_ERROR: "static.error_estimate, and the mesh",
    FRICTION: "static.friction, and the mesh",
    DAMPING: "damping.stiffness, and the mesh",
    "modes": "modal.count or modal.up_to, and the mesh",
    FOOTPRINT: "tire.segments, tire.elements_arc, tire.elements_thickness, tire.order",
    "rotating pencil": "modal.count or modal.up_to",
    "flexibility of the patch": "greens.residual, the mesh, contact.reach, the road's height",
    "contact": "contact.points, contact.reach, the road's height",
    TRAINING: "motion.kind, and the mesh",
    SLOW: "contact.points, contact.reach, the road's height, moduli over frequency",
    "receptances": "output.receptance.step, output.receptance.to, the number of forces",
    "time series": "time.duration, time.step",
    "contact.h5": "time.duration, time.step, contact.points",
    "contact loop": "time.duration, time.step, contact.points",
    "modes.h5": "modal.count, and the mesh",
    "vibration.h5": "output.vibration, time.duration, and the mesh",
    "motion.h5": "output.fields, and the mesh",
    "radiation.h5": "sound.up_to",
    "radiation": "sound.up_to",
    "air around": "sound.up_to",
    "error bars": "accuracy.estimate",
    "stretches": "accuracy.chance_db, time.duration",
}

# Parts that the processes of a run share by rows; of everything else each process has its own.
SPREAD = (
    "matrices",
    FACTOR,
    FOOTPRINT,
    LOAD_ERROR,
    FRICTION,
    DAMPING,
    "modes",
    "flexibility of the patch",
    TRAINING,
)
# Share of a factor that MUMPS keeps on disk out of core: with 54,000 and 108,000 unknowns, 26 and
# 22 % of the memory were still taken.
ON_DISK = 0.7


def turning(scene: Scene) -> bool:
    """Whether the wheel turns."""
    return scene.rotation is not None and scene.rotation.speed > 0


def tangents_with_friction(scene: Scene) -> int:
    """Number of unsymmetric tangents that the static state factorises; 0 without friction."""
    static, rotation = scene.static, scene.rotation
    if static.friction is None or not static.on_road:
        return 0
    if rotation is None or not _rolls(scene):
        return static.friction_steps * _STEP + _LOAD * (static.load is not None)
    slips = rotation.slip_angle or (scene.contact is not None and any(scene.contact.slip))
    return _ROLLING + _TRAVEL * (rotation.rolling_radius is None) + _SLIP * bool(slips)


def _rolls(scene: Scene) -> bool:
    """Whether the static state is that of a tire that rolls."""
    return turning(scene) and scene.static.steady_rolling


def holds_damping(scene: Scene) -> bool:
    """Whether the tangent holds the damping by the stiffness (fem.static.equilibrium).

    Strains per radian at most: 20 with 40 elements of order 1 around, 33 and 62 with 22 and 40 of
    order 2.
    """
    if scene.rotation is None or scene.damping is None or not _rolls(scene):
        return False
    fastest = 0.51 * scene.tire.segments * scene.tire.order**1.6
    return scene.rotation.speed * scene.damping.stiffness * fastest > _WEAK


def beside_tangents(scene: Scene, free: float, later: float) -> dict[str, float]:
    """Bytes beside the frictionless state's tangents and factor, which are released before the
    modes: the excess over `later`, the bytes that come then.

    Friction comes first and the companions of the load's error after it; the larger counts.
    """
    static = scene.static
    through, order = scene.tire.proportions().through, scene.tire.order
    taken = {}
    if static.on_road and static.error_estimate:
        taken[LOAD_ERROR] = _companions(free, through, order)
    if tangents_with_friction(scene):
        # Both triangles of a factor; a rolling tire has products of its tangent beside it. With
        # 25,056 and 40,176 unknowns they took 0.5 and 1.0 GB, standing 0.2 GB.
        products = matrices(TANGENTS, free, through, order) if _rolls(scene) else 0.0
        taken[FRICTION] = 2 * factor(free, through, order) + products
    name = max(taken, key=taken.__getitem__, default="")
    found = {name: max(taken[name] - later, 0.0)} if taken else {}
    if holds_damping(scene):
        # A node is coupled to four times as many: the product, and both triangles of its factor.
        wide = matrices(4, free, through, order) + 7 * factor(free, through, order)
        found[DAMPING] = max(wide - max(later - taken.get(name, 0.0), 0.0), 0.0)
    return found


def _companions(free: float, through: int, order: int) -> float:
    """Bytes of the two companions of the load's error (fem.static.load_error), on half of the ring.

    One has elements halved at the footprint, which doubles their number; the other has another
    order everywhere, a higher one on half as many elements around.
    """
    other = order + 1 if order < HIGHEST else order - 1
    layers = unknowns_through(through, other) / unknowns_through(through, order)
    share = 0.25 if other > order else 0.5
    rest = share * free * (other / order) ** 2 * layers
    return sum(
        matrices(TANGENTS, one, through, p) + factor(one, through, p)
        for one, p in ((free, order), (rest, other))
    )


def seconds(
    work: dict[str, float],
    size: Sizes,
    column: int,
    bars: bool = False,
    load_error: bool = False,
    stretches: float = 0.0,
) -> dict[str, float]:
    """CPU time (s) of `operations` by stage; `column`: unknowns in a column through the wall.

    On a core of a shared server (Intel Xeon), one BLAS thread, 2026-11-23; from 7,020 to 98,100
    unknowns (static state: 224,100) within a factor of 1.6
    (tests/runs/scenes/test_estimated_time.py). Operations through the wall are done in blocks,
    which are faster the thicker the wall; those on modes too, in larger blocks on larger meshes.
    `bars`: with error bars, by companion runs; `load_error`: with static.error_estimate; `stretches`:
    steps on further stretches of road, over those of the run.
    """
    thicker, larger = column / 9, size.free / 27_900
    share = {
        "static": larger**0.08 / thicker,
        "modes": 1.4 / (thicker**0.5 * larger**0.2),
        "greens": 1.1 / thicker**0.5,
    }
    found = {name: share.get(name, 1.0) * each for name, each in work.items()}
    beside = {"error bars": _BARS * sum(found.values())} if bars else {}
    if load_error:
        beside[LOAD_ERROR] = _LOAD_ERROR * found["static"]
    if stretches:
        beside["stretches"] = stretches * found["contact loop"]
    return found | beside


def _stretches(scene: Scene, size: Sizes) -> float:
    """Steps on further stretches of road (runs.stages.stretches), over those of the run."""
    rotation, duration = scene.rotation, scene.time.duration
    radius = scene.tire.proportions().outer_radius
    speed = rotation.speed * radius if rotation else 0.0
    grown = (scene.road.run_in + 0.5 * radius) / speed if speed else 0.0
    window = duration - grown if grown < duration / 2 else duration
    limit = USABLE * highest_frequency(scene, size.modes)
    plan = planned(asked(1 / window, limit), 1 / window, scene.accuracy.chance_db)
    return plan.stretches * (grown + (plan.windows + 1) / 2 * window) / duration


def operations(
    scene: Scene, size: Sizes, left_out: dict[str, str], column: int, dense: bool
) -> dict[str, float]:
    """Operations by stage, in seconds on one core of 2020.

    Those of torus.toml (27,900 unknowns, 9 per column of nodes, 200 modes, 277 nodes), scaled
    by the fastest-growing operations: each unknown is coupled to all those of the neighbouring
    columns. `dense`: the contact points have a full matrix.
    """
    count, pairs = size.modes / 200, size.coordinates / 200
    mesh = (size.free / 27_900) ** 1.2 * column / 9
    parts = {"static": 8.0 * mesh * (1 + _RUBBING * tangents_with_friction(scene))}
    if holds_damping(scene):
        parts["static"] *= WIDE
    if "radiation" not in left_out:
        elements, frequencies = boundary_elements(scene)
        parts["radiation"] = 0.8 * frequencies * (elements / 1900) ** 2
    if "modes" not in left_out:
        parts["modes"] = 7.0 * mesh * count
    if "rotating" not in left_out:
        # 2.8 s for 400 coordinates, 62 to 82 s for 2,060 to 2,280: blocks fill the caches.
        parts["rotating"] = 0.7 * pairs**2 * max(1.0, pairs / 12) * (1 + size.speeds)
    if "contact" not in left_out:
        loads = size.nodes * (3 if scene.contact.has_friction else 1)
        parts["greens"] = 3.0 * mesh * loads / 277
        if residual_of(
            scene.greens.residual
        ).joins:  # solved for both sides, and joined to the modes
            parts["greens"] *= 1.6
        # Conjugate gradients: 12 ms for 3,041 points.
        points = size.points**2 if dense else 4000 * size.points
        if at_once := _at_once(scene, size):
            points = 0
        step = 2e-4 + 1e-9 * (4 * loads * size.coordinates + points)
        if scene.contact.has_friction:
            alone = _SHEARED + _SHEARED_PAIR * size.touching**2
            shear = AT_ONCE * size.touching if at_once else alone
            step += shear if scene.contact.has_shear else _BRISTLES
        if keeps_history(scene.time.scheme):
            step += 1e-9 * 0.5 * size.steps * loads**2
        parts["contact loop"] = size.steps * step
    if "response" not in left_out:
        parts["response"] = size.steps * 2e-5 + size.frequencies * (2e-5 + 5e-8 * size.coordinates)
    return parts


def _at_once(scene: Scene, size: Sizes) -> bool:
    """Whether normal and horizontal forces are found at once (contact.loop)."""
    grid = not scene.contact.on_nodes and size.points > DENSE_POINTS
    return grid and scene.contact.has_friction and _by_product(scene, size, size.touching)


def _by_product(scene: Scene, size: Sizes, touching: float) -> bool:
    """Whether a grid of so many points is solved with products in place of matrices."""
    solver, friction = scene.contact.solver, scene.contact.has_friction
    if solver == "auto":
        return by_product(friction, size.points, size.nodes, round(touching))
    return solver == "projected-cg"


def boundary_elements(scene: Scene) -> tuple[float, float]:
    """Boundary elements of the air, and frequencies they are solved at.

    Those of greens.tire_sound on a passenger tire: 1,468 of 60 mm, 1,928 of 43 mm.
    """
    up_to = scene.heard_up_to
    size = min(max(343.0 / (8 * up_to), 0.02), 0.06)
    return 1000 + 1.75 / size**2, 2 + up_to / 60


def disk(scene: Scene, size: Sizes, left_out: dict[str, str]) -> dict[str, float]:
    """Peak bytes of the result folder by file, without stages that are `left_out`."""
    parts = {"static.h5": HEADER + 40.0 * size.free}
    if "radiation" not in left_out:
        elements, frequencies = boundary_elements(scene)
        parts["radiation.h5"] = HEADER + 8.0 * 225 * elements * frequencies
    if "modes" not in left_out:
        every = face(scene, size) + 5 * size.coordinates
        parts["modes.h5"] = HEADER + 8.0 * size.coordinates * every
    if "rotating" not in left_out:
        branches = scene.rotation.campbell.branches if scene.rotation.campbell else 0
        parts["rotating.h5"] = (
            HEADER + 16.0 * 2 * size.coordinates**2 + 40.0 * size.speeds * branches
        )
    if "contact" not in left_out:
        # A checkpoint is a copy of contact.h5 so far.
        numbers = size.points * (3 + 2 * (scene.contact.has_friction)) + 10
        parts["contact.h5"] = HEADER + 2 * PACKED * 8.0 * size.steps * numbers
        parts["greens.h5"] = HEADER + 16.0 * 2 * size.nodes * (2 * size.coordinates + size.nodes)
    if "response" not in left_out:
        k = max(size.driven, 1)
        more = sum(kind.numbers(k) for _, kind in scene.output.kinds)
        series = size.steps * (4 * k + 3 + more)
        parts["response.h5"] = 8.0 * (series + 2 * size.frequencies * k * k)
    if "report" not in left_out:
        parts["report.html"] = REPORT
    return parts | _in_frequency(scene, size, left_out)


def face(scene: Scene, size: Sizes) -> float:
    """Unknowns of the outer face, one layer of nodes."""
    return size.free / (scene.tire.proportions().through * scene.tire.order + 1)


def _in_frequency(scene: Scene, size: Sizes, left_out: dict[str, str]) -> dict[str, float]:
    """Files of lines up to where the modes are an answer, one in each 1 / duration."""
    if scene.time is None:
        return {}
    parts, outer = {}, face(scene, size)
    lines = USABLE * highest_frequency(scene, size.modes) * scene.time.duration
    if "spectra" not in left_out:
        parts["spectra.h5"] = HEADER + 8.0 * (1 + 6 * 3) * lines
    if "vibration" not in left_out:
        parts["vibration.h5"] = HEADER + min(16.0 * lines * outer, MOST_OF_VIBRATION)
    if "sound" not in left_out:
        parts["sound.h5"] = HEADER + 4 * (24.0 * lines + 8 * outer * (2 + scene.heard_up_to / 60))
    if "motion" not in left_out:
        # Eight instants a period of the highest line, the last ones of the run.
        parts["motion.h5"] = HEADER + 4.0 * min(8 * lines, INSTANTS) * outer
    return parts


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Estimated demand of a scene, by part, and the `sizes` it follows from.

    `memory` (bytes): peak of one process; `disk` (bytes): peak of the result folder; `seconds` on
    one core. `work`: operations, to which the seconds are a measured factor; choices by cost use
    `work`, so that they do not change when the seconds are recalibrated.
    """

    sizes: Sizes
    memory: dict[str, float]
    disk: dict[str, float]
    work: dict[str, float]
    seconds: dict[str, float]


def estimate(scene: Scene, until: str | None = None) -> Estimate:
    """Demand of the stages up to `until`; memory within 1.5 where measured, the rest rougher."""
    left_out = skipped(scene, until)
    size = sizes(scene if meets_road(until) else replace(scene, contact=None))
    column = unknowns_through(scene.tire.proportions().through, scene.tire.order)
    dense = "contact" not in left_out and bool(_matrices_of_points(scene, size))
    work = operations(scene, size, left_out, column, dense)
    return Estimate(
        sizes=size,
        memory=_memory(scene, size, left_out),
        disk=disk(scene, size, left_out),
        work=work,
        seconds=seconds(
            work,
            size,
            column,
            bars="accuracy" not in left_out,
            load_error=scene.static.on_road and scene.static.error_estimate,
            stretches=0.0 if "stretches" in left_out else _stretches(scene, size),
        ),
    )


def memory(scene: Scene) -> dict[str, float]:
    """Peak bytes by part, for one process."""
    return estimate(scene).memory


def _memory(scene: Scene, size: Sizes, left_out: dict[str, str]) -> dict[str, float]:
    """Peak bytes by part. The factor for a rotating tire's responses has both triangles."""
    tire, free, count = scene.tire, size.free, size.coordinates
    through = tire.proportions().through
    tangents = matrices(TANGENTS, free, through, tire.order)
    parts = {
        "program": PROGRAM,
        "matrices": matrices(MATRICES, free, through, tire.order),
        FACTOR: (2 if turning(scene) and "greens" not in left_out else 1)
        * factor(free, through, tire.order),
    }
    if "modes" in left_out:
        parts["matrices"] = tangents
        if scene.static.on_road:
            parts[FOOTPRINT] = 8.0 * 2 * COLUMNS * free
    else:
        parts["modes"] = 8.0 * BASES * free * count
    later = parts["matrices"] - tangents + parts.get("modes", 0.0)
    parts |= beside_tangents(scene, free, later)
    if "rotating" not in left_out:
        parts["rotating pencil"] = 16.0 * 4 * (2 * count) ** 2
    if "contact" not in left_out:
        parts |= _contact_memory(scene, size)
        parts |= road_memory(scene)
    if "nonlinear" not in left_out:
        parts[TRAINING] = _training(free, through, tire.order)
    if "response" not in left_out:
        k = max(size.driven, 1)
        parts["receptances"] = 16.0 * 5 * size.frequencies * k**2
        parts["time series"] = 8.0 * size.steps * (4 * k + 3 * _each_step(scene, k) + 6) * 2
    return parts


def _each_step(scene: Scene, points: int) -> int:
    """Values per time step that the outputs at the driven points add."""
    return sum(kind.numbers(points) for _, kind in scene.output.kinds)


def _training(free: float, through: int, order: int) -> float:
    """Bytes of the training of large motions: fields of its states, stiffnesses of all cells and what they weigh together, and
    a tangent with its factor."""
    cells, own = free / (3 * order**3), 3 * (order + 1) ** 3
    fields = STATES * HELD * free
    return (
        8.0 * (fields + cells * own**2 + 2 * cells**2)
        + matrices(1, free, through, order)
        + factor(free, through, order)
    )


def _contact_memory(scene: Scene, size: Sizes) -> dict[str, float]:
    directions = 3 if scene.contact.has_friction else 1
    loads = directions * size.nodes
    shapes = SHAPES if residual_of(scene.greens.residual).joins else 0
    parts = {
        "flexibility of the patch": 8.0 * size.free * (ANSWERS + shapes * loads),
        "contact": 16.0 * 4 * loads * 2 * size.coordinates
        + 8.0 * 3 * loads**2
        + 8.0 * _in_the_loop(scene, size, directions),
        "time series": 8.0 * size.steps * 24,
    }
    if keeps_history(scene.time.scheme):
        parts["time series"] += 8.0 * size.steps * loads**2
    if residual_of(scene.greens.residual).solves and scene.tire.shape.varies(scene.tire):
        poles = (ROLLED_OUT if turning(scene) else RELAXING) * loads
        parts[SLOW] = 16.0 * 4 * 2 * loads * poles + 8.0 * SOFTENED * loads**2
    return parts


def _in_the_loop(scene: Scene, size: Sizes, directions: int) -> float:
    """Numbers held at most: while matrices are made, or while a block of steps is counted.

    A step has the normal force, gap and displacement, the horizontal force, and change and motion
    in each of the `directions`. All but the displacement, a view, are held twice in the count, as
    steps and as arrays of them, with two more for checks and nine for the work of a piece.
    """
    dense = _matrices_of_points(scene, size)
    slipping = SLIPPING * size.touching**2 if scene.contact.has_friction else 0
    each = 2 + (2 if scene.contact.has_friction else 0) + 2 * directions
    steps = min(size.steps, BLOCK) * size.points
    pieces = min(size.steps, PIECE) * size.points * 9 * directions
    counted = dense * PIVOTED / PIVOT + (2 * each + 1 + 2) * steps + pieces
    return max(max(dense, slipping) + each * steps, counted)


def _matrices_of_points(scene: Scene, size: Sizes) -> int:
    """Numbers in the matrices of the contact points held at once."""
    if scene.contact.on_nodes or size.points <= DENSE_POINTS:
        return 3 * size.points**2
    usual = min(size.points, USUAL * size.touching)
    # The estimate of those that touch may be half too high.
    return 0 if _by_product(scene, size, size.touching / 1.5) else PIVOT * usual**2


def memory_of(wanted: Estimate, processes: int, on_disk: bool = False) -> dict[str, float]:
    """Bytes by part, all processes of a run together, with factors in memory or `on_disk`."""
    parts = {
        name: size if name in SPREAD else processes * size for name, size in wanted.memory.items()
    }
    return parts | {FACTOR: parts[FACTOR] * (1 - ON_DISK)} if on_disk else parts


def duration(seconds: float) -> str:
    """A rough time in words, accurate within a factor of three."""
    for unit, size in (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 1.5 * size:
            return (
                f"{seconds / size:.1g} {unit}"
                if seconds < 9.5 * size
                else f"{seconds / size:.0f} {unit}"
            )
    return f"{max(seconds, 1.0):.0f} seconds"
