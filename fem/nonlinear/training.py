"""Training of the reduced nonlinear force: states on level roads and roads with bars and holes.

Each road is climbed with the vectors known so far, all cells being evaluated. What K^-1 r of the states on the way
lacks of them joins them; where the reduced tire does not converge, the elements are solved by Newton's method.
Vectors: proper orthogonal decomposition of K^-1 r over all states, in the norm of K. Weights: non-negative
least squares.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import sparse

from tireroad.fem.collective import summed
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices.compliance import factorise, multiply, solve_columns
from tireroad.fem.nonlinear.cells import cell_forms
from tireroad.fem.nonlinear.force import RestoringForce
from tireroad.fem.nonlinear.quasi_static import TOLERANCE, Elements, Reduced, Standing
from tireroad.fem.nonlinear.reduced import ReducedForce, outside, reduced_force, sizes
from tireroad.fem.nonlinear.road import ContactPoints, Ground
from tireroad.fem.static.symmetric import TURN, looks_the_same
from tireroad.fem.static.virtual_work import AT_REST, tangent

Array = np.ndarray

_LEAST = 0.1  # J^(1/2): the size of a motion of hundredths of a joule
_SMALLEST, _NONE, _BLOCK, _MANY, _TANGENTS = 0.25, 1e-9, 512, 400, 6
_CELLS = 128
_SMALL = 1 / 20
# Of a state, lacking midway between two places that are trained, from which on places beside it are, too: with 20 % one place fewer
# under a bar of 25 mm let runs with eight vectors grow without bound.
FAR = 0.05
_SAME = 1e-3  # of a force: that of a half-turned motion and the half-turned force


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a training: largest `share` (outside over sizes) that the vectors may lack of a state on the way, and that
    those `kept` at last may; `tolerance` of the weights; `step` of a road's height, m; `most` vectors at last; `turns` in
    which a state is solved for again, and its `precision`."""

    share: float = 0.04
    kept: float = 0.03
    tolerance: float = 0.01
    step: float = 4e-3
    most: int = 80
    turns: int = 5
    precision: float = TOLERANCE


@dataclass
class Trained:
    """Outcome of the training on one road: largest shares `lacked` and `left` before and after; how states were found."""

    road: str
    states: int
    lacked: float
    left: float
    how: str


@dataclass(frozen=True)
class Training:
    """The reduced force with its vectors V (n, k) on own unknowns and the `record` of each road.

    `states`: used, half-turned copies included; `left`: largest share of them that V lacks; `error`: of
    the weighted force over the states, relative; `tangents` of Newton's method; `evaluations` of all cells.
    """

    force: ReducedForce
    vectors: Array
    record: list[Trained]
    states: int
    left: float
    error: float
    singular: Array = field(repr=False)
    tangents: int = 0
    evaluations: int = 0


class Trainer:
    """The states and vectors of a training. Collective, as are all methods."""

    def __init__(
        self,
        force: RestoringForce,
        points: ContactPoints,
        settings: Settings,
        report: Callable[[str], None],
    ) -> None:
        self.force, self.settings, self._report = force, settings, report
        self._comm, self._stiffness = force.body.comm, force.operators.stiffness
        self._factor = factorise(self._stiffness)
        self.elements = Elements(force, points)
        self._columns = self.elements.columns
        count = points.weights.shape[0]
        n = len(force.at_rest)
        # Motions under unit forces of the points: products with them take a third of a solution's time.
        self._shapes = np.empty((count, n))
        for first in range(0, count, _BLOCK):
            part = slice(first, min(first + _BLOCK, count))
            self._shapes[part] = self.answer(self._columns[:, part].toarray()).T
        compliance = self.elements.seen(self._shapes.T)
        self.vectors = np.zeros((n, 0))
        nothing = np.zeros((count, 0))
        given = points, compliance, nothing, self._evaluate, self._jacobian
        self.tire = Reduced(*given, settings.precision)
        self._cells = CellTangents(force)
        self.turn = half_turn(force)
        self.motions: list[Array] = []
        self.answers: list[Array] = []
        self.record: list[Trained] = []

    def answer(self, loads: Array) -> Array:
        """K^-1 loads, own rows."""
        return solve_columns(self._factor, self._stiffness, loads)

    def motion(self, load: Array, s: Array) -> Array:
        """q (n,) under loads (3 p,) N of the points and the reduced force."""
        pushed = np.flatnonzero(load)
        return load[pushed] @ self._shapes[pushed] - self.vectors @ s

    def _evaluate(self, load: Array, s: Array) -> Array:
        """V^T r, K q being known: V^T K q = (W V)^T h - s."""
        pushed = summed(self._comm, self.vectors.T @ self.force.change(self.motion(load, s)))
        return pushed - (self.tire.seen.T @ load - s)

    def _jacobian(self, load: Array, s: Array) -> Array:
        """V^T (dF/dq - K) V."""
        inside = self._cells.between(self.vectors, self.motion(load, s))
        return inside - np.eye(len(s))

    def visit(self, road: Ground) -> Trained:
        """Climb a road and learn from the states on the way."""
        steps = np.ceil(road.largest / self.settings.step - 1e-9)
        done, size, state = 0.0, 1.0 / max(steps, 1.0), self.tire.rest()
        smallest = _SMALLEST * size
        found = Trained(str(road), 0, 0.0, 0.0, "reduced")
        while done < 1.0 - 1e-9:
            part = min(1.0, done + size)
            try:
                state = self._learnt(road.times(part), state, found)
            except (ConvergenceError, np.linalg.LinAlgError) as error:
                size /= 2
                if size < smallest:
                    found.how = f"to {100 * done:.0f} % of its height: {error}"
                    break
                continue
            done = part
        self._compress()
        self.record.append(found)
        self._report(
            f"{road}: lacked {100 * found.lacked:.1f} %, left {100 * found.left:.1f} %, {found.how}, "
            f"{self.vectors.shape[1]} vectors, {len(self.motions)} states, {self.elements.tangents} tangents, "
            f"{self.tire.evaluations} evaluations"
        )
        return found

    def follow(self, ways: Array, under: Callable[[float], Ground]) -> None:
        """Learn from a road that passes, where it is `under` the tire after the `ways` (n,) m.

        Greedily: each fourth way, then those half between, then the others beside one of these that lacked `FAR`: the first ones
        lack much whatever lies beside them.
        """
        lacked: dict[int, float] = {}
        for stride in (4, 2, 1):
            last, lacked = lacked, {}
            for number in range(stride % 4, len(ways), 2 * stride if stride < 4 else stride):
                beside = [last.get(number + side, 0.0) for side in (-stride, stride)]
                if stride > 1 or max(beside) > FAR:
                    lacked[number] = self.visit(under(float(ways[number]))).lacked

    @property
    def states(self) -> tuple[Array, Array]:
        """Motions and answers K^-1 r (n, s) of all states, half-turned copies too."""
        return self._with_turned(self.motions), self._with_turned(self.answers)

    def _learnt(self, road: Ground, before: Standing, found: Trained) -> Standing:
        """The state on a road, solved for again while the vectors lack some of its K^-1 r."""
        # Vectors may have joined on the way to a state that was not found.
        lacking = self.vectors.shape[1] - len(before.s)
        before = replace(before, s=np.append(before.s, np.zeros(lacking)))
        for turn in range(self.settings.turns):
            state = self._solved(road, before, found)
            motion = self.motion(state.load, state.s)
            share, answer, rest = self._lacking(motion)
            if not turn:
                found.lacked = max(found.lacked, share)
            if share <= self.settings.share:
                break
            before = self._grown(state, rest)
        else:
            with suppress(ConvergenceError):
                state, motion = self._by_elements(road, motion, before, found)
                share, answer, _ = self._lacking(motion)
        # States on the way are none of the tire's.
        self.motions.append(motion)
        self.answers.append(answer)
        found.left, found.states = max(found.left, share), found.states + 1
        return state

    def _compress(self) -> None:
        """Vectors of all answers so far in place of those that joined one by one; more of them than are kept at last,
        with which more roads are climbed to their height."""
        if not self.answers:
            return
        before = multiply(self._stiffness, self.vectors)
        self.vectors, _ = decomposed(self.force, *self.states, self.settings.share / 4, _MANY)
        overlap = summed(self._comm, self.vectors.T @ before)
        self.tire.seen = self.elements.seen(self.vectors)
        self.tire.jacobian = overlap @ self.tire.jacobian @ overlap.T

    def _with_turned(self, fields: list[Array]) -> Array:
        """Fields (n, s) of all states, followed by their half-turned copies."""
        own = np.stack(fields, axis=1)
        return own if self.turn is None else np.hstack([own, self.turn(own)])

    def _lacking(self, motion: Array) -> tuple[float, Array, Array]:
        """Share of a state that the vectors lack, its K^-1 r (n,), and the part of it outside them."""
        forces = self.force.nonlinear(motion[:, None])
        answers = self.answer(forces)
        off = outside(self.force, self.vectors, answers, forces)
        share = off / np.maximum(sizes(self.force, motion[:, None], answers), _LEAST)
        inside = summed(self._comm, self.vectors.T @ forces)
        return float(share[0]), answers[:, 0], (answers - self.vectors @ inside)[:, 0]

    def _solved(self, road: Ground, before: Standing, found: Trained) -> Standing:
        """By the reduced tire, otherwise by the elements from the state before."""
        try:
            return self.tire.solve(road, before)
        except (ConvergenceError, np.linalg.LinAlgError):
            return self._by_elements(road, self.motion(before.load, before.s), before, found)[0]

    def _by_elements(
        self, road: Ground, motion: Array, before: Standing, found: Trained
    ) -> tuple[Standing, Array]:
        """The elements' state and motion from one near by, whose K^-1 r the vectors then hold."""
        found.how = "elements"
        motion = self.elements.solve(road, motion, _TANGENTS)
        stood = self.elements.standing(motion, road)
        self._grown(replace(stood, s=before.s), self._lacking(motion)[2])
        s = summed(self._comm, self.vectors.T @ self.force.nonlinear(motion[:, None]))[:, 0]
        return replace(stood, s=s), motion

    def _grown(self, state: Standing, rest: Array) -> Standing:
        """Let what the vectors lack join them, with its half-turned copy; the state in the new ones."""
        tire, before = self.tire, self.vectors.shape[1]
        more = [rest] if self.turn is None else [rest, self.turn(rest[:, None])[:, 0]]
        for one in more:
            one = one[:, None]
            for _ in range(2):
                pushed = multiply(self._stiffness, one)
                one = one - self.vectors @ summed(self._comm, self.vectors.T @ pushed)
            size = np.sqrt(summed(self._comm, np.sum(one * multiply(self._stiffness, one))))
            if size > _NONE:
                self.vectors = np.hstack([self.vectors, one / size])
        tire.seen = self.elements.seen(self.vectors)
        added = self.vectors.shape[1] - before
        tire.jacobian = np.pad(tire.jacobian, (0, added))
        return replace(state, s=np.append(state.s, np.zeros(added)))

    def concluded(self) -> Training:
        """Vectors and weights from all states."""
        found = trained_on(self.force, *self.states, self.settings, self.record)
        return replace(found, tangents=self.elements.tangents, evaluations=self.tire.evaluations)


def trained_on(
    force: RestoringForce,
    motions: Array,
    answers: Array,
    settings: Settings,
    record: list[Trained],
) -> Training:
    """Vectors and weights from the motions and K^-1 r (n, s) of states. Collective."""
    vectors, singular = decomposed(force, motions, answers, settings.kept, settings.most)
    forces, scale = (
        multiply(force.operators.stiffness, answers),
        _scale(sizes(force, motions, answers)),
    )
    left = outside(force, vectors, answers, forces) / scale
    given = force, vectors, motions, forces, scale, settings.tolerance
    cells, weights, error = weighted_cells(*given)
    return Training(
        force=reduced_force(force, vectors, cells, weights),
        vectors=vectors,
        record=record,
        states=motions.shape[1],
        left=float(left.max()),
        error=error,
        singular=singular,
    )


class CellTangents:
    """V^T (dF/dq) V from the cells' stiffnesses, some cells at a time. Collective."""

    def __init__(self, force: RestoringForce) -> None:
        self._force = force
        whole = cell_forms(force.body, tangent(force.body, force.work), 2)
        cells, local = len(whole.place), len(force.body.u.x.array)
        self._parts = []
        for first in range(0, cells, _CELLS):
            part = whole.only(np.arange(first, min(first + _CELLS, cells)))
            place = part.place.ravel()
            ones = np.ones(len(place)), (place, np.arange(len(place)))
            self._parts.append((part, sparse.csr_matrix(ones, (local, len(place)))))

    def between(self, vectors: Array, motion: Array) -> Array:
        """(k, k) of V (n, k) at a motion (n,)."""
        force, rest = self._force, self._force.body.u.x.array.copy()
        at_nodes = np.stack([force.local(one) - rest for one in vectors.T], axis=1)
        here, pushed = force.local(motion), np.zeros(at_nodes.shape)
        for part, spread in self._parts:
            size = part.place.shape[1]
            product = part(here).reshape(-1, size, size) @ at_nodes[part.place]
            pushed += spread @ product.reshape(-1, vectors.shape[1])
        return summed(force.body.comm, at_nodes.T @ pushed)


def train(
    force: RestoringForce,
    points: ContactPoints,
    roads: Sequence[Ground],
    settings: Settings = Settings(),
    report: Callable[[str], None] = lambda text: None,
) -> Training:
    """The reduced force of a tire trained on `roads`, to be climbed in their order. Collective.

    Where the tire is symmetric under the half turn, its half-turned states are taken, too.
    """
    trainer = Trainer(force, points, settings, report)
    for road in roads:
        trainer.visit(road)
    return trainer.concluded()


def _scale(size: Array) -> Array:
    """Sizes of states by which errors are divided: those of the smallest motions are not told from none."""
    return np.maximum(size, _SMALL * size.max())


def decomposed(
    force: RestoringForce, motions: Array, answers: Array, kept: float, most: int
) -> tuple[Array, Array]:
    """V (n, k), V^T K V = 1, of states' motions and answers K^-1 r (n, s), and the singular values, of answers over
    sizes: the fewest vectors, at most `most`, that lack no more than the share `kept` of any state. Collective."""
    forces = multiply(force.operators.stiffness, answers)
    gram = summed(force.body.comm, answers.T @ forces)
    scale = 1 / _scale(sizes(force, motions, answers))
    squares, turn = np.linalg.eigh(scale[:, None] * (gram + gram.T) / 2 * scale)
    squares, turn = np.maximum(squares[::-1], 0.0), turn[:, ::-1]
    lacking = (squares * turn**2).sum(axis=1)[:, None] - np.cumsum(squares * turn**2, axis=1)
    enough = np.flatnonzero(lacking.max(axis=0) <= kept**2)
    count = min(int(enough[0]) + 1 if len(enough) else len(squares), most)
    count = min(count, int((squares > 1e-14 * squares[0]).sum()))
    vectors = answers @ (scale[:, None] * turn[:, :count] / np.sqrt(squares[:count]))
    return vectors, np.sqrt(squares)


def weighted_cells(
    force: RestoringForce,
    vectors: Array,
    motions: Array,
    forces: Array,
    scale: Array,
    tolerance: float,
) -> tuple[Array, Array, float]:
    """Numbers (c,) of cells, ascending, their weights (c,), and the relative error of V^T r that is left.

    min |G w - G 1| over w >= 0, G_(s j),e = V_j^T r_e(q_s) / scale_s, by the normal equations. Collective.
    """
    body, comm = force.body, force.body.comm
    forms = cell_forms(body, force.work, 1)
    rest = body.u.x.array.copy()
    size = forms.place.shape[1]
    stiffness = cell_forms(body, tangent(body, force.work), 2)(rest).reshape(-1, size, size)
    at_rest = forms(rest)
    local = np.stack(
        [force.local(one)[forms.place] - rest[forms.place] for one in vectors.T], axis=-1
    )
    wanted = summed(comm, vectors.T @ forces).T  # (s, k)
    count = comm.allgather(len(at_rest))
    first = sum(count[: comm.rank])
    normal, right = np.zeros((sum(count),) * 2), np.zeros(sum(count))
    for motion, target, by in zip(motions.T, wanted, scale, strict=True):
        here = force.local(motion)
        own = forms(here) - at_rest
        own -= np.matmul(stiffness, (here - rest)[forms.place][:, :, None])[:, :, 0]
        part = np.zeros((len(target), sum(count)))
        part[:, first : first + len(own)] = np.matmul(own[:, None], local)[:, 0].T / by
        part = summed(comm, part)
        normal += part.T @ part
        right += part.T @ (target / by)
    total = float(((wanted / scale[:, None]) ** 2).sum())
    number = np.concatenate(comm.allgather(forms.number))
    weights, error = nonnegative(normal, right, total, tolerance)
    kept = np.flatnonzero(weights)
    order = kept[np.argsort(number[kept])]
    return number[order], weights[order], error


def nonnegative(normal: Array, right: Array, total: float, tolerance: float) -> tuple[Array, float]:
    """Weights w >= 0 with |G w - b| <= tolerance |b| with few of them not 0, and |G w - b| / |b|.

    From G^T G, G^T b and |b|^2, by the active set of Lawson and Hanson (1974), stopped at the tolerance.
    """
    weights = np.zeros(len(right))
    chosen: list[int] = []
    while True:
        residual = weights @ normal @ weights - 2 * right @ weights + total
        error = float(np.sqrt(max(residual, 0.0) / total))
        slope = right - normal @ weights
        slope[chosen] = -np.inf
        best = int(slope.argmax())
        if error <= tolerance or not slope[best] > 0 or len(chosen) >= len(right):
            return weights, error
        chosen.append(best)
        while True:
            trial = np.zeros_like(weights)
            trial[chosen] = np.linalg.lstsq(
                normal[np.ix_(chosen, chosen)], right[chosen], rcond=1e-13
            )[0]
            low = [c for c in chosen if trial[c] <= 0]
            if not low:
                weights = trial
                break
            part = min(weights[c] / (weights[c] - trial[c]) for c in low)
            weights = weights + part * (trial - weights)
            chosen = [c for c in chosen if weights[c] > 1e-14 * weights.max(initial=0.0)]
            weights[np.setdiff1d(np.arange(len(weights)), chosen)] = 0.0
            if not chosen:
                return weights, error


def half_turn(force: RestoringForce) -> Callable[[Array], Array] | None:
    """The half turn about the vertical of fields (n, m) on own unknowns; None if it changes the tire. Collective."""
    body, operators = force.body, force.operators
    if not looks_the_same(body.ring, AT_REST):
        return None
    lattice = body.lattice
    around, count = lattice.shape
    section = lattice.section
    image = np.abs(section[:, None] * [1, -1] - section).sum(axis=-1).argmin(axis=1)
    turned = ((-np.arange(around) % around)[:, None] * count + image).ravel()

    def turn(fields: Array) -> Array:
        out = np.empty_like(fields)
        for k, one in enumerate(fields.T):
            whole = body.everywhere(operators.spread(one))
            out[:, k] = operators.restrict((whole[turned] * TURN)[body.ids])
        return out

    trial = operators.restrict(1e-2 * body.owned(force.body.u.x.array))
    forces = force.change(turn(trial[:, None])[:, 0])
    straight = turn(force.change(trial)[:, None])[:, 0]
    off, size = summed(body.comm, np.array([np.sum((forces - straight) ** 2), forces @ forces]))
    return turn if off <= _SAME**2 * size else None
