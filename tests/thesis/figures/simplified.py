"""The simplified tire under a point force: any number of modes, any residual, or all unknowns."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from tireroad.fem.transient import FullTire
from tireroad.greens.recursion import Recursion
from tireroad.greens.response import Response
from tireroad.greens.responses import make_response
from tireroad.modal.rolling import rolling_modes
from tireroad.runs.pipeline import Finished
from tireroad.runs.stages.setup import Probes, probes
from tireroad.tests.thesis.runner import Scenes

Array = NDArray[np.floating]
SCENE = "figure-6.2"
AVERAGE = 1.0  # spectral radius of average acceleration: the smallest error without contact
VERTICAL = slice(2, 3)  # of x, y, z at the driven point


class Simplified:
    """Ten segments, driven at the lowest node, damping gamma1 (1/s). Methods are collective."""

    def __init__(self, scenes: Scenes, damping: float) -> None:
        self.comm = scenes.comm
        self.run: Finished = scenes.run(SCENE, f"damping.mass={damping:g}", until="greens")
        self._points = probes(self.run.job, self.run.static, None).on_face

    @property
    def frequency(self) -> Array:
        """Natural frequencies (1000,) Hz."""
        return self.run.rolling.basis.frequency

    def response(self, count: int, residual: str = "none") -> Response:
        """The response of the lowest modes."""
        rolling = rolling_modes(
            self.run.rolling.basis.first(count), self.run.rolling.turning, self.comm
        )
        given = self._points.outputs, self._points.loads, residual
        made = make_response(lambda: self.run.wheel, rolling, *given, lambda: rolling.basis)
        return made.response.between(VERTICAL, slice(None))

    def kept(self, count: int, dynamic: int) -> Response:
        """`dynamic` modes, those up to `count` static: (6.1), (6.2). All must oscillate."""
        whole = self.response(count)
        assert len(whole.eigenvalue) == count, "a mode does not oscillate: lower the damping"
        return whole.keeping(np.arange(count) < dynamic)

    def full(self, frequency: Array) -> Array:
        """H (f,) m/N with all unknowns."""
        points = self._points
        return self.run.wheel.receptance(points.outputs, points.loads, frequency)[:, 2, 0]

    def history(self, response: Response, force: Array, step: float) -> Array:
        """Displacement (n,) m under a force (n,) N from rest."""
        return self._marched(
            Recursion(response=response, step=step, scheme="linear", comm=self.comm), force
        )[:, 0]

    def full_history(self, force: Array, step: float) -> Array:
        """The same with all unknowns."""
        return self._marched(full_tire(self.run, self._points, step, AVERAGE), force)[:, 2]

    @cached_property
    def compliance(self) -> float:
        """Static displacement per force, m/N, with all unknowns."""
        return float(self.full(np.zeros(1))[0].real)

    def _marched(self, tire: Recursion | FullTire, force: Array) -> Array:
        tire.start(force[:1])
        moved = np.zeros((len(force), tire.same_step.shape[0]))
        with threadpool_limits(1, "blas"):
            for k in range(1, len(force)):
                free = tire.predict()
                tire.advance(force[k : k + 1])
                moved[k] = free + tire.same_step @ force[k : k + 1]
        return moved


def full_tire(run: Finished, points: Probes, step: float, radius: float) -> FullTire:
    """All unknowns of a run's non-rolling tire between probes, integrated in steps of `step` s.

    `radius`: spectral radius of the scheme. Collective.
    """
    wheel = run.wheel
    return FullTire(
        operators=wheel.operators,
        rotation=wheel.rotation,
        speed=wheel.speed,
        damping=(run.job.scene.damping.mass, 0.0),
        step=step,
        outputs=points.outputs,
        loads=points.loads,
        spectral_radius=radius,
    )


def sine(frequency: float, duration: float, step: float) -> tuple[Array, Array]:
    """Times (n,) s, and a force (n,) of 1 N amplitude at the frequency (Hz)."""
    time = step * np.arange(round(duration / step) + 1)
    return time, np.sin(2 * np.pi * frequency * time)


def amplitude(values: Array, frequency: float, step: float) -> float:
    """Amplitude over the last whole period: the component at the frequency."""
    count = round(1 / (frequency * step))
    turn = np.exp(-2j * np.pi * np.arange(count) / count)
    return float(np.abs(2 * (values[-count:] @ turn) / count))
