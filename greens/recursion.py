"""The convolution of Green's functions and forces, advanced exactly step by step without a history.

Over one step h with the force linear, f(tau) = f_n + (f_{n+1} - f_n) tau / h, each state moves by

    z_{n+1} = e^{sh} z_n + b0 P f_n + b1 P f_{n+1},   b1 = h phi2(sh),  b0 = h (phi1 - phi2)(sh),

phi1(x) = (e^x - 1)/x, phi2(x) = (e^x - 1 - x)/x^2; with the force constant at its new value b0 = 0
and b1 = h phi1. Cost: one pass over output and input, 4 q (r + k) flops and 16 q (r + k) bytes.
"""

from __future__ import annotations

import math

import numpy as np
from mpi4py import MPI
from scipy import linalg

from greens.response import Response


class Recursion:
    """Response states of a `Response`, spread over the processes of `comm` by eigenvalue.

    `predict` gives the displacement at the end of the next step if the new force were zero (without
    the residual); `advance` takes the new force. `same_step` (r, k) m/N is what a unit new force
    adds to it at once, the residual included.
    """

    def __init__(self, response: Response, step: float, scheme: str, comm: MPI.Comm):
        self.comm = comm
        self.step = step
        mine = np.arange(comm.rank, len(response.eigenvalue), comm.size)
        s = response.eigenvalue[mine]
        self._s = s
        self._decay = np.exp(s * step)
        self._old, self._new = _weights(s * step, step, scheme)
        # Real arithmetic and contiguous rows: a step is two matrix-vector products.
        self._output = np.hstack([response.output[:, mine].real, -response.output[:, mine].imag])
        self._input = np.vstack([response.input[mine].real, response.input[mine].imag])
        self._momentum = response.momentum[:, mine]
        self._block = _Block(response, step, scheme) if comm.rank == 0 else None
        self._q = len(mine)
        self.state = np.zeros(self._q, complex)
        self._push = np.zeros(self._q, complex)  # P f of the step before
        self.same_step = response.residual + self._reduce(self._direct())
        self._late = np.zeros_like(response.residual)
        if response.pulse and scheme == "linear":
            # A pulse one step long answers the mean of a linear force over the step.
            self._late = response.residual / 2
            self.same_step -= self._late
        self._force = np.zeros(response.residual.shape[1])

    def _direct(self) -> np.ndarray:
        """Displacement at the end of a step per unit force there, of this process's states."""
        weighted = self._new[:, None] * self._complex(self._input)
        direct = self._output @ np.vstack([weighted.real, weighted.imag])
        return direct + self._block.direct() if self._block else direct

    def _complex(self, stacked: np.ndarray) -> np.ndarray:
        return stacked[: self._q] + 1j * stacked[self._q :]

    def _reduce(self, values: np.ndarray) -> np.ndarray:
        if self.comm.size == 1:
            return values
        total = np.ascontiguousarray(values)
        self.comm.Allreduce(MPI.IN_PLACE, total)
        return total

    def start(self, force: np.ndarray) -> None:
        """Begin with a force (k,) N that is already there at t = 0, the tire still at rest."""
        self._force = force
        self._push = self._complex(self._input @ force)
        if self._block:
            self._block.start(force)

    def predict(self) -> np.ndarray:
        """Displacement (r,) m at the end of the step with no new force. Collective."""
        self._free = self._decay * self.state + self._old * self._push
        out = self._output @ np.concatenate([self._free.real, self._free.imag])
        if self._block:
            out += self._block.predict()
        return self._reduce(out) + self._late @ self._force

    def advance(self, force: np.ndarray) -> None:
        """Take the force (k,) N at the end of the step; after `predict`. Local to each process."""
        self._force = force
        self._push = self._complex(self._input @ force)
        self.state = self._free + self._new * self._push
        if self._block:
            self._block.advance(force)

    def snapshot(self) -> dict[str, np.ndarray]:
        """All states in the order of the response, the same for any number of processes. Collective."""
        kept = {"state": self._gathered(self.state), "push": self._gathered(self._push)}
        block = self._block.snapshot() if self._block else None
        return kept | self.comm.bcast(block)

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        """Go on from a snapshot, between `advance` and `predict`."""
        mine = slice(self.comm.rank, None, self.comm.size)
        self.state, self._push = kept["state"][mine].copy(), kept["push"][mine].copy()
        if self._block:
            self._block.restore(kept)

    def _gathered(self, values: np.ndarray) -> np.ndarray:
        parts = self.comm.allgather(values)
        out = np.empty(sum(map(len, parts)), complex)
        for rank, part in enumerate(parts):
            out[rank :: self.comm.size] = part
        return out

    def inertia_force(self) -> np.ndarray:
        """Rate of the tire's momentum (3,), N: sum_k (int rho phi_k) eta_k''. Collective."""
        rate = self._s * (self._s * self.state + self._push)
        out = (self._momentum @ rate).real
        if self._block:
            out += self._block.inertia_force()
        return self._reduce(out)


class _Block:
    """The same recursion for the dense block of near-defective states, on the root process only."""

    def __init__(self, response: Response, step: float, scheme: str):
        self._response = response
        size, forces = response.block_input.shape
        # expm of [[T, P, 0], [0, 0, I/h], [0, 0, 0]] h carries e^{Th}, h phi1 P and h phi2 P at once.
        wide = np.zeros((size + 2 * forces, size + 2 * forces))
        wide[:size, :size] = response.block * step
        wide[:size, size : size + forces] = response.block_input * step
        wide[size : size + forces, size + forces :] = np.eye(forces)
        moved = linalg.expm(wide)[:size] if size else np.zeros((0, size + 2 * forces))
        self._decay = moved[:, :size]
        first, second = moved[:, size : size + forces], moved[:, size + forces :]
        self._old, self._new = (
            (first - second, second) if scheme == "linear" else (0 * first, first)
        )
        self.state = np.zeros(size)
        self._force = np.zeros(forces)

    def direct(self) -> np.ndarray:
        return self._response.block_output @ self._new

    def start(self, force: np.ndarray) -> None:
        self._force = force

    def predict(self) -> np.ndarray:
        self._free = self._decay @ self.state + self._old @ self._force
        return self._response.block_output @ self._free

    def advance(self, force: np.ndarray) -> None:
        self._force = force
        self.state = self._free + self._new @ force

    def snapshot(self) -> dict[str, np.ndarray]:
        return {"block_state": self.state, "block_force": self._force}

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        self.state, self._force = kept["block_state"], kept["block_force"]

    def inertia_force(self) -> np.ndarray:
        block = self._response.block
        push = self._response.block_input @ self._force
        return self._response.block_momentum @ (block @ (block @ self.state + push))


def _weights(x: np.ndarray, step: float, scheme: str) -> tuple[np.ndarray, np.ndarray]:
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
