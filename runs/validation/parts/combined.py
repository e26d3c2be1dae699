"""Part of `validate stability`: combinations of a scene's options on one coarse tire, all stages.

Every value of axle, road shape, tread, bristles, pattern and road occurs, and pairs that could
amplify each other: a moving wheel on creeping rubber, patterns with friction, drums with jumps,
slip with camber.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mpi4py import MPI

from tireroad.fem.errors import ConvergenceError, InputError
from tireroad.runs.files.store import opened
from tireroad.runs.process import observe
from tireroad.runs.stages.pipeline import run_scene

_BASE = """
name = "combined"
[tire]
segments = 16
elements_arc = 6
[tire.material]
youngs_modulus = 48e6
[static]
load = 800.0
error_estimate = false
camber = {camber}
{static}
[modal]
count = 40
[damping]
mass = 200.0
[rotation]
speed = 40.0
{rotation}
[axle]
kind = "{axle}"
[contact]
points = {{ dx = 0.008, dy = 0.008 }}
reach = 0.025
tread = "{tread}"
youngs_modulus = 1e7
{contact}
{pattern}
[road]
{road}
[time]
duration = 0.08
[accuracy]
estimate = false
[output]
spectra = false
"""
_GROOVES = """
[pattern]
pitches = 50
[[pattern.groove]]
width = 0.008
depth = 0.006
[[pattern.groove]]
direction = "circumferential"
width = 0.006
depth = 0.006
"""
_BRUSH = "brush_stiffness_per_area = 1e8\nfriction = 0.8\n"
_CREEPS = "relaxation = [0.3, 0.2]\nrelaxation_time = [1e-3, 1e-2]\n"
_ROUGH = 'kind = "two-slope"\nstone_size = 0.02\nroad_class = "C"\n'
_BAR = 'kind = "cleat"\nposition = 0.2\nheight = 0.01\nlength = 0.02\n'
_HOLE = 'kind = "step"\nposition = 0.3\nheight = -0.02\nramp = 0.0\n'
_DRUM = "drum_radius = 0.85\n"
_INSIDE = 'drum_radius = 1.0\ndrum = "inside"\n'


@dataclass(frozen=True)
class Combination:
    """Values of the scene's keys."""

    axle: str = "corner"
    tread: str = "half-space"
    road: str = _ROUGH
    camber: float = 0.0
    rotation: str = ""
    contact: str = ""
    pattern: str = ""
    static: str = ""


COMBINATIONS = {
    "corner, pattern, layer, rough": Combination(tread="layer", pattern=_GROOVES),
    "corner, creeping tread with friction, over a bar": Combination(
        tread="viscoelastic", contact=_BRUSH + _CREEPS, road=_BAR
    ),
    "free wheel, camber, drum, pattern with friction": Combination(
        axle="free", camber=3.0, contact=_BRUSH, pattern=_GROOVES, road=_ROUGH + _DRUM
    ),
    "corner, camber, free rolling at a slip angle, creeping tread": Combination(
        tread="viscoelastic", camber=-3.0, rotation="free_rolling = true\nslip_angle = 2.0",
        contact=_BRUSH + _CREEPS,
    ),
    "held, inside a drum, over a bar": Combination(axle="fixed", road=_BAR + _INSIDE),
    "corner, springs, drum, into a hole": Combination(tread="winkler", road=_HOLE + _DRUM),
    "corner, friction in the static state, rolling freely, rough": Combination(
        static="friction = 0.8\n",
    ),
    "held, friction in the static state at a slip angle and driven, pattern, over a bar": Combination(
        axle="fixed", static="friction = 0.6\n", rotation="slip_angle = 2.0", pattern=_GROOVES, road=_BAR,
        contact="slip = [0.01, 0.0]\n",
    ),
    "free wheel, friction in the static state, braked by 20 %, creeping tread": Combination(
        axle="free", static="friction = 1.0\n", tread="viscoelastic", contact=_CREEPS + "slip = [-0.2, 0.0]\n",
    ),
    "corner, friction in the static state under camber on a drum, at a slip angle, rough": Combination(
        camber=3.0, static="friction = 0.8\n", rotation="slip_angle = 2.0", road=_ROUGH + _DRUM,
    ),
    "free wheel, friction in the static state inside a drum, braked by 5 %, over a bar": Combination(
        axle="free", static="friction = 0.8\n", contact="slip = [-0.05, 0.0]\n", road=_BAR + _INSIDE,
    ),
    "corner, friction on a half-space without bristles, rolling freely, rough": Combination(
        rotation="free_rolling = true", contact="friction = 0.8\n",
    ),
    "free wheel, friction on a layer without bristles, braked by 10 %, pattern, over a bar": Combination(
        axle="free", tread="layer", contact="friction = 1.2\nslip = [-0.1, 0.0]\n", pattern=_GROOVES, road=_BAR,
    ),
    "corner, camber, friction on creeping tread without bristles, at a slip angle, into a hole": Combination(
        camber=3.0, tread="viscoelastic", rotation="slip_angle = 2.0", contact="friction = 0.8\n" + _CREEPS, road=_HOLE,
    ),
    "held, friction on a half-space that pressure moves sideways, driven by 5 %, rough": Combination(
        axle="fixed", contact="friction = 0.8\npoisson_ratio = 0.2\nslip = [0.05, 0.0]\n",
    ),
    "corner, bristles that never slip, braked by 10 %": Combination(
        contact="brush_stiffness_per_area = 1e8\nslip = [-0.1, 0.0]\n"
    ),
}  # fmt: skip


def rows(names: list[str] | None = None) -> list[list]:
    """Package, case, result and how it was caught, for each combination. Collective."""
    with TemporaryDirectory() as folder:
        return [
            ["all stages", name, *_ended(COMBINATIONS[name], Path(folder))]
            for name in names or COMBINATIONS
        ]


def _ended(one: Combination, folder: Path) -> tuple[str, str]:
    """The result, and how it was caught."""
    from tireroad.runs.scene.load import load

    text = _BASE.format(**vars(one))
    if one.tread == "winkler":
        text = text.replace("youngs_modulus = 1e7\n", "")
    (folder / "scene.toml").write_text(text)
    try:
        scene = load(folder / "scene.toml", [])
        with observe.quiet():
            run_scene(scene, folder, MPI.COMM_WORLD, until="contact", fresh=False, petsc_options=[])
    except (InputError, ConvergenceError) as error:
        return "refused", str(error)
    with opened(folder / "contact.h5") as file:
        load_, residual = file["total_force"][:, 2], float(np.max(file["residual"][:]))
        axle = file["axle_force"][:]
    if not (np.isfinite(load_).all() and np.isfinite(axle).all()):
        return "NaN", "not caught"
    return (
        f"{len(load_)} steps, load {load_.min():.4g} to {load_.max():.4g} N",
        f"complementarity in every step, worst {residual:.0e}",
    )
