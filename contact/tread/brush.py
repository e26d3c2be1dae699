"""The brush between tread and road, whose bristles carry the horizontal forces.

A bristle enters undeflected and moves through the patch with the material, at the road's speed v
towards -x. Its deflection e (base relative to tip) grows by the slip of its base,

    De/Dt = Du/Dt + v (-s_x, s_y),   t = -K_b e on the tire,   |t| <= mu f,

s_x > 0 driving, s_y > 0 the wheel drifting towards +y. Points stay where they are, each with a cell that reaches
halfway to its neighbours on its line; bristles, several to a cell, pass through the cells in steps of the road. Bristle b has a
tip a_b, the displacement of its base at which it is undeflected; a point has the mean of those that stand on its cell,

    e = u - mean(a_b),   a_b <- a_b - v h (-s_x, s_y) in each step,

and none of its own where none stand. What a point slides in a step moves the tips of its cell. A bristle comes to stand undeflected:

- on a cell whose point begins to touch, with the displacement at its own place, between those of the point and the next one ahead;
- where it comes into a cell that touches, with the displacement of the cell's front, the mean of both points.

It stands until neither its point nor the other next to it touches. One that stood before, or that begins to stand where others do,
takes their mean: what adheres to an asperity of the road goes with it from point to point.

Tips are kept. Interpolated from point to point in each step, what adheres would spread by sqrt(L p) over a footprint of
the length L with points p apart: 4 cm in a passenger tire's with points of 1 cm, in steps as small as one likes.

The force of a rolling, sticking body has errors of 2.7, 1.6 and 0.6 % with 6, 12 and 24 points
along its contact (Kalker's C11); with bristles entering at a point it had 18, 8 and 4 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.int32]

FEWEST, MOST = 4, 64  # bristles from one point to the next


@dataclass(frozen=True)
class BrushLaw:
    """Parameters of the brush.

    `stiffness`: N/m per point, or (c,) of each, inf: rigid bristles; `friction`: mu, None: never
    slides; `slip`: (s_x, s_y), or (c, 2); `kind`: "rolling", or "spring", the thesis's spring on
    the point's own displacement, e = u.
    """

    stiffness: float | Array
    friction: float | None = None
    slip: tuple[float, float] | Array = (0.0, 0.0)
    kind: str = "rolling"


@dataclass(frozen=True)
class Rows:
    """The places of b bristles on the lines of c points, between which they move on by `shift` once in `every` steps.

    Those of line l are `line[l]` to `line[l + 1]`, from the front. `cell` (b,): the point in whose cell each stands, `beside` (b,) the
    other point that is next to it; `along` (b,) how far it is ahead of that point, in ways to the next one; `entry` (b,) how
    far behind the cell's front, in ways of a step. Point i has those from `foremost[i]` on in its cell, with the `weight`s
    `first[i]` to `first[i + 1]`, whose sum is 1 and whose mean place is the point's.
    """

    shift: int
    every: int
    line: Index
    cell: Index
    beside: Index
    along: Array
    entry: Array
    foremost: Index
    first: Index
    weight: Array


class Brush:
    """The bristles of c points: tips and, in the mean of each cell, deflections e (c, 2) m.

    `x` (c,) m and `line` (c,) int: points of one line follow each other in the rolling direction. The
    kernel of a step (contact.solver.stick_slip) reads and advances the state in these arrays: `tip` (2, b) m and `stands` (b,), 0 not yet,
    1 stands, 2 stood, of the bristles in their `rows`, `deflected` and `moved` (2, c) m, `touched`, `slid` (c,) at the end of the last step, `waited` (1,)
    steps since they moved on; by the next point `ahead` (c,), `slip` (2,) or (c, 2) m a step.
    """

    def __init__(self, law: BrushLaw, x: Array, line: Array, speed: float, step: float) -> None:
        self.law = law
        self.way = speed * step
        self._x, self._line = x, line
        ahead, _ = next_ahead(x, line)
        self.ahead = ahead.astype(np.int32)
        self.rows = rows_of(x, line, self.way)
        self.slip = self.way * np.array([-1.0, 1.0]) * np.asarray(law.slip)
        bristles = len(self.rows.cell)
        self.tip, self.stands = np.zeros((2, bristles)), np.zeros(bristles, np.int32)
        self.deflected, self.moved = np.zeros((2, len(x))), np.zeros((2, len(x)))
        self.touched: Mask = np.zeros(len(x), dtype=bool)
        self.slid: Mask = np.zeros(len(x), dtype=bool)
        self.waited = np.zeros(1, np.int32)

    @cached_property
    def upstream(self) -> sparse.csr_matrix:
        """Linear interpolation (c, c) at the places where what is at the points was a step before (`upstream`)."""
        return upstream(self._x, self._line, self.way)

    @property
    def deflection(self) -> Array:
        """Deflections e (c, 2) m."""
        return self.deflected.T.copy()

    def begin(self, touching: Mask, moved: Array | None = None) -> None:
        """Begin with the points that touch in the static state and undeflected bristles.

        `moved` (c, 2) m: displacements in that state, by default none.
        """
        self.touched[:] = touching
        if moved is not None:
            self.moved[:] = moved.T
        self._stand()

    def state(self) -> dict[str, np.ndarray]:
        """The state that a checkpoint keeps."""
        points = {"deflection": self.deflected, "moved": self.moved, "tip": self.tip}
        flags = {name: getattr(self, name).copy() for name in ("touched", "slid", "stands")}
        return (
            {name: each.T.copy() for name, each in points.items()}
            | flags
            | {"waited": self.waited.copy()}
        )

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Continue from `state`; of a brush on the same points in other steps, from what their bristles have in the mean."""
        self.deflected[:], self.moved[:] = state["deflection"].T, state["moved"].T
        self.touched[:], self.slid[:] = state["touched"], state["slid"]
        if state["stands"].shape == self.stands.shape:
            self.tip[:], self.stands[:], self.waited[:] = (
                state["tip"].T,
                state["stands"],
                state["waited"],
            )
        else:
            self._stand()

    def _stand(self) -> None:
        """Let bristles stand where points touch, with the deflections of the points, between them interpolated."""
        cell, ahead = self.rows.cell, self.ahead[self.rows.cell]
        tip = self.moved - self.deflected
        further = np.where(self.touched[ahead], tip[:, ahead], tip[:, cell])
        self.tip[:] = tip[:, cell] + self.rows.along * (further - tip[:, cell])
        self.stands[:], self.waited[:] = self.touched[cell], 0


def rows_of(x: Array, line: Array, way: float) -> Rows:
    """The places of bristles on lines of points (`Brush`), in steps of a `way` m. A point alone on its line has a cell as long as others
    have; where all are alone and roll they have no bristles."""
    _, pitch = next_ahead(x, line)
    known = pitch[pitch > 0]
    usual = float(np.median(known)) if len(known) else float(way == 0)
    shift = math.ceil(FEWEST * way / usual) if usual else 0
    every = max(math.floor(usual / (MOST * way)), 1) if way else 1
    apart = way * every / shift if shift else usual / FEWEST
    lines = [_line(x, np.flatnonzero(line == each), way, usual, apart) for each in np.unique(line)]
    begin = np.cumsum([0, *(len(each.cell) for each in lines)])
    foremost, of_point = np.zeros(len(x), np.int32), [np.zeros(0)] * len(x)
    for at, each in zip(begin.tolist(), lines, strict=False):
        foremost[each.points] = at + each.first
        for i, weights in zip(each.points.tolist(), each.weights, strict=True):
            of_point[i] = weights
    return Rows(
        shift=shift,
        every=every,
        line=begin.astype(np.int32),
        cell=np.concatenate([each.cell for each in lines]).astype(np.int32),
        beside=np.concatenate([each.beside for each in lines]).astype(np.int32),
        along=np.concatenate([each.along for each in lines]),
        entry=np.concatenate([each.entry for each in lines]),
        foremost=foremost,
        first=np.cumsum([0, *(len(weights) for weights in of_point)]).astype(np.int32),
        weight=np.concatenate(of_point),
    )


class _Line(NamedTuple):
    """The bristles of a line, as in `Rows`, and of its `points`, from the front, the `first` one and the weights."""

    cell: NDArray[np.intp]
    beside: NDArray[np.intp]
    along: Array
    entry: Array
    points: NDArray[np.intp]
    first: NDArray[np.intp]
    weights: list[Array]


def _line(x: Array, points: NDArray[np.intp], way: float, usual: float, apart: float) -> _Line:
    """Bristles of a line, `apart` m."""
    points = points[np.argsort(-x[points], kind="stable")]
    if not apart:
        none = np.zeros(0)
        return _Line(points[:0], points[:0], none, none, points, 0 * points, [none] * len(points))
    places, number = x[points], np.arange(len(points))
    gaps = -np.diff(places) if len(points) > 1 else np.array([usual])
    fronts = places + 0.5 * np.append(gaps[0], gaps)[: len(points)]
    backs = places - 0.5 * np.append(gaps, gaps[-1])[-len(points) :]
    count = math.ceil((fronts[0] - backs[-1]) / apart * (1 - 1e-12))
    at = fronts[0] - apart * (np.arange(count) + 0.5)
    cell = np.minimum(np.searchsorted(-backs, -at, side="right"), len(points) - 1)
    beside = np.clip(cell + np.where(at > places[cell], -1, 1), 0, len(points) - 1)
    along = np.zeros(count)
    further = np.append(0.0, gaps)[
        cell
    ]  # of the foremost point none, and none to one at the same place
    np.divide(at - places[cell], further, out=along, where=further > 0)
    entry = (fronts[cell] - at) / (way or np.inf)
    first, end = (np.searchsorted(cell, number, side=side) for side in ("left", "right"))
    none = first == end  # in a cell shorter than bristles are apart
    first[none] = np.abs(np.subtract.outer(places[none], at)).argmin(axis=1)
    end[none] = first[none] + 1
    weights = [_weights(at[a:b] - place) for a, b, place in zip(first, end, places, strict=True)]
    return _Line(points[cell], points[beside], along, entry, points, first, weights)


def _weights(off: Array) -> Array:
    """Weights (n,) of bristles `off` m ahead of a point, of which it has the mean: alike, but for as much as their mean place is off it."""
    mean = float(off.mean())
    spread = float(((off - mean) ** 2).mean())
    part = np.maximum(1.0 - mean / spread * (off - mean), 0.0) if spread > 0 else np.ones(len(off))
    whole: Array = part / part.sum()
    return whole


def next_ahead(x: Array, line: Array) -> tuple[NDArray[np.intp], Array]:
    """Next point ahead of each on its line (c,) and its distance (m); the first has itself, 0."""
    ahead, pitch = np.arange(len(x)), np.zeros(len(x))
    for number in np.unique(line):
        members = np.flatnonzero(line == number)
        members = members[np.argsort(x[members], kind="stable")]
        ahead[members[:-1]], pitch[members[:-1]] = members[1:], np.diff(x[members])
    return ahead, pitch


def upstream(x: Array, line: Array, way: float) -> sparse.csr_matrix:
    """Linear interpolation (c, c) at x + way (m) on each point's line; none beyond its end."""
    rows, columns, values = [], [], []
    for number in np.unique(line):
        members = np.flatnonzero(line == number)
        members = members[np.argsort(x[members], kind="stable")]
        place = x[members] + way
        right = np.searchsorted(x[members], place, side="left")
        inside = right < len(members)
        right, ahead = right[inside], members[inside]
        left = np.maximum(right - 1, 0)
        gap = x[members[right]] - x[members[left]]
        to_right = np.where(
            gap > 0, (place[inside] - x[members[left]]) / np.where(gap > 0, gap, 1), 1
        )
        for ends, part in ((left, 1 - to_right), (right, to_right)):
            rows.append(ahead)
            columns.append(members[ends])
            values.append(part)
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    matrix = sparse.csr_matrix(entries, shape=(len(x), len(x)))
    matrix.eliminate_zeros()
    return matrix


def shape_slip(positions: Array, ring: Array, shape: tuple[int, int], radius: float) -> Array:
    """Slip (s, 2) of the outer face's nodes on a wheel of effective rolling radius `radius` (m).

    Bristles are sensitive to the local speed of the surface. For a wheel at speed Omega with r_e Omega = v, the road's
    speed, the surface at (x, y) moves at -Omega d(x, y)/dtheta in the static shape, and so slips by

        s_x = (dx/dtheta) / r_e - 1,     s_y = -(dy/dtheta) / r_e

    in addition to the slip of the whole wheel (signs as in the module). The resultant of these forces need not vanish: the
    wheel rotates slightly faster or slower until it does. `positions` (s, 3) m form a ring of `shape` at the angles
    `ring` (rad).
    """
    grid = positions.reshape(*shape, 3)[:, :, :2]
    closed = np.concatenate([grid[-1:], grid, grid[:1]])
    angle = np.concatenate([ring[-1:] - 2 * np.pi, ring, ring[:1] + 2 * np.pi])
    rate = np.gradient(closed, angle, axis=0)[1:-1].reshape(-1, 2) / radius
    return np.stack([rate[:, 0] - 1.0, -rate[:, 1]], axis=-1)
