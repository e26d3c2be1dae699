"""What the static state takes: matrices, companions for the load's error, friction, tangents."""

from tireroad.runs.scene.extent.matrices import factor, matrices, unknowns_through
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
_WEAK = 0.5  # as in fem.static.shape_damping, which is not imported just to estimate
# Tangents with friction, as counted on the built-in tire with 25,056 and 40,176 unknowns: a rolling
# tire takes 7 or 8 with its friction, 13 or 14 to find its free travel and 8 with its slip; a
# standing one 6 or 7 a step, and 4 for its load.
_ROLLING, _TRAVEL, _SLIP, _STEP, _LOAD = 8, 13, 8, 7, 4


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
    """Whether the tangent holds the damping by the stiffness (fem.static.shape_damping).

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
