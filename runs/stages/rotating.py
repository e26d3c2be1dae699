"""Stage rotating: eigenproblem of the rotating tire, on the modal basis or the finite elements.

In rotating.h5 the states of the modes stand apart from those of the shapes that joined them. A
state dominated by rotation shapes (modal.rotation_shapes) is not an eigenfrequency of the tire: it
represents the coupling of its modes to faster ones. There are as many as shapes; `turning/place`
holds their indices among all states.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tireroad.fem.cavity import Column
from tireroad.fem.model import SmallMotions
from tireroad.fem.parallel import on_root
from tireroad.fem.static.state import StaticState
from tireroad.greens.coupling import Wheel, wheel_of
from tireroad.modal.basis import ModalBasis, Projection
from tireroad.modal.campbell import (
    Campbell,
    critical_speed,
    growth,
    onset,
    standing_wave,
    sweep,
)
from tireroad.modal.damping import Proportional
from tireroad.modal.rolling import RollingModes, full_states, named_states, rolling_modes
from tireroad.modal.states import StateModes
from tireroad.modal.waves import FaceWaves, ModeNames
from tireroad.runs.files.store import put
from tireroad.runs.scene.physics import turning_of
from tireroad.runs.stages import cavity, corner
from tireroad.runs.stages.modes import fill_names
from tireroad.runs.stages.stage import MUMPS, Computed, Job, Record, Result, Shared

_STATES = {"eigenvalue": "1/s", "right": "-", "left": "s", "residual": "-", "left_residual": "-"}
_BLOCK = {"block": "1/s", "block_right": "-", "block_left": "s"}
_LAST = ("right",)  # the states lie along the last axis; for all others along the first
LOWER = 0.7  # of the highest mode: the modes by which the critical speed is judged
CONVERGED = 0.03  # largest relative change by the modes above


def of_shapes(rolling: RollingModes) -> np.ndarray:
    """Mask (q,) of the shapes' states: those with the largest share of shapes in their norm."""
    projection, right = rolling.basis.projection, rolling.states.right
    mask = np.zeros(right.shape[1], bool)
    if projection.shapes and not rolling.full:
        square = np.abs(right) ** 2
        share = square[projection.modes : projection.own].sum(axis=0) / square.sum(axis=0)
        mask[np.argsort(-share, kind="stable")[: projection.shapes]] = True
    return mask


def fill(file, rolling: RollingModes) -> None:
    """Write the states and the near-defective block."""
    states, joined = rolling.states, of_shapes(rolling)
    for group, mask in (("", ~joined), ("turning/", joined)):
        if group and not joined.any():
            continue
        for name, unit in _STATES.items():
            values = getattr(states, name)
            put(file, group + name, values[:, mask] if name in _LAST else values[mask], unit)
        put(file, f"{group}frequency", states.eigenvalue[mask].imag / (2 * np.pi), "Hz")
    if rolling.names is not None:
        fill_names(file, rolling.names.at(~joined))
        put(file, "travel", rolling.names.travel[~joined], "-")
    put(file, "damping", states.damping[~joined], "-")
    if joined.any():
        put(file, "turning/place", np.flatnonzero(joined), "-")
    for name, unit in _BLOCK.items():
        put(file, name, getattr(states, name), unit)
    file.attrs["basis_condition"] = states.condition
    file.attrs["rigid_states"] = states.rigid


def read(file) -> StateModes:
    """The states in their original order."""
    values = {name: file[name][:] for name in (*_STATES, *_BLOCK)}
    if "turning" in file:
        place = file["turning/place"][:]
        joined = np.zeros(len(values["eigenvalue"]) + len(place), bool)
        joined[place] = True
        order = np.argsort(np.concatenate([np.flatnonzero(~joined), place]))
        for name in _STATES:
            axis = -1 if name in _LAST else 0
            both = np.concatenate([values[name], file[f"turning/{name}"][:]], axis=axis)
            values[name] = np.ascontiguousarray(np.take(both, order, axis=axis))
    known = float(file.attrs["basis_condition"]), int(file.attrs["rigid_states"])
    return StateModes(condition=known[0], rigid=known[1], **values)


@dataclass(frozen=True, kw_only=True)
class FullMatrices(Shared[Wheel]):
    """The full matrices of the rotating wheel."""

    name: ClassVar[str] = "wheel"
    motions: Result[SmallMotions]
    modes: Result[ModalBasis]
    air: Result[Column | None]

    def make(self) -> Wheel:
        """Assemble them. Collective."""
        turning, projection = (
            turning_of(self.job.scene, self.job.speed),
            self.modes.product.projection,
        )
        arguments = self.motions.product, turning, self.air.product, projection
        return wheel_of(*arguments, self.job.axle)


@dataclass(frozen=True, kw_only=True)
class RotatingStage(Computed[RollingModes]):
    """The states of the rolling tire; for a wheel at rest, those of the modes."""

    name: ClassVar[str] = "rotating"
    reads: ClassVar[tuple[str, ...]] = ("rotation.campbell",)
    static: Result[StaticState]
    modes: Result[ModalBasis]
    wheel: Result[Wheel]

    def solver(self) -> str:
        """The solvers' settings, for the log."""
        scene = self.job.scene
        if scene.rotation is None or scene.rotation.method == "projected":
            from tireroad.modal.rotating import LIMITS

            return f"LAPACK on the modal basis; residual at most {LIMITS[0]:g}, identities to {LIMITS[1]:g}"
        from tireroad.modal.solver.quadratic import ITERATIONS, RESIDUAL_TOLERANCE, TOLERANCE

        return (
            f"SLEPc PEP nearest to 0 by shift-and-invert to {TOLERANCE:g}, at most {ITERATIONS} restarts, {MUMPS}, "
            f"options -rotating_…; residual at most {RESIDUAL_TOLERANCE:g}"
        )

    @classmethod
    def if_skipped(cls, job: Job, done: Mapping[str, Result]) -> Result[RollingModes] | None:
        """For a wheel at rest, the states follow from the modes in closed form."""
        if "modes" not in done or job.speed:
            return None
        modes = done["modes"]
        return Result(
            modes.key,
            lambda: rolling_modes(modes.product, turning_of(job.scene, job.speed), job.comm),
        )

    def inputs(self) -> dict:
        """Also damping, speed and inertia; the number of states only for the full method."""
        rotation, turning = self.job.scene.rotation, turning_of(self.job.scene, self.job.speed)
        return super().inputs() | {
            "axle": corner.inputs(self.job),
            "damping": repr(turning.damping),
            "speed": turning.speed,
            "inertia": turning.inertia,
            "full": (rotation.count, rotation.window) if rotation.method == "full" else None,
        }

    def compute(self, record: Record) -> RollingModes:
        """Solve on the root process, share with all, check. Collective."""
        job, basis = self.job, self.modes.product
        with record.timing("eigensolver"):
            rolling = rolling_modes(basis, turning_of(job.scene, job.speed), job.comm)
        projected = {
            f"projected: {name}": (figure, "-") for name, figure in rolling.figures.items()
        }
        record.indicators |= projected
        if job.scene.rotation.method == "full":
            rolling = self._full(record, rolling)
        speed = rolling.turning.speed
        free_at = speed if job.scene.modes.rim == "free" else None
        inertia = rolling.turning.inertia
        critical, wave = standing_wave(basis.projection, inertia, free_at)
        _describe(record, rolling, critical)
        if np.isfinite(critical):
            few = basis.projection.among(_lower(basis.projection))
            before = critical_speed(few, inertia, free_at)
            _describe_wave(record, self._where(basis, wave), critical, before)
        if speed > critical:
            record.warnings.append(_beyond(speed, critical))
        if rolling.states.unstable:
            record.warnings.append(_growth(job, rolling, basis))
        waves = FaceWaves(job.tire.lattice)
        arguments = rolling.basis.shape, rolling.basis.projection, waves
        with record.timing("names"):
            names = on_root(job.comm, lambda: named_states(rolling.states, *arguments))
        return replace(rolling, names=names, campbell=self._campbell(record, waves))

    def _where(self, basis: ModalBasis, wave: np.ndarray) -> tuple[int, float]:
        """Number of waves around, and y (m) where it is largest, of coordinates (m,) of the modes."""
        state = self.static.product
        around, along = state.shape
        field = (basis.shape[: 3 * around * along] @ wave).reshape(around, along, 3)
        size = (field**2).sum(axis=(0, 2))
        # Of both sides of a symmetric tire the positive one, whatever rounding says.
        column = int(np.flatnonzero(size >= 0.999 * size.max())[-1])
        place = state.points.reshape(around, along, 3)[:, column]
        ring = np.arctan2(place[:, 0], -place[:, 2]) % (2 * np.pi)
        order = np.argsort(ring)
        even = 2 * np.pi * np.arange(8 * around) / (8 * around)
        line = np.interp(even, ring[order], field[order, column].sum(axis=1), period=2 * np.pi)
        return int(np.abs(np.fft.rfft(line))[1:].argmax()) + 1, float(place[0, 1])

    def _full(self, record: Record, projected: RollingModes) -> RollingModes:
        """The states of the finite elements, which replace the projected ones. Collective."""
        wheel, rotation = self.wheel.product, self.job.scene.rotation
        with record.timing("full eigensolver"):
            matrices = wheel.rotating_damping, wheel.rotating_stiffness
            rim = wheel.rim() if wheel.rim else None
            arguments = wheel.operators, matrices, projected, rim
            states, figures, warnings = full_states(
                *arguments, count=rotation.count, window=rotation.window
            )
        record.indicators |= figures
        record.warnings += warnings
        return states

    def _campbell(self, record: Record, waves: FaceWaves) -> Campbell | None:
        """Eigenvalue branches over speed, if the scene asks for them. Collective."""
        campbell, turning = (
            self.job.scene.rotation.campbell,
            turning_of(self.job.scene, self.job.speed),
        )
        if campbell is None:
            return None
        speeds = np.arange(0.0, campbell.to + campbell.step / 2, campbell.step)
        basis = self.modes.product
        held = replace(basis.projection, corner=None)

        def names(states: StateModes) -> ModeNames:
            return named_states(states, basis.shape, held, waves)

        def both() -> Campbell:
            arguments = turning.inertia, speeds, campbell.branches
            free = sweep(held, Proportional(), *arguments)
            return replace(sweep(held, turning.damping, *arguments, names), undamped=free.frequency)

        with record.timing("campbell"):
            lines = on_root(self.job.comm, both)
        least = float(np.nanmin(lines.similarity))
        record.indicators["least similarity along a branch"] = (least, "-")
        return lines

    def write(self, file, product: RollingModes) -> None:
        """The states, the fields of full states, the branches over speed."""
        _fill(file, product)

    def read(self, file) -> tuple[StateModes, dict]:
        """The states and, for full states, their own fields: shape and momentum."""
        states = read(file)
        if "basis" not in file:
            return states, {}
        own = file["basis"]
        wheel = {"corner": corner.read(own, None)}
        return states, wheel | {name: own[name][:] for name in ("shape", "momentum")}

    def restored(self, held: tuple[StateModes, dict]) -> RollingModes:
        """The states on the modes, or on fields of their own."""
        (states, own), basis = held, self.modes.product
        if own:
            state = {name: own[name] for name in ("momentum", "corner")}
            projection = replace(basis.projection, **state)
            basis = replace(basis, shape=own["shape"], projection=projection, modes=None)
        turning = turning_of(self.job.scene, self.job.speed)
        return RollingModes(basis=basis, states=states, turning=turning, full=bool(own))


def _beyond(speed: float, critical: float) -> str:
    """Warning of a speed beyond the critical speed (rad/s)."""
    return (
        f"rotation.speed = {speed:g} rad/s lies beyond the tire's critical speed of {critical:.4g} "
        "rad/s, at which a wave is stationary on the road and grows without bound: the results have "
        "little meaning; take a lower speed, a higher static.inflation or a stiffer material"
    )


def _lower(projection: Projection) -> np.ndarray:
    """Mask (m,) of the modes up to `LOWER` of the highest, without rotation shapes."""
    squares = projection.own_squares
    top = squares[projection.modes - 1]
    below = squares <= LOWER**2 * top
    below[projection.modes :] = False
    return below


def _describe_wave(
    record: Record, where: tuple[int, float], critical: float, before: float
) -> None:
    """The wave that stands at the critical speed, and whether modes enough are there to say so."""
    waves, y = where
    record.headline["standing wave at the critical speed"] = (
        f"{waves} around, largest at y = {1e3 * y:.0f} mm",
        "-",
    )
    if not before < (1 + CONVERGED) * critical:
        record.headline["bound on the critical speed"] = (
            f"an upper bound, of the stiffness at the present speed: with modes to {LOWER:g} of the highest it was "
            f"{before:.4g} rad/s, and more modes lower it further",
            "-",
        )


def _describe(record: Record, rolling: RollingModes, critical: float) -> None:
    states = rolling.states
    own = states.eigenvalue[~of_shapes(rolling)]
    oscillating = own[own.imag > 0]
    record.headline |= {
        "pairs": (len(oscillating), "-"),
        "speed": (rolling.turning.speed, "rad/s"),
        "critical speed": (critical, "rad/s"),
    }
    if rolling.basis.projection.air is not None:
        cavity.describe(record, rolling)
    if rolling.basis.projection.moves:
        corner.describe(record, rolling)
    if len(oscillating):
        record.headline["lowest frequency"] = (float(oscillating.imag.min() / (2 * np.pi)), "Hz")
    record.indicators |= {
        "worst residual": (float(states.residual.max(initial=0.0)), "-"),
        "worst left residual": (float(states.left_residual.max(initial=0.0)), "-"),
        "basis condition": (states.condition, "-"),
        "states in the near-defective block": (len(states.block), "-"),
    }


def _growth(job: Job, rolling: RollingModes, basis: ModalBasis) -> str:
    """Warning of an unstable tire. Collective."""
    states, turning = rolling.states, rolling.turning
    arguments = turning.damping, turning.inertia

    def first() -> float:
        if not growth(basis.projection, turning.speed, *arguments):
            return turning.speed  # only the full problem is unstable
        return onset(basis.projection, *arguments, turning.speed)

    return (
        f"{states.unstable} state(s) of the rolling tire are unstable, the fastest growing at "
        f"{states.fastest_growth:.3g} 1/s; on this static state that begins at {on_root(job.comm, first):.4g} "
        "rad/s: the wheel turns beyond its critical speed"
    )


def _fill(file, rolling: RollingModes) -> None:
    states, lines = rolling.states, rolling.campbell
    fill(file, rolling)
    if rolling.full:
        put(file, "basis/shape", rolling.basis.shape, "kg^-1/2")
        put(file, "basis/momentum", rolling.basis.projection.momentum, "kg^1/2")
        corner.fill(file["basis"], rolling.basis.projection.corner)
    if rolling.basis.projection.air is not None:
        put(file, "air_share", cavity.share(rolling)[~of_shapes(rolling)], "-")
    if lines is not None:
        put(file, "campbell/speed", lines.speed, "rad/s")
        put(file, "campbell/eigenvalue", lines.eigenvalue, "1/s")
        put(file, "campbell/frequency", lines.frequency, "Hz")
        put(file, "campbell/similarity", lines.similarity, "-")
        put(file, "campbell/undamped", lines.undamped, "Hz")
        put(file, "campbell/name", lines.name, "-")
    file.attrs["speed"] = rolling.turning.speed
    file.attrs["first_unstable"] = states.unstable
