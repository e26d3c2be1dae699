"""Semi-analytical response of the tire between chosen forces and displacements.

    u(t) = Re[C z(t)] + C_b y(t) + G_res f(t),   z' = s z + P f,   y' = T y + P_b f
    g(t) = Re[C e^{st} P] + C_b e^{Tt} P_b  (+ G_res delta(t)),   g(0) = 0 without truncation

thesis (4.14), whose sum over eigenpairs is kept as a product, C = Phi_out R and P = L Phi_in^T."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from tireroad.greens.hub import at_once, rates
from tireroad.greens.residual.made_static import added, block_made_static, poles_made_static
from tireroad.modal.states import StateModes, growing

# Radians a state may rotate in a step and stay dynamic. Undamped, bouncing on a stiff tread, up to
# 3 gained no energy and 5 diverged: rotation beyond pi is not resolved. Rolling on a rough road in
# steps of 0.2 ms, 1 has an error of 1.6 % in the axle force, 1.5 to 3 of 0.7 %: a rotating state is
# better kept dynamic.
RESOLVED = 2.0


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
    statically; their rates are what the axle force lacks."""

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

    def spectral_moment(self) -> np.ndarray:
        """-dH/ds (r, k) at s = 0, m s/N: the first-order effect of damping under a slow force."""
        first = ((self.output / self.eigenvalue**2) @ self.input).real
        block, output, push = self.held_block()
        if len(block):
            first += output @ np.linalg.solve(block, np.linalg.solve(block, push))
        return first

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
        """Mask (q,) of the poles that `resolved` keeps."""
        return np.abs(self.eigenvalue) * step <= limit

    def resolved(self, step: float, limit: float = RESOLVED) -> Response:
        """States with |s| step above the limit follow statically: the step does not resolve their
        rotation, and they can gain energy in contact."""
        return self.keeping_where(lambda s: np.abs(s) * step <= limit)

    def rate(self) -> Response:
        """The velocities at the outputs: g' for g, i omega H for H.

        The poles' own jump at an impulse, Re[C P], is the new residual, zero for a complete set of
        states. G_res f' is omitted: it needs the rate of the force."""
        return replace(
            self,
            output=self.output * self.eigenvalue,
            block_output=self.block_output @ self.block,
            residual=(self.output @ self.input).real + self.block_output @ self.block_input,
            pulse=0,
            moments=None,
            slope=None,
        )

    def between(self, outputs: slice, forces: slice) -> Response:
        """The response for some of the outputs and forces (slices)."""
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
            slope=None if self.slope is None else self.slope[self._with_rates(outputs), forces],
        )

    def _with_rates(self, outputs: slice) -> np.ndarray:
        """Rows of some outputs and of the rate of momentum, of all of both."""
        r = len(self.residual)
        return np.append(np.arange(r)[outputs], [r, r + 1, r + 2])

    def joined(self, other: Response) -> Response:
        """Both sets of states between the same outputs and forces; no rigid `other`."""
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
            moments=self.moments,
            slope=added(self.slope, other.slope),
        )


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
