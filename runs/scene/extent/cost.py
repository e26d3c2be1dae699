"""Cost of a scene's stages: operations, and seconds on one core."""

from tireroad.runs.scene.extent.sizes import Sizes
from tireroad.runs.scene.extent.static_state import (
    LOAD_ERROR,
    WIDE,
    holds_damping,
    tangents_with_friction,
)
from tireroad.runs.scene.tables.scene import Scene

# Error bars, of the time of all else: 0.49 in torus.toml and 0.35 in passenger.toml
# (2026-11-24); the stage bounds its window to keep them below a half.
_BARS = 0.42
# The load's error by finer meshes, of the time of the static state: 1.8 of 9,828 and of 29,700
# unknowns (2026-11-25). The companion runs of error bars go without it.
_LOAD_ERROR = 1.8
# s a step of the horizontal forces: a few Newton steps, each with an iterative solver, whose calls
# cost more than their operations. Measured with 44 to 113 points that touch (2026-11-25): 7.2 to
# 10 ms with a tread that shears, 4.4 ms with a brush alone.
_SHEARED, _BRISTLES = 8e-3, 4.4e-3
# One tangent with friction, of the frictionless static state: its factor has two triangles, and is
# of the whole ring. Measured on the built-in tire (2026-11-25): 0.2 standing, 0.24 and 0.26 rolling.
_RUBBING = 0.25


def seconds(
    work: dict[str, float],
    size: Sizes,
    column: int,
    bars: bool = False,
    load_error: bool = False,
) -> dict[str, float]:
    """CPU time (s) of `operations` by stage; `column`: unknowns in a column through the wall.

    On a core of a shared server (Intel Xeon), one BLAS thread, 2026-11-23; from 7,020 to 98,100
    unknowns (static state: 224,100) within a factor of 1.6
    (tests/runs/scenes/test_estimated_time.py). Operations through the wall are done in blocks,
    which are faster the thicker the wall; those on modes too, in larger blocks on larger meshes.
    `bars`: with error bars, by companion runs; `load_error`: with static.error_estimate.
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
    return found | beside


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
    if "modes" not in left_out:
        parts["modes"] = 7.0 * mesh * count
    if "rotating" not in left_out:
        parts["rotating"] = 0.8 * pairs**3 * (1 + size.speeds)
    if "contact" not in left_out:
        loads = size.nodes * (3 if scene.contact.rubs else 1)
        parts["greens"] = 3.0 * mesh * loads / 277
        points = size.points**2 if dense else 300 * size.points
        step = 2e-4 + 1e-9 * (4 * loads * size.coordinates + points)
        if scene.contact.rubs:
            step += _SHEARED if scene.contact.sheared else _BRISTLES
        if scene.time.scheme == "convolution":
            step += 1e-9 * 0.5 * size.steps * loads**2
        parts["contact loop"] = size.steps * step
    if "response" not in left_out:
        parts["response"] = size.steps * 2e-5 + size.frequencies * (2e-5 + 5e-8 * size.coordinates)
    return parts
