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

from tireroad.fem.collective import joined
from tireroad.greens.residual.sparse_columns import LoadedColumns
from tireroad.greens.response import Response


class Recursion:
    """Response states of a `Response`, spread over the processes of `comm` by eigenvalue.

    `predict` gives the displacement at the end of the next step if the new force were zero (without
    the residual); `advance` takes the new force. `same_step` (r, k) m/N is what a unit new force
    adds to it at once, the residual included. A step reads the output matrix once and of the input
    matrix the columns of the forces that are not zero. The rate of momentum is three more outputs,
    so that processes meet once a step.
    """

    def __init__(self, *, response: Response, step: float, scheme: str, comm: MPI.Comm) -> None:
        self.comm = comm
        self.step = step
        mine = np.arange(comm.rank, len(response.eigenvalue), comm.size)
        s = response.eigenvalue[mine]
        self._decay = np.exp(s * step)
        self._old, self._new = weights(s * step, step, scheme)
        momentum = response.momentum[:, mine]
        # Real arithmetic on (re, im) beside each other, as the states lie in memory.
        output = np.vstack([response.output[:, mine], momentum * s**2])
        into = np.ascontiguousarray(response.input[mine])
        self._output = np.ascontiguousarray(output.conj()).view(float)
        self._block = None
        if comm.rank == 0 and len(response.block):
            self._block = _Block(response, step, scheme)
        self.state = np.zeros(len(mine), complex)
        self._push = np.zeros(len(mine), complex)  # P f of the step before
        self._free = self.state
        self._begun = response.direct_momentum_rate()
        self._add_same_step(response, into)
        self._late = None
        if response.pulse and scheme == "linear":
            # A pulse one step long answers the mean of a linear force over the step.
            self._late = response.residual / 2
            self._late[response.pulse :] = 0.0
            self.same_step -= self._late
        self._force = np.zeros(response.residual.shape[1])
        self._rate = np.zeros(3)

    def _add_same_step(self, response: Response, into: np.ndarray) -> None:
        """What a unit new force adds at once, to the displacements and to the rate of momentum."""
        pushed = np.ascontiguousarray((self._new[:, None] * into).T).view(float)
        direct = self._output @ pushed.T
        if self._block:
            direct += self._block.direct()
        direct = self._reduce(direct)
        self.same_step = response.residual + direct[:-3]
        pushes = np.ascontiguousarray(into.T).view(float).T
        self._input = LoadedColumns(np.vstack([pushes, direct[-3:] + self._begun]))

    def _reduce(self, values: np.ndarray) -> np.ndarray:
        if self.comm.size == 1:
            return values
        total = np.ascontiguousarray(values)
        self.comm.Allreduce(MPI.IN_PLACE, total)
        return total

    def start(self, force: np.ndarray) -> None:
        """Begin with a force (k,) N that is already there at t = 0, the tire still at rest."""
        self._force = force
        self._push = (self._input @ force)[:-3].view(complex)
        self._rate = self._begun @ force
        if self._block:
            self._block.start(force)

    def predict(self) -> np.ndarray:
        """Displacement (r,) m at the end of the step with no new force. Collective."""
        self._free = self._decay * self.state + self._old * self._push
        out = self._output @ self._free.view(float)
        if self._block:
            out += self._block.predict()
        out = self._reduce(out)
        self._rate = out[-3:]
        out = out[:-3]
        return out if self._late is None else out + self._late @ self._force

    def advance(self, force: np.ndarray) -> None:
        """Take the force (k,) N at the end of the step; after `predict`. Local to each process."""
        self._force = force
        pushed = self._input @ force
        self._push = pushed[:-3].view(complex)
        self.state = self._free + self._new * self._push
        self._rate = self._rate + pushed[-3:]
        if self._block:
            self._block.advance(force)

    def sample(self) -> tuple[np.ndarray, np.ndarray]:
        """This process's states and pushes (mine,), after `advance`."""
        return self.state, self._push

    @property
    def force(self) -> np.ndarray:
        """The force (k,) N that `advance` took last."""
        return self._force

    def everywhere(self, samples: list[np.ndarray]) -> np.ndarray:
        """Samples of n steps as (n, q), all states in the order of the response. Collective."""
        own = np.array(samples)
        if self.comm.size == 1:
            return own
        every = joined(self.comm, np.ascontiguousarray(own.T))
        out = np.empty((len(own), len(every)), complex)
        first = 0
        for rank in range(self.comm.size):
            share = out[:, rank :: self.comm.size]
            share[:] = every[first : first + share.shape[1]].T
            first += share.shape[1]
        return out

    def snapshot(self) -> dict[str, np.ndarray]:
        """All states in the order of the response, the same for any number of processes. Collective."""
        kept = {"state": self._gathered(self.state), "push": self._gathered(self._push)}
        kept["push_force"] = self._force
        block = self._block.snapshot() if self._block else _NO_BLOCK
        return kept | self.comm.bcast(block)

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        """Go on from a snapshot, between `advance` and `predict`."""
        mine = slice(self.comm.rank, None, self.comm.size)
        self.state, self._push = kept["state"][mine].copy(), kept["push"][mine].copy()
        self._force = kept["push_force"]
        if self._block:
            self._block.restore(kept)

    def _gathered(self, values: np.ndarray) -> np.ndarray:
        parts = self.comm.allgather(values)
        out = np.empty(sum(map(len, parts)), complex)
        for rank, part in enumerate(parts):
            out[rank :: self.comm.size] = part
        return out

    def inertia_force(self) -> np.ndarray:
        """Rate of the tire's momentum (3,), N: sum_k (int rho phi_k) eta_k'', after `advance`."""
        return self._rate


class _Block:
    """The same recursion for the dense block of near-defective states, on the root process only.

    Its last three outputs are the rate of momentum, the jump with the force left out.
    """

    def __init__(self, response: Response, step: float, scheme: str) -> None:
        block, push = response.block, response.block_input
        self._output = np.vstack([response.block_output, response.block_momentum @ block @ block])
        self._decay, self._old, self._new = block_steps(block, push, step, scheme)
        size, forces = push.shape
        self.state = np.zeros(size)
        self._force = np.zeros(forces)

    def direct(self) -> np.ndarray:
        return self._output @ self._new

    def start(self, force: np.ndarray) -> None:
        self._force = force

    def predict(self) -> np.ndarray:
        self._free = self._decay @ self.state + self._old @ self._force
        return self._output @ self._free

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
    """e^{Th} (b, b), and b0 P and b1 P (b, k) of the block T with its input P."""
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


_NO_BLOCK = {"block_state": np.zeros(0), "block_force": np.zeros(0)}


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
