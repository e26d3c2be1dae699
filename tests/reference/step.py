"""The time loop in plain NumPy: dense matrices, complex states, each step solved from the last one to rounding."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.tread.brush import Brush
from tireroad.greens.recursion import late_answers, weights
from tireroad.greens.response import Response
from tireroad.greens.schemes import SCHEMES

Array = NDArray[np.float64]


def unilateral(matrix: Array, q: Array, touching: NDArray[np.bool_]) -> Array:
    """f >= 0, g = A f + q >= 0, f . g = 0 by exchange of all points of wrong sign."""
    for _ in range(200):
        force = np.zeros(len(q))
        force[touching] = np.linalg.solve(matrix[np.ix_(touching, touching)], -q[touching])
        gap = matrix @ force + q
        wrong = np.where(
            touching, force < -1e-11 * np.abs(force).max(), gap < -1e-12 * np.abs(q).max()
        )
        if not wrong.any():
            return np.maximum(force, 0.0)
        touching = touching ^ wrong
    raise AssertionError("no set")


def onto_discs(force: Array, bound: Array) -> Array:
    """Forces (2, a) cut to the bounds (a,)."""
    length = np.hypot(*force)
    return force * np.where(length > bound, bound / np.where(length > 0, length, 1.0), 1.0)


def sliding(matrix: Array, constant: Array, bound: Array, force: Array) -> Array:
    """B t + c = 0 within the bounds, against the slip on them, (2, a): semismooth Newton with dense matrices."""
    a = len(bound)
    if not a:
        return force
    rate = 1.0 / np.diag(matrix).reshape(2, a).mean(axis=0)
    force = onto_discs(force, bound)
    for _ in range(100):
        trial = force - rate * ((matrix @ force.ravel()).reshape(2, a) + constant)
        off = force - onto_discs(trial, bound)
        if np.abs(off).max() <= 1e-13 * max(np.abs(force).max(), 1e-30):
            break
        length = np.hypot(*trial)
        slips = length > bound
        n = np.where(slips, trial / np.where(slips, length, 1.0), 0.0)
        share = np.where(slips, bound / np.where(slips, length, 1.0), 1.0)
        moved = np.tile(rate, 2)[:, None] * matrix - np.eye(2 * a)
        along = np.vstack([np.diag(n[0]), np.diag(n[1])])
        moved -= along @ (along.T @ moved)
        force = force - np.linalg.solve(
            np.eye(2 * a) + np.tile(share, 2)[:, None] * moved, off.ravel()
        ).reshape(2, a)
    return onto_discs(force, bound)


class Pressed:
    """A normal solver whose forces are the static ones."""

    def solve(self, q, guess_active=None, reference=None):
        return reference


class Bristles:
    """The brush of contact.tread.brush by its equations: rolling, of stiffness K (c,), slip (2, c) m a step.

    `members` of each point: its bristles and their weights; `cell`, `beside`, `along`, `entry` (b,) of each bristle's place, which is
    taken by that of the place `from_` (b,) after a step, -1: by one that comes from beyond the line.
    """

    def __init__(self, brush: Brush, slip: Array, stiffness: Array) -> None:
        rows, self.ahead = brush.rows, brush.ahead
        assert rows.every == 1, "bristles move on in each step"
        self.members = [
            (np.arange(k := rows.foremost[i], k + b - a), rows.weight[a:b])
            for i, (a, b) in enumerate(pairwise(rows.first))
        ]
        self.cell, self.beside, self.along, self.entry = (
            rows.cell,
            rows.beside,
            rows.along,
            rows.entry,
        )
        places = [np.arange(a, b) for a, b in pairwise(rows.line)]
        self.from_ = np.concatenate(
            [np.where(each - rows.shift >= each[0], each - rows.shift, -1) for each in places]
        )
        self.slip, self.stiffness = slip, stiffness
        self.deflection = self.moved = np.zeros_like(slip)
        self.touched = self.slid = np.zeros(slip.shape[1], bool)
        self.tip = np.zeros((2, len(rows.cell)))
        self.stands = self.stood = np.zeros(len(rows.cell), bool)

    def begin(self, touching: NDArray[np.bool_]) -> None:
        """Stand where points touch, at rest."""
        self.touched = touching
        self.stands = self.stood = touching[self.cell]

    def travel(self) -> None:
        """Before a step."""
        tip, stands, stood, u = self.tip.copy(), self.stands.copy(), self.stood.copy(), self.moved
        slid, mean = np.zeros_like(u), [self._mean_tip(i) for i in range(len(self.members))]
        for i in np.flatnonzero(self.slid & self.touched):
            if mean[i] is not None:
                slid[:, i] = u[:, i] - self.deflection[:, i] - mean[i]
                mean[i] = mean[i] + slid[:, i]
        for b, i in enumerate(self.cell):
            if not self.touched[i]:
                stands[b] &= self.touched[self.beside[b]]
            elif stands[b]:
                tip[:, b] += slid[:, i]
            else:
                own = u[:, i] + self.along[b] * (u[:, self.ahead[i]] - u[:, i])
                tip[:, b], stands[b] = own if mean[i] is None else mean[i], True
        stood |= stands
        self.tip = np.where(self.from_ < 0, 0.0, tip[:, self.from_])
        self.stands, self.stood = ((self.from_ >= 0) & each[self.from_] for each in (stands, stood))
        for b, i in enumerate(self.cell):
            if not self.stands[b] and not self.touched[i]:
                continue
            if not self.stands[b] and self.stood[b] and mean[i] is not None:
                self.tip[:, b] = mean[i]
            elif not self.stands[b]:
                edge = 0.5 * (u[:, i] + u[:, self.ahead[i]])
                self.tip[:, b] = edge + (1 - self.entry[b]) * self.slip[:, i]
            self.tip[:, b] -= self.slip[:, i]
            self.stands[b] = self.stood[b] = True

    def _mean_tip(self, point: int) -> Array | None:
        """The mean (2,) of the bristles that stand on a point's cell."""
        index, weight = self.members[point]
        weight = weight * self.stands[index]
        return self.tip[:, index] @ weight / weight.sum() if weight.sum() > 1e-9 else None

    def offer(self) -> tuple[NDArray[np.bool_], Array]:
        """Which points bear (c,), and past (2, c) of e = u + past, in a step that begins."""
        self.travel()
        mean = [self._mean_tip(i) for i in range(len(self.members))]
        return np.array([each is not None for each in mean]), -np.array(
            [np.zeros(2) if each is None else each for each in mean]
        ).T

    def end(self, force: Array, t: Array, bound: Array, moved: Array) -> None:
        """After a step with normal (c,) and horizontal forces (2, c), whose bases have `moved` (2, c)."""
        self.moved, self.deflection, self.touched = moved, -t / self.stiffness, force > 0
        size = np.hypot(*t)
        self.slid = (size == 0) | (size >= (1 - 1e-6) * bound)


class PlainLoop:
    """`response` of p nodes in z, x, y (or z alone), W (c, p), tread C (c or 3 c, ...) in z, x, y; friction mu or None.

    `at_rest` (c,) N and `gap` (c,) m of the static state.
    """

    def __init__(
        self, response: Response, step: float, scheme: str, weights_: Array, tread: Array, at_rest: Array, gap: Array,
        bristles: Bristles | None = None, friction: float | None = None,
    ) -> None:  # fmt: skip
        self.response, self.parts = response, SCHEMES[scheme].earlier
        self.decay = np.exp(response.eigenvalue * step)
        self.old, self.new = weights(response.eigenvalue * step, step, scheme)
        late = late_answers(response, step, scheme)
        c, p = weights_.shape
        self.late = (
            np.zeros((len(response.residual), response.residual.shape[1]))
            if late is None
            else late.toarray()[:-3]
        )
        direct = (
            ((response.output * self.new) @ response.input).real + response.residual - self.late
        )
        self.w, self.c = weights_, c
        forces, rows = response.residual.shape[1] // p, len(response.residual) // p
        self.up, self.down = np.kron(np.eye(rows), weights_), np.kron(np.eye(forces), weights_.T)
        self.answer = self.up @ direct @ self.down
        self.whole = self.answer[:, : rows * c] + tread
        self.at_rest, self.gap, self.bristles, self.friction = at_rest, gap, bristles, friction
        self.state = np.zeros(len(self.decay), complex)
        self.push = self.before = np.zeros(len(self.decay), complex)
        self.force = np.zeros(response.residual.shape[1])
        self.touching, self.tangential, self.normal = at_rest > 0, np.zeros((2, c)), np.zeros(c)

    def step(
        self, at: Callable[[Array], tuple[Array, Array | None]]
    ) -> tuple[Array, Array, Array | None]:
        """Normal (c,) and bristle forces (2, c) at the end of the next step, and the slope met; `at` a place (2, c) beside the
        points' own are a road's heights and its slope, None if it is level."""
        c, response = self.c, self.response
        earlier = self.parts[0] * self.push + self.parts[1] * self.before
        moved = self.decay * self.state + self.old * earlier
        nodes = (response.output @ moved).real + self.late @ self.force
        free, place, kept = (
            self.up @ nodes,
            np.zeros((2, c)),
            vars(self.bristles or Pressed()).copy(),
        )
        for _ in range(200):
            road, slope = at(place)
            led = free
            if slope is not None:
                led = free + self.answer @ self._added(slope, self.normal, self.tangential)
            if self.bristles is not None:
                vars(self.bristles).update(kept)
            before = self.normal, self.tangential
            force, t = self._solve(self.gap + led[:c] - road, led[c:])
            change = np.zeros(self.down.shape[1])
            change[:c] = force - self.at_rest
            if len(change) > c:
                change[c:] = t.ravel()
            self.normal, self.tangential = force, t
            if slope is None:
                break
            change = change + self._added(slope, force, t)
            now = (free + self.answer @ change)[c:].reshape(2, c)
            if self.bristles is not None:
                now = self.bristles.moved - self.bristles.deflection
            off = np.abs(now - place)[:, force > 0].max(initial=0.0)
            off += (
                max(np.abs(one - two).max() for one, two in zip(before, (force, t), strict=True))
                * 1e-6
            )
            place = now
            if off < 1e-15:
                break
        self.force = self.down @ change
        self.before, self.push = self.push, response.input @ self.force
        self.state = moved + self.new * self.push
        return force, t, slope

    @staticmethod
    def _added(slope: Array, force: Array, t: Array) -> Array:
        return np.concatenate([(t * slope.T).sum(axis=0), *(-force * slope.T)])

    def _solve(self, q: Array, free: Array) -> tuple[Array, Array]:
        c, whole = self.c, self.whole
        zz, t = whole[:c, :c], self.tangential
        start = -zz @ self.at_rest
        if self.bristles is None:
            force = unilateral(zz, q + start, self.touching)
            self.touching = force > 0
            return force, np.zeros((2, c))
        bears, past = self.bristles.offer()
        for _ in range(500):
            force = unilateral(zz, q + start + whole[:c, c:] @ t.ravel(), self.touching)
            self.touching = force > 0
            moved = free.reshape(2, c) + (whole[c:, :c] @ (force - self.at_rest)).reshape(2, c)
            some = np.flatnonzero((force > 0) & bears)
            both = np.concatenate([some, c + some])
            spring = 1.0 / self.bristles.stiffness[some]
            matrix = whole[c:, c:][np.ix_(both, both)] + np.diag(np.tile(spring, 2))
            new = np.zeros((2, c))
            constant = moved[:, some] + past[:, some]
            new[:, some] = sliding(matrix, constant, self.friction * force[some], t[:, some])
            done, t = np.abs(new - t).max() <= 1e-12 * max(np.abs(new).max(), 1e-30), new
            if done:
                break
        moved = moved + (whole[c:, c:] @ t.ravel()).reshape(2, c)
        self.bristles.end(force, t, self.friction * force, moved)
        return force, t
