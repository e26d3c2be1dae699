"""Slow motions meet the slow moduli of rubber: real poles beside the states of the modes.

In the loop each mode has the moduli of its own frequency, and a load that comes in seconds would find the tire as stiff as
they are. Below the lowest mode the tire follows statically, with the moduli of the rate at which the rubber is deformed: at a
rate of change of f, a wave of n around a tire that turns at Omega with those of

    max(f, n Omega / 2 pi),

so that of a rolling tire only what is alike all around (n = 0) ever becomes as soft as at rest. With K(f) the stiffness with
these moduli, K that of the loop and B the loads, what the loop lacks is

    dA(f) = B^T (K(f)^-1 - K^-1) B,

the softer the slower. From the lowest mode f_J down, in steps of sqrt 10 until all rubbers have their static modulus (f_0 = 0),
each step relaxes in a time of its own between its two frequencies,

    A(s) = A_loop(s) + sum_j (dA(f_j) - dA(f_j+1)) / (1 + s tau_j),   dA(f_J) = 0,   tau_j = 10^(1/4) / (2 pi f_j+1),

so that A is right at rest and in steps of half a decade, and the loop's own far above the lowest mode. Each difference is symmetric
and positive semidefinite; it is kept by its largest eigenvectors, each one real pole -1/tau_j whose output is its input (a spring
and a dashpot side by side, so it stores and loses and never gives).

The waves of the modes are those of the body rate between them, B (m, m): G(f) = g(max(f, Omega n / 2 pi)) of the square root of
B^T B, whose eigenvalues are n^2, and sqrt(G) P sqrt(G) the stiffness P of a rubber then. Static shapes outside the modes
have local deformations of the rubber: of a tire that stands or turns slowly their flexibility is that of the full matrices with the
moduli of each frequency, less that of the modes with these.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import linalg, sparse

from tireroad.fem.matrices.compliance import add_part, compliance, rotating_stiffness
from tireroad.fem.parallel import on_root
from tireroad.fem.tire.material import CONSTANT, LOADING
from tireroad.fem.wheel import Damping
from tireroad.greens.basis import Array, Basis, Probes
from tireroad.greens.coupling import Wheel
from tireroad.greens.response import Response
from tireroad.modal.basis import Projection
from tireroad.modal.rotating import held_matrices

STEP = math.sqrt(10.0)  # from one frequency to the next
# Share of the largest softening of all combinations of the loads from which one is kept, but for the first FEW: on the 549 loads of a
# footprint the slope of the load at rest is then 0.2 % off when rolling, 0.1 % standing (with 0.1: 0.2 and 2.6 %). From a share of
# STEP_KEPT on it relaxes in a time of its own; what is less joins the next slower one, and of the slowest what is more than SLOWEST_KEPT
# is kept.
KEPT, FEW, STEP_KEPT, SLOWEST_KEPT = 0.02, 24, 0.05, 5e-3
_ROUNDING = 1e-9
# By how much what is outside the modes must be softer to be solved for once more: at 80 km/h it is 1 to 5 %.
_SLIGHT = 0.05
_UNDAMPED = (0.0, 0.0)


@dataclass(frozen=True)
class Slowed:
    """A `response` with its slow poles. Of a point's own flexibility: the most that is `left_out`, and the most by which it would
    have become stiffer, which no rubber does (`stiffer`)."""

    response: Response
    left_out: float = 0.0
    stiffer: float = 0.0


def slowed(wheel: Wheel, basis: Basis, probes: Probes, response: Response) -> Slowed:
    """The response (k, k) between the `probes` with what slow motions find softer than its modes.

    `basis`: the states of the response, none of them made static. Unchanged where no modulus depends on frequency, and of a free
    rim, which nothing holds statically. Collective.
    """
    if basis.projection.parts is None or wheel.operators.unknowns.rim is not None:
        return Slowed(response)
    return _Slow(wheel, basis.held, probes, response).response()


def lowest(projection: Projection) -> float:
    """Frequency of the lowest mode that is not rigid, Hz."""
    return float(projection.frequency[projection.frequency > 0].min())


class _Slow:
    """The flexibilities dA(f) between the probes."""

    def __init__(self, wheel: Wheel, basis: Basis, probes: Probes, response: Response) -> None:
        self._wheel, self._whole, self._probes = wheel, response, probes
        self._projection = projection = basis.projection
        kinds = [kind for kind, _ in wheel.operators.body.wall.kinds()]
        self._kinds = [kind for kind in kinds if kind.spectrum != CONSTANT]
        self._lowest = lowest(projection)
        own = projection.squares > 0
        self._flexible = np.pad(own, (0, basis.coordinates - len(own)), constant_values=True)
        self._seen = basis.seen(probes)[:, self._flexible]
        self._hub = basis.of_hub(probes)
        self._beside = basis.beside(self._hub)[:, self._flexible]

    def response(self) -> Slowed:
        """The response with slow poles. Collective."""
        comm, every = self._wheel.operators.body.comm, np.eye(len(self._seen))
        solved = on_root(comm, self._solved)
        beyond = [self._beyond_modes(self._frequencies[0], every)] if solved[0] else []
        # One process alone: another one's rounding would turn alike eigenvectors otherwise.
        shapes, *figures = on_root(comm, lambda: self._shapes(*beyond))
        within = [shapes.T @ one @ shapes for one in beyond]
        for frequency, wanted in zip(self._frequencies[1:-1], solved[1:], strict=True):
            within += [self._beyond_modes(frequency, shapes)] if wanted else []
        poles = on_root(comm, lambda: self._poles(shapes, within))
        rate, output, push = poles
        return Slowed(self._whole.with_slow(-rate, output, push), *figures)

    @cached_property
    def _frequencies(self) -> list[float]:
        """f_0 = 0 to that of the lowest mode, Hz."""
        found = [self._lowest]
        while found[0] > LOADING and any(
            kind.slow_modulus(np.array(found[:1]), self._lowest)[0] > static
            for kind, static in zip(self._kinds, self._static, strict=True)
        ):
            found.insert(0, found[0] / STEP)
        return [0.0, *(found[1:] or found)]

    @cached_property
    def _static(self) -> list[float]:
        return [float(kind.slow_modulus(np.zeros(1), self._lowest)[0]) for kind in self._kinds]

    @cached_property
    def _waves(self) -> tuple[Array, Array]:
        """Numbers of waves around (m,), and the coordinates (m, m) in which the modes have them; all 0 where no wave is moved through."""
        body, count = self._projection.body, len(self._projection.squares)
        if not self._wheel.speed or body is None:
            return np.zeros(count), np.eye(count)
        squares, turn = np.linalg.eigh(body.T @ body)
        return np.sqrt(np.maximum(squares, 0.0)), turn

    @cached_property
    def _parts(self) -> list[Array]:
        _, turn = self._waves
        assert self._projection.parts is not None, "moduli depend on frequency"
        return [turn.T @ part @ turn for part in self._projection.parts]

    def _moduli(self, frequency: float, waves: Array) -> list[Array]:
        """Modulus (n,) of each kind for waves of a number (n,) around."""
        met = np.maximum(frequency, abs(self._wheel.speed) * waves / (2 * np.pi))
        return [kind.slow_modulus(met, self._lowest) for kind in self._kinds]

    def _at(self, moduli: Sequence[Array]) -> Projection:
        """The projection with moduli (m,) of each kind for the waves of the modes."""
        _, turn = self._waves
        changed = zip(self._parts, moduli, strict=True)
        rise = sum(part * (np.sqrt(np.outer(g, g)) - 1) for part, g in changed)
        return replace(self._projection, rise=turn @ rise @ turn.T)

    def _stiffness(self, projection: Projection, damping: Damping) -> Array:
        """Stiffness (m, m) of flexible coordinates, rim held."""
        given = self._wheel.speed, damping, self._wheel.inertia
        _, stiffness = held_matrices(projection, *given)
        return stiffness[np.ix_(self._flexible, self._flexible)]

    @cached_property
    def _loop(self) -> tuple:
        return linalg.lu_factor(self._stiffness(self._projection, self._wheel.damping))

    def _softer(self, frequency: float, loads: Array) -> Array:
        """Coordinates (m, r) under loads (m, r) beyond those of the loop."""
        projection = self._at(self._moduli(frequency, self._waves[0]))
        slow = np.linalg.solve(self._stiffness(projection, self._wheel.damping), loads)
        return slow - linalg.lu_solve(self._loop, loads)

    @cached_property
    def _flexibility(self) -> Array:
        """Flexibility (k,) m/N of each probe under its own force, rim held."""
        own = np.einsum("km,mk->k", self._seen, linalg.lu_solve(self._loop, self._seen.T))
        return np.abs(own + np.diag(self._whole.residual))

    def _shapes(self, beyond: Array | float = 0.0) -> tuple[Array, float, float]:
        """Orthonormal combinations of the loads (k, r) that are softer at rest, and of a point's own flexibility the most that is
        left out and that would be stiffer; `beyond` of `_beyond_modes`. Not collective."""
        whole = self._seen @ self._softer(0.0, self._seen.T) + beyond
        sizes, vectors = np.linalg.eigh((whole + whole.T) / 2)
        own = np.where(self._flexibility > 0, self._flexibility, np.inf)[:, None]
        largest = max(float(sizes[-1]), 0.0)
        kept = sizes > KEPT * largest
        kept[-FEW:] |= sizes[-FEW:] > _ROUNDING * largest
        gone, stiffer = (
            float((part * vectors**2 / own).sum(axis=1).max(initial=0.0))
            for part in (np.where(kept, 0.0, np.maximum(sizes, 0.0)), np.maximum(-sizes, 0.0))
        )
        return vectors[:, kept], gone, stiffer

    def _poles(self, shapes: Array, beyond: list[Array]) -> tuple[Array, Array, Array]:
        """Rates (p,) 1/s, output (k, p) and input (p, k) of the poles, from what is softer `beyond` the modes at the first
        frequencies. Not collective."""
        seen, none = self._seen.T @ shapes, np.zeros((shapes.shape[1],) * 2)
        moved = [self._softer(f, seen) for f in self._frequencies[:-1]]
        beside = [*beyond, *[none] * (len(moved) - len(beyond))]
        answers = [seen.T @ one + more for one, more in zip(moved, beside, strict=True)]
        largest = float(np.linalg.eigvalsh(answers[0] + answers[0].T)[-1:].sum()) / 2
        change, states = np.zeros_like(none), np.zeros_like(seen)
        rates, outputs, inputs = [], [], []
        for j in reversed(range(len(moved))):
            change = change + answers[j] - (answers[j + 1] if j + 1 < len(moved) else 0.0)
            states = states + moved[j] - (moved[j + 1] if j + 1 < len(moved) else 0.0)
            sizes, turn = np.linalg.eigh((change + change.T) / 2)
            kept = sizes > self._smallest(j) * largest
            own, root = turn[:, kept], np.sqrt(sizes[kept])
            into, read = shapes @ (own * root), 0.0
            if self._hub.nnz:
                read = self._hub @ (self._beside @ states @ (own / root))[3:6]
            rate = 2 * np.pi * self._frequencies[j + 1] / math.sqrt(STEP)
            rates.append(np.full(len(root), rate))
            outputs.append(into - read)
            inputs.append(rate * into.T)
            change, states = (rest - rest @ own @ own.T for rest in (change, states))
        return np.concatenate(rates), np.hstack(outputs), np.vstack(inputs)

    def _smallest(self, step: int) -> float:
        """Share of the largest softening from which one relaxes in the time of a step; all of few loads do."""
        if len(self._seen) <= FEW:
            return _ROUNDING
        return STEP_KEPT if step else SLOWEST_KEPT

    def _solved(self) -> list[bool]:
        """Whether static shapes outside the modes are softer than in the loop by enough at each frequency, by the mean modulus of
        the highest modes. Not collective."""
        projection = self._projection
        assert projection.parts is not None, "moduli depend on frequency"
        upper = slice(projection.modes - max(projection.modes // 4, 1), projection.modes)
        stored = [np.diag(part)[upper] / projection.squares[upper] for part in projection.parts]
        loop, found = self._wheel.growth or 1.0, []
        for frequency in self._frequencies[:-1]:
            changed = zip(self._outside(frequency), stored, strict=True)
            growth = 1.0 + np.mean(sum((float(g[0]) - 1) * part for g, part in changed))
            found.append(bool(loop / growth - 1 > _SLIGHT))
        return found

    def _outside(self, frequency: float) -> list[Array]:
        """Moduli (1,) of each kind for what is outside the modes: of the shortest waves among them."""
        return self._moduli(frequency, self._waves[0][-1:])

    def _beyond_modes(self, frequency: float, shapes: Array) -> Array:
        """How much softer what is outside the modes is than in the loop (r, r) m/N, of combinations (k, r) of the loads: the
        flexibility of all elements less that of the modes, both with its moduli. Collective."""
        wheel, moduli = self._wheel, [float(g[0]) for g in self._outside(frequency)]
        given = wheel.operators, wheel.rotation, wheel.speed, _UNDAMPED, wheel.inertia
        stiffness = rotating_stiffness(*given)
        varying = [one for one in wheel.compounds if one.kind.spectrum != CONSTANT]
        for modulus, compound in zip(moduli, varying, strict=True):
            add_part(stiffness, modulus - 1, compound.stiffness)
        moves = self._seen.any(axis=1) & (np.diff(self._hub.tocsr().indptr) == 0)
        shapes = shapes * moves[:, None]
        probes = sparse.csr_matrix(shapes.T) @ self._probes
        found = compliance(wheel.operators, stiffness, probes, probes, wheel.air)
        stiffness.destroy()
        projection = self._at([np.full(len(self._waves[0]), g) for g in moduli])
        modal, seen = self._stiffness(projection, _UNDAMPED), self._seen.T @ shapes
        known = seen.T @ np.linalg.solve(modal, seen)
        softer: Array = found - known - shapes.T @ self._whole.residual @ shapes
        return softer
