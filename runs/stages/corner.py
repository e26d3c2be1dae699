"""The wheel corner in a run: its part of the modes, and readings of a moving or held wheel."""

from __future__ import annotations

from dataclasses import asdict

import h5py
import numpy as np

from tireroad.contact.patch import Patch
from tireroad.fem.wheel import Axle
from tireroad.greens.basis import Basis
from tireroad.greens.outputs import disagreement
from tireroad.greens.schemes import keeps_history
from tireroad.modal.corner import ARRAYS, HUB_MOMENTS, READINGS, Corner
from tireroad.modal.rolling import RollingModes
from tireroad.runs.files.store import put
from tireroad.runs.scene.tables.scene import Scene
from tireroad.runs.stages.stage import Job, Record

UNITS = {
    "wheel/translation": "m",
    "wheel/rotation": "rad",
    "body/height": "m",
    "hub_moment": "N m",
}
SPIN = "wheel/spin"
_PLACES = {
    "wheel/translation": slice(0, 3),
    "wheel/rotation": slice(3, 6),
    "body/height": slice(6, 7),
}
_FREQUENCIES, _LOADS = 25, 20


def inputs(job: Job) -> dict | None:
    """The axle's inputs; None if the wheel is held."""
    return asdict(job.scene.axle) if job.axle else None


def readings(job: Job) -> int:
    """Number of additional outputs of a response.

    Motions of wheel and body and hub moments for a moving wheel; for a held wheel the moments
    alone, if the axle force is wanted. 0 for a free rim, and 0 if the road holds the footprint,
    which then carries part of the moments.
    """
    if job.axle:
        return READINGS
    held = job.scene.modes.on_axle_alone and job.scene.output.axle_force
    return HUB_MOMENTS if held else 0


def turns_freely(scene: Scene) -> bool:
    """Whether the wheel's rate of rotation is found in the loop: asked for, on a road that rubs it, and possible."""
    contact, rotation = scene.contact, scene.rotation
    rolls = contact is not None and contact.has_friction and contact.brush == "rolling"
    asked = rotation is not None and rotation.speed != 0 and rotation.wheel == "free"
    return rolls and asked and held_by(scene) is None


def held_by(scene: Scene) -> str | None:
    """The setting of a scene with which the loop cannot let a wheel turn freely; None: there is none."""
    rotation, axle = scene.rotation, scene.axle
    reasons = {
        'rotation.method = "full"': rotation is not None and rotation.method == "full",
        "greens.dynamic, without some of the states": scene.greens.dynamic is not None,
        f'motion.kind = "{scene.motion.kind}"': scene.motion.kind != "linear",
        "a convolution": keeps_history(scene.time.scheme),
        "the rim or the road that modal holds": not scene.modes.on_axle_alone,
        "output.axle_force = false": not scene.output.axle_force,
        "ry that is not in axle.locked": axle.kind != "fixed" and "ry" not in axle.locked,
    }
    return next((reason for reason, holds in reasons.items() if holds), None)


def layout(job: Job) -> dict[str, tuple[tuple, str]]:
    """Shape per step and unit of each reading, by the names in contact.h5."""
    names = {0: (), HUB_MOMENTS: ("hub_moment",)}.get(readings(job), tuple(UNITS))
    shapes = {name: ((3,) if name != "body/height" else (), UNITS[name]) for name in names}
    return shapes | ({SPIN: ((), "rad/s")} if turns_freely(job.scene) else {})


def fill(file: h5py.File, corner: Corner | None) -> None:
    """Write the matrices of the rim's motions with the modes; the axle belongs to the scene."""
    for name in ARRAYS if corner else ():
        put(file, f"corner/{name}", getattr(corner, name), "kg, m, N, rad")


def read(file: h5py.File, axle: Axle | None) -> Corner | None:
    """The corner from a file of modes, with the scene's axle or held; None if the file has none."""
    if "corner" not in file:
        return None
    return Corner(axle=axle or Axle.held(), **{name: file[f"corner/{name}"][:] for name in ARRAYS})


def standing_moment(patch: Patch) -> np.ndarray:
    """Moment (3,) N m of the static contact forces about the axle's centre."""
    up = np.array([0.0, 0.0, 1.0]) if patch.frames is None else patch.frames[:, 2]
    push = patch.force[:, None] * up
    if patch.pull is not None and patch.frames is None:
        push[:, :2] += patch.pull
    elif patch.pull is not None:
        push = push + np.einsum("ct,cti->ci", patch.pull, patch.frames[:, :2])
    return np.cross(patch.points, push).sum(axis=0)


def parts(readings: np.ndarray, static: np.ndarray) -> dict[str, np.ndarray]:
    """Datasets of contact.h5 (n, ...) from readings (n, 10), or (n, 3) of moments alone; behind them the rate of a free wheel, if it is one.

    `static` (3,) N m: the static moment, which is added.
    """
    turns = readings.shape[1] not in (HUB_MOMENTS, READINGS)
    held, spin = np.split(readings, [readings.shape[1] - turns], axis=1)
    out = {"hub_moment": held[:, -HUB_MOMENTS:] + static}
    if turns:
        out[SPIN] = spin[:, 0]
    if held.shape[1] > HUB_MOMENTS:
        out |= {name: held[:, place] for name, place in _PLACES.items()}
        out["body/height"] = out["body/height"][:, 0]
    return out


def check_blocked(record: Record, rolling: RollingModes, loads, highest: float) -> None:
    """Record how far hub force and blocked force (greens.outputs) differ up to `highest` Hz.

    Nothing is recorded of a hub that no force acts on.
    """
    basis, some = Basis.of(rolling), loads[:: -(-loads.shape[0] // _LOADS)]
    frequency = np.linspace(0, highest, _FREQUENCIES + 1)[1:]
    off = disagreement(basis, rolling.turning, some, frequency)
    if off is not None:
        name = f"force on the hub off that by the blocked force, up to {highest:.4g} Hz"
        record.indicators[name] = (off, "-")


def describe(record: Record, rolling: RollingModes) -> None:
    """Record the slowest motions of wheel and body."""
    values = rolling.states.eigenvalue
    slow = values[np.argsort(np.abs(values))][:3]
    record.headline["slowest motions of tire, wheel and body"] = (
        ", ".join(f"{abs(s) / (2 * np.pi):.3g} Hz (decay {-s.real:.3g} 1/s)" for s in slow),
        "-",
    )
