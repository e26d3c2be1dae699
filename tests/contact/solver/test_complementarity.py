"""The contact solvers against each other, against enumeration, and where they are easily lost."""

import itertools

import numpy as np
import pytest

from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.projected_cg import MatrixCompliance, ProjectedCG
from tireroad.contact.solver.snes_vi import SnesVI
from tireroad.contact.solver.solvers import make_solver
from tireroad.contact.tread.compliance import half_space_compliance
from tireroad.fem.errors import ConvergenceError, InputError

SOLVERS = ("active-set", "snes-vi")


def random_compliance(rng: np.random.Generator, n: int, skew: float) -> np.ndarray:
    factor = rng.standard_normal((n, n))
    symmetric = factor @ factor.T / n + 0.1 * np.eye(n)
    turn = rng.standard_normal((n, n))
    return symmetric + skew * (turn - turn.T)


def enumerate_solution(matrix: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The one set of touching points, of all 2^n, that gives no wrong sign."""
    n = len(q)
    found = []
    for chosen in itertools.product((False, True), repeat=n):
        active = np.array(chosen)
        force = np.zeros(n)
        if active.any():
            force[active] = np.linalg.solve(matrix[np.ix_(active, active)], -q[active])
        if np.all(force >= 0.0) and np.all((matrix @ force + q)[~active] >= 0.0):
            found.append(force)
    assert len(found) == 1
    return found[0]


@pytest.mark.parametrize(
    ("solver", "skew"),
    [("active-set", 0.0), ("active-set", 2.0), ("snes-vi", 0.0), ("snes-vi", 0.1)],
)
@pytest.mark.parametrize("n", [1, 2, 5, 9])
def test_agrees_with_enumeration(solver: str, skew: float, n: int) -> None:
    rng = np.random.default_rng(100 * n + int(10 * skew))
    for _ in range(5):
        matrix, q = random_compliance(rng, n, skew), rng.standard_normal(n)
        expected = enumerate_solution(matrix, q)
        force = make_solver(solver, matrix).solve(q)
        assert np.allclose(force, expected, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("skew", [0.0, 0.02])
def test_solvers_agree(skew: float) -> None:
    rng = np.random.default_rng(7)
    matrix = random_compliance(rng, 120, skew)
    ours, petsc = make_solver("active-set", matrix), make_solver("snes-vi", matrix)
    for _ in range(5):
        q = rng.standard_normal(120)
        a, b = ours.solve(q), petsc.solve(q)
        assert np.abs(a - b).max() < 1e-9 * a.max()
        assert np.array_equal(ours.active, petsc.active)


def exchange_alone(matrix: np.ndarray, q: np.ndarray, active: np.ndarray) -> list[bytes]:
    """The sets that full exchange without safeguard passes through, to the end or 60 of them."""
    passed = [active.tobytes()]
    for _ in range(60):
        force = np.zeros(len(q))
        force[active] = np.linalg.solve(matrix[np.ix_(active, active)], -q[active])
        wrong = np.where(active, force, matrix @ force + q) < -1e-12
        if not wrong.any():
            break
        active = active ^ wrong
        passed.append(active.tobytes())
    return passed


@pytest.mark.parametrize("copies", [1, 3, 10])
def test_backup_ends_where_full_exchange_cycles(copies: int) -> None:
    # Positive definite (0.25, 0.25, 2.5), after Ben Gharbia and Gilbert, Math. Program. 134 (2012).
    block = np.array([[1.0, 0.0, 1.5], [1.5, 1.0, 0.0], [0.0, 1.5, 1.0]])
    matrix, q = np.kron(np.eye(copies), block), -np.ones(3 * copies)
    start = np.arange(3 * copies) % 3 == 0
    passed = exchange_alone(matrix, q, start)
    assert len(set(passed)) < len(passed)
    assert np.allclose(ActiveSet(matrix).solve(q, start), 0.4, atol=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.5, 3.0])
def test_bad_guess_and_strong_skew_part(share: float) -> None:
    rng = np.random.default_rng(11)
    matrix, turn = random_compliance(rng, 200, 0.0), rng.standard_normal((200, 200))
    turn -= turn.T
    matrix += share * np.linalg.norm(matrix, 2) / np.linalg.norm(turn, 2) * turn
    q, contact = rng.standard_normal(200), ActiveSet(matrix)
    force = contact.solve(q, rng.random(200) < 0.5)
    gap = matrix @ force + q
    assert force.min() >= 0.0 and gap.min() > -1e-11 and abs(force @ gap) < 1e-11 * force.sum()
    assert contact.iterations < 60


@pytest.mark.parametrize("make", [ActiveSet, SnesVI, lambda a: ProjectedCG(MatrixCompliance(a))])
def test_the_penetration_is_that_of_the_answer_as_solved(make) -> None:
    """The gaps at touching points are set to 0 afterwards: what they were before is told apart."""
    rng = np.random.default_rng(5)
    matrix, q = random_compliance(rng, 60, 0.0), rng.standard_normal(60)
    contact = make(matrix)
    force = contact.solve(q)
    assert contact.gap[force > 0.0].max() == 0.0
    deepest = -(matrix @ force + q).min()
    assert 0.0 < contact.penetration < 1e-7 * np.abs(q).max()
    assert contact.penetration == pytest.approx(deepest, rel=0.5, abs=1e-14 * np.abs(q).max())


@pytest.mark.parametrize("solver", SOLVERS)
def test_degenerate_points(solver: str) -> None:
    rng = np.random.default_rng(3)
    matrix = random_compliance(rng, 60, 0.01)
    force = np.maximum(rng.standard_normal(60), 0.0)
    # Gap zero everywhere: half of the points have both force and gap zero.
    solution = make_solver(solver, matrix).solve(-matrix @ force)
    assert np.allclose(solution, force, atol=1e-10)


@pytest.mark.parametrize("solver", SOLVERS)
def test_near_no_contact_and_near_full_contact(solver: str) -> None:
    x = np.linspace(-1.0, 1.0, 41)
    matrix = np.exp(-np.abs(x[:, None] - x[None, :])) + 0.1 * np.eye(41)
    bowl = 1e-3 * x**2
    contact = make_solver(solver, matrix)
    assert np.all(contact.solve(bowl + 1e-12) == 0.0)
    one = contact.solve(bowl - 1e-9)
    assert np.flatnonzero(one).tolist() == [20]
    full = contact.solve(bowl - 1.0)
    assert np.all(full > 0.0)
    assert np.abs(matrix @ full + bowl - 1.0).max() < 1e-12
    assert np.all(contact.solve(bowl) == 0.0)


@pytest.mark.parametrize("solver", SOLVERS)
def test_no_contact_gives_the_gap_back(solver: str) -> None:
    contact = make_solver(solver, np.eye(4))
    q = np.array([1.0, 2.0, 0.5, 3.0])
    assert np.array_equal(contact.solve(q), np.zeros(4))
    assert np.array_equal(contact.gap, q) and not contact.active.any()


def test_same_set_costs_no_factorisation_and_gives_the_same_bits() -> None:
    rng = np.random.default_rng(5)
    contact = ActiveSet(random_compliance(rng, 80, 0.01))
    q = rng.standard_normal(80)
    first, count = contact.solve(q), contact.factorisations
    assert np.array_equal(contact.solve(q), first)
    assert contact.factorisations == count


def test_reference_at_rest_is_returned_bit_for_bit() -> None:
    rng = np.random.default_rng(6)
    matrix = random_compliance(rng, 80, 0.01)
    contact = ActiveSet(matrix)
    static = contact.solve(rng.standard_normal(80))
    at_rest = np.where(static > 0.0, 0.0, contact.gap)
    force = static
    for _ in range(100):
        force = contact.solve(at_rest, reference=static)
    assert np.array_equal(force, static)
    assert np.array_equal(ActiveSet(matrix).solve(at_rest, reference=static), static)


@pytest.mark.parametrize("solver", SOLVERS)
def test_reference_only_moves_the_origin(solver: str) -> None:
    rng = np.random.default_rng(8)
    matrix, reference = random_compliance(rng, 50, 0.01), np.abs(rng.standard_normal(50))
    q = rng.standard_normal(50)
    shifted = make_solver(solver, matrix).solve(q + matrix @ reference, reference=reference)
    assert np.allclose(shifted, make_solver(solver, matrix).solve(q), atol=1e-10)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_units_do_not_matter(solver: str, unit: float) -> None:
    rng = np.random.default_rng(9)
    matrix, q = random_compliance(rng, 40, 0.01), rng.standard_normal(40)
    expected = make_solver(solver, matrix).solve(q)
    assert np.allclose(make_solver(solver, unit * matrix).solve(q) * unit, expected, atol=1e-10)


def test_clipping_negative_forces_is_no_solution() -> None:
    # The thesis (3.7), 5.3.2: solve for all points that overlap, then set negative forces to zero.
    side = (np.arange(21) - 10) * 1e-3
    x, y = (c.ravel() for c in np.meshgrid(side, side, indexing="ij"))
    points = np.column_stack((x, y))
    matrix = half_space_compliance(points, np.full_like(points, 5e-4), 3.4e8, 0.49)
    q = (x**2 + y**2) / (2 * 0.1) - 3e-4
    force = ActiveSet(matrix).solve(q)
    overlap = q < 0.0
    clipped = np.zeros_like(q)
    clipped[overlap] = np.linalg.solve(matrix[np.ix_(overlap, overlap)], -q[overlap])
    clipped = np.maximum(clipped, 0.0)
    gap = matrix @ clipped + q
    assert clipped.sum() > 1.3 * force.sum()
    # Without the pulling points, the pushing ones float above the road they are to press on.
    assert gap[clipped > 0.0].max() > 0.1 * 3e-4


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_gaps_that_are_not_finite_stop_the_run(solver: str, value: float) -> None:
    with pytest.raises(ConvergenceError, match="grown without bound"):
        make_solver(solver, np.eye(3)).solve(np.array([0.0, value, 1.0]))


@pytest.mark.parametrize("solver", SOLVERS)
def test_compliance_without_unique_solution_is_refused(solver: str) -> None:
    with pytest.raises(InputError, match="not positive definite"):
        make_solver(solver, np.diag([1.0, 0.0, 1.0]))
    with pytest.raises(InputError, match="square"):
        make_solver(solver, np.ones((2, 3)))


def test_unknown_solver_is_named() -> None:
    with pytest.raises(InputError, match="gauss"):
        make_solver("gauss", np.eye(2))
