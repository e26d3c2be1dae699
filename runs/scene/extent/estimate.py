"""Estimates of a scene's memory, disk and time before anything is computed."""

from dataclasses import dataclass, replace

from tireroad.runs.scene.extent.cost import operations, seconds
from tireroad.runs.scene.extent.files import disk
from tireroad.runs.scene.extent.matrices import factor, matrices, unknowns_through
from tireroad.runs.scene.extent.sizes import Sizes, road_memory, sizes
from tireroad.runs.scene.extent.static_state import (
    COLUMNS,
    DAMPING,
    FRICTION,
    LOAD_ERROR,
    TANGENTS,
    beside_tangents,
    turning,
)
from tireroad.runs.scene.plan import meets_road, skipped
from tireroad.runs.scene.tables.scene import Scene

PROGRAM = 2.1e8
"""Bytes of one process with all libraries loaded and the mesh made (measured)."""
MATRICES = 5
"""Sparse matrices held at peak: K, its scaled copy and parts, those of rotation (measured,
including the rest: 0.6 to 0.83 GB for torus.toml, 1.1 to 1.4 GB for passenger.toml, 2.3 to 2.8
GB for a passenger tire of 102,060 unknowns on one process, 1.6 to 1.8 GB on each of two)."""
BASES = 3
"""Copies of all modes held at peak: slices, the sorted vectors, their products."""
ANSWERS = 6 * 64
"""Columns held while solving for the flexibility of the patch (fem.matrices.direct.solve_parts):
loads, solutions, copies."""
SHAPES = {"attachment": 3, "second-order": 5}
"""By residual: full-length columns per force on the patch held at peak; other residuals hold only
values at the patch."""
DENSE = 1000
"""Number of contact points up to which a tread's matrix is stored (contact.model.DENSE_POINTS)."""
BLOCK = 512
"""Steps of contact results held between two writes (stages.stored.contact_file)."""
PIECE = 64
"""Steps of which the work is computed at a time (contact.results.energy)."""
MOST = 1000
"""Touching points up to which "auto" takes the active set (contact.model.MOST_TOUCHING)."""
PIVOT, PIVOTED, USUAL = 5, 2, 3
"""Copies of the matrix of the usual set during pivoting and afterwards (contact.solver.active_set), and its
size over the number of points that touch at rest: 3,094 of 958 (2026-11-25)."""
SLIPPING = 16
"""Copies of the matrix of the touching points while the largest unique friction is found: the tread's
kernels and their indices 7, the normal forces' 1, of twice its width the lifts 2, the coupling 1, its
singular values 1 (contact.solver.stick_slip). Not during pivoting."""

FOOTPRINT = "columns of the footprint"
FACTOR = "factor of the stiffness"

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
    "receptances": "output.receptance.step, output.receptance.to, the number of forces",
    "time series": "time.duration, time.step",
    "contact.h5": "time.duration, time.step, contact.points",
    "contact loop": "time.duration, time.step, contact.points",
    "modes.h5": "modal.count, and the mesh",
    "vibration.h5": "output.vibration, time.duration, and the mesh",
    "motion.h5": "output.fields, and the mesh",
    "error bars": "accuracy.estimate",
}


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
    if "response" not in left_out:
        k = max(size.driven, 1)
        parts["receptances"] = 16.0 * 5 * size.frequencies * k**2
        parts["time series"] = 8.0 * size.steps * (4 * k + 3 * _each_step(scene, k) + 6) * 2
    return parts


def _each_step(scene: Scene, points: int) -> int:
    """Values per time step that the outputs at the driven points add."""
    return sum(kind.numbers(points) for _, kind in scene.output.kinds)


def _contact_memory(scene: Scene, size: Sizes) -> dict[str, float]:
    directions = 3 if scene.contact.rubs else 1
    loads = directions * size.nodes
    shapes = SHAPES.get(scene.greens.residual, 0)
    parts = {
        "flexibility of the patch": 8.0 * size.free * (ANSWERS + shapes * loads),
        "contact": 16.0 * 4 * loads * 2 * size.coordinates
        + 8.0 * 3 * loads**2
        + 8.0 * _in_the_loop(scene, size, directions),
        "time series": 8.0 * size.steps * 24,
    }
    if scene.time.scheme == "convolution":
        parts["time series"] += 8.0 * size.steps * loads**2
    return parts


def _in_the_loop(scene: Scene, size: Sizes, directions: int) -> float:
    """Numbers held at most: while matrices are made, or while a block of steps is counted.

    A step has the normal force, gap and displacement, the horizontal force, and change and motion
    in each of the `directions`. All but the displacement, a view, are held twice in the count, as
    steps and as arrays of them, with two more for checks and nine for the work of a piece.
    """
    dense = _matrices_of_points(scene, size)
    slipping = SLIPPING * size.touching**2 if scene.contact.rubs else 0
    each = 2 + (2 if scene.contact.rubs else 0) + 2 * directions
    steps = min(size.steps, BLOCK) * size.points
    pieces = min(size.steps, PIECE) * size.points * 9 * directions
    counted = dense * PIVOTED / PIVOT + (2 * each + 1 + 2) * steps + pieces
    return max(max(dense, slipping) + each * steps, counted)


def _matrices_of_points(scene: Scene, size: Sizes) -> int:
    """Numbers in the matrices of the contact points held at once."""
    if scene.contact.on_nodes or size.points <= DENSE:
        return 3 * size.points**2
    by_product = scene.contact.solver == "projected-cg"
    if scene.contact.solver == "auto":
        by_product = size.touching > 1.5 * MOST  # the estimate may be half too high
    usual = min(size.points, USUAL * size.touching)
    return 0 if by_product else PIVOT * usual**2
