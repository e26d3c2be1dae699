"""Normal and horizontal forces at once on a grid: resumed, split, with all of the tire's compliance. The oracle is in test_oracle."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from tireroad.contact.loop import MEETING, ContactProblem, Drive
from tireroad.contact.solver import grid_newton
from tireroad.contact.solver.projected_cg import ProjectedCG, SpreadCompliance
from tireroad.contact.solver.stick_slip import TOLERANCE, BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.kernel import GridPlaces, KernelTread
from tireroad.contact.tread.layer import LayerInfluence, LayerShear
from tireroad.contact.tread.shear import KernelShear
from tireroad.fem.errors import ConvergenceError
from tireroad.tests.validation.cases import oval_patch

STEP, SPEED, STEPS, FRICTION = 1e-4, 20.0, 12, 0.6
COUNTS, NODES, SPACING = (25, 17), (13, 9), (0.004, 0.005)


def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 2e-4 * (np.sin(90 * x + 40 * y) + np.sin(310 * x - 170 * y))


def slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    one, two = np.cos(90 * x + 40 * y), np.cos(310 * x - 170 * y)
    return 2e-4 * np.stack([90 * one + 310 * two, 40 * one - 170 * two], axis=-1)


def problem_of(places_to: float = MEETING, sliding_to: float = TOLERANCE) -> ContactProblem:
    """A bonded layer on nodes twice as far apart as the points; tolerances of places and of stick and slip."""
    both = [
        np.maximum(1 - np.abs(np.arange(c)[:, None] / 2 - np.arange(n)), 0.0)
        for c, n in zip(COUNTS, NODES, strict=True)
    ]
    weights = sparse.csr_matrix(np.kron(*both))
    patch = replace(oval_patch(COUNTS, SPACING, 500.0), weights=weights)
    places = GridPlaces(COUNTS, SPACING, np.arange(len(patch.points)))
    at = np.stack([a.ravel() for a in np.indices(NODES)], axis=-1) * 2 * np.array(SPACING)
    apart = np.linalg.norm(at[:, None] - at[None], axis=-1)
    parts = [[1.0, 0.1, 0.0], [0.1, 0.6, 0.0], [0.0, 0.0, 0.6]]
    same_step = np.kron(parts, 4e-6 * np.exp(-apart / 0.01))
    normal = KernelTread(places, LayerInfluence(5e6, 0.45, 0.008))
    p = len(at)
    solver = ProjectedCG(SpreadCompliance(same_step[:p, :p], weights, normal))
    brush = Brush(
        BrushLaw(np.inf, FRICTION, (0.05, 0.02)), patch.points[:, 0], patch.line, SPEED, STEP
    )
    brush.begin(patch.force > 0)
    shear = KernelShear(places, LayerShear(5e6, 0.45, 0.008))
    coupling = BrushFriction(brush, same_step, weights, shear, tolerance=sliding_to)
    return ContactProblem(patch, same_step, solver, coupling, tolerance=places_to)


def rolled(problem: ContactProblem, first: int, last: int) -> np.ndarray:
    """Forces (n, 3, c) N of the steps after `first` up to `last`."""
    drive = Drive(height, lambda t: 0.0, SPEED, slope)
    free, found = np.zeros(len(problem.change)), []
    for _, roads in drive.roads(problem.patch, STEP, last, first, moving=True):
        for road in roads:
            solved = problem.solve(road, None, free)
            problem.commit(solved)
            found.append(np.concatenate([solved.force[None], solved.horizontal]))
    return np.array(found)


def test_a_loop_taken_up_again_has_the_same_bits() -> None:
    whole, begun, resumed = problem_of(), problem_of(), problem_of()
    expected = rolled(whole, 0, STEPS)
    rolled(begun, 0, STEPS // 2)
    resumed.set_state({name: value.copy() for name, value in begun.state().items()})
    assert np.array_equal(rolled(resumed, STEPS // 2, STEPS), expected[STEPS // 2 :])
    assert resumed.solutions == whole.solutions
    force = expected[-1]
    slides = np.hypot(*force[1:]) > 0.999 * FRICTION * force[0]
    assert 10 < np.count_nonzero(slides & (force[0] > 0)) < np.count_nonzero(force[0]) - 5


def again_and_again(problem: ContactProblem, push: float, steps: int = 6) -> np.ndarray:
    """Forces (n, c) N of steps each solved for displacements that are `push` m off, then again for none."""
    drive = Drive(height, lambda t: 0.0, SPEED, slope)
    none, found = np.zeros(len(problem.change)), []
    for _, roads in drive.roads(problem.patch, STEP, steps, 0, moving=True):
        for road in roads:
            if push:
                problem.commit(problem.solve(road, None, none + push))
            for _ in range(20 if push else 1):
                solved = problem.solve(road, None, none, again=bool(push))
                problem.commit(solved)
            found.append(solved.force)
    return np.array(found)


def test_a_step_solved_again_is_as_if_it_had_been_solved_once(tight) -> None:
    """Bristles and forces go back to the step before, whatever displacements were tried first."""
    once, twice = (again_and_again(problem_of(1e-9, 1e-9), push) for push in (0.0, 1e-5))
    assert np.abs(twice - once).max() < 1e-6 * once.max()


def test_all_of_the_tire_and_its_neighbourhood_find_the_same(monkeypatch) -> None:
    """A Newton step needs the tire's compliance only about; what is found is that of all of it."""
    monkeypatch.setattr(grid_newton, "GAP_TOLERANCE", 1e-11)
    monkeypatch.setattr(grid_newton, "NEAR", 2.6)
    some = problem_of()
    monkeypatch.setattr(grid_newton, "MOST", 0.0)
    every = problem_of()
    assert every._at_once is not None and every._at_once._near is None
    assert some._at_once is not None and some._at_once._near is not None
    both = [rolled(problem, 0, STEPS) for problem in (some, every)]
    # Horizontal forces end at 1e-3 of the largest, places where 3 % of deflections are left of gaps.
    assert np.abs(both[0] - both[1]).max() < 5e-3 * both[0].max()
    assert (
        np.abs(both[0].sum(axis=2) - both[1].sum(axis=2)).max()
        < 1e-3 * both[0][:, 0].sum(axis=1).max()
    )


def test_secants_save_newton_steps(monkeypatch) -> None:
    """What Newton steps lack of the tread's farther neighbours is known from the steps before."""
    monkeypatch.setattr(grid_newton, "NEAR", 2.6)
    found = {}
    for count in (8, 0):
        monkeypatch.setattr(grid_newton, "SECANTS", count)
        problem = problem_of()
        assert problem._at_once is not None
        problem._at_once.compiled.near = 1
        found[count] = rolled(problem, 0, STEPS), problem.solutions
    (mended, fewer), (plain, more) = found[8], found[0]
    assert fewer < 0.85 * more
    # Both are 2 % off in the mean square, as much as 3 % of deflections left of gaps by places make.
    assert np.linalg.norm(mended - plain) < 0.03 * np.linalg.norm(plain)
    load = plain[:, 0].sum(axis=1).max()
    assert np.abs((mended - plain).sum(axis=2)).max() < 3e-3 * load


@pytest.fixture
def tight(monkeypatch) -> pytest.MonkeyPatch:
    """Tolerances at which what is found depends on nothing but the problem."""
    monkeypatch.setattr(grid_newton, "GAP_TOLERANCE", 1e-11)
    monkeypatch.setattr(grid_newton, "READINGS", 40)
    return monkeypatch


def test_parts_that_do_not_converge_give_way_to_the_whole(tight) -> None:
    """A tread without its neighbours is no approximation; the loop finds so by itself."""
    expected = rolled(problem_of(1e-9, 1e-9), 0, STEPS)
    few = problem_of(1e-9, 1e-9)
    solver = few._at_once
    assert solver is not None
    solver.compiled.near = 0
    tight.setattr(grid_newton, "GROWN", 1.2)
    tight.setattr(grid_newton, "WHOLLY", 2 * STEPS)
    found = rolled(few, 0, STEPS)
    assert solver.wholly > 0
    assert few.lagging == 0
    assert np.abs(found - expected).max() < 1e-6 * expected.max()


def test_the_box_grows_where_points_beyond_it_touch(tight) -> None:
    """From a box that is too small forces are found as from one of all points."""
    beyond, grown, found = grid_newton._Step._beyond, [], []
    tight.setattr(
        grid_newton._Step, "_beyond", lambda step: grown.append(beyond(step)) or grown[-1]
    )
    rows, columns = np.divmod(np.arange(COUNTS[0] * COUNTS[1]), COUNTS[1])
    within = (rows >= 9) & (rows < 16) & (columns >= 6) & (columns < 11)
    for box in ((0, COUNTS[0], 0, COUNTS[1]), (9, 16, 6, 11)):
        problem = problem_of(1e-9, 1e-9)
        solver = problem._at_once
        assert solver is not None
        solver.force[:, ~within] = 0.0
        solver._set_box(box)
        found.append(rolled(problem, 0, 3))
        assert problem.lagging == 0
    assert any(grown)
    assert np.abs(found[1] - found[0]).max() < 1e-6 * found[0].max()


def test_what_newton_steps_do_not_find_is_found_by_turns(monkeypatch) -> None:
    """Normal forces under the horizontal ones and these under the former, until both are in balance: the same solution."""
    settle, found = grid_newton._Step.settle, []

    def never_both(step, normal: bool = True, plane: bool = True) -> bool:
        return settle(step, normal, plane) and not (normal and plane)

    for by_turns in (False, True):
        problem = problem_of(1e-9, 1e-9)
        rolled(problem, 0, 4)
        with monkeypatch.context() as here:
            if by_turns:
                here.setattr(grid_newton._Step, "settle", never_both)
            found.append(rolled(problem, 4, 5)[0])
        assert problem.lagging == 0
    assert np.abs(found[1] - found[0]).max() < 2e-4 * found[0].max()  # gaps to 1e-5 of the largest


def test_a_step_without_a_solution_of_both_is_split(monkeypatch) -> None:
    """Normal forces then are in balance with the horizontal ones of the step before, and these with the normal ones."""
    problem = problem_of()
    rolled(problem, 0, 4)
    settle, asked = grid_newton._Step.settle, []

    def never_both(step, normal: bool = True, plane: bool = True) -> bool:
        asked.append((normal, plane))
        return settle(step, normal, plane) and not (normal and plane)

    monkeypatch.setattr(grid_newton._Step, "settle", never_both)
    monkeypatch.setattr(grid_newton._Step, "alternate", lambda step: False)
    force, *t = rolled(problem, 4, 5)[0]
    assert asked == [(True, True), (True, False), (False, True)]
    assert problem.lagging == 1
    assert force.min() == 0.0
    assert (np.hypot(*t) <= FRICTION * force * (1 + 1e-9)).all()
    assert problem._at_once is not None and len(problem._at_once.index) < len(force)


def test_what_no_newton_step_settles_ends_the_run(monkeypatch) -> None:
    problem = problem_of()
    monkeypatch.setattr(grid_newton, "TURNS", 1)
    with pytest.raises(ConvergenceError, match="do not converge"):
        rolled(problem, 0, 1)
