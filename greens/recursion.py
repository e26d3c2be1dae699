"""The convolution of Green's functions and forces, advanced exactly step by step without a history.

Over one step h with the force linear, f(tau) = f_n + (f_{n+1} - f_n) tau / h, each state moves by

    z_{n+1} = e^{sh} z_n + b0 P f_n + b1 P f_{n+1},   b1 = h phi2(sh),  b0 = h (phi1 - phi2)(sh),

phi1(x) = (e^x - 1)/x, phi2(x) = (e^x - 1 - x)/x^2; with the force constant at its new value b0 = 0
and b1 = h phi1. Cost: one pass over output and input, 4 q (r + k) flops and 16 q (r + k) bytes.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from tireroad.fem.collective import joined
from tireroad.greens.one_step import NO_BLOCK, Block, weights
from tireroad.greens.residual.sparse_columns import LoadedColumns
from tireroad.greens.response import Response


class Recursion:
    """Response states of a `Response`, spread over the processes of `comm` by eigenvalue; with `ahead`, over all but the
    root, which solves the contact problem while they look ahead.

    `predict` gives the displacement at the end of the next step if the new force were zero (without
    the residual); `advance` takes the new force. `same_step` (r, k) m/N is what a unit new force
    adds to it at once, the residual included. A step reads the output matrix once and of the input
    matrix the columns of the forces that are not zero. The rate of momentum is three more outputs,
    so that processes meet once a step.

    Looking ahead: with z_n = e^{sh} z_{n-1} + b0 P f_{n-1} + b1 P f_n = y_n + b1 P f_n the displacement C y_{n+1} at the end of
    the step after is C e^{sh} y_n, known before f_n is, and C (e^{sh} b1 + b0) P f_n, of which the root reads the columns
    of the forces that are not zero.
    """

    def __init__(
        self, *, response: Response, step: float, scheme: str, comm: MPI.Comm, ahead: bool = False
    ) -> None:
        self.comm = comm
        self.step = step
        self._idle = int(ahead and comm.size > 1)  # processes without states, from the root on
        mine = self._mine(np.arange(len(response.eigenvalue)))
        s = response.eigenvalue[mine]
        self._decay = np.exp(s * step)
        self._old, self._new = weights(s * step, step, scheme)
        momentum = response.momentum[:, mine]
        # Real arithmetic on (re, im) beside each other, as the states lie in memory.
        output = np.vstack([response.output[:, mine], momentum * s**2])
        into = np.ascontiguousarray(response.input[mine])
        self._output = np.ascontiguousarray(output.conj()).view(float)
        self._block = None
        if comm.rank == self._idle and len(response.block):
            self._block = Block(response, step, scheme)
        self.state = np.zeros(len(mine), complex)
        self._push = np.zeros(len(mine), complex)  # P f of the step before
        self._free = self.state
        self._begun = response.direct_momentum_rate()
        self._add_same_step(response, into)
        self._known: np.ndarray | None = None
        self._next = self._answers_next(into) if self._idle else None
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
        self._input = LoadedColumns(pushes)
        # By itself, or processes with other numbers of states would round it otherwise.
        self._into_rate = direct[-3:] + self._begun

    def _answers_next(self, into: np.ndarray) -> LoadedColumns | None:
        """What a unit force does by the end of the step after its own, on the root process. Collective."""
        pushed = (self._decay * self._new + self._old)[:, None] * into
        direct = self._output @ np.ascontiguousarray(pushed.T).view(float).T
        if self._block:
            direct += self._block.direct_next()
        direct = self._reduce(direct)
        return LoadedColumns(direct) if self.comm.rank == 0 else None

    def _mine(self, every: np.ndarray) -> np.ndarray:
        """Of all states (q, ...) those of this process."""
        return self._of(self.comm.rank, every)

    def _of(self, rank: int, every: np.ndarray) -> np.ndarray:
        """Of all states (q, ...) those of a process, a view."""
        owners = self.comm.size - self._idle
        return every[rank - self._idle :: owners] if rank >= self._idle else every[:0]

    def _reduce(self, values: np.ndarray) -> np.ndarray:
        if self.comm.size == 1:
            return values
        total = np.ascontiguousarray(values)
        self.comm.Allreduce(MPI.IN_PLACE, total)
        return total

    def start(self, force: np.ndarray) -> None:
        """Begin with a force (k,) N that is already there at t = 0, the tire still at rest."""
        self._force = force
        self._push = (self._input @ force).view(complex)
        self._rate = self._begun @ force
        if self._block:
            self._block.start(force)

    def predict(self) -> np.ndarray:
        """Displacement (r,) m at the end of the step with no new force. Collective."""
        self._free = self._decay * self.state + self._old * self._push
        if self._block:
            self._block.move()
        out = self._reduce(self._seen() if self._known is None else self._known_of_next())
        self._rate = out[-3:]
        out = out[:-3]
        return out if self._late is None else out + self._late @ self._force

    def _seen(self) -> np.ndarray:
        """This process's part of the outputs with no new force."""
        out = self._output @ self._free.view(float)
        if self._block:
            out += self._block.seen()
        return out

    def _known_of_next(self) -> np.ndarray:
        """The same in two parts: what was known ahead, and of the root process what the force just taken adds."""
        known, self._known = self._known, None
        assert known is not None, "after look_ahead()"
        return known if self._next is None else self._next @ self._force

    def look_ahead(self) -> None:
        """Find what of the next outputs does not depend on the force of this step; between `predict` and `advance`."""
        if not self._idle:
            return
        self._known = self._output @ (self._decay * self._free).view(float)
        if self._block:
            self._known += self._block.seen_next()

    def advance(self, force: np.ndarray) -> None:
        """Take the force (k,) N at the end of the step; after `predict`. Local to each process."""
        self._force = force
        self._push = (self._input @ force).view(complex)
        self.state = self._free + self._new * self._push
        self._rate = self._rate + self._into_rate @ force
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
            share = self._of(rank, out.T)
            share[:] = every[first : first + len(share)]
            first += len(share)
        return out

    def snapshot(self) -> dict[str, np.ndarray]:
        """All states in the order of the response, the same for any number of processes. Collective."""
        kept = {"state": self._gathered(self.state), "push": self._gathered(self._push)}
        kept["push_force"] = self._force
        block = self._block.snapshot() if self._block else NO_BLOCK
        return kept | self.comm.bcast(block, root=self._idle)

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        """Go on from a snapshot, between `advance` and `predict`."""
        self.state, self._push = (self._mine(kept[name]).copy() for name in ("state", "push"))
        self._force, self._known = kept["push_force"], None
        if self._block:
            self._block.restore(kept)

    def _gathered(self, values: np.ndarray) -> np.ndarray:
        parts = self.comm.allgather(values)
        out = np.empty(sum(map(len, parts)), complex)
        for rank, part in enumerate(parts):
            self._of(rank, out)[:] = part
        return out

    def inertia_force(self) -> np.ndarray:
        """Rate of the tire's momentum (3,), N: sum_k (int rho phi_k) eta_k'', after `advance`."""
        return self._rate
