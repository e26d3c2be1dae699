"""One time step of the states: decay, and forces at its start and end (greens.recursion)."""

from __future__ import annotations

import math

import numpy as np
from scipy import linalg, sparse

from tireroad.greens.response import Response


class Block:
    """Recursion of the block of nearly defective states, on the first process with states.

    Its last three outputs are the rate of change of momentum, without its jump due to the force.
    """

    def __init__(self, response: Response, step: float, scheme: str) -> None:
        block, push = response.block, response.block_input
        self._output = np.vstack([response.block_output, response.inertia[1]])
        self._decay, self._old, self._new = block_steps(block, push, step, scheme)
        size, forces = push.shape
        self.state = np.zeros(size)
        self._force = np.zeros(forces)

    def direct(self) -> np.ndarray:
        return self._output @ self._new

    def start(self, force: np.ndarray) -> None:
        self._force = force

    def direct_next(self) -> np.ndarray:
        return self._output @ (self._decay @ self._new + self._old)

    def move(self) -> None:
        self._free = self._decay @ self.state + self._old @ self._force

    def seen(self) -> np.ndarray:
        return self._output @ self._free

    def seen_next(self) -> np.ndarray:
        return self._output @ (self._decay @ self._free)

    def advance(self, force: np.ndarray) -> None:
        self._force = force
        self.state = self._free + self._new @ force

    def snapshot(self) -> dict[str, np.ndarray]:
        return {"block_state": self.state, "block_force": self._force}

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        self.state, self._force = kept["block_state"], kept["block_force"]


def block_steps(
    block: np.ndarray, push: np.ndarray, step: float, scheme: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """e^{Th} (b, b), and b0 P and b1 P (b, k), of the block T with its input P."""
    size, forces = push.shape
    # expm of [[T, P, 0], [0, 0, I/h], [0, 0, 0]] h carries e^{Th}, h phi1 P and h phi2 P at once.
    wide = np.zeros((size + 2 * forces, size + 2 * forces))
    wide[:size, :size] = block * step
    wide[:size, size : size + forces] = push * step
    wide[size : size + forces, size + forces :] = np.eye(forces)
    moved = linalg.expm(wide)[:size]
    first, second = moved[:, size : size + forces], moved[:, size + forces :]
    old, new = (first - second, second) if scheme == "linear" else (0 * first, first)
    return moved[:, :size], old, new


NO_BLOCK = {"block_state": np.zeros(0), "block_force": np.zeros(0)}


def weights(x: np.ndarray, step: float, scheme: str) -> tuple[np.ndarray, np.ndarray]:
    """b0 and b1 for x = s h."""
    phi1, phi2 = _phi(x)
    if scheme == "linear":
        return step * (phi1 - phi2), step * phi2
    return np.zeros_like(x), step * phi1


def _phi(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """phi1 and phi2; by their series below 0.3, where the closed forms cancel."""
    small = np.abs(x) < 0.3
    safe = np.where(small, 1.0, x)
    phi1 = np.where(small, _series(x, 1), np.expm1(safe) / safe)
    phi2 = np.where(small, _series(x, 2), (phi1 - 1) / safe)
    return phi1, phi2


def _series(x: np.ndarray, order: int) -> np.ndarray:
    """phi_order(x) = sum_k x^k / (k + order)!, for |x| < 0.3 to full precision."""
    out = np.zeros_like(x)
    for k in range(14, -1, -1):
        out = out * x + 1 / math.factorial(k + order)
    return out


def late_answers(response: Response, step: float, scheme: str) -> sparse.csr_matrix | None:
    """What the outputs and the rate of momentum (r + 3, k) still answer to the step's first force.

    It is missing in the answer to its last force: a pulse one step long responds to the mean of a
    linear force over the step, and a slope (Response.slope) to the difference of both.
    """
    late = np.zeros((len(response.residual) + 3, response.residual.shape[1]))
    if response.pulse and scheme == "linear":
        late[: response.pulse] = response.residual[: response.pulse] / 2
    if response.slope is not None:
        late -= response.slope / step
    return sparse.csr_matrix(late) if late.any() else None
