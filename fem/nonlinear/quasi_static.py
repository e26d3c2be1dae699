"""Slow motions over a road: the linear tire, the reduced nonlinear one, and the elements themselves.

With w (3 p) the motion of the contact points, h their forces beyond those at rest, K the stiffness, and
V (n, k) with V^T K V = 1:

    linear      q = K^-1 W^T h
    reduced     q = K^-1 W^T h - V s,   s = V^T r(q)
    elements    K q + r(q) = W^T h
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy import sparse

from tireroad.fem.collective import allgather_rows, from_local_rows, summed
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.compliance import factorise, on_own_rows, solve_columns
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.road import Compliance, ContactPoints, Ground, Touch

Array = np.ndarray

Evaluate = Callable[[Array, Array], Array]
TOLERANCE = 1e-3  # of s over the tire's whole motion in the same measure
_MOST = 30
_STALE = 8  # evaluations in which J should have done
_PART, _FLOOR = 1e-5, 0.1  # of the motion, of which a difference is taken; J^(1/2)
_BALANCED, _DIVERGED, _LEAST = 1e-5, 1e4, 10.0  # of the norm of the points' forces; N
_STEP = 0.012  # m: largest motion in one step
State = TypeVar("State")


@dataclass(frozen=True)
class Standing:
    """The tire on a road: motion (3 p,) m of its points, their `force` (p,) N, their `load` (3 p,) N beyond
    that at rest, and the reduced force `s` (k,) J^(1/2)."""

    w: Array
    force: Array
    load: Array
    s: Array

    def total(self) -> Array:
        """Change of the force (3,) N of the road on the tire since the static state."""
        return self.load.reshape(3, -1).sum(axis=1)


class Linear:
    """The linear tire under its contact `points`: their `compliance` (3 p, 3 p) m/N."""

    def __init__(self, points: ContactPoints, compliance: Array, moved: bool = True) -> None:
        self.points, self.compliance, self._moved = points, compliance, moved

    def rest(self) -> Standing:
        """The static state."""
        load = np.zeros(len(self.compliance))
        return Standing(load, self.points.rest[2 * len(load) // 3 :], load, np.zeros(0))

    def solve(self, road: Ground, before: Standing) -> Standing:
        """On a road, from a state near by."""
        nothing = np.zeros(len(before.w))
        plain = Compliance(self.compliance, np.zeros((len(nothing), 0)), np.zeros((0, 0)))
        w, touch = self.points.solve(plain, nothing, road, before.w, self._moved)
        return Standing(w, touch.force, touch.load - self.points.rest, before.s)


class Reduced:
    """The tire with the reduced force. `seen` (3 p, k): W V; `evaluate(load, s)`: V^T r at the motion that
    these give.

    Newton's method for s with the contact solved inside: with J = V^T (dF/dq - K) V the loads' compliance is

        C - W V (1 + J)^-1 J (W V)^T,

    so that contact and s are solved for together. J is corrected by Broyden's update after each evaluation
    and kept from one road to the next; where that does not do it is taken anew: by `differentiate(load, s)`, or by
    differences. `tolerance`: of s, over the tire's whole motion.
    """

    def __init__(
        self,
        points: ContactPoints,
        compliance: Array,
        seen: Array,
        evaluate: Evaluate,
        differentiate: Evaluate | None = None,
        tolerance: float = TOLERANCE,
    ) -> None:
        self.points, self.compliance, self.seen, self.evaluate = points, compliance, seen, evaluate
        self._tolerance = tolerance
        self._differentiate = differentiate or self._differences
        self.jacobian = np.zeros((seen.shape[1],) * 2)
        self.evaluations = 0

    def rest(self) -> Standing:
        """The static state."""
        still = Linear(self.points, self.compliance).rest()
        return replace(still, s=np.zeros(self.seen.shape[1]))

    def differentiate(self, load: Array, s: Array) -> None:
        """Take J anew at a motion."""
        jacobian = self._differentiate(load, s)
        self.jacobian = (jacobian + jacobian.T) / 2

    def _differences(self, load: Array, s: Array) -> Array:
        base, out = self.evaluate(load, s), np.empty((len(s),) * 2)
        size = _PART * max(float(np.linalg.norm(self.seen.T @ load - s)), 1.0)
        for k in range(len(s)):
            other = s.copy()
            other[k] -= size
            out[:, k] = (self.evaluate(load, other) - base) / size
        self.evaluations += 1 + len(s)
        return out

    def solve(self, road: Ground, before: Standing) -> Standing:
        """On a road, from a state near by. Raises ConvergenceError if it is not near enough."""
        try:
            return self._solve(road, before)
        except (ConvergenceError, np.linalg.LinAlgError):
            self.differentiate(before.load, before.s)
            return self._solve(road, before)

    def _solve(self, road: Ground, before: Standing) -> Standing:
        s, load, w = before.s, before.load, before.w
        value, seen, one = self.evaluate(load, s), self.seen, np.eye(len(s))
        self.evaluations += 1
        for turn in range(_MOST):
            if turn % _STALE == _STALE - 1:
                self.differentiate(load, s)
            inverse = np.linalg.inv(one + self.jacobian)
            soft = inverse @ self.jacobian
            start = s + inverse @ (value - s) - soft @ (seen.T @ load)
            softened = Compliance(self.compliance, seen, soft)
            w, touch = self.points.solve(softened, -seen @ start, road, w)
            new = touch.load - self.points.rest
            changed = start + soft @ (seen.T @ new)
            found = self.evaluate(new, changed)
            self.evaluations += 1
            step = seen.T @ (new - load) - (changed - s)
            if step @ step > 0:
                lacking = found - value - self.jacobian @ step
                self.jacobian = self.jacobian + np.outer(lacking, step) / (step @ step)
            s, load, value = changed, new, found
            off, size = np.linalg.norm(value - s), np.linalg.norm(seen.T @ load)
            if off <= self._tolerance * max(float(size), _FLOOR):
                return Standing(w, touch.force, load, s)
            if not np.isfinite(off):
                break
        raise ConvergenceError(f"large motions: the reduced force on a {road} does not settle")


class Elements:
    """The finite elements under the contact points, by Newton's method. All methods are collective."""

    def __init__(self, force: RestoringForce, points: ContactPoints) -> None:
        self.force, self.points = force, points
        self._comm = force.body.comm
        own = on_own_rows(force.operators, points.weights)
        self.columns = own
        self._first = self._comm.exscan(own.shape[0]) or 0
        self._whole = _on_all(self._comm, own)
        self.tangents = 0

    def seen(self, motion: Array) -> Array:
        """Motion (3 p, ...) m of the points."""
        return summed(self._comm, self.columns.T @ motion)

    def residual(self, motion: Array, road: Ground) -> tuple[Array, Touch]:
        """Forces out of balance (own rows) N, and the contact."""
        touch = self.points.touch(self.seen(motion), road)
        return self.force.change(motion) - self.columns @ (touch.load - self.points.rest), touch

    def solve(self, road: Ground, motion: Array, most: int = 12) -> Array:
        """The motion (own rows) in equilibrium on a road, from one near by.

        Raises ConvergenceError if Newton's method does not converge.
        """
        before, stuck = motion, np.inf
        for _ in range(most):
            off, touch = self.residual(motion, road)
            size = float(np.sqrt(summed(self._comm, np.array(off @ off))))
            scale = float(np.linalg.norm(touch.force)) + _LEAST
            if size <= _BALANCED * scale:
                return motion
            if not size < _DIVERGED * scale:
                break
            matrix = self.force.tangent(motion, before)
            self._press(matrix, touch)
            factor = factorise(matrix)
            self.tangents += 1
            change = -solve_columns(factor, matrix, off[:, None])[:, 0]
            factor.destroy()
            matrix.destroy()
            largest = self._comm.allreduce(float(np.abs(change).max(initial=0.0)), op=MPI.MAX)
            before, motion = motion, motion + min(1.0, _STEP / largest) * change
            stuck = size
        raise ConvergenceError(
            f"large motions: {stuck:.1e} N out of balance remain on a {road}: take smaller steps to it"
        )

    def _press(self, matrix: PETSc.Mat, touch: Touch) -> None:
        """Add the stiffness of the contact to the tangent."""
        columns = self._whole[:, touch.entries]
        stiff = -(columns @ touch.derivative @ columns.T).tocsr()
        end = self._first + self.columns.shape[0]
        sizes = matrix.getSizes()
        part = from_local_rows(stiff[self._first : end], sizes, self._comm)
        matrix.axpy(1.0, part, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        part.destroy()
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)

    def standing(self, motion: Array, road: Ground) -> Standing:
        """The contact of a motion."""
        w = self.seen(motion)
        touch = self.points.touch(w, road)
        return Standing(w, touch.force, touch.load - self.points.rest, np.zeros(0))


def _on_all(comm: MPI.Comm, own: sparse.csr_matrix) -> sparse.csr_matrix:
    """The rows of all processes on every process. Collective."""
    part = own.tocoo()
    first = comm.exscan(own.shape[0]) or 0
    rows = comm.allreduce(own.shape[0])
    entries = np.stack([part.row + float(first), part.col.astype(float), part.data], axis=1)
    every = allgather_rows(comm, entries)
    index = every[:, 0].astype(int), every[:, 1].astype(int)
    return sparse.csr_matrix((every[:, 2], index), (rows, own.shape[1]))


class Tire(Protocol[State]):
    """A tire that can be solved on a road from a state near by."""

    def solve(self, road: Ground, before: State, /) -> State: ...


def climb(
    tire: Tire[State],
    road: Ground,
    start: State,
    steps: int = 4,
    seen: Callable[[float, State], None] = lambda part, state: None,
) -> State:
    """The state on the whole of a road, in steps of its height, halved where one does not converge.

    `seen` is told of each. Raises ConvergenceError below a 32nd of the height.
    """
    done, size, state = 0.0, 1.0 / steps, start
    while done < 1.0 - 1e-9:
        part = min(1.0, done + size)
        try:
            state = tire.solve(road.times(part), state)
        except (ConvergenceError, np.linalg.LinAlgError) as error:
            size /= 2
            if size < 1 / 32:
                raise ConvergenceError(f"{error}; it stopped at {100 * done:.0f} % of it") from None
            continue
        done = part
        seen(part, state)
    return state
