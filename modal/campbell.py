"""The second eigenproblem over speed: branches, critical speed, onset of instability.

One modal basis and one static state serve all speeds; only D~ and K~ change, as polynomials in
Omega.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize

from tireroad.modal.basis import Projection
from tireroad.modal.damping import Damping
from tireroad.modal.rotating import matrices, overlap, rotating
from tireroad.modal.states import StateModes, growing

# Stiffness of a rigid motion of a free wheel over Omega^2: zero but for truncation.
RIGID = 1e-3


@dataclass(frozen=True)
class Campbell:
    """Eigenvalues over speed, one column per branch.

    `speed` (v,) rad/s; `eigenvalue` (v, b) complex 1/s, NaN where a branch is in a nearly defective
    block or no longer oscillates; `similarity` (v, b): the share of the branch's state at the
    previous speed, 1 when nothing changes, low where branches veer; `undamped` (v, b) Hz: the
    branches of the same tire without damping, where they were followed.
    """

    speed: np.ndarray
    eigenvalue: np.ndarray
    similarity: np.ndarray
    undamped: np.ndarray | None = None

    @property
    def frequency(self) -> np.ndarray:
        """(v, b) Hz in the non-rotating frame."""
        return self.eigenvalue.imag / (2 * np.pi)


def sweep(
    projection: Projection,
    damping: Damping,
    inertia: str,
    speeds: np.ndarray,
    branches: int,
) -> Campbell:
    """Follow the `branches` lowest oscillating states of the first speed through all others.

    A state continues in the state at the next speed that shares most of it
    (modal.rotating.overlap), one to one, so that branches cross instead of being cut and rejoined
    by size. Not collective.
    """
    eigenvalue = np.full((len(speeds), branches), np.nan + 0j)
    similarity = np.full((len(speeds), branches), np.nan)
    before, held = None, np.zeros(0, int)
    for k, speed in enumerate(speeds):
        drag, stiffness = matrices(projection, float(speed), damping, inertia)
        now = rotating(drag, stiffness)
        if before is None:
            held = _lowest(now, branches)
            share = np.ones(len(held))
        else:
            held, share = _continued(before, now, held, drag)
        found = held >= 0
        eigenvalue[k, : len(held)][found] = now.eigenvalue[held[found]]
        similarity[k, : len(held)] = share
        before = now
    return Campbell(np.asarray(speeds, float), eigenvalue, similarity)


def _lowest(modes: StateModes, count: int) -> np.ndarray:
    """Indices of the oscillating states by frequency."""
    waves = np.flatnonzero(modes.eigenvalue.imag > 0)
    return waves[np.argsort(modes.eigenvalue.imag[waves], kind="stable")][:count]


def _continued(
    before: StateModes, now: StateModes, held: np.ndarray, drag: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Indices at the present speed of the states followed so far (-1: lost), and their shares."""
    alive = np.flatnonzero(held >= 0)
    share = np.abs(overlap(before, now, drag))[held[alive]]
    rows, columns = optimize.linear_sum_assignment(-np.minimum(share, 1.0))
    out, similarity = np.full(len(held), -1), np.full(len(held), np.nan)
    out[alive[rows]] = columns
    similarity[alive[rows]] = share[rows, columns]
    return out, similarity


def critical_speed(projection: Projection, inertia: str, free_at: float | None = None) -> float:
    """The lowest Omega (rad/s) at which a wave stands in the non-rotating frame; inf if none does.

    Without damping K~ = Lambda + Omega^2 S is singular there: Omega^-2 is the largest eigenvalue of
    Lambda^-1/2 (-S) Lambda^-1/2, rigid modes excluded. A road at rest relative to the axle excites
    such a wave without limit. `free_at` (rad/s) is the speed of an unrestrained wheel: its rigid
    motions are stationary by themselves and make K~ singular at that very speed, so they are
    excluded too.
    """
    return standing_wave(projection, inertia, free_at)[0]


def standing_wave(
    projection: Projection, inertia: str, free_at: float | None = None
) -> tuple[float, np.ndarray]:
    """The critical speed (rad/s) and the modal coordinates (m,) of the wave that stands there.

    By the principle of Rayleigh and Ritz more modes can only lower the speed: that of few is an
    upper bound.
    """
    _, convective, _ = projection.rotating(inertia)
    flexible = projection.own_squares > 0
    wave = np.zeros(len(flexible))
    turn = np.eye(int(flexible.sum()))
    squares = np.diag(projection.own_squares[flexible])
    convective = convective[np.ix_(flexible, flexible)]
    if free_at is not None:
        values, motions = linalg.eigh(squares + free_at**2 * convective)
        held = motions[:, np.abs(values) > RIGID * free_at**2]
        squares, convective = held.T @ squares @ held, held.T @ convective @ held
        turn = held
    if not len(squares):
        return np.inf, wave
    last = [len(squares) - 1] * 2
    largest, vector = linalg.eigh(-convective, squares, subset_by_index=last)
    if not largest[0] > 0:
        return np.inf, wave
    wave[flexible] = turn @ vector[:, 0]
    return float(1 / np.sqrt(largest[0])), wave


def onset(projection: Projection, damping: Damping, inertia: str, unstable: float) -> float:
    """The speed (rad/s) at which a motion begins to grow, within 0.1 %.

    By bisection between rest and an `unstable` speed (rad/s): where there are several intervals of
    instability, the edge of one is found. Static state and modes are those of the basis at every
    speed.
    """
    stable = 0.0
    while unstable - stable > 1e-3 * unstable:
        middle = (stable + unstable) / 2
        if growth(projection, middle, damping, inertia) > 0:
            unstable = middle
        else:
            stable = middle
    return unstable


def growth(projection: Projection, speed: float, damping: Damping, inertia: str) -> float:
    """Largest Re s (1/s) at a speed; 0 if it is rounding."""
    drag, stiffness = matrices(projection, speed, damping, inertia)
    m = len(drag)
    values = linalg.eigvals(np.block([[np.zeros((m, m)), np.eye(m)], [-stiffness, -drag]]))
    return float(values.real.max()) if growing(values).any() else 0.0
