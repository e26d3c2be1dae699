"""Semi-analytical response of the tire between chosen forces and displacements.

    u(t) = Re[C z(t)] + C_b y(t) + G_res f(t),   z' = s z + P f,   y' = T y + P_b f
    g(t) = Re[C e^{st} P] + C_b e^{Tt} P_b  (+ G_res delta(t)),   g(0) = 0 without truncation

thesis (4.14) with its sum over eigenpairs kept as a product, C = Phi_out R and P = L Phi_in^T.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from tireroad.greens.residual.parted import parted
from tireroad.modal.states import StateModes, growing

# Radians a state may turn in a step and stay dynamic. Undamped and bouncing on a stiff tread, up to 3
# gained no energy and 5 blew up: from pi on a turn is not seen any more. Rolling on a rough road in
# steps of 0.2 ms, 1 errs by 1.6 % in the axle force, 1.5 to 3 by 0.7 %: what turns is better not static.
RESOLVED = 2.0


@dataclass(frozen=True, kw_only=True)
class Response:
    """Poles with their input and output, for k forces and r displacements.

    `eigenvalue` (q,) 1/s, `output` (r, q) and `input` (q, k) complex, `block` (b, b) with its
    `block_output` (r, b) and `block_input` (b, k), `residual` (r, k) m/N; `momentum` (3, q) and
    `block_momentum` (3, b): the momentum (kg m/s) that each state's rate carries. The last `rigid`
    states of the block drift under a constant force: static figures leave them out. Of the first `pulse`
    outputs the residual answers not at once but with a pulse 1/step high and one step long in place of its
    delta(t) (thesis (C.4)). `left_out` (3, k) kg m/N, where it is known: the static first moment int rho u of
    all motions that no state has; the axle force lacks its second rate.
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

    def impulse(self, times: np.ndarray) -> np.ndarray:
        """Green's functions g (t, r, k), m/(N s), without the residual's delta at t = 0."""
        return self._waves(times, self.output, self.block_output)

    def momentum_rate(self, times: np.ndarray) -> np.ndarray:
        """Rate of momentum (t, 3, k) 1/s after a unit impulse of each force, its own jump left out."""
        s, block = self.eigenvalue, self.block
        return self._waves(times, self.momentum * s**2, self.block_momentum @ block @ block)

    def direct_momentum_rate(self) -> np.ndarray:
        """Rate of momentum (3, k) per force acting at the moment itself."""
        direct = ((self.momentum * self.eigenvalue) @ self.input).real
        return direct + self.block_momentum @ self.block @ self.block_input

    def _waves(self, times: np.ndarray, output: np.ndarray, block_output: np.ndarray) -> np.ndarray:
        g = np.stack([((output * np.exp(self.eigenvalue * t)) @ self.input).real for t in times])
        if len(self.block):
            steps = np.stack([linalg.expm(self.block * t) for t in times])
            g += block_output @ steps @ self.block_input
        return g

    def receptance(self, frequency: np.ndarray) -> np.ndarray:
        """H (f, r, k) complex, m/N, at the given frequencies in Hz, 0 only without rigid states."""
        H = np.empty((len(frequency), *self.residual.shape), complex)
        for k, s in enumerate(2j * np.pi * frequency):
            poles = (self.output / (s - self.eigenvalue)) @ self.input
            mirror = (self.output.conj() / (s - self.eigenvalue.conj())) @ self.input.conj()
            H[k] = (poles + mirror) / 2 + self.residual
            if len(self.block):
                shifted = s * np.eye(len(self.block)) - self.block
                H[k] += self.block_output @ np.linalg.solve(shifted, self.block_input)
        return H

    def static(self) -> np.ndarray:
        """Displacement (r, k) per constant force, m/N, of the poles alone: H at 0 Hz."""
        static = -((self.output / self.eigenvalue) @ self.input).real
        block, output, push = self._held_block()
        if len(block):
            static -= output @ np.linalg.solve(block, push)
        return static

    def static_moment(self) -> np.ndarray:
        """First moment (3, k) kg m of all states per constant force, N."""
        moving = replace(self, output=self.momentum, block_output=self.block_momentum)
        return moving.static()

    @property
    def growth(self) -> tuple[int, float]:
        """How many states grow, beyond rounding, and how fast the fastest does, 1/s."""
        values = self.every
        grows = growing(values)
        return int(grows.sum()), float(values.real[grows].max(initial=0.0))

    def _held_block(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The block with its output and input without rigid states, which are last and apart."""
        k = len(self.block) - self.rigid
        return self.block[:k, :k], self.block_output[:, :k], self.block_input[:k]

    def spectral_moment(self) -> np.ndarray:
        """-dH/ds (r, k) at s = 0, m s/N: what damping adds to a slow force's displacement."""
        first = ((self.output / self.eigenvalue**2) @ self.input).real
        block, output, push = self._held_block()
        if len(block):
            first += output @ np.linalg.solve(block, np.linalg.solve(block, push))
        return first

    def keeping(self, keep: np.ndarray) -> Response:
        """The poles where `keep` (q,) is true; the others follow the force statically."""
        if keep.all():
            return self
        following = self.input[~keep] / self.eigenvalue[~keep, None]
        gone, left_out = self.output[:, ~keep] @ following, self.left_out
        if left_out is not None:
            left_out = left_out - (self.momentum[:, ~keep] @ following).real
        return replace(
            self,
            left_out=left_out,
            eigenvalue=self.eigenvalue[keep],
            output=self.output[:, keep],
            input=self.input[keep],
            momentum=self.momentum[:, keep],
            residual=self.residual - gone.real,
        )

    @property
    def every(self) -> np.ndarray:
        """All eigenvalues but the rigid ones, the block's last: (q + b - rigid,) 1/s."""
        return np.concatenate([self.eigenvalue, np.linalg.eigvals(self._held_block()[0])])

    def keeping_where(self, wanted: Callable[[np.ndarray], np.ndarray]) -> Response:
        """Rigid states, and those where `wanted` of their eigenvalues is true; the others follow statically."""
        values = self.every
        stays = wanted(values)
        poles = self.keeping(stays[: len(self.eigenvalue)])
        return poles._block_keeping(values[len(self.eigenvalue) :], stays[len(self.eigenvalue) :])

    def _block_keeping(self, values: np.ndarray, stays: np.ndarray) -> Response:
        """The same for the block alone."""
        if stays.all():
            return self
        held, output, push = self._held_block()
        momentum = self.block_momentum[:, : len(held)]
        kept = parted(held, values, stays)
        following = kept.following(push)
        k, left_out = len(held), self.left_out
        if left_out is not None:
            left_out = left_out - momentum @ following
        return replace(
            self,
            block=linalg.block_diag(kept.block, self.block[k:, k:]),
            block_output=np.hstack([output @ kept.right, self.block_output[:, k:]]),
            block_input=np.vstack([kept.left @ push, self.block_input[k:]]),
            block_momentum=np.hstack([momentum @ kept.right, self.block_momentum[:, k:]]),
            residual=self.residual - output @ following,
            left_out=left_out,
        )

    def slow(self, step: float, limit: float = RESOLVED) -> np.ndarray:
        """Which poles (q,) `resolved` keeps."""
        return np.abs(self.eigenvalue) * step <= limit

    def resolved(self, step: float, limit: float = RESOLVED) -> Response:
        """Poles and states of the block with |s| step above the limit follow the force statically: over so
        long a step their turning is not seen, and they can gain energy in contact."""
        return self.keeping_where(lambda s: np.abs(s) * step <= limit)

    def rate(self) -> Response:
        """The velocities at the outputs: g' for g, i omega H for H.

        The poles' own jump at an impulse, Re[C P], is the new residual: zero for a complete set of
        states. G_res f' of the residual is left out: it needs the rate of the force.
        """
        return replace(
            self,
            output=self.output * self.eigenvalue,
            block_output=self.block_output @ self.block,
            residual=(self.output @ self.input).real + self.block_output @ self.block_input,
            pulse=0,
        )

    def between(self, outputs: slice, forces: slice) -> Response:
        """The same for some of the outputs and forces (slices)."""
        return replace(
            self,
            output=self.output[outputs],
            input=self.input[:, forces],
            block_output=self.block_output[outputs],
            block_input=self.block_input[:, forces],
            residual=self.residual[outputs, forces],
            pulse=sum(k < self.pulse for k in range(len(self.residual))[outputs]),
            left_out=None if self.left_out is None else self.left_out[:, forces],
        )

    def joined(self, other: Response) -> Response:
        """Both sets of states between the same outputs and forces, the residuals added; no rigid `other`."""
        return Response(
            eigenvalue=np.concatenate([self.eigenvalue, other.eigenvalue]),
            output=np.hstack([self.output, other.output]),
            input=np.vstack([self.input, other.input]),
            block=linalg.block_diag(other.block, self.block),
            block_output=np.hstack([other.block_output, self.block_output]),
            block_input=np.vstack([other.block_input, self.block_input]),
            residual=self.residual + other.residual,
            momentum=np.hstack([self.momentum, other.momentum]),
            block_momentum=np.hstack([other.block_momentum, self.block_momentum]),
            pulse=self.pulse,
            rigid=self.rigid,
        )


def couple(
    modes: StateModes,
    output: np.ndarray,
    forces: np.ndarray,
    momentum: np.ndarray,
    compliance: np.ndarray | None = None,
) -> Response:
    """Response from modal shapes at the outputs (r, m) and forces (k, m), kg^-1/2.

    `momentum` (3, m) as in modal.basis. `compliance` (r, k) m/N is the exact static flexibility in the
    rotating frame; with it G_res = [K_Omega^-1]_rk - Phi_r K~^-1 Phi_k^T stands for all modes left
    out (static, exact at 0 Hz); without it they are simply missing.
    """
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
