"""Estimates of a scene's memory, disk and time before anything is computed."""

from dataclasses import dataclass

from tireroad.runs.scene.extent.cost import operations, seconds
from tireroad.runs.scene.extent.matrices import factor, matrices, unknowns_through
from tireroad.runs.scene.extent.sizes import Sizes, road_memory, sizes
from tireroad.runs.scene.extent.static_state import (
    COLUMNS,
    FRICTION,
    LOAD_ERROR,
    TANGENTS,
    beside_tangents,
    turning,
)
from tireroad.runs.scene.plan import skipped
from tireroad.runs.scene.tables.scene import Scene

PROGRAM = 2.1e8
"""Bytes of one process with all libraries loaded and the mesh made (measured)."""
MATRICES = 5
"""Sparse matrices held at peak: K, its scaled copy and parts, those of rotation (measured,
including the rest: 0.6 to 0.83 GB for the quickstart, 1.1 to 1.4 GB for passenger.toml, 2.3 to 2.8
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
MOST = 1000
"""Touching points up to which "auto" takes the active set (contact.model.MOST_TOUCHING)."""
PIVOT = 5
"""Copies of the matrix of the touching points during pivoting (contact.solver.pivot)."""
PACKED = 0.3
"""Size of contact.h5 relative to its raw numbers: most forces are 0 (measured: 0.24 on stones, 0.29
on texture)."""

FOOTPRINT = "columns of the footprint"
FACTOR = "factor of the stiffness"

# Keys that determine the size of each part.
KEYS = {
    "matrices": "tire.segments, tire.elements_arc, tire.elements_thickness, tire.order",
    FACTOR: "tire.segments, tire.elements_arc, tire.elements_thickness, tire.order",
    LOAD_ERROR: "static.error_estimate, and the mesh",
    FRICTION: "static.friction, and the mesh",
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
    size, left_out = sizes(scene), skipped(scene, until)
    column = unknowns_through(scene.tire.proportions().through, scene.tire.order)
    dense = "contact" not in left_out and bool(_matrices_of_points(scene, size))
    work = operations(scene, size, left_out, column, dense)
    return Estimate(
        sizes=size,
        memory=_memory(scene, size, left_out),
        disk=_disk(scene, size, left_out),
        work=work,
        seconds=seconds(work, size, column, bars="accuracy" not in left_out),
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
        + 8.0 * _matrices_of_points(scene, size) * size.points**2
        + 8.0 * BLOCK * size.points * (3 + directions),
        "time series": 8.0 * size.steps * 24,
    }
    if scene.time.scheme == "convolution":
        parts["time series"] += 8.0 * size.steps * loads**2
    return parts


def _matrices_of_points(scene: Scene, size: Sizes) -> int:
    """Number of matrices of the contact points held at once."""
    if scene.contact.on_nodes or size.points <= DENSE:
        return 3
    by_product = scene.contact.solver == "projected-cg"
    if scene.contact.solver == "auto":
        by_product = size.points > 2 * MOST  # about half of them touch
    return 0 if by_product else PIVOT


def _disk(scene: Scene, size: Sizes, left_out: dict[str, str]) -> dict[str, float]:
    """Bytes of the files; a checkpoint is a copy of contact.h5 so far."""
    through = scene.tire.proportions().through
    face = size.free / (3 * (through * scene.tire.order + 1)) * 3
    parts = {"static.h5": 40.0 * size.free}
    if "modes" not in left_out:
        parts["modes.h5"] = 8.0 * size.coordinates * (face + 5 * size.coordinates)
    if "contact" not in left_out:
        numbers = size.points * (3 + 2 * (scene.contact.rubs)) + 10
        parts["contact.h5"] = 2 * PACKED * 8.0 * size.steps * numbers
        parts["greens.h5"] = 16.0 * 2 * size.nodes * (2 * size.coordinates + size.nodes)
    if "response" not in left_out:
        k = max(size.driven, 1)
        parts["response.h5"] = 8.0 * (
            size.steps * (4 * k + 3 + _each_step(scene, k)) + 2 * size.frequencies * k * k
        )
    return parts
