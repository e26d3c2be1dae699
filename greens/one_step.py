"""One time step of the states: decay, and the force during it (greens.recursion).

The schemes differ in the force within a step, from the forces f_n at its end, f_{n-1} and f_{n-2}:

    linear     from f_{n-1} to f_n: second order; a contact that the step does not resolve chatters
    damped     (9 f_n + 6 f_{n-1} + f_{n-2}) / 16 throughout: second order; damps such a contact
    constant   f_n throughout: first order, as forces half a step early; never gains energy from
               contact

Of the means a f_n + b f_{n-1} + c f_{n-2} that are of second order, a = 1/2 + c, b = 1/2 - 2 c, the
error is (1/8 + c) h^2 f'' and the work that springs lose on an oscillation of angle t a step is as
2 c (1 - cos t)^2 >= 0, whatever the tire. With c = 1/16 a mass bouncing on a spring of stiffness k
loses at least 2.5 % of its amplitude a step from k h^2 / m = 2 to 10^3.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import linalg, sparse

from tireroad.greens.response import Response

DAMPED = 1 / 16
# Parts of f_{n-1} and f_{n-2} in the earlier force l of a step, z_n = e^{sh} z_{n-1} + b0 P l + b1 P f_n.
EARLIER = {
    "linear": (1.0, 0.0),
    "damped": (0.5 - 2 * DAMPED, DAMPED),
    "constant": (1.0, 0.0),
}


class Block:
    """Recursion of the block of nearly defective states, on the first process with states.

    Its last three outputs are the rate of change of momentum, without its jump due to the force.
    """

    def __init__(self, response: Response, step: float, scheme: str) -> None:
        block, push = response.block, response.block_input
        self._output = np.vstack([response.block_output, response.inertia[1]])
        self._decay, self._old, self._new = block_steps(block, push, step, scheme)
        self._parts = EARLIER[scheme]
        size, forces = push.shape
        self.state = np.zeros(size)
        self._force = self._before = np.zeros(forces)

    def direct(self) -> np.ndarray:
        return self._output @ self._new

    def start(self, force: np.ndarray) -> None:
        self._force = self._before = force

    def direct_next(self) -> np.ndarray:
        return self._output @ (self._decay @ self._new + self._parts[0] * self._old)

    def move(self) -> None:
        self._free = self._decay @ self.state + self._old @ mixed(
            self._parts, self._force, self._before
        )

    def seen(self) -> np.ndarray:
        return self._output @ self._free

    def seen_next(self) -> np.ndarray:
        moved = self._decay @ self._free
        if self._parts[1]:
            moved += self._old @ (self._parts[1] * self._force)
        return self._output @ moved

    def advance(self, force: np.ndarray) -> None:
        self._before, self._force = self._force, force
        self.state = self._free + self._new @ force

    def snapshot(self) -> dict[str, np.ndarray]:
        return {
            "block_state": self.state,
            "block_force": self._force,
            "block_before": self._before,
        }

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        self.state, self._force = kept["block_state"], kept["block_force"]
        self._before = kept["block_before"]


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
    return moved[:, :size], *_shares(first, second, scheme)


NO_BLOCK = {name: np.zeros(0) for name in ("block_state", "block_force", "block_before")}


def weights(x: np.ndarray, step: float, scheme: str) -> tuple[np.ndarray, np.ndarray]:
    """b0 and b1 for x = s h."""
    phi1, phi2 = _phi(x)
    return _shares(step * phi1, step * phi2, scheme)


def _shares(first: np.ndarray, second: np.ndarray, scheme: str) -> tuple[np.ndarray, np.ndarray]:
    """b0 and b1 from h phi1 and h phi2."""
    if scheme == "linear":
        return first - second, second
    if scheme == "damped":
        return first, (0.5 + DAMPED) * first
    return 0 * first, first


def mixed(parts: tuple[float, float], last: np.ndarray, before: np.ndarray) -> np.ndarray:
    """The earlier force of a step, by the `parts` of the two before it; also of their pushes."""
    return parts[0] * last + parts[1] * before if parts[1] else last


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


def ahead_of_mean(scheme: str, forces: np.ndarray) -> np.ndarray:
    """The mean force that acts during each step, less (f_n + f_{n-1}) / 2: (n, k) N.

    `forces` (n + 2, k) N: at the ends of n steps, with the two before them.
    """
    if scheme == "constant":
        return 0.5 * np.diff(forces[1:], axis=0)
    return (DAMPED if scheme == "damped" else 0.0) * np.diff(forces, 2, axis=0)


def late_answers(response: Response, step: float, scheme: str) -> sparse.csr_matrix | None:
    """What the outputs and the rate of momentum (r + 3, k) still answer to the step's first force.

    It is missing in the answer to its last force: a pulse one step long responds to the mean of both,
    as of a linear force, and a slope (Response.slope) to the difference of both.
    """
    late = np.zeros((len(response.residual) + 3, response.residual.shape[1]))
    if response.pulse and scheme != "constant":
        late[: response.pulse] = response.residual[: response.pulse] / 2
    if response.slope is not None:
        late -= response.slope / step
    return sparse.csr_matrix(late) if late.any() else None
