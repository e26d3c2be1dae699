"""The second eigenproblem over speed: branches, critical speed, onset of instability.

One modal basis and one static state serve all speeds; only D~ and K~ change, as polynomials in
Omega.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg, optimize

from tireroad.modal.basis import Projection
from tireroad.modal.damping import Damping
from tireroad.modal.rotating import matrices, overlap, rotating
from tireroad.modal.states import StateModes, growing
from tireroad.modal.waves import ALONE, ModeNames

CLEAR = 0.5  # least share of one wave number times the excess of one direction
# Stiffness of a rigid motion of a free wheel over Omega^2: zero but for truncation.
RIGID = 1e-3


@dataclass(frozen=True)
class Campbell:
    """Eigenvalues over speed, one column per branch.

    `speed` (v,) rad/s; `name` (b,) of each branch where it begins, or None: branches that veer go on as each other;
    `eigenvalue` (v, b) complex 1/s, NaN where a branch is in a nearly defective
    block or no longer oscillates; `similarity` (v, b): the share of the branch's state at the
    previous speed, 1 when nothing changes, low where branches veer; `undamped` (v, b) Hz: the
    branches of the same tire without damping, where they were followed.
    """

    speed: np.ndarray
    eigenvalue: np.ndarray
    similarity: np.ndarray
    undamped: np.ndarray | None = None
    name: np.ndarray | None = None

    @property
    def frequency(self) -> np.ndarray:
        """(v, b) Hz in the non-rotating frame."""
        return self.eigenvalue.imag / (2 * np.pi)

    @property
    def damping(self) -> np.ndarray:
        """Damping ratios -Re s / |s| (v, b)."""
        return -self.eigenvalue.real / np.abs(self.eigenvalue)


def sweep(
    projection: Projection,
    damping: Damping,
    inertia: str,
    speeds: np.ndarray,
    branches: int,
    names: Callable[[StateModes], ModeNames] | None = None,
) -> Campbell:
    """Follow the `branches` lowest oscillating states of the first speed through all others.

    A state continues in the state at the next speed that shares most of it
    (modal.rotating.overlap), one to one, so that branches cross instead of being cut and rejoined
    by size. `names` gives the states their names. Not collective.
    """
    eigenvalue = np.full((len(speeds), branches), np.nan + 0j)
    similarity = np.full((len(speeds), branches), np.nan)
    called = None if names is None else _BranchNames(branches, names)
    before, held = None, np.zeros(0, int)
    for k, speed in enumerate(speeds):
        drag, stiffness = matrices(projection, float(speed), damping, inertia)
        now = rotating(drag, stiffness)
        if before is None:
            held = _lowest(now, branches)
            share = np.ones(len(held))
        else:
            held, share = _continued(before, now, held, drag)
        is_known = held >= 0
        eigenvalue[k, : len(held)][is_known] = now.eigenvalue[held[is_known]]
        similarity[k, : len(held)] = share
        if called is not None:
            called.see(now, held)
        before = now
    name = None if called is None else called.all
    return Campbell(np.asarray(speeds, float), eigenvalue, similarity, name=name)


class _BranchNames:
    """The names of branches, each from the first speed at which its state is clear.

    Clear is a state of one wave number that travels one way: at rest, a pair is of both. What never is clear
    is named where it is clearest, and without a direction if it might as well be the other one's.
    """

    def __init__(self, branches: int, names: Callable[[StateModes], ModeNames]) -> None:
        self._names = names
        self._clearest, self._name = np.full(branches, -1.0), np.full(branches, "", dtype=object)

    def see(self, now: StateModes, held: np.ndarray) -> None:
        """Take what the states that are `held` (b,), -1 for none, are called at one speed."""
        branch = np.flatnonzero(held >= 0)
        if not len(branch):
            return
        # Those below decide which is the lowest of its kind; there may be thousands above.
        lower = now.eigenvalue.imag <= now.eigenvalue.imag[held[branch]].max()
        names = self._names(now.among(lower)).at(np.cumsum(lower)[held[branch]] - 1)
        goes = np.where(names.wave > 0, np.abs(names.travel), 1.0)
        clear = names.share * goes
        better = (clear > self._clearest[branch]) & (self._clearest[branch] < CLEAR)
        leans = (clear < CLEAR) & (goes < ALONE)
        name = [
            name.rstrip("+-") if so else name for name, so in zip(names.name, leans, strict=True)
        ]
        self._name[branch[better]] = np.array(name, dtype=object)[better]
        self._clearest[branch[better]] = clear[better]

    @property
    def all(self) -> np.ndarray:
        """The names (b,); empty for a branch that was never seen."""
        return self._name


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
    squares = projection.stiffness[np.ix_(flexible, flexible)]
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
