"""The time loop's recursion of states: exact convolution of Green's functions without history.

With a force linear over one step h (first-order hold), f(tau) = f_n + (f_{n+1} - f_n) tau / h, each
state advances by

    z_{n+1} = e^{sh} z_n + b0 P f_n + b1 P f_{n+1},   b1 = h phi2(sh),  b0 = h (phi1 - phi2)(sh),

phi1(x) = (e^x - 1)/x, phi2(x) = (e^x - 1 - x)/x^2. With the force constant at its new value b0 = 0
and b1 = h phi1. Cost: one pass over output and input,
4 q (r + k) flops and 16 q (r + k) bytes.

Other forces within a step are declared in greens.schemes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import linalg, sparse
from threadpoolctl import threadpool_info

from tireroad.fem.collective import allgather_rows, same_on_all
from tireroad.fem.compiled import library
from tireroad.fem.errors import InputError
from tireroad.greens.response import Response
from tireroad.greens.schemes import SCHEMES

_C = library(Path(__file__).with_suffix(".c"))

NO_BLOCK = {name: np.zeros(0) for name in ("block_state", "block_force", "block_before")}
# Bytes of both matrices; smaller ones fit the caches, and processes would only wait.
SHARED_FROM = 20e6
_LIBRARY = "user_api", "internal_api", "version", "architecture"
Array = NDArray[np.float64]
Index = NDArray[np.intp]
# How a contact yields: the changes (k, m) N of forces on the nodes by displacements (k, m) m of them.
Yields = Callable[[Array], Array]
LARGEST = 4e9  # bytes of sampled Green's functions


class Block:
    """Recursion of the block of nearly defective states, on the first process with states.

    Its last three outputs are the rate of change of momentum, without its jump due to the force.
    """

    def __init__(self, response: Response, step: float, scheme: str) -> None:
        block, push = response.block, response.block_input
        self._output = np.vstack([response.block_output, response.inertia[1]])
        self._decay, self._old, self._new = block_steps(block, push, step, scheme)
        self._parts, self._held = SCHEMES[scheme].earlier, response.held_block()
        size, forces = push.shape
        self.state = np.zeros(size)
        self._force = self._before = np.zeros(forces)

    def direct(self) -> np.ndarray:
        return self._output @ self._new

    def start(self, force: np.ndarray) -> None:
        self._force = self._before = force

    def start_steady(self, force: np.ndarray) -> np.ndarray:
        """Begin at rest under a force (k,) N that always was; the outputs. Rigid states, which are last, stay 0."""
        block, _, push = self._held
        self.state = np.zeros(len(self.state))
        self.state[: len(block)] = -np.linalg.solve(block, push @ force)
        return self._output @ self.state

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

    def restore(self, state: dict[str, np.ndarray]) -> None:
        self.state, self._force = state["block_state"], state["block_force"]
        self._before = state["block_before"]


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
    return moved[:, :size], *SCHEMES[scheme].shares(first, second)


def weights(x: np.ndarray, step: float, scheme: str) -> tuple[np.ndarray, np.ndarray]:
    """b0 and b1 for x = s h."""
    phi1, phi2 = _phi(x)
    return SCHEMES[scheme].shares(step * phi1, step * phi2)


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


def late_answers(response: Response, step: float, scheme: str) -> sparse.csr_matrix | None:
    """The answer (r + 3, k) of outputs and rate of momentum that a step's first force still gives.

    It is missing in the answer to its last force: a pulse one step long responds to the mean of both,
    as of a linear force, and a slope (Response.slope) to the difference of both.
    """
    late = np.zeros((len(response.residual) + 3, response.residual.shape[1]))
    if response.pulse and not SCHEMES[scheme].late:
        late[: response.pulse] = response.residual[: response.pulse] / 2
    if response.slope is not None:
        late -= response.slope / step
    return sparse.csr_matrix(late) if late.any() else None


@dataclass(frozen=True)
class StateDistribution:
    """States dealt in turn to the processes of `comm`, except the first `idle` ones."""

    comm: MPI.Comm
    idle: int

    def mine(self, every: np.ndarray) -> np.ndarray:
        """This process's share of all states (q, ...), a view."""
        return self._of(self.comm.rank, every)

    def everywhere(self, own: np.ndarray) -> np.ndarray:
        """All states (q, ...) from those of each process. Collective."""
        if self.comm.size == 1:
            return own
        every = allgather_rows(self.comm, np.ascontiguousarray(own))
        out, first = np.empty_like(every), 0
        for rank in range(self.comm.size):
            share = self._of(rank, out)
            share[:] = every[first : first + len(share)]
            first += len(share)
        return out

    def _of(self, rank: int, every: np.ndarray) -> np.ndarray:
        owners = self.comm.size - self.idle
        return every[rank - self.idle :: owners] if rank >= self.idle else every[:0]


def loop_communicator(response: Response, comm: MPI.Comm) -> MPI.Comm:
    """The processes worth distributing a loop over: all of `comm`, or each one by itself.
    Collective.

    The root solves the contact problem while the others look ahead (greens.recursion). 625 points
    and 410 states have 8 MB, 1,296 and 1,010 have 42 MB. Each process decides from the results of
    the loop whether to continue. Processes whose BLAS rounds differently, on nodes of another kind,
    could decide differently and wait for ever, so they do not share.
    """
    size = response.output.nbytes + response.input.nbytes
    return comm if size >= SHARED_FROM and same_on_all(comm, _kernels()) else MPI.COMM_SELF


def _kernels() -> str:
    """The libraries of this process's products, with the kernels chosen for its processor."""
    found = [[str(lib.get(name)) for name in _LIBRARY] for lib in threadpool_info()]
    return str(sorted(found))


def alternating(response: Response, step: float) -> np.ndarray:
    """Displacement (r, k) m/N under unit forces of alternating sign, without the residual.

    `response` as the loop uses it (Response.resolved), `step` s; forces linear over the step.

    With f_n = (-1)^n F, linear in between, every state settles at z_n = (-1)^n Z,

        -Z = e^{sh} Z + b0 P F - b1 P F   =>   Z = (b1 - b0) P F / (1 + e^{sh})

    The mass of a mode alone gives -h^2 / (12 m): the tire moves towards a force
    that pushes it, as if it were a negative spring. Forces constant over the step give zero.
    """
    x = response.eigenvalue * step
    old, new = weights(x, step, "linear")
    out = ((response.output * ((new - old) / (1 + np.exp(x)))) @ response.input).real
    if len(response.block):
        decay, old, new = block_steps(response.block, response.block_input, step, "linear")
        out += response.block_output @ np.linalg.solve(np.eye(len(decay)) + decay, new - old)
    return out


def at_once(response: Response) -> np.ndarray:
    """The residual's contribution (r, k) m/N; that of a pulse, half of it a step late, cancels."""
    return np.zeros_like(response.residual) if response.pulse else response.residual


class SharedRows:
    """This process's share `mine` of `count` rows, and their collection by `gathered`."""

    def __init__(self, count: int, comm: MPI.Comm) -> None:
        ends = count * np.arange(comm.size + 1) // comm.size
        self.comm = comm
        self.mine = slice(int(ends[comm.rank]), int(ends[comm.rank + 1]))
        self._count, self._shares = count, (np.diff(ends), ends[:-1])

    def gathered(self, own: Array) -> Array:
        """The numbers (count,) of all processes, bitwise equal on each, from this one's.
        Collective.
        """
        if self.comm.size == 1:
            return own
        every = np.empty(self._count)
        self.comm.Allgatherv(np.ascontiguousarray(own), [every, self._shares, MPI.DOUBLE])
        return every


class LoadedColumns:
    """A (n, k), stored by `columns` (k, n); products read only columns of nonzero forces.

    The order of summation depends on the nonzero entries alone, so that a run restarted from a
    checkpoint yields the same bits. With a `comm` of several processes, each computes its share of the n rows.
    """

    def __init__(self, matrix: Array, comm: MPI.Comm = MPI.COMM_SELF) -> None:
        self.columns = np.ascontiguousarray(matrix.T)
        self.rows = SharedRows(len(matrix), comm)
        self._own = np.ascontiguousarray(self.columns[:, self.rows.mine])
        count = len(self.columns)
        self._pointers = (
            _C.doubles(self._own),
            _C.ints(np.empty(count, np.int32)),
            _C.doubles(np.empty(count)),
        )

    def __matmul__(self, force: Array) -> Array:
        """A f (n,) for f (k,). Collective where the rows are shared."""
        return self.rows.gathered(self.product(force))

    def product(self, force: Array) -> Array:
        """This process's rows of A f for f (k,)."""
        out = np.zeros(self._own.shape[1])
        force = np.ascontiguousarray(force, dtype=float)
        _C.lib.add_loaded(
            *self._own.shape,
            self._pointers[0],
            _C.doubles(force),
            *self._pointers[1:],
            _C.doubles(out),
        )
        return out


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
        self._spread = StateDistribution(comm, self._idle)
        mine = self._spread.mine(np.arange(len(response.eigenvalue)))
        s = response.eigenvalue[mine]
        old, new = weights(s * step, step, scheme)
        self._decay, self._old, self._new = (
            np.exp(s * step),
            old.astype(complex),
            new.astype(complex),
        )
        self._parts = SCHEMES[scheme].earlier
        # Real arithmetic on adjacent (re, im), as the states lie in memory.
        output = np.vstack([response.output[:, mine], response.inertia[0][:, mine]])
        into = np.ascontiguousarray(response.input[mine])
        self._eigenvalue, self._residual = s, response.residual
        self._output = np.ascontiguousarray(output.conj()).view(float)
        self._block = None
        if comm.rank == self._idle and len(response.block):
            self._block = Block(response, step, scheme)
        forces = response.residual.shape[1]
        self._state = np.zeros(len(mine), complex)
        self._free = self._state.copy()  # at the end of the step without a new force
        # P f of the previous step, and of the one before it.
        self._push, self._before = np.zeros((2, len(mine)), complex)
        self._moved = False  # whether `_free` belongs to this step yet
        self._taken = True  # whether `_state` includes the last force
        self._samples: list[tuple[np.ndarray, ...]] | None = None
        self._begun = response.direct_momentum_rate()
        self._into_rate = np.zeros((3, forces))
        self._add_same_step(response, into)
        self.ahead = self if self._idle else None
        self._next = self._answers_next(into) if self._idle else None
        self._late = late_answers(response, step, scheme)
        if self._late is not None:
            self.same_step -= self._late[:-3].toarray()
            self._into_rate -= self._late[-3:].toarray()
        self._force, self._rate = np.zeros(forces), np.zeros(3)
        # Outputs at the end of this step; this process's and all known parts of the next step's.
        self._heard = False  # whether the processes have exchanged what they know of this step
        self._out = np.zeros(len(self._output))
        self._part = self._known = self._out
        self._unknown = self._force  # the force missing from `_known`
        self._bind()

    def _bind(self) -> None:
        """The structure of the compiled step, which works in this object's arrays."""
        self._into_rate = np.ascontiguousarray(self._into_rate)
        complexes = {
            "decay": self._decay, "old_": self._old, "new_": self._new, "state": self._state,
            "moved": self._free, "push": self._push, "before": self._before,
        }  # fmt: skip
        doubles = {name: values.view(float) for name, values in complexes.items()} | {
            "output": self._output, "input": self._input.columns, "into_rate": self._into_rate, "force": self._force,
            "out": self._out, "rate": self._rate, "value": np.empty(len(self._force)),
        }  # fmt: skip
        sizes = {"states": len(self._state), "forces": len(self._force), "outputs": len(self._out)}
        parts = {"last_part": self._parts[0], "before_part": self._parts[1]}
        pointers = {name: _C.doubles(values) for name, values in doubles.items()}
        pointers["which"] = _C.ints(np.empty(len(self._force), np.int32))
        self._held = pointers
        self._c = _C.ffi.new("states *", sizes | parts | pointers)

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
        self._force[:] = force
        self._push[:] = (self._input @ self._force).view(complex)
        self._before[:] = self._push
        self._rate[:] = self._begun @ force
        if self._block:
            self._block.start(force)
        self._begin()

    def start_steady(self, force: np.ndarray, sudden: np.ndarray | None = None) -> np.ndarray:
        """Begin at rest under a force (k,) N that has always been there, with a `sudden` one at t = 0 beside it.

        Every state is z = -P f / s, of the block T z = -P f; rigid states rest. Returns the displacement (r,) m. Collective.
        """
        self.start(force if sudden is None else force + sudden)
        push = (self._input @ np.ascontiguousarray(force)).view(complex)
        self._state[:] = -push / self._eigenvalue
        moved = self._output @ self._state.view(float)
        if self._block:
            moved += self._block.start_steady(force)
        self._rate[:] = 0.0 if sudden is None else self._begun @ sudden
        self._moved, self._taken = False, True
        self._begin()
        return self._reduce(moved)[:-3] + self._residual @ force

    def _begin(self) -> None:
        """Compute all outputs of the first step. Collective when looking ahead."""
        if self.ahead:
            self._move()
            self._see()
            self._known, self._unknown = self._reduce(self._out), np.zeros_like(self._force)

    def predict(self) -> np.ndarray:
        """Displacement (r,) m at the end of the step without a new force, valid until the next call.

        Collective. When looking ahead the root calls it first, and the others may after `exchange`.
        """
        if not self.ahead:
            self._move()
            self._see()
            if self.comm.size > 1:
                self._out[:] = self._reduce(self._out)
        elif self._next is not None:
            self._out[:] = self._known + self._next @ self._unknown
        out = self._out if self._late is None else self._out + self._late @ self._force
        self._rate[:] = out[-3:]
        return out[:-3]

    def _move(self) -> None:
        """Advance the states to the end of the step, without a new force."""
        if self._moved:
            return
        self._take()
        _C.lib.move(self._c)
        if self._block:
            self._block.move()
        self._moved = True

    def _take(self) -> None:
        """Add the force that `advance` was given to the states."""
        if self._taken:
            return
        _C.lib.take(self._c)
        if self._block:
            self._block.advance(self._force.copy())
        self._taken = True
        if self._samples is not None:
            block = self._block.state if self._block else np.zeros(0)
            self._samples.append((self._state.copy(), self._push.copy(), self._force.copy(), block))

    def _see(self) -> None:
        """This process's part of the outputs without a new force, in `_out`."""
        _C.lib.see(self._c)
        if self._block:
            self._out += self._block.seen()

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
        self._heard = True
        self.comm.Bcast(self._out)
        self._known = self._reduce(self._part)

    def advance(self, force: np.ndarray) -> None:
        """Set the force (k,) N at the end of the step; after `predict`. Local to each process."""
        if self.ahead and not self._heard:
            raise RuntimeError("a recursion that looks ahead needs `exchange` in every step")
        self._heard = False
        self._move()
        self._force[:] = force
        self._unknown = self._force
        _C.lib.advance(self._c)
        self._moved = self._taken = False

    @property
    def force(self) -> np.ndarray:
        """The force (k,) N at the end of the last step."""
        return self._force.copy()

    @property
    def state(self) -> np.ndarray:
        """This process's states (mine,), after `advance`."""
        self._take()
        return self._state.copy()

    def keep_samples(self) -> None:
        """Record `samples` of each step from now on."""
        self._samples = []

    def samples(self) -> list[tuple[np.ndarray, ...]]:
        """States and pushes (mine,), force (k,) N, and the block's states, of each step since the last call.

        Those of the block are on the process that has it, empty on others: `block_everywhere`.
        """
        self._take()
        kept, self._samples = self._samples, []
        assert kept is not None, "samples() before keep_samples()"
        return kept

    def everywhere(self, samples: list[np.ndarray]) -> np.ndarray:
        """Samples of n steps as (n, q), all states in the order of the response. Collective."""
        return self._spread.everywhere(np.array(samples).T).T

    def block_everywhere(self, samples: list[np.ndarray]) -> np.ndarray:
        """The block's states of n steps as (n, b). Collective."""
        return self.comm.bcast(np.array(samples), self._idle)

    def snapshot(self) -> dict[str, np.ndarray]:
        """All states in the order of the response, alike for any number of processes.
        Collective."""
        kept = {
            "state": self._spread.everywhere(self.state),
            "push": self._spread.everywhere(self._push.copy()),
            "push_before": self._spread.everywhere(self._before.copy()),
        }
        kept["push_force"] = self._force.copy()
        kept["known_ahead"] = self._known if self.ahead else self._known[:0]
        block = self._block.snapshot() if self._block else NO_BLOCK
        return kept | self.comm.bcast(block, root=self._idle)

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from a snapshot, after `advance`. Collective when looking ahead."""
        arrays = {"state": self._state, "push": self._push, "push_before": self._before}
        for name, own in arrays.items():
            own[:] = self._spread.mine(state[name])
        self._force[:] = state["push_force"]
        self._unknown = self._force
        self._moved, self._taken = False, True
        if self._block:
            self._block.restore(state)
        if len(state.get("known_ahead", ())):
            self._known = state["known_ahead"]
        else:
            self._begin()

    def inertia_force(self) -> np.ndarray:
        """Rate of the tire's momentum (3,), N, after `advance`: sum_k (int rho phi_k) eta_k''."""
        return self._rate.copy()


def marched(
    response: Response,
    step: float,
    scheme: str,
    begun: Array,
    blocks: Iterable[Array],
    always: Array | None = None,
) -> Iterator[Array]:
    """Displacements (n, r) m at the ends of steps of `step` s under forces that are known, block by
    block.

    As `Recursion` finds them step by step, but by products of matrices: with known forces only the
    decay of the states goes from one step to the next. `begun` (k,) N at t = 0, `blocks` (n, k) N; `always` (k,) N: the part
    of `begun` that always was, as `Recursion.start_steady` has it.
    """
    decay = np.exp(response.eigenvalue * step)
    old, new = weights(response.eigenvalue * step, step, scheme)
    parts, late = SCHEMES[scheme].earlier, late_answers(response, step, scheme)
    into = np.ascontiguousarray(response.input.T).view(float)
    output = np.ascontiguousarray(response.output.conj()).view(float).T
    block = Block(response, step, scheme) if len(response.block) else None
    force, state = begun, np.zeros(len(decay), complex)
    if always is not None:
        state -= (always @ into).view(complex) / response.eigenvalue
    if block:
        block.start(begun)
        if always is not None:
            block.start_steady(always)
    last = np.repeat((begun @ into).view(complex)[None], 2, axis=0)
    for forces in blocks:
        pushes = np.concatenate([last, (forces @ into).view(complex)])
        states = old * mixed(parts, pushes[1:-1], pushes[:-2]) + new * pushes[2:]
        for each in states:
            each += decay * state
            state = each
        out = states.view(float) @ output + forces @ response.residual.T
        if block:
            for row, each in zip(out, forces, strict=True):
                block.move()
                block.advance(each)
                row += response.block_output @ block.state
        if late is not None:
            out += (late[:-3] @ (np.vstack([force, forces[:-1]]) - forces).T).T
        yield out
        force, last = forces[-1], pushes[-2:]


class Convolution:
    """The interface of `Recursion` by direct sums over the whole history, in steps of `step` s.

    InputError if the sampled Green's functions take more than `LARGEST` bytes. Not collective.

    Thesis (5.3), kept as a reference:

        u_n = sum_{k<n} g((n - k) h) f_k h + G_res f_n,   g(0) = 0

    A rectangle rule: first order in h, and only for modes that h resolves well. Time and memory grow
    with the number of steps: n r k multiplications in step n.
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

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Continue from a snapshot."""
        self._n = len(state["history"]) - 1
        self._history[: self._n + 1] = state["history"]

    def inertia_force(self) -> np.ndarray:
        """Rate of change of the tire's momentum (3,), N."""
        past = _convolve(self._momentum[: self._n], self._history[: self._n])
        change = self._history[self._n] - self._history[max(self._n - 1, 0)]
        return past + self._direct @ self._history[self._n] + self._slope[-3:] @ change


def _convolve(kernel: np.ndarray, history: np.ndarray) -> np.ndarray:
    """sum_k kernel[n - 1 - k] history[k]."""
    return np.einsum("trk,tk->r", kernel[::-1], history, optimize=True)
