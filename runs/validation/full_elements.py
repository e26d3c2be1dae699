"""Full finite elements in time, between the points of a scene's contact and over its road."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from threadpoolctl import threadpool_limits

from tireroad.contact.model import ContactSpec
from tireroad.contact.rolling import make_loop, rolling_steadily
from tireroad.contact.setup import ContactSetup
from tireroad.fem.transient import FullTire, ModalDamping, NonlinearTire, equal_angles
from tireroad.greens.coupling import Wheel
from tireroad.greens.response import Response
from tireroad.modal.damping import StrainEnergy, beyond, modal_damping
from tireroad.runs.pipeline import Finished
from tireroad.runs.stages.setup import Probes
from tireroad.runs.stages.stage import Job

# Spectral radius of the full finite elements' scheme. Axle force on a cleat at steps of 1e-4 s with
# 0, 0.5 and 0.8: 5.4, 2.8 and 2.1 % off; contact force on cobblestones at 2.5e-5 s: 0 and 0.5 are
# 0.08 % apart, 0.8 is 0.2 % off.
RADIUS = 0.5


@dataclass(frozen=True)
class FullHistory:
    """Quantities (n, k) by name at the end of each of n steps of `step` s.

    `seconds` of the loop: CPU time of one thread, which a busy machine changes little; `setup`:
    seconds of its set-up.
    """

    step: float
    values: dict[str, np.ndarray]
    seconds: float
    setup: float


@dataclass(frozen=True)
class Conditions:
    """The conditions of any tire model's run: table [contact], patch and road, `duration` s.

    `response`: of the same tire, exact at 0 Hz, in whose steady rolling all models begin; None: at rest.
    """

    spec: ContactSpec
    setup: ContactSetup
    duration: float
    response: Response | None = None


def follow(trial: Conditions, tire, step: float, setup: float) -> FullHistory:
    """Run the tire over the trial's road, with the same points, tread, friction and solver for any tire.

    Contact and axle force (n, 3) N, displacement of the contact points (n, c) m.
    """
    given, steps = trial.setup, round(trial.duration / step)
    if trial.response is not None:
        given = rolling_steadily(trial.spec, given, trial.response, step)
    loop = make_loop(trial.spec, given, tire, step)
    with threadpool_limits(1, "blas"):
        began = time.process_time()
        blocks = list(loop.roll(given.drive, step, steps))
        seconds = time.process_time() - began
    contact = [
        given.patch.resultant(*of)
        for block in blocks
        for of in zip(block.force, block.horizontal, strict=True)
    ]
    values = {
        "contact force": np.array(contact),
        "axle force": np.concatenate([block.axle_force for block in blocks]),
        "displacement": np.concatenate([block.displacement for block in blocks]),
    }
    return FullHistory(step, values, seconds, setup)


class Elements:
    """The full finite elements of a `run` that has come as far as its modes, between the `probes` of its contact."""

    def __init__(self, run: Finished, job: Job, probes: Probes | None) -> None:
        self.run, self.job, self.probes = run, job, probes
        self.motions, self.modes = run.motions, run.fields

    @property
    def unknowns(self) -> int:
        """Free degrees of freedom of the finite elements."""
        return self.motions.unknowns

    @property
    def wheel(self) -> Wheel:
        """The full matrices of the rotating wheel."""
        return self.run.wheel

    @property
    def relaxes(self) -> bool:
        """Whether the full finite elements have the rubber of the scene: Prony series, and nodes at equal angles if it turns."""
        wheel, kinds = self.wheel, self.motions.body.wall.kinds()
        series = bool(kinds) and all(kind.spectrum.series for kind, _ in kinds)
        turns = not wheel.speed or equal_angles(self.motions.lattice)
        return isinstance(wheel.damping, StrainEnergy) and series and turns and not self.job.axle

    def full(self, step: float, radius: float = RADIUS) -> tuple[FullTire, float, float]:
        """All degrees of freedom between the same points; step; set-up in s."""
        wheel, axle = self.wheel, self.job.axle
        began = time.perf_counter()
        losses = {"damping": (0.0, 0.0), "relaxes": True} if self.relaxes else self._damping()
        tire = FullTire(
            **self._between_points(step),
            **losses,
            rotation=wheel.rotation,
            speed=wheel.speed,
            inertia=wheel.inertia,
            spectral_radius=radius,
            air=wheel.air,
            corner=(axle, self.motions.rim_motion(wheel.speed != 0)) if axle else None,
        )
        return tire, step, time.perf_counter() - began

    def nonlinear(self, step: float) -> tuple[NonlinearTire, float, float]:
        """The full finite elements with large motions; step; set-up in s."""
        wheel, static = self.wheel, self.run.static
        began = time.perf_counter()
        tire = NonlinearTire(
            **self._between_points(step),
            **self._damping(),
            inflation=static.inflation,
            spectral_radius=RADIUS,
            turning=(wheel.rotation, static.rolling) if wheel.speed else None,
        )
        return tire, step, time.perf_counter() - began

    def _between_points(self, step: float) -> dict[str, Any]:
        """The arguments that any full tire has between the points of the contact. Collective."""
        points, operators = self._all_points, self.wheel.operators
        return {"operators": operators, "step": step, "outputs": points, "loads": points}

    @property
    def _all_points(self) -> sparse.csr_matrix:
        """Outputs and loads of full finite elements."""
        assert self.probes is not None, "points of a contact"
        return self.probes.on_face.loads

    def _damping(self) -> dict[str, Any]:
        """Uniform damping of the full matrices, and additional modal damping. Collective."""
        wheel, modes = self.wheel, self.modes
        if not isinstance(wheel.damping, StrainEnergy):
            return {"damping": wheel.damping}
        uniform = beyond(wheel.damping, modes.projection)
        excess = modal_damping(wheel.damping, modes.projection)
        excess = excess - uniform.mass * np.eye(len(excess))
        turning = (wheel.rotation.body, wheel.speed) if wheel.speed else ()
        modal = ModalDamping(wheel.operators, modes.modes.vectors, excess, *turning)
        return {"damping": uniform, "modal": modal}


def percent(part: float) -> float:
    """A share in %, to three digits."""
    return digits(100 * part)


def digits(value: float) -> float:
    """Round to three digits: more would be noise, in errors and in times."""
    return float(f"{value:.3g}")
