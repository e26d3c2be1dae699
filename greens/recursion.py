"""State-space recursion: the exact convolution of Green's functions and forces, without history.

With a force linear over one step h (first-order hold), f(tau) = f_n + (f_{n+1} - f_n) tau / h, each
state advances by

    z_{n+1} = e^{sh} z_n + b0 P f_n + b1 P f_{n+1},   b1 = h phi2(sh),  b0 = h (phi1 - phi2)(sh),

phi1(x) = (e^x - 1)/x, phi2(x) = (e^x - 1 - x)/x^2. With the force constant at its new value b0 = 0
and b1 = h phi1; other forces within a step: greens.one_step. Cost: one pass over output and input,
4 q (r + k) flops and 16 q (r + k) bytes."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from tireroad.greens.one_step import EARLIER, NO_BLOCK, Block, late_answers, mixed, weights
from tireroad.greens.residual.sparse_columns import LoadedColumns
from tireroad.greens.response import Response
from tireroad.greens.spread import Spread


class Recursion:
    """The states of a `Response`, distributed over the processes of `comm` by eigenvalue.

    `predict` gives the displacement at the end of the next step for a zero new force (without the
    residual); `advance` sets the new force. `same_step` (r, k) m/N is the immediate displacement
    per unit new force, residual included. A step reads the output matrix once, and of the input
    matrix the columns of nonzero forces. The rate of change of momentum is three more outputs, so
    processes meet once per step.

    With `look_ahead` the root has no states: it solves the contact problem while the others look
    ahead. With z_n = e^{sh} z_{n-1} + b0 P f_{n-1} + b1 P f_n = y_n + b1 P f_n, the displacement
    C y_{n+1} at the end of the following step is C e^{sh} y_n, known before f_n, plus
    C (e^{sh} b1 + b0) P f_n, of which the root reads the columns of nonzero forces. So the root
    predicts by itself and sends its prediction with the force, when it receives what the others
    know of the next step. States take up a force only when they are next needed, so nobody waits
    for P f_n. `ahead` is then the recursion itself, else None."""

    def __init__(
        self,
        *,
        response: Response,
        step: float,
        scheme: str,
        comm: MPI.Comm,
        look_ahead: bool = False,
    ) -> None:
        self.comm = comm
        self.step = step
        self._idle = int(look_ahead and comm.size > 1)  # processes without states, the root first
        self._spread = Spread(comm, self._idle)
        mine = self._spread.mine(np.arange(len(response.eigenvalue)))
        s = response.eigenvalue[mine]
        self._decay = np.exp(s * step)
        self._old, self._new = weights(s * step, step, scheme)
        self._parts = EARLIER[scheme]
        # Real arithmetic on adjacent (re, im), as the states lie in memory.
        output = np.vstack([response.output[:, mine], response.inertia[0][:, mine]])
        into = np.ascontiguousarray(response.input[mine])
        self._output = np.ascontiguousarray(output.conj()).view(float)
        self._block = None
        if comm.rank == self._idle and len(response.block):
            self._block = Block(response, step, scheme)
        self._state = np.zeros(len(mine), complex)
        # P f of the previous step, and of the one before it.
        self._push = self._before = np.zeros(len(mine), complex)
        self._free = self._state  # at the end of the step without a new force
        self._moved = False  # whether `_free` belongs to this step yet
        self._taken = True  # whether `_state` includes the last force
        self._samples: list[tuple[np.ndarray, np.ndarray, np.ndarray]] | None = None
        self._begun = response.direct_momentum_rate()
        self._add_same_step(response, into)
        self.ahead = self if self._idle else None
        self._next = self._answers_next(into) if self._idle else None
        self._late = late_answers(response, step, scheme)
        if self._late is not None:
            self.same_step -= self._late[:-3].toarray()
            self._into_rate -= self._late[-3:].toarray()
        self._force = np.zeros(response.residual.shape[1])
        self._rate = np.zeros(3)
        # Outputs at the end of this step; this process's and all known parts of the next step's.
        self._out = np.zeros(len(self._output))
        self._part = self._known = self._out
        self._unknown = self._force  # the force missing from `_known`

    def _add_same_step(self, response: Response, into: np.ndarray) -> None:
        """Immediate effect of a unit new force on the displacements and on the rate of momentum."""
        pushed = np.ascontiguousarray((self._new[:, None] * into).T).view(float)
        direct = self._output @ pushed.T
        if self._block:
            direct += self._block.direct()
        direct = self._reduce(direct)
        self.same_step = response.residual + direct[:-3]
        pushes = np.ascontiguousarray(into.T).view(float).T
        self._input = LoadedColumns(pushes)
        # A product of its own: otherwise its rounding would depend on the number of states per
        # process.
        self._into_rate = direct[-3:] + self._begun

    def _answers_next(self, into: np.ndarray) -> LoadedColumns | None:
        """Effect of a unit force at the end of the step after its own, on the root. Collective."""
        pushed = (self._decay * self._new + self._parts[0] * self._old)[:, None] * into
        direct = self._output @ np.ascontiguousarray(pushed.T).view(float).T
        if self._block:
            direct += self._block.direct_next()
        direct = self._reduce(direct)
        return LoadedColumns(direct) if self.comm.rank == 0 else None

    def _reduce(self, values: np.ndarray) -> np.ndarray:
        if self.comm.size == 1:
            return values
        total = np.ascontiguousarray(values)
        self.comm.Allreduce(MPI.IN_PLACE, total)
        return total

    def start(self, force: np.ndarray) -> None:
        """Begin with a force (k,) N at t = 0, at rest. Collective when looking ahead."""
        self._force = force
        self._push = self._before = (self._input @ force).view(complex)
        self._rate = self._begun @ force
        if self._block:
            self._block.start(force)
        self._begin()

    def _begin(self) -> None:
        """Compute all outputs of the first step. Collective when looking ahead."""
        if self.ahead:
            self._move()
            self._known, self._unknown = self._reduce(self._seen()), np.zeros_like(self._force)

    def predict(self) -> np.ndarray:
        """Displacement (r,) m at the end of the step without a new force.

        Collective. When looking ahead the root calls it first, and the others may after `exchange`.
        """
        if not self.ahead:
            self._move()
            self._out = self._reduce(self._seen())
        elif self._next is not None:
            self._out = self._known + self._next @ self._unknown
        out = self._out if self._late is None else self._out + self._late @ self._force
        self._rate = out[-3:]
        return out[:-3]

    def _move(self) -> None:
        """Advance the states to the end of the step, without a new force."""
        if self._moved:
            return
        self._take()
        earlier = mixed(self._parts, self._push, self._before)
        self._free = self._decay * self._state + self._old * earlier
        if self._block:
            self._block.move()
        self._moved = True

    def _take(self) -> None:
        """Add the force that `advance` was given to the states."""
        if self._taken:
            return
        self._before, self._push = self._push, (self._input @ self._force).view(complex)
        self._state = self._free + self._new * self._push
        if self._block:
            self._block.advance(self._force)
        self._taken = True
        if self._samples is not None:
            self._samples.append((self._state, self._push, self._force))

    def _seen(self) -> np.ndarray:
        """This process's part of the outputs without a new force."""
        out = self._output @ self._free.view(float)
        if self._block:
            out += self._block.seen()
        return out

    def look_ahead(self) -> None:
        """Compute the part of the next outputs that does not depend on the force of this step."""
        self._move()
        moved = self._decay * self._free
        if self._parts[1]:
            moved += self._old * (self._parts[1] * self._push)
        self._part = self._output @ moved.view(float)
        if self._block:
            self._part += self._block.seen_next()

    def exchange(self) -> None:
        """Broadcast the root's prediction and sum what was looked ahead; before `advance`.
        Collective."""
        self._out = self._out if self._next is not None else np.empty_like(self._out)
        self.comm.Bcast(self._out)
        self._known = self._reduce(self._part)

    def advance(self, force: np.ndarray) -> None:
        """Set the force (k,) N at the end of the step; after `predict`. Local to each process."""
        self._move()
        self._force = self._unknown = force
        self._rate = self._rate + self._into_rate @ force
        self._moved = self._taken = False

    @property
    def state(self) -> np.ndarray:
        """This process's states (mine,), after `advance`."""
        self._take()
        return self._state

    def keep_samples(self) -> None:
        """Record `samples` of each step from now on."""
        self._samples = []

    def samples(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """States and pushes (mine,), and force (k,) N, of each step since the last call."""
        self._take()
        kept, self._samples = self._samples, []
        assert kept is not None, "samples() before keep_samples()"
        return kept

    def everywhere(self, samples: list[np.ndarray]) -> np.ndarray:
        """Samples of n steps as (n, q), all states in the order of the response. Collective."""
        return self._spread.everywhere(np.array(samples).T).T

    def snapshot(self) -> dict[str, np.ndarray]:
        """All states in the order of the response, alike for any number of processes.
        Collective."""
        kept = {
            "state": self._spread.everywhere(self.state),
            "push": self._spread.everywhere(self._push),
            "push_before": self._spread.everywhere(self._before),
        }
        kept["push_force"] = self._force
        kept["known_ahead"] = self._known if self.ahead else self._known[:0]
        block = self._block.snapshot() if self._block else NO_BLOCK
        return kept | self.comm.bcast(block, root=self._idle)

    def restore(self, kept: dict[str, np.ndarray]) -> None:
        """Continue from a snapshot, after `advance`. Collective when looking ahead."""
        self._state, self._push, self._before = (
            self._spread.mine(kept[name]).copy() for name in ("state", "push", "push_before")
        )
        self._force = self._unknown = kept["push_force"]
        self._moved, self._taken = False, True
        if self._block:
            self._block.restore(kept)
        if len(kept.get("known_ahead", ())):
            self._known = kept["known_ahead"]
        else:
            self._begin()

    def inertia_force(self) -> np.ndarray:
        """Rate of the tire's momentum (3,), N, after `advance`: sum_k (int rho phi_k) eta_k''."""
        return self._rate
