"""Stages vibration and motion: the whole tire over frequency and over time, under the forces of the run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tireroad.contact.results.spectra import a_weighting, band_sums
from tireroad.fem.static.state import StaticState
from tireroad.greens.basis import Basis
from tireroad.greens.outputs import Surface, mean_square_velocity, radiated_power
from tireroad.runs.files.store import attribute, dataset
from tireroad.runs.process.mpi import on_root
from tireroad.runs.stages.replay import PatchForces, replayed
from tireroad.runs.stages.spectra import Spectra
from tireroad.runs.stages.stage import Record, Result
from tireroad.runs.stages.whole_tire import Lines, WholeTire

VELOCITY, POWER = 1e-9, 1e-12  # m/s, W: reference values of the levels, ISO 1683
_LARGEST = 2e8  # bytes: largest size of the stored displacement fields
HANN = 1.5  # noise bandwidth of the window in lines: mean of w^2 over the square of its mean
_INSTANTS = 400  # at most; the last ones of the run
_PER_PERIOD = 8  # of the band's upper frequency


@dataclass(frozen=True, kw_only=True)
class Vibration:
    """Vibration of the outer face with the wheel, up to the model's frequency limit.

    `frequency` (f,) Hz; `velocity` (f,) m2/s2: mean square normal velocity per line; `centre` (b,)
    Hz with the third-octave `velocity_level` dB re 1 nm/s and `power_level` dB re 1 pW, and both
    A-weighted, `velocity_weighted` and `weighted` (b,); `total_velocity`, `total_power` and
    `total_weighted`, the same of all lines together, also of those in no band. `shapes_at` (g,) Hz: the lines whose
    `displacement` (g, s, 3) m, complex amplitudes at the `points` (s, 3) m, is stored: all lines,
    or the strongest that fit in 200 MB.
    """

    frequency: np.ndarray = dataset("Hz")
    velocity: np.ndarray = dataset("m2/s2", "mean_square_velocity")
    centre: np.ndarray = dataset("Hz", "third_octave/centre")
    velocity_level: np.ndarray = dataset("dB re 1 nm/s", "third_octave/velocity_level")
    power_level: np.ndarray = dataset("dB re 1 pW", "third_octave/radiated_power_level")
    weighted: np.ndarray = dataset("dB(A) re 1 pW", "third_octave/radiated_power_level_a_weighted")
    velocity_weighted: np.ndarray = dataset(
        "dB(A) re 1 nm/s", "third_octave/velocity_level_a_weighted"
    )
    shapes_at: np.ndarray = dataset("Hz", "surface/frequency")
    displacement: np.ndarray = dataset("m", "surface/displacement")
    points: np.ndarray = dataset("m", "surface/points")
    total_velocity: float = attribute("velocity_level")  # dB, as the bands
    total_power: float = attribute("radiated_power_level")  # dB, as the bands
    total_weighted: float = attribute("radiated_power_level_a_weighted")  # dB, as the bands


@dataclass(frozen=True, kw_only=True)
class VibrationStage(WholeTire[Vibration]):
    """From the states of the modes, after the run-in."""

    name: ClassVar[str] = "vibration"
    kind: ClassVar[type] = Vibration
    lines: Result[Lines | None]
    spectra: Result[Spectra] | None = None

    def compute(self, record: Record) -> Vibration | None:
        """The vibration of the outer face, line by line; None but on the root process. Collective."""
        lines, state = self.lines.product, self.static.product
        if lines is None:
            return None
        surface = Surface.of(state.points, self.job.tire.lattice.quads())
        shape = Basis.of(self.rotating.product).face(len(state.points))
        vibration = _seen(shape, surface, state, lines.frequency, lines.amplitude)
        record.headline |= _headline(vibration, surface)
        return vibration


def _seen(
    shape: np.ndarray, surface: Surface, state: StaticState, frequency: np.ndarray, a: np.ndarray
) -> Vibration:
    """The vibration of the outer face for coordinates `a` (f, m), its motion with which is `shape`
    (3 s, m)."""
    velocity = mean_square_velocity(a, surface.gram(shape), surface.area, frequency)
    # Amplitudes are scaled to show a sine in full; summed over a band, each line counts HANN times.
    lines = velocity / HANN
    centre, square = band_sums(frequency, lines)
    heard = lines * 10 ** (a_weighting(frequency) / 10)
    _, weighted = band_sums(frequency, heard)
    fits = max(int(_LARGEST // (16 * shape.shape[0])), 1)
    nodes = np.sort(np.argsort(-velocity)[:fits])
    return Vibration(
        frequency=frequency,
        velocity=velocity,
        centre=centre,
        velocity_level=decibels(square, VELOCITY**2),
        power_level=decibels(radiated_power(square, surface.area), POWER),
        weighted=decibels(radiated_power(weighted, surface.area), POWER),
        velocity_weighted=decibels(weighted, VELOCITY**2),
        shapes_at=frequency[nodes],
        displacement=(a[nodes] @ shape.T).reshape(len(nodes), -1, 3),
        points=state.points,
        total_velocity=_total(lines, VELOCITY**2),
        total_power=_total(radiated_power(lines, surface.area), POWER),
        total_weighted=_total(radiated_power(heard, surface.area), POWER),
    )


def decibels(square: np.ndarray | float, reference: float) -> np.ndarray:
    """Level in dB of a mean square or a power over its reference."""
    return 10 * np.log10(np.maximum(square, np.finfo(float).tiny) / reference)


def _total(square: np.ndarray, reference: float) -> float:
    """Level in dB of all lines together: bands too narrow for a level count as well."""
    return float(decibels(square.sum(), reference))


def _headline(vibration: Vibration, surface: Surface) -> dict[str, tuple[float, str]]:
    """Totals over all lines."""
    return {
        "area of the outer face": (surface.area, "m2"),
        "velocity level": (vibration.total_velocity, "dB re 1 nm/s"),
        "equivalent radiated power": (vibration.total_power, "dB re 1 pW"),
        "A-weighted equivalent radiated power": (vibration.total_weighted, "dB(A) re 1 pW"),
        "strongest line": (float(vibration.frequency[vibration.velocity.argmax()]), "Hz"),
    }


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Motion of the outer face at the instants `time` (g,) s.

    `displacement` (g, s, 3) m from the static state, of the nodes at `points` (s, 3) m, with the
    motion of the wheel. From the modes only: the residual flexibility is not included.
    """

    time: np.ndarray = dataset("s")
    displacement: np.ndarray = dataset("m")
    points: np.ndarray = dataset("m", "surface/points")


@dataclass(frozen=True, kw_only=True)
class MotionStage(WholeTire[Motion]):
    """Integrates the states once more under the forces of the run, which are known by now."""

    name: ClassVar[str] = "motion"
    kind: ClassVar[type] = Motion

    def compute(self, record: Record) -> Motion | None:
        """The outer face at the stored instants; None but on the root process. Collective."""
        motions: list[Motion] = []
        basis, forces = self.taken_in()
        on_root(self.job.comm, lambda: motions.append(self._seen(basis, forces())))
        if not motions:
            return None
        size = float(np.linalg.norm(motions[0].displacement, axis=2).max(initial=0.0))
        record.headline["instants"] = (len(motions[0].time), "-")
        record.headline["largest displacement of the face"] = (size, "m")
        return motions[0]

    def _seen(self, basis: Basis, forces: PatchForces) -> Motion:
        points = self.static.product.points
        stride = max(int(1 / (_PER_PERIOD * self.band * forces.step)), 1)
        instants = range(len(forces.time) - 1, -1, -stride)[:_INSTANTS][::-1]
        time, q = forces.time[instants], replayed(basis, forces, instants)
        field = (q @ basis.face(len(points)).T).reshape(len(time), -1, 3)
        return Motion(time=time, displacement=field.astype("f4"), points=points)
