"""Contact with friction on a grid of thousands of points: normal and horizontal forces of a step at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.spatial import KDTree

from tireroad.contact.patch import Patch
from tireroad.contact.solver.active_set import COMPILED
from tireroad.contact.solver.conditions import Array, Index, Mask, check_residual, penetration
from tireroad.contact.solver.projected_cg import ProjectedCG
from tireroad.contact.solver.stick_slip import TURNS, BrushFriction, CompressedRows
from tireroad.contact.tread.kernel import EMPTY, Box, points_in, widened
from tireroad.contact.tread.shear import GridTread, KernelShear
from tireroad.greens.recursion import LoadedColumns

_C, _FFI = COMPILED.lib, COMPILED.ffi
_RULES = _C.newton  # as for the steps of stick and slip

# Of the largest gap: residual of normal forces and gaps, at the worst point. On rough asphalt about a thousandth of deflections.
GAP_TOLERANCE = 1e-5
NEAR = 4.0  # spacings of nodes up to which a Newton step has the tire's compliance between them,
MOST = 0.5  # unless what is left out is more than this share of it: then all of it
PATIENT = 12  # Newton steps, before fewer points are to be found slipping where the residual does not fall
# Where these are not enough, or what is out of balance has grown by more than this factor since the first one, the near parts of the
# compliance do not do: the whole of it is taken in this step and those that follow.
GROWN, WHOLLY = 10.0, 30
READINGS = 12  # Newton steps in which the road is read, at most: on a steep flank a point may go to and fro
_EDGE = 1  # rows and columns of points beyond those that touch, which the edge of a brush needs

# Heights (c,) m and slopes (c, 2) of the road under points at places (2, c) m beside their own.
Reading = Callable[[Array], tuple[Array, Array]]


class GridNewton:
    """Semismooth Newton for normal and horizontal forces at once, on a grid whose tread is a convolution.

    Forces p = (f, t) at the points, vertical and of their bristles, move the tire by A R p, R p = (f + t . r, t - f r) on a road
    of slope r, and the tread by C p. With the gap g and the bristles' deflection e, past included,

        f = max(f - g / a_n, 0),   t = P(t - e / a_t),

    P the projection on the disc of radius mu f and a the compliances of single points (Alart and Curnier, Comput. Methods
    Appl. Mech. Eng. 92 (1991) 353). The road is read anew in each Newton step, where the points have moved to.
    Residuals are exact; the linear problem of a step is solved to a tenth by GMRES with C up to some cells and A between nodes
    near each other (all of A where it is not local, as of a tire that follows its forces at once; all of both where these
    parts do not converge). The points of a box around those
    that touch take part; the gaps of all others are found afterwards.

    Where no solution of both is found in 40 steps, normal forces take the horizontal ones of the step before, and
    stick and slip these normal forces (BrushFriction, `lagging`). Serial; `force` (3, c) N is the last solution.
    """

    def __init__(
        self, normal: ProjectedCG, friction: BrushFriction, same_step: Array, patch: Patch
    ) -> None:  # fmt: skip
        """`same_step` (3p, 3p) m/N between the nodes; the points, weights and forces at rest of the `patch`."""
        assert normal.tread is not None and patch.weights is not None, "points on a grid"
        assert friction.shear is None or isinstance(friction.shear, KernelShear), "points on a grid"
        weights, tread = patch.weights.tocsr(), normal.tread
        c, p = weights.shape
        self.friction, self.at_rest, self.own = friction, patch.force, normal.diagonal
        self._weights, self._transposed, self._cells = weights, weights.T.tocsr(), tread.cells
        self._grid = GridTread(tread, friction.shear)
        self._whole = self._grid.inside(self._grid.box)
        at_rest, pressed = np.zeros((2, 3, c))
        at_rest[0], pressed[0] = (
            patch.force,
            patch.force if friction.pressed is None else friction.pressed,
        )
        self._constant = np.concatenate([self._whole(at_rest)[:1], self._whole(pressed)[1:]])
        self._tire = LoadedColumns(same_step)
        self._near = _near(same_step, _positions(weights, patch.points[:, :2]))
        self._box, self.index, self._inside = EMPTY, np.arange(0), self._whole
        self.before, self.force, self.slope = at_rest.copy(), at_rest.copy(), np.zeros((c, 2))
        self.wholly = 0  # steps to come with the whole compliance in Newton steps
        self._compile(p)

    def _compile(self, p: int) -> None:
        up, down = CompressedRows(self._weights), CompressedRows(self._transposed)
        grid = self._grid.compiled(COMPILED)
        plane = _FFI.new("plane *", {
            "points": len(self.own), "nodes": p, "w_begin": up.begin, "w_column": up.column, "w_value": up.value,
            "t_begin": down.begin, "t_column": down.column, "t_value": down.value,
        } | grid)  # fmt: skip
        _C.plane_begin(plane)
        cells = grid["nx"] * (grid["ny"] + 8)
        sizes = {
            "nodal": 3 * p,
            "nodes": 3 * p,
            "value": 3 * p,
            "force": len(self.own),
            "field": 3 * cells,
        }
        self._kernel = {name: COMPILED.doubles(np.empty(size)) for name, size in sizes.items()} | {
            "compliance": _FFI.gc(plane, _C.plane_end), "which": COMPILED.ints(np.empty(3 * p, np.int32)),
            "pressed": self._grid.pressed(COMPILED), "friction": self.friction.coefficient or 0.0,
        }  # fmt: skip
        everywhere = {"tire": COMPILED.doubles(self._tire.columns)}
        self._whole_step = everywhere | {"reach": max(grid["nx"], grid["ny"])}
        self._near_step = everywhere | {"reach": grid["near"]}
        if self._near is not None:
            near = CompressedRows(self._near)
            parts = {"n_begin": near.begin, "n_column": near.column, "n_value": near.value}
            self._near_step = parts | {"reach": grid["near"]}
        self._held = up, down, grid

    def solve(
        self,
        gap: Array,
        free: Array,
        read: Reading | None,
        road: Array,
        tolerance: float,
        again: bool = False,
    ) -> _Step:
        """The forces, gaps and slopes of a step, whose brush is then at its end.

        `gap` (c,) and `free` (2, c) m: gaps over a level road at height 0 and displacements in the plane, under the forces at
        rest. The road is `read` at the points' places, or at heights `road` (c,) m and level. `tolerance`: what places may change of gaps after the
        road was read, as a share of deflections (mean squares). `again`: the last step once more, from its forces. ConvergenceError
        after 40 steps in a row that had to be split.
        """
        step = _Step(self, gap, free, read, road, tolerance, again)
        lags = not step.settle()
        if lags and (self.friction.unbounded or not step.split()):
            raise self.friction.unsolved()
        step.within_bounds()
        self.before = self.before if again else self.force
        self.force, self.slope = step.force, step.slope
        self.wholly = max(self.wholly - 1, 0)
        self.friction.advance(step.force, step.bases, lags)
        return step

    def moved(self, pushed: Array) -> Array:
        """Displacements (3, c) m of the points with the tire under changes (3, c) N of forces."""
        moved = self._tire @ np.concatenate([self._transposed @ part for part in pushed])
        return np.stack([self._weights @ part for part in np.split(moved, 3)])

    def tread(self, force: Array) -> Array:
        """Displacements (3, a) m of the box's points with the tread."""
        return self._inside(force) - self._constant[:, self.index]

    def whole_tread(self, force: Array) -> Array:
        """Displacements (c,) m of all points away from the road with the tread."""
        return self._whole(force)[0] - self._constant[0]

    def linear(
        self, at: Index, slope: Array, own: Array, beside: Array, spring: Array, direction: Array, share: Array,
        kept: Array, caution: float, reads: bool, whole: bool, right: Array,
    ) -> Array:  # fmt: skip
        """The step (3, a) N of a Newton step between the points `at` (a,), to a tenth of `right` (contact.c, at_once); with
        the `whole` compliance, or what is near."""
        right, step = np.ascontiguousarray(right), np.zeros(right.shape)
        doubles = {
            "slope": slope,
            "own": own,
            "beside": beside,
            "spring": spring,
            "direction": direction,
            "share": share,
        }
        held = {name: np.ascontiguousarray(values) for name, values in doubles.items()}
        index = at.astype(np.int32)
        compliance = self._whole_step if whole else self._near_step
        problem = _FFI.new("at_once *", self._kernel | compliance | {name: COMPILED.doubles(values) for name, values in held.items()} | {
            "count": len(at), "index": COMPILED.ints(index), "kept": COMPILED.flags(np.ascontiguousarray(kept)), "caution": caution, "reads": reads,
        })  # fmt: skip
        _C.at_once_step(problem, COMPILED.doubles(right), _RULES.inner, COMPILED.doubles(step))
        return step

    def take_box(self, points: Mask) -> bool:
        """Solve between the points of a box around these (c,) bool too; whether it has grown."""
        if not points.any():
            return False
        touching = self._cells[0][points], self._cells[1][points]
        box = widened(self._box, touching, self._whole.shape, _EDGE)
        if box == self._box:
            return False
        self._set_box(box)
        return True

    def _set_box(self, box: Box) -> None:
        self._box, self.index = box, points_in(box, self._cells)
        self._inside = self._grid.inside(box)

    def state(self) -> dict[str, Array]:
        """The state from which the next step starts."""
        return {
            "forces": np.stack([self.force, self.before]),
            "slope": self.slope,
            "box": np.array(self._box),
            "wholly": np.array(self.wholly),
        }

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from `state`."""
        self.force, self.before = state["forces"].copy()
        self.slope, self.wholly = state["slope"].copy(), int(state["wholly"])
        top, bottom, left, right = state["box"].astype(int).tolist()
        if bottom:
            self._set_box((top, bottom, left, right))


class _Step:
    """A step's `force` (3, c) N, `gap` (c,) m and `slope` (c, 2) of the road, while they are sought."""

    def __init__(
        self, solver: GridNewton, gap: Array, free: Array, read: Reading | None, road: Array, tolerance: float,
        again: bool,
    ) -> None:  # fmt: skip
        if not (np.all(np.isfinite(gap)) and np.all(np.isfinite(free))):
            check_residual("projected-cg", np.nan)
        self._solver, self._brush = solver, solver.friction
        self._open, self._free, self._read = gap, free, read
        self._tolerance = tolerance
        self._bears, self._past = self._brush.begin(again)
        self._spring = 1.0 / self._brush.stiffness
        self._beside = self._brush.own + self._spring
        last = solver.force
        if again:
            self.force = last.copy()
        else:
            self.force = self._brush.carried(last) if read else 2.0 * last - solver.before
        self.force[:, ~(self.force[0] > 0.0)] = 0.0
        _onto_discs(self.force[1:], self._brush.bound(self.force[0]))
        self.slope = solver.slope if read else np.zeros((len(gap), 2))
        self.gap, self.residual, self.turns, self.astray = gap, 0.0, 0, False
        self._height, self._reads = road, False
        self._place: Array | None = None
        self._caution, self._off, self._first, self._limit = 1.0, 0.0, 0.0, 0.0
        solver.take_box((self.force[0] > 0.0) | (last[0] > 0.0))
        if not len(solver.index):
            solver.take_box(np.asarray(solver.at_rest > 0.0))

    def settle(self, normal: bool = True, plane: bool = True) -> bool:
        """Newton steps until the forces `normal` to the road and in its `plane` are in balance, while the others stay. Whether
        40 were enough."""
        before, least, most, best = np.inf, np.inf, np.inf, self.force
        for turn in range(TURNS):
            self.turns += 1
            self._evaluate()
            if self._balanced(normal, plane):
                if not self._beyond():
                    return True
                continue  # with the points of a larger box
            if not self._solver.wholly and (turn == PATIENT or self._rest > most):
                self._solver.wholly, self.force = WHOLLY, best.copy()
                continue
            if turn == 0:
                most = GROWN * self._rest
            if self._rest < least:
                least, best = self._rest, self.force.copy()
            if turn >= PATIENT and self._off > max(_RULES.falls * before, self._limit):
                self._caution = max(_RULES.caution * self._caution, _RULES.least_caution)
            before = self._off
            self._newton(normal, plane, turn)
        return False

    def split(self) -> bool:
        """Normal forces under the horizontal ones of the step before, then stick and slip under these; whether both were found."""
        self.force[1:] = self._brush.horizontal.T
        self._caution = 1.0
        return self.settle(plane=False) and self.settle(normal=False)

    def within_bounds(self) -> None:
        """Let no point pull at the road or bear more than friction holds, by what the tolerances have left."""
        self.force[0] = np.maximum(self.force[0], 0.0)
        _onto_discs(self.force[1:], self._brush.bound(self.force[0]))
        self.force[1:, self.force[0] <= 0.0] = 0.0

    def _evaluate(self) -> None:
        """Gaps and slips of the box's points, with the road read where they lie."""
        solver, (f, *t), slope = self._solver, self.force, self.slope
        pushed = np.stack(
            [
                f + t[0] * slope[:, 0] + t[1] * slope[:, 1] - solver.at_rest,
                t[0] - f * slope[:, 0],
                t[1] - f * slope[:, 1],
            ]
        )
        tire, inside = solver.moved(pushed), solver.index
        moved = tire[:, inside] + solver.tread(self.force[:, inside])
        place = self._free + tire[1:]
        self.bases = place.copy()
        self.bases[:, inside] = self._free[:, inside] + moved[1:]
        place[:, inside] = (
            self.bases[:, inside] + self.force[1:, inside] / self._brush.stiffness[inside]
        )
        self._meet(place)
        self._tire = tire[0]
        self._near_gap = self._open[inside] + moved[0] - self._height[inside]
        self._slip = (
            self._free[:, inside]
            + moved[1:]
            + self._spring[inside] * self.force[1:, inside]
            + self._past[:, inside]
        )

    def _meet(self, place: Array) -> None:
        """Read the road where the points lie, (2, c) m, unless gaps have hardly changed since by where they lie, in the mean
        square; what is `astray` after some readings stays where the road was read last."""
        (f, *_), own = self.force, self._solver.own
        self._reads = self._read is not None
        if self._place is not None:
            shift = np.abs(
                self.slope[:, 0] * (place[0] - self._place[0])
                + self.slope[:, 1] * (place[1] - self._place[1])
            )
            moved = np.linalg.norm(shift[f > 0.0]) > self._tolerance * np.linalg.norm(own * f)
            self.astray = bool(moved) and self.turns > READINGS
            self._reads = bool(moved) and not self.astray
        if self._reads and self._read is not None:
            self._place = place
            self._height, self.slope = self._read(place)

    def _balanced(self, normal: bool, plane: bool) -> bool:
        solver, index = self._solver, self._solver.index
        own, (f, *t) = solver.own[index], self.force[:, index]
        scale = float(np.abs(self._near_gap).max() + (own * f).max(initial=0.0))
        worst = np.abs(np.minimum(own * f, self._near_gap)).max(initial=0.0)
        self.residual = float(worst) / scale if scale > 0.0 else 0.0
        if np.isnan(self.residual):
            check_residual("projected-cg", np.nan)
        self._touches = own * f - self._near_gap > 0.0
        bound, r = self._brush.bound(f), 1.0 / self._beside[index]
        self._trial = self.force[1:, index] - self._caution * r * self._slip
        whole = self.force[1:, index] - r * self._slip
        _onto_discs(whole, bound)
        held = self._touches & self._bears[index]
        off = np.hypot(*(self.force[1:, index] - whole))
        self._off = float(off[held].max(initial=0.0))
        most = max(
            float(np.max(bound, where=np.isfinite(bound), initial=0.0)),
            float(np.hypot(*t).max(initial=0.0)),
        )
        self._first = self._first or self._off
        self._limit = self._brush.limit(self._first, most)
        # Of both, over what they may be.
        self._rest = max(
            self.residual / GAP_TOLERANCE * normal, self._off / max(self._limit, 1e-300) * plane
        )
        settled = not normal or self.residual <= GAP_TOLERANCE
        return settled and (not plane or self._off <= self._limit) and not self._reads

    def _newton(self, normal: bool, plane: bool, turn: int) -> None:
        """Forces that balance gaps and slips where they are linear; those of points that leave the road go."""
        solver, index = self._solver, self._solver.index
        if plane and self._brush.unbounded and turn > _C.LIFT_PATIENCE:
            self._bears[index[self._touches != (self.force[0, index] > 0.0)]] = False
        touches = self._touches if normal else self.force[0, index] > 0.0
        part = np.flatnonzero(touches | self.force[:, index].any(axis=0))
        if not len(part):
            return
        at = index[part]
        touches, trial, gap, slip = (
            touches[part],
            self._trial[:, part],
            self._near_gap[part],
            self._slip[:, part],
        )
        f, *t = self.force[:, at]
        bound, length = self._brush.bound(f), np.hypot(*trial)
        bears = touches & self._bears[at]
        slips = bears & (length > bound)
        share = np.divide(bound, length, out=np.ones_like(length), where=slips)
        direction = np.divide(trial, length, out=np.zeros_like(trial), where=slips)
        kept = np.array(
            [
                ~touches if normal else np.ones_like(touches),
                ~bears if plane else np.ones_like(bears),
            ]
        )
        own, beside = solver.own[at], self._beside[at]
        right = np.concatenate(
            [
                (-gap / own)[None],
                np.where(slips, bound * direction - self.force[1:, at], -slip / beside),
            ]
        )
        right[0, kept[0]] = -f[~touches] if normal else 0.0
        right[1:, kept[1]] = -self.force[1:, at[kept[1]]] if plane else 0.0
        step = solver.linear(
            at,
            self.slope[at],
            own,
            beside,
            self._spring[at],
            direction,
            share,
            kept,
            self._caution,
            self._reads,
            self._solver.wholly > 0,
            right,
        )
        self.force[:, at] += step
        if normal:
            self.force[0, at[~touches]] = 0.0
        if plane:
            self.force[1:, at[~bears]] = 0.0

    def _beyond(self) -> bool:
        """Set the gaps of all points; whether some touch beyond the box or at its edge, which then has grown."""
        solver = self._solver
        gap = self._open + self._tire - self._height + solver.whole_tread(self.force)
        scale = np.abs(gap).max()
        outside = gap < -GAP_TOLERANCE * scale
        outside[solver.index] = False
        self.penetration = penetration(gap)
        self.gap = np.where(self.force[0] > 0.0, 0.0, gap)
        return solver.take_box(outside | (self.force[0] > 0.0))


def _onto_discs(force: Array, bound: Array) -> None:
    """Cut forces (2, n) N down to the `bound` (n,) N."""
    length = np.hypot(*force)
    too_long = length > bound
    force[:, too_long] *= bound[too_long] / length[too_long]


def _positions(weights: sparse.csr_matrix, places: Array) -> Array:
    """Places (p, 2) m of nodes, from those of the points (c, 2) m that they carry; far away where there are none."""
    carried = np.asarray(weights.sum(axis=0)).ravel()
    known = carried > 1e-6
    at = (weights.T @ places) / np.where(known, carried, 1.0)[:, None]
    at[~known] = 1e3 * (1.0 + np.arange(np.count_nonzero(~known)))[:, None]
    return at


def _near(tire: Array, places: Array) -> sparse.csr_matrix | None:
    """`tire` (3p, 3p) between nodes at `places` (p, 2) m that lie near each other; None where that is not most of it."""
    p, tree = len(places), KDTree(places)
    spacing = float(np.median(tree.query(places, 2)[0][:, 1]))
    i, j = tree.query_pairs(NEAR * spacing, output_type="ndarray").T
    own = np.arange(p)
    i, j = np.concatenate([own, i, j]), np.concatenate([own, j, i])
    rows, columns = ((np.arange(3)[:, None] * p + of).ravel() for of in (i, j))
    rows, columns = (
        np.tile(rows, 3),
        np.concatenate([np.roll(columns, d * len(i)) for d in range(3)]),
    )
    near = sparse.csr_matrix((tire[rows, columns], (rows, columns)), shape=tire.shape)
    return near if _size(tire - near.toarray()) < MOST * _size(tire) else None


def _size(matrix: Array) -> float:
    """About the largest singular value."""
    vector = np.ones(len(matrix))
    for _ in range(10):
        vector = matrix.T @ (matrix @ vector)
        vector /= max(float(np.linalg.norm(vector)), 1e-300)
    return float(np.linalg.norm(matrix @ vector))
