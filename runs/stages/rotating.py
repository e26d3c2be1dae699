"""Stage rotating: eigenproblem of the rotating tire, on the modal basis or the finite elements."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import ClassVar

import numpy as np

from tireroad.fem.cavity.column import Column
from tireroad.fem.model import SmallMotions
from tireroad.fem.parallel import on_root
from tireroad.greens.coupling import Wheel, wheel_of
from tireroad.modal.basis import ModalBasis
from tireroad.modal.campbell import Campbell, critical_speed, growth, onset, sweep
from tireroad.modal.damping import Proportional, StrainEnergy
from tireroad.modal.rolling import RollingModes, full_states, rolling_modes
from tireroad.modal.states import StateModes
from tireroad.runs.files.store import put
from tireroad.runs.stages.base.job import Job
from tireroad.runs.stages.base.record import Record
from tireroad.runs.stages.base.stage import Computed, Done, Shared
from tireroad.runs.stages.build import cavity, corner
from tireroad.runs.stages.build.turning import turning_of
from tireroad.runs.stages.stored import states_file


@dataclass(frozen=True, kw_only=True)
class FullMatrices(Shared[Wheel]):
    """The full matrices of the rotating wheel."""

    name: ClassVar[str] = "wheel"
    motions: Done[SmallMotions]
    modes: Done[ModalBasis]
    air: Done[Column | None]

    def make(self) -> Wheel:
        """Assemble them. Collective."""
        turning, projection = turning_of(self.job), None
        if isinstance(turning.damping, StrainEnergy):
            projection = self.modes.product.projection
        given = self.motions.product, turning, self.air.product, projection
        return wheel_of(*given, self.job.axle)


@dataclass(frozen=True, kw_only=True)
class RotatingStage(Computed[RollingModes]):
    """The states of the rolling tire; for a wheel at rest, those of the modes."""

    name: ClassVar[str] = "rotating"
    modes: Done[ModalBasis]
    wheel: Done[Wheel]

    @classmethod
    def instead(cls, job: Job, done: Mapping[str, Done]) -> Done[RollingModes] | None:
        """For a wheel at rest, the states follow from the modes in closed form."""
        if "modes" not in done or job.speed:
            return None
        modes = done["modes"]
        return Done(modes.key, lambda: rolling_modes(modes.product, turning_of(job), job.comm))

    def inputs(self) -> dict:
        """The modes, damping, speed and inertia; the number of states only for the full method."""
        wanted, turning = self.job.scene.rotation, turning_of(self.job)
        return {
            "modes": self.modes.key,
            "axle": corner.inputs(self.job),
            "damping": repr(turning.damping),
            "speed": turning.speed,
            "inertia": turning.inertia,
            "campbell": asdict(wanted.campbell) if wanted.campbell else None,
            "full": (wanted.count, wanted.window) if wanted.method == "full" else None,
        }

    def compute(self, record: Record) -> RollingModes:
        """Solve on the root process, share with all, check. Collective."""
        job, basis = self.job, self.modes.product
        with record.timing("eigensolver"):
            rolling = rolling_modes(basis, turning_of(job), job.comm)
        projected = {
            f"projected: {name}": (figure, "-") for name, figure in rolling.figures.items()
        }
        record.indicators |= projected
        if job.scene.rotation.method == "full":
            rolling = self._full(record, rolling)
        speed = rolling.turning.speed
        free_at = speed if job.scene.modes.rim == "free" else None
        critical = critical_speed(basis.projection, rolling.turning.inertia, free_at)
        _describe(record, rolling, critical)
        if speed > critical:
            record.warnings.append(_beyond(speed, critical))
        if rolling.states.unstable:
            record.warnings.append(_growth(job, rolling, basis))
        return replace(rolling, campbell=self._campbell(record))

    def _full(self, record: Record, projected: RollingModes) -> RollingModes:
        """The states of the finite elements, which replace the projected ones. Collective."""
        wheel, wanted = self.wheel.product, self.job.scene.rotation
        with record.timing("full eigensolver"):
            matrices = wheel.rotating_damping, wheel.rotating_stiffness
            rim = wheel.rim() if wheel.rim else None
            given = wheel.operators, matrices, projected, rim
            found, figures, warnings = full_states(*given, count=wanted.count, window=wanted.window)
        record.indicators |= figures
        record.warnings += warnings
        return found

    def _campbell(self, record: Record) -> Campbell | None:
        """Eigenvalue branches over speed, if the scene asks for them. Collective."""
        wanted, turning = self.job.scene.rotation.campbell, turning_of(self.job)
        if wanted is None:
            return None
        speeds = np.arange(0.0, wanted.to + wanted.step / 2, wanted.step)
        held = replace(self.modes.product.projection, corner=None)

        def both() -> Campbell:
            free = sweep(held, Proportional(), turning.inertia, speeds, wanted.branches)
            lines = sweep(held, turning.damping, turning.inertia, speeds, wanted.branches)
            return replace(lines, undamped=free.frequency)

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
        states = states_file.read(file)
        if "basis" not in file:
            return states, {}
        own = file["basis"]
        wheel = {"corner": corner.read(own, None)}
        return states, wheel | {name: own[name][:] for name in ("shape", "momentum")}

    def restored(self, held: tuple[StateModes, dict]) -> RollingModes:
        """The states on the modes, or on fields of their own."""
        (states, own), basis = held, self.modes.product
        if own:
            kept = {name: own[name] for name in ("momentum", "corner")}
            projection = replace(basis.projection, **kept)
            basis = replace(basis, shape=own["shape"], projection=projection, modes=None)
        turning = turning_of(self.job)
        return RollingModes(basis=basis, states=states, turning=turning, full=bool(own))


def _beyond(speed: float, critical: float) -> str:
    """Warning of a speed beyond the critical speed (rad/s)."""
    return (
        f"rotation.speed = {speed:g} rad/s lies beyond the tire's critical speed of {critical:.4g} "
        "rad/s, at which a wave is stationary on the road and grows without bound: the results have "
        "little meaning; take a lower speed, a higher static.inflation or a stiffer material"
    )


def _describe(record: Record, rolling: RollingModes, critical: float) -> None:
    states = rolling.states
    own = states.eigenvalue[~states_file.of_shapes(rolling)]
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
        record.headline["lowest"] = (float(oscillating.imag.min() / (2 * np.pi)), "Hz")
    record.indicators |= {
        "worst residual": (float(states.residual.max(initial=0.0)), "-"),
        "worst left residual": (float(states.left_residual.max(initial=0.0)), "-"),
        "basis condition": (states.condition, "-"),
        "states in the near-defective block": (len(states.block), "-"),
    }


def _growth(job: Job, rolling: RollingModes, basis: ModalBasis) -> str:
    """Warning of an unstable tire. Collective."""
    states, turning = rolling.states, rolling.turning
    given = turning.damping, turning.inertia

    def first() -> float:
        if not growth(basis.projection, turning.speed, *given):
            return turning.speed  # only the full problem is unstable
        return onset(basis.projection, *given, turning.speed)

    return (
        f"{states.unstable} state(s) of the rolling tire are unstable, the fastest growing at "
        f"{states.fastest_growth:.3g} 1/s; on this static state that begins at {on_root(job.comm, first):.4g} "
        "rad/s: the wheel turns beyond its critical speed"
    )


def _fill(file, rolling: RollingModes) -> None:
    states, lines = rolling.states, rolling.campbell
    states_file.fill(file, rolling)
    if rolling.full:
        put(file, "basis/shape", rolling.basis.shape, "kg^-1/2")
        put(file, "basis/momentum", rolling.basis.projection.momentum, "kg^1/2")
        corner.fill(file["basis"], rolling.basis.projection.corner)
    if rolling.basis.projection.air is not None:
        put(file, "air_share", cavity.share(rolling)[~states_file.of_shapes(rolling)], "-")
    if lines is not None:
        put(file, "campbell/speed", lines.speed, "rad/s")
        put(file, "campbell/eigenvalue", lines.eigenvalue, "1/s")
        put(file, "campbell/frequency", lines.frequency, "Hz")
        put(file, "campbell/similarity", lines.similarity, "-")
        put(file, "campbell/undamped", lines.undamped, "Hz")
    file.attrs["speed"] = rolling.turning.speed
    file.attrs["first_unstable"] = states.unstable
