"""Contact with friction on a grid of thousands of points: normal and horizontal forces of a step at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.spatial import KDTree

from tireroad.contact.patch import Patch
from tireroad.contact.solver.active_set import COMPILED
from tireroad.contact.solver.conditions import Array, Mask, check_residual, penetration
from tireroad.contact.solver.projected_cg import ProjectedCG
from tireroad.contact.solver.stick_slip import TURNS, BrushFriction, CompressedRows
from tireroad.contact.tread.kernel import EMPTY, Box, points_in, widened
from tireroad.contact.tread.shear import GridTread, KernelShear

_C, _FFI = COMPILED.lib, COMPILED.ffi
_RULES = _C.newton  # as for the steps of stick and slip

# Of the largest gap: residual of normal forces and gaps, at the worst point. On rough asphalt about a thousandth of deflections.
GAP_TOLERANCE = 1e-5
NEAR = 4.0  # spacings of nodes up to which a Newton step has the tire's compliance between them,
MOST = 0.5  # unless what is left out is more than this share of it: then all of it
PATIENT = 12  # Newton steps, before fewer points are to be found slipping where the residual does not fall
# Where these are not enough, or what is out of balance has grown by more than this factor since the first one, the near parts of the
# compliance do not do: the whole of it is taken in this step and those that follow.
GROWN, WHOLLY = 10.0, 4
ALONE = 200  # Newton steps of stick and slip under given normal forces, which have a solution
STALLED = 4  # turns of normal and horizontal forces, in which what is out of balance is to halve
READINGS = 12  # Newton steps in which the road is read, at most: on a steep flank a point may go to and fro
SECANTS = 8  # of Newton steps that are kept
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
    parts do not converge). What these parts lack is much the same from step to step: it is mended by secants of the last Newton steps,
    also of earlier steps in time (IQN-ILS: Degroote, Bathe and Vierendeels 2009, doi 10.1016/j.compstruc.2008.11.013).
    Compiled (contact.c). The points of a box around those
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
        self._weights, self._cells = weights, tread.cells
        self._grid = GridTread(tread, friction.shear)
        self._whole = self._grid.inside(self._grid.box)
        at_rest, pressed = np.zeros((2, 3, c))
        at_rest[0], pressed[0] = (
            patch.force,
            patch.force if friction.pressed is None else friction.pressed,
        )
        self._constant = np.concatenate([self._whole(at_rest)[:1], self._whole(pressed)[1:]])
        self._tire = np.ascontiguousarray(same_step.T)  # by columns
        self._near = _near(same_step, _positions(weights, patch.points[:, :2]))
        self._box, self.index, self._inside = EMPTY, np.arange(0, dtype=np.int32), self._whole
        self._fixed = self._constant[:, :0]
        self.wholly = 0  # steps to come with the whole compliance in Newton steps
        self._compile(p)
        self.force, self.slope = self.array["force"], self.array["slope"]
        self.force[:], self.before = at_rest, at_rest.copy()

    def _compile(self, p: int) -> None:
        up, down = CompressedRows(self._weights), CompressedRows(self._weights.T)
        grid, c = self._grid.compiled(COMPILED), len(self.own)
        plane = _FFI.new("plane *", {
            "points": c, "nodes": p,
        } | up.named("w_") | down.named("t_") | grid)  # fmt: skip
        _C.plane_begin(plane)
        coefficient, spring = self.friction.coefficient, 1.0 / self.friction.stiffness
        given = {
            "at_rest": self.at_rest,
            "own": self.own,
            "beside": self.friction.own + spring,
            "spring": spring,
        }
        shapes = {"slope": (c, 2), "force": (3, c), "moved": (3, c), "gap": (c,), "moves": (SECANTS, 3, c), "changes": (SECANTS, 3, c)} | {
            name: (2, c) for name in ("base", "place", "slip", "trial")
        }  # fmt: skip
        self.array = {name: np.zeros(shape) for name, shape in shapes.items()}
        self.touches, self._secants = np.zeros(c, bool), np.zeros(1, np.int32)
        doubles = {
            name: np.ascontiguousarray(values, float) for name, values in given.items()
        } | self.array
        pressed = self._grid.pressed(COMPILED)
        near = {} if self._near is None else CompressedRows(self._near).named("n_")
        self.compiled = _FFI.new("at_once *", {name: COMPILED.doubles(values) for name, values in doubles.items()} | near | {
            "compliance": plane, "tire": COMPILED.doubles(self._tire), "pressed": pressed,
            "near": grid["near"], "friction": -1.0 if coefficient is None else coefficient,
            "touches": COMPILED.flags(self.touches), "most_secants": SECANTS, "secants": COMPILED.ints(self._secants),
        })  # fmt: skip
        _C.at_once_begin(self.compiled)
        self._freed = _FFI.gc(plane, _C.plane_end), _FFI.gc(self.compiled, _C.at_once_end)
        self._held = up, down, grid, doubles, pressed, near

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
        last = self.force.copy()
        step = _Step(self, gap, free, read, road, tolerance, again)
        lags = not (step.settle() or step.alternate())
        if lags and (self.friction.unbounded or not step.split()):
            raise self.friction.unsolved()
        _C.at_once_bound(self.compiled)
        if not again:
            self.before = last
        self.wholly = max(self.wholly - 1, 0)
        self.friction.advance(self.force, self.array["base"], lags)
        return step

    def tread(self) -> Array:
        """Displacements (3, a) m of the box's points with the tread."""
        return self._inside(self.force.take(self.index, axis=1)) - self._fixed

    def whole_tread(self) -> Array:
        """Displacements (c,) m of all points away from the road with the tread."""
        return self._whole(self.force)[0] - self._constant[0]

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
        self._box, self.index = box, points_in(box, self._cells).astype(np.int32)
        self._inside, self._fixed = self._grid.inside(box), self._constant.take(self.index, axis=1)
        self.compiled.inside, self.compiled.index = len(self.index), COMPILED.ints(self.index)
        _C.at_once_box(self.compiled)

    def state(self) -> dict[str, Array]:
        """The state from which the next step starts."""
        count = int(self._secants[0])
        return {
            "forces": np.stack([self.force, self.before]),
            "slope": self.slope.copy(),
            "box": np.array(self._box),
            "wholly": np.array(self.wholly),
            "secants": np.stack([self.array[name][:count] for name in ("moves", "changes")]),
        }

    def set_state(self, state: dict[str, Array]) -> None:
        """Continue from `state`."""
        self.force[:], self.before = state["forces"][0], state["forces"][1].copy()
        self.slope[:], self.wholly = state["slope"], int(state["wholly"])
        self._secants[0] = count = state["secants"].shape[1]
        self.array["moves"][:count], self.array["changes"][:count] = state["secants"]
        top, bottom, left, right = state["box"].astype(int).tolist()
        if bottom:
            self._set_box((top, bottom, left, right))


class _Step:
    """A step's `force` (3, c) N, `gap` (c,) m and `slope` (c, 2) of the road, while they are sought; all valid until the next one."""

    def __init__(
        self, solver: GridNewton, gap: Array, free: Array, read: Reading | None, road: Array, tolerance: float,
        again: bool,
    ) -> None:  # fmt: skip
        if not (np.all(np.isfinite(gap)) and np.all(np.isfinite(free))):
            check_residual("projected-cg", np.nan)
        self._solver, self._brush, self._compiled = solver, solver.friction, solver.compiled
        self._open, self._read, self._tolerance = gap, read, tolerance
        self.force, self.slope = solver.force, solver.slope
        self._place: Array | None = None
        bears, past = self._brush.begin(again)
        self._arrays: dict[str, Array] = {}
        self._set(open=gap, free=free, past=past, height=road)
        self._bears = bears
        self._compiled.bears = COMPILED.flags(bears)
        self._compiled.caution = 1.0
        last = self.force.copy()
        if not again:
            self.force[:] = self._brush.carried(last) if read else 2.0 * last - solver.before
        self.force[:, ~(self.force[0] > 0.0)] = 0.0
        _C.at_once_bound(self._compiled)
        if not read:
            self.slope[:] = 0.0
        self.gap, self.residual, self.turns, self.astray = gap, 0.0, 0, False
        self._first = 0.0
        _C.at_once_step(self._compiled)
        solver.take_box((self.force[0] > 0.0) | (last[0] > 0.0))
        if not len(solver.index):
            solver.take_box(np.asarray(solver.at_rest > 0.0))

    def _set(self, **arrays: Array) -> None:
        """Let the kernel read these arrays."""
        for name, values in arrays.items():
            held = np.ascontiguousarray(values, float)
            self._arrays[name] = held
            setattr(self._compiled, name, COMPILED.doubles(held))

    def settle(self, normal: bool = True, plane: bool = True) -> bool:
        """Newton steps until the forces `normal` to the road and in its `plane` are in balance, while the others stay. Whether
        they were found: in at most 40, of stick and slip alone `ALONE`, and of both as long as what is out of balance halves now and then."""
        solver, at = self._solver, self._compiled
        before, least, most, best = np.inf, np.inf, np.inf, self.force.copy()
        half, since = np.inf, 0
        for turn in range(TURNS if normal else ALONE):
            self.turns += 1
            self._evaluate()
            if self._balanced(normal, plane):
                if not self._beyond():
                    return True
                half, since = np.inf, turn
                continue  # with the points of a larger box
            if not solver.wholly and (turn == PATIENT or self._rest > most):
                solver.wholly, self.force[:] = WHOLLY, best
                continue
            if turn == 0:
                most = GROWN * self._rest
            if self._rest < least:
                least, best[:] = self._rest, self.force
            if self._rest < half:
                half, since = 0.5 * self._rest, turn
            elif normal and plane and solver.wholly and turn - since > PATIENT:
                break  # neither fits the other: it goes to and fro
            if turn >= PATIENT and at.off > max(_RULES.falls * before, self._limit):
                at.caution = max(_RULES.caution * at.caution, _RULES.least_caution)
            before = at.off
            if plane and self._brush.unbounded and turn > _C.LIFT_PATIENCE:
                index = solver.index
                lifts = index[solver.touches[index] != (self.force[0, index] > 0.0)]
                self._bears[lifts] = False
            _C.at_once_newton(at, normal, plane, solver.wholly > 0, _RULES.inner)
        return False

    def alternate(self) -> bool:
        """Normal forces under the horizontal ones and these under the former, in turns from those of the step before, while what
        is out of balance falls. Whether both are in balance."""
        self.force[1:] = self._brush.horizontal.T
        rests: list[float] = []
        while len(rests) <= STALLED or rests[-1] < 0.5 * rests[-1 - STALLED]:
            if not self._turn():
                return False
            self._evaluate()
            if self._balanced(normal=True, plane=True) and not self._beyond():
                return True
            rests.append(self._rest)
        return False

    def split(self) -> bool:
        """Normal forces under the horizontal ones of the step before, then stick and slip under these; whether both were found."""
        self.force[1:] = self._brush.horizontal.T
        return self._turn()

    def _turn(self) -> bool:
        """Normal forces under the horizontal ones, then stick and slip under these; whether both were found."""
        self._compiled.caution = 1.0
        return self.settle(plane=False) and self.settle(normal=False)

    def _evaluate(self) -> None:
        """Gaps and slips of the box's points, with the road read where they lie."""
        at = self._compiled
        _C.at_once_push(at)
        _C.at_once_meet(at, COMPILED.doubles(self._solver.tread()))
        self._meet()
        _C.at_once_balance(at)

    def _meet(self) -> None:
        """Read the road where the points lie, unless gaps have hardly changed since by where they lie, in the mean
        square; what is `astray` after some readings stays where the road was read last."""
        reads, at = self._read is not None, self._compiled
        if self._place is not None:
            moved = bool(_C.at_once_strays(at, COMPILED.doubles(self._place), self._tolerance))
            self.astray = moved and self.turns > READINGS
            reads = moved and not self.astray
        if reads and self._read is not None:
            self._place = place = self._solver.array["place"].copy()
            height, self.slope[:] = self._read(place)
            self._set(height=height)
        at.reads = reads

    def _balanced(self, normal: bool, plane: bool) -> bool:
        at = self._compiled
        if np.isnan(at.residual):
            check_residual("projected-cg", np.nan)
        self.residual = at.residual
        self._first = self._first or at.off
        self._limit = self._brush.limit(self._first, at.most)
        # Of both, over what they may be.
        self._rest = max(
            at.residual / GAP_TOLERANCE * normal, at.off / max(self._limit, 1e-300) * plane
        )
        settled = not normal or at.residual <= GAP_TOLERANCE
        return settled and (not plane or at.off <= self._limit) and not at.reads

    def _beyond(self) -> bool:
        """Set the gaps of all points; whether some touch beyond the box or at its edge, which then has grown."""
        solver = self._solver
        gap = self._open + solver.array["moved"][0] - self._arrays["height"] + solver.whole_tread()
        scale = np.abs(gap).max()
        outside = gap < -GAP_TOLERANCE * scale
        outside[solver.index] = False
        self.penetration = penetration(gap)
        self.gap = np.where(self.force[0] > 0.0, 0.0, gap)
        return solver.take_box(outside | (self.force[0] > 0.0))


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
