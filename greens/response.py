"""The response between forces and displacements by states, which of them are dynamic, hub moments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, sparse

from tireroad.modal.states import StateModes, growing

# Radians a state may rotate in a step and stay dynamic. Undamped, bouncing on a stiff tread, up to
# 3 gained no energy and 5 diverged: rotation beyond pi is not resolved. Rolling on a rough road in
# steps of 0.2 ms, 1 has an error of 1.6 % in the axle force, 1.5 to 3 of 0.7 %: a rotating state is
# better kept dynamic.
RESOLVED = 2.0


@dataclass(frozen=True)
class SplitStates:
    """y' = A y + b f as two decoupled blocks: y = right z + lagging r.

    z' = block z + left b f and r' = faster r + lagging_left b f. Shapes: `block` (p, p), `right`
    (n, p), `left` (p, n); `faster` (n - p, n - p), `lagging` (n, n - p), `lagging_left` (n - p, n).
    """

    block: np.ndarray
    right: np.ndarray
    left: np.ndarray
    faster: np.ndarray
    lagging: np.ndarray
    lagging_left: np.ndarray

    def following(self, push: np.ndarray) -> np.ndarray:
        """lagging faster^-1 lagging_left b (n, k) for the inputs b = `push` (n, k).

        Its negative is the static response y, per constant force, of the states that do not stay.
        """
        return self.lagging @ np.linalg.solve(self.faster, self.lagging_left @ push)


def split_states(block: np.ndarray, values: np.ndarray, stays: np.ndarray) -> SplitStates:
    """Split the block (n, n) by its eigenvalues (n,), those that stay first; pairs together.

    Its real Schur form is divided between the two, and the coupling C removed by the solution of
    Sylvester's equation A X - X B = -C. Not collective.
    """

    def first(re: float, im: float) -> bool:
        return bool(stays[np.abs(values - complex(re, im)).argmin()])

    schur, turn, p = linalg.schur(block, output="real", sort=first)
    X = linalg.solve_sylvester(schur[:p, :p], -schur[p:, p:], -schur[:p, p:])
    right, left = turn.copy(), turn.T.copy()
    right[:, p:] += turn[:, :p] @ X
    left[:p] -= X @ turn.T[p:]
    return SplitStates(schur[:p, :p], right[:, :p], left[:p], schur[p:, p:], right[:, p:], left[p:])


@dataclass(frozen=True, kw_only=True)
class Response:
    """Poles with their input and output, for k forces and r displacements.

    `eigenvalue` (q,) 1/s, `output` (r, q) and `input` (q, k) complex, `block` (b, b) with its
    `block_output` (r, b) and `block_input` (b, k), `residual` (r, k) m/N; `momentum` (3, q) and
    `block_momentum` (3, b): the momentum (kg m/s) that each state's rate carries, or nine rows
    (basis.Basis.felt). The last `rigid` states of the block drift under a constant force and are
    omitted from static results. In the first `pulse` outputs the residual responds not at once but
    with a pulse 1/step high and one step long, in place of its delta(t) (thesis (C.4)). `left_out`
    (3 or 9, k) kg m/N, where known: the same rows of all motions outside the states, which follow
    statically; their rates are what the axle force lacks. The last `relaxing` poles are real and carry no
    momentum: what slow motions find softer than the modes (greens.slow). `offset` (r,) m, where there is one: displacements
    of the outputs from the static state by forces that always act inside the tire (greens.rolling_loss).

        u(t) = Re[C z(t)] + C_b y(t) + G_res f(t),   z' = s z + P f,   y' = T y + P_b f
        g(t) = Re[C e^{st} P] + C_b e^{Tt} P_b  (+ G_res delta(t)),   g(0) = 0 without truncation

    thesis (4.14), whose sum over eigenpairs is kept as a product, C = Phi_out R and P = L Phi_in^T.
    """

    eigenvalue: np.ndarray
    output: np.ndarray
    input: np.ndarray
    block: np.ndarray
    block_output: np.ndarray
    block_input: np.ndarray
    residual: np.ndarray
    momentum: np.ndarray
    block_momentum: np.ndarray
    pulse: int = 0
    rigid: int = 0
    left_out: np.ndarray | None = None
    moments: np.ndarray | None = None
    slope: np.ndarray | None = None
    relaxing: int = 0
    offset: np.ndarray | None = None

    @property
    def of_modes(self) -> slice:
        """The poles of the modes, which are first."""
        return slice(len(self.eigenvalue) - self.relaxing)

    def without_slow(self) -> Response:
        """The response of the modes alone, in which slow motions find moduli of the modes' frequencies."""
        own = self.of_modes
        return replace(
            self,
            eigenvalue=self.eigenvalue[own],
            output=self.output[:, own],
            input=self.input[own],
            momentum=self.momentum[:, own],
            relaxing=0,
        )

    def with_slow(self, eigenvalue: np.ndarray, output: np.ndarray, push: np.ndarray) -> Response:
        """The response with real poles (p,) 1/s behind its own, which relax; `output` (r, p), `push` (p, k)."""
        none = np.zeros((len(self.momentum), len(eigenvalue)))
        return replace(
            self,
            eigenvalue=np.concatenate([self.eigenvalue, eigenvalue]),
            output=np.hstack([self.output, output]),
            input=np.vstack([self.input, push]),
            momentum=np.hstack([self.momentum, none]),
            relaxing=self.relaxing + len(eigenvalue),
        )

    def impulse(self, times: np.ndarray) -> np.ndarray:
        """Green's functions g (t, r, k), m/(N s), without the residual's delta at t = 0."""
        return self._waves(times, self.output, self.block_output)

    def momentum_rate(self, times: np.ndarray) -> np.ndarray:
        """Rate of momentum (t, 3, k) 1/s after a unit impulse of each force, without its jump."""
        return self._waves(times, *self.inertia)

    @property
    def inertia(self) -> tuple[np.ndarray, np.ndarray]:
        """Rate of momentum (3, q) and (3, b), N, per state and per state of the block."""
        return rates(self)[1]

    def direct_momentum_rate(self) -> np.ndarray:
        """Rate of momentum (3, k) due to each force at the same instant."""
        return at_once(self)

    def _waves(self, times: np.ndarray, output: np.ndarray, block_output: np.ndarray) -> np.ndarray:
        g = np.stack([((output * np.exp(self.eigenvalue * t)) @ self.input).real for t in times])
        if len(self.block):
            steps = np.stack([linalg.expm(self.block * t) for t in times])
            g += block_output @ steps @ self.block_input
        return g

    def receptance(self, frequency: np.ndarray) -> np.ndarray:
        """H (f, r, k) complex, m/N, at the given frequencies in Hz; 0 only without rigid states."""
        H = np.empty((len(frequency), *self.residual.shape), complex)
        for k, s in enumerate(2j * np.pi * frequency):
            poles = (self.output / (s - self.eigenvalue)) @ self.input
            mirror = (self.output.conj() / (s - self.eigenvalue.conj())) @ self.input.conj()
            H[k] = (poles + mirror) / 2 + self.residual
            if len(self.block):
                shifted = s * np.eye(len(self.block)) - self.block
                H[k] += self.block_output @ np.linalg.solve(shifted, self.block_input)
            if self.slope is not None:
                H[k] += s * self.slope[:-3]
        return H

    def static(self) -> np.ndarray:
        """Displacement (r, k) per constant force, m/N, of the poles alone: H at 0 Hz."""
        static = -((self.output / self.eigenvalue) @ self.input).real
        block, output, push = self.held_block()
        if len(block):
            static -= output @ np.linalg.solve(block, push)
        return static

    def static_moment(self) -> np.ndarray:
        """First moment (3, k) kg m of all states, or the nine rows, per constant force, N."""
        return replace(self, output=self.momentum, block_output=self.block_momentum).static()

    @property
    def growth(self) -> tuple[int, float]:
        """Number of states that grow beyond rounding, and the largest growth rate, 1/s."""
        values = self.every
        grows = growing(values)
        return int(grows.sum()), float(values.real[grows].max(initial=0.0))

    def held_block(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The block, its output and input, without rigid states, which are last and decoupled."""
        k = len(self.block) - self.rigid
        return self.block[:k, :k], self.block_output[:, :k], self.block_input[:k]

    def keeping(self, keep: np.ndarray) -> Response:
        """The poles where `keep` (q,) is true stay dynamic; the others follow statically."""
        return self if keep.all() else poles_made_static(self, keep)

    @property
    def every(self) -> np.ndarray:
        """All eigenvalues but the rigid ones, the block's last: (q + b - rigid,) 1/s."""
        return np.concatenate([self.eigenvalue, np.linalg.eigvals(self.held_block()[0])])

    def keeping_where(self, wanted: Callable[[np.ndarray], np.ndarray]) -> Response:
        """Keep states of `wanted` eigenvalues, and rigid ones; the others follow statically."""
        values = self.every
        stays = wanted(values)
        count = len(self.eigenvalue)
        poles, of_block = self.keeping(stays[:count]), stays[count:]
        return poles if of_block.all() else block_made_static(poles, values[count:], of_block)

    def slow(self, step: float, limit: float = RESOLVED) -> np.ndarray:
        """Mask (q - relaxing,) of the modes' poles that `resolved` keeps."""
        return np.abs(self.eigenvalue[self.of_modes]) * step <= limit

    def resolved(self, step: float, limit: float = RESOLVED) -> Response:
        """States with |s| step above the limit follow statically: the step does not resolve their
        rotation, and they can gain energy in contact."""
        return self.keeping_where(lambda s: np.abs(s) * step <= limit)

    def between(self, outputs: slice, forces: slice | np.ndarray) -> Response:
        """The response for some of the outputs and forces (slices, or indices of forces)."""
        return replace(
            self,
            output=self.output[outputs],
            input=self.input[:, forces],
            block_output=self.block_output[outputs],
            block_input=self.block_input[:, forces],
            residual=self.residual[outputs, forces],
            pulse=sum(k < self.pulse for k in range(len(self.residual))[outputs]),
            left_out=None if self.left_out is None else self.left_out[:, forces],
            moments=None if self.moments is None else self.moments[outputs],
            slope=None if self.slope is None else self.slope[self._with_rates(outputs)][:, forces],
            offset=None if self.offset is None else self.offset[outputs],
        )

    def _with_rates(self, outputs: slice) -> np.ndarray:
        """Rows of some outputs and of the rate of momentum, of all of both."""
        r = len(self.residual)
        return np.append(np.arange(r)[outputs], [r, r + 1, r + 2])


def couple(
    modes: StateModes,
    output: np.ndarray,
    forces: np.ndarray,
    momentum: np.ndarray,
    compliance: np.ndarray | None = None,
) -> Response:
    """Response from modal shapes at the outputs (r, m) and forces (k, m), kg^-1/2.

    `momentum` (3, m) as in modal.basis, or (9, m). With the exact static flexibility `compliance` (r, k) m/N
    of the rolling tire, G_res = [K_Omega^-1]_rk - Phi_r K~^-1 Phi_k^T represents the truncated
    modes (statically, exact at 0 Hz); without it they are missing."""
    response = Response(
        eigenvalue=modes.eigenvalue,
        output=output @ modes.right,
        input=modes.left @ forces.T,
        block=modes.block,
        block_output=output @ modes.block_right,
        block_input=modes.block_left @ forces.T,
        residual=np.zeros((len(output), len(forces))),
        momentum=momentum @ modes.right,
        block_momentum=momentum @ modes.block_right,
        rigid=modes.rigid,
    )
    if compliance is None:
        return response
    return replace(response, residual=compliance - response.static())


def rates(response: Response) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rows of its momentum per state (3, q) and per state of the block (3, b), two pairs.

    First A_2 s + A_1, by which a force changes the axle force at once, then A_2 s^2 + A_1 s + A_0.
    """
    s, block = response.eigenvalue, response.block
    poles = _horner(response.momentum, lambda rows: rows * s)
    return list(
        zip(poles, _horner(response.block_momentum, lambda rows: rows @ block), strict=True)
    )


def _horner(rows: np.ndarray, rate: Callable[[np.ndarray], np.ndarray]) -> list[np.ndarray]:
    """Both of `rates`; `rows` (3, n) are A_2 alone, (9, n) are A_2, A_1 and A_0 (Basis.felt)."""
    inertia, *rest = np.split(rows, len(rows) // 3)
    first, still = rest or (0.0, 0.0)
    direct = rate(inertia) + first
    return [direct, rate(direct) + still]


def at_once(response: Response) -> np.ndarray:
    """Rate of momentum (3, k) due to each force at the same instant, including the part of the residual that
    follows the force."""
    poles, block = rates(response)[0]
    direct = (poles @ response.input).real + block @ response.block_input
    follows = response.left_out
    return direct if follows is None or len(follows) == 3 else direct + follows[6:]


def reading(
    response: Response, states: StateModes, wanted: sparse.csr_matrix, rows: np.ndarray
) -> Response:
    """The `response` with -(A_2 q'' + A_1 q' + A_0 q) of its own `states` added to its outputs.

    `wanted` (r, 3): the weights of the moments in the outputs; `rows` (9, m): A_0, A_1 and A_2 on
    the m coordinates.

        m = R^T f - (A_2 u'' + A_1 u' + A_0 u),

    with A as in modal.corner.Corner.moments, and u the motion of the states and of what follows a
    force statically. States z' = s z + P f with coordinates q = C z (real part) have the rates q' =
    C s z + C P f and q'' = C s^2 z + C s P f + C P f'. C P vanishes for a complete set of states;
    what it is where some are made static is the response's slope (static condensation).
    """
    if not wanted.nnz:
        return response
    s, block = states.eigenvalue, states.block
    by_state, by_block = np.zeros((3, len(s)), complex), np.zeros((3, len(block)))
    # Horner's rule: each further rate has the jump of the one before.
    for part in np.split(rows, 3)[::-1]:
        direct = (by_state @ response.input).real + by_block @ response.block_input
        by_state = by_state * s - part @ states.right
        by_block = by_block @ block - part @ states.block_right
    return replace(
        response,
        output=response.output + wanted @ by_state,
        block_output=response.block_output + wanted @ by_block,
        residual=response.residual + wanted @ direct,
        moments=np.diff(wanted.tocsr().indptr) > 0,
    )


def poles_made_static(response: Response, keep: np.ndarray) -> Response:
    """The poles where `keep` (q,) is true stay dynamic; the others follow statically.

    A state z' = s z + P f, seen by C, answers a slow force by

        C P / (D - s) f = -C P / s f - C P / s^2 f' - ...,   D = d/dt.

    The first term joins the residual. The second is small in a displacement, and would feed a rate
    of the force back into a contact. But the rate of momentum and hub moments weight a state with
    s^2 (greens.response), so that however fast it is it answers a rate of force with C P / s^2: by
    as much as the states that stay now lack of completeness, Re(C P / s^2) = 0 over all of them.
    That part is the response's `slope`.
    """
    s = response.eigenvalue[~keep, None]
    following = response.input[~keep] / s
    gone, left_out = response.output[:, ~keep] @ following, response.left_out
    if left_out is not None:
        left_out = left_out - (response.momentum[:, ~keep] @ following).real
    slope = _rates(response, response.output, response.inertia[0])[:, ~keep] @ (following / s)
    return replace(
        response,
        left_out=left_out,
        eigenvalue=response.eigenvalue[keep],
        output=response.output[:, keep],
        input=response.input[keep],
        momentum=response.momentum[:, keep],
        residual=response.residual - gone.real,
        slope=added(response.slope, -slope.real),
        relaxing=int(np.count_nonzero(keep[response.of_modes.stop :])),
    )


def block_made_static(response: Response, values: np.ndarray, stays: np.ndarray) -> Response:
    """The same for the block, by its eigenvalues, `values` (b - rigid,) 1/s."""
    held, output, push = response.held_block()
    k = len(held)
    momentum, rates = response.block_momentum[:, :k], response.inertia[1][:, :k]
    kept = split_states(held, values, stays)
    following = kept.following(push)
    left_out = response.left_out
    if left_out is not None:
        left_out = left_out - momentum @ following
    slope = _rates(response, output, rates) @ kept.following(following)
    return replace(
        response,
        block=linalg.block_diag(kept.block, response.block[k:, k:]),
        block_output=np.hstack([output @ kept.right, response.block_output[:, k:]]),
        block_input=np.vstack([kept.left @ push, response.block_input[k:]]),
        block_momentum=np.hstack([momentum @ kept.right, response.block_momentum[:, k:]]),
        residual=response.residual - output @ following,
        left_out=left_out,
        slope=added(response.slope, -slope),
    )


def _rates(response: Response, output: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Rows (r + 3, n) of what is weighted with s^2: hub moments, zeros for other outputs, and the
    rate of momentum."""
    moments = response.moments
    own = np.zeros_like(output) if moments is None else output * moments[:, None]
    return np.vstack([own, inertia])


def added(one: np.ndarray | None, other: np.ndarray | None) -> np.ndarray | None:
    """The sum of two slopes, where None is none."""
    return other if one is None else one if other is None else one + other


def participation(response: Response, band: float) -> np.ndarray:
    """Loss (q,) if a state is made static, from 0 to `band` Hz.

    The larger of its shares in the static displacements and in the axle force, in Frobenius norms
    over all outputs and forces.

    A state A = C P that is made static loses (A e(s) + A* e(s*)) / 2, e(s) = i w / (s (i w - s)).
    Its participation is the largest magnitude of that over the band. Fast modes lose (w/s)^2, since
    the two halves of a pair almost cancel. For the axle force, the contact forces less the rate of
    momentum, C is replaced by s^2 times the state's momentum: the few modes with a net momentum
    matter there long after the displacements no longer need them.
    """
    still = np.linalg.norm(response.static() + response.residual)
    displacement = _lost(response, response.output, band) / still
    # Of each unit force one unit reaches the axle.
    axle = _lost(response, response.inertia[0], band)
    return np.maximum(displacement, axle / np.sqrt(response.input.shape[1]))


def _lost(response: Response, output: np.ndarray, band: float) -> np.ndarray:
    """Largest magnitude (q,) over the band of what each state loses at the outputs (r, q)."""
    s, push = response.eigenvalue, response.input.T
    # The maximum is at the state's resonance if that is within the band, else at the end of the
    # band.
    omega = 1j * np.clip(np.abs(s), 0, 2 * np.pi * band)
    half = omega / (s * (omega - s))
    mirror = omega / (s.conj() * (omega - s.conj()))
    square = (np.abs(output) ** 2).sum(axis=0) * (np.abs(push) ** 2).sum(axis=0)
    plain = (output**2).sum(axis=0) * (push**2).sum(axis=0)  # of A with A*
    cross = 2 * (half * mirror.conj() * plain).real
    loss = square * (np.abs(half) ** 2 + np.abs(mirror) ** 2) + cross
    return np.sqrt(np.maximum(loss, 0.0)) / 2


def keep(response: Response, count: int, band: float, counted: slice = slice(None)) -> Response:
    """The response with the `count` states that participate most in the band (Hz) dynamic.

    The others follow statically, but for what relaxes. A state is a pair of complex eigenvalues or one real eigenvalue;
    `counted` are the outputs and forces that decide.
    """
    merit = participation(response.between(counted, counted), band)[response.of_modes]
    foremost = np.argsort(-merit, kind="stable")[:count]
    relaxing = np.ones(response.relaxing, bool)
    return response.keeping(np.append(np.isin(np.arange(len(merit)), foremost), relaxing))
