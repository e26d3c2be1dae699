"""Direct convolution with sampled Green's functions (thesis (5.3)), kept as a reference.

    u_n = sum_{k<n} g((n - k) h) f_k h + G_res f_n,   g(0) = 0

A rectangle rule: first order in h, and only for modes that h resolves well. Time and memory grow
with the number of steps: n r k multiplications in step n.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from tireroad.fem.errors import InputError
from tireroad.greens.response import Response

LARGEST = 4e9  # bytes of sampled Green's functions


class Convolution:
    """The interface of `Recursion` by direct sums over the whole history, in steps of `step` s.

    InputError if the sampled Green's functions take more than `LARGEST` bytes. Not collective.
    """

    def __init__(self, *, response: Response, step: float, steps: int) -> None:
        outputs, forces = response.residual.shape
        needed = 8.0 * steps * outputs * forces
        if needed > LARGEST:
            raise InputError(
                f'time.scheme = "convolution" needs {needed / 1e9:.1f} GB for {steps} steps of '
                f"{outputs} x {forces} Green's functions (at most {LARGEST / 1e9:.0f} GB): shorten "
                'time.duration, or take scheme = "linear", which needs no history'
            )
        times = step * np.arange(1, steps + 1)
        self._kernel = step * response.impulse(times)
        self._momentum = step * response.momentum_rate(times)
        self._direct = response.direct_momentum_rate()
        # Answers to the rate of the force: of the outputs, and of the momentum's rate.
        slope = 0.0 if response.slope is None else response.slope / step
        self._slope = np.zeros((outputs + 3, forces)) + slope
        self._history = np.zeros((steps + 1, forces))
        self._n = 0
        self.same_step, self.comm = response.residual + self._slope[:-3], MPI.COMM_SELF

    def start(self, force: np.ndarray) -> None:
        """Begin with a force (k,) N that is already there at t = 0."""
        self._history[0] = force

    def predict(self) -> np.ndarray:
        """Displacement (r,) m at the end of the step due to all earlier forces."""
        self._n += 1
        past = _convolve(self._kernel[: self._n], self._history[: self._n])
        return past - self._slope[:-3] @ self._history[self._n - 1]

    def advance(self, force: np.ndarray) -> None:
        """Set the force (k,) N at the end of the step."""
        self._history[self._n] = force

    def snapshot(self) -> dict[str, np.ndarray]:
        """The forces so far."""
        return {"history": self._history[: self._n + 1]}

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        """Continue from a snapshot."""
        self._n = len(kept["history"]) - 1
        self._history[: self._n + 1] = kept["history"]

    def inertia_force(self) -> np.ndarray:
        """Rate of change of the tire's momentum (3,), N."""
        past = _convolve(self._momentum[: self._n], self._history[: self._n])
        change = self._history[self._n] - self._history[max(self._n - 1, 0)]
        return past + self._direct @ self._history[self._n] + self._slope[-3:] @ change


def _convolve(kernel: np.ndarray, history: np.ndarray) -> np.ndarray:
    """sum_k kernel[n - 1 - k] history[k]."""
    return np.einsum("trk,tk->r", kernel[::-1], history, optimize=True)
