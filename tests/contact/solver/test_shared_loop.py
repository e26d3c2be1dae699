"""A loop that processes take together: states and rows spread, one answer, the same bits on each."""

import numpy as np
import pytest
from mpi4py import MPI

from tireroad.contact.loop import Drive, DrivenTire, RootSolve, Solved, roll
from tireroad.contact.solver.projected_cg import MatrixCompliance
from tireroad.contact.solver.solvers import make_solver
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.compliance import half_space_compliance
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.recursion import Recursion
from tireroad.tests.validation.cases import RollingStrip, oval_patch

PATCH = oval_patch((13, 9), (0.012, 0.012), 500.0)
COUNT = len(PATCH.points)
STEP, STEPS, SPEED = 2e-4, 40, 20.0


def rolled(comm: MPI.Comm, solver: str, has_friction: bool, driven: bool = False) -> np.ndarray:
    """Forces, horizontal forces, motions and axle force of each step, (STEPS, n); `driven` as a run drives it."""
    strip = RollingStrip(speed=SPEED)
    response = strip.response(PATCH.points, 6, 4, 4)
    if has_friction:
        response = strip.horizontal_response(PATCH.points, 6, 4, 3.0)
    tire = Recursion(response=response, step=STEP, scheme="linear", comm=comm, look_ahead=True)
    tread = half_space_compliance(PATCH.points[:, :2], PATCH.half_sizes, 5e6, 0.45)
    normal = make_solver(solver, tire.same_step[:COUNT, :COUNT] + tread)
    friction = None
    if has_friction:
        brush = Brush(BrushLaw(3e4, 0.6, (0.02, 0.01)), PATCH.points[:, 0], PATCH.line, SPEED, STEP)
        brush.begin(PATCH.force > 0)
        friction = BrushFriction(brush, tire.same_step, None)
    if driven:
        tire = DrivenTire(tire, np.zeros((STEPS + 1, 0)), np.zeros((0, 3)))
    drive = Drive(lambda x, y: 1e-4 * np.sin(80 * x + 10 * y), lambda t: 0.0, SPEED)
    steps = roll(tire, normal, PATCH, drive, STEP, STEPS, friction)
    parts = ([s.force, s.horizontal.ravel(), s.moved, s.gap, s.axle_force] for s in steps)
    return np.array([np.concatenate(part) for part in parts])


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("solver", "has_friction", "driven"),
    [
        ("active-set", False, False),
        ("active-set", True, False),
        ("projected-cg", False, False),
        ("active-set", False, True),
    ],
)
def test_processes_find_together_what_each_finds_alone(
    solver: str, has_friction: bool, driven: bool
) -> None:
    comm = MPI.COMM_WORLD
    alone, together = (rolled(c, solver, has_friction, driven) for c in (MPI.COMM_SELF, comm))
    # Conjugate gradients end at 1e-10 of the scale, the turns of friction at 1e-8.
    tolerance = 1e-10 if solver == "active-set" and not has_friction else 1e-6
    forces = np.abs(alone[:, :COUNT]).max()
    assert np.abs(together[:, :COUNT] - alone[:, :COUNT]).max() < tolerance * forces
    np.testing.assert_allclose(together, alone, atol=tolerance * forces, rtol=1e-5)
    first = comm.bcast(together)
    assert np.array_equal(first, together)  # or processes would take different decisions


class Looking:
    """What is asked of a tire that looks ahead."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def look_ahead(self) -> None:
        self.asked.append("look")

    def exchange(self) -> None:
        self.asked.append("exchange")


@pytest.mark.mpi
def test_what_stops_the_root_process_stops_all() -> None:
    """And a number that is not a number from one solve leaves none behind for the next. The root predicts before it solves,
    the others once they have met."""
    comm, ahead = MPI.COMM_WORLD, Looking()
    together = RootSolve(comm, 2, ahead)
    force, gap = np.array([1.0, 0.0]), np.array([0.0, 2.0])
    answer = Solved(force, gap, np.zeros((2, 0)), 1e-12, 3e-13)

    def predict() -> np.ndarray:
        ahead.asked.append("predict")
        return gap

    def refused(free: np.ndarray) -> Solved:
        raise ConvergenceError("no consistent set")

    def solved(free: np.ndarray) -> Solved:
        return answer if comm.rank == 0 and free is gap else refused(free)

    for _ in range(2):
        with pytest.raises(ConvergenceError, match="no consistent set"):
            together(predict, refused, horizontal=False, leans=False)
        free, found = together(predict, solved, horizontal=False, leans=False)
        assert all(np.array_equal(*pair) for pair in zip(found[:5], answer[:5], strict=True))
        assert free is gap
    root, other = ["predict", "look", "exchange"], ["look", "exchange", "predict"]
    expected = ["predict"] if comm.size == 1 else other if comm.rank else root
    assert ahead.asked[-len(expected) :] == expected


def test_the_parts_of_a_matrix_are_those_of_the_whole() -> None:
    """Rows or columns, whichever are fewer, are picked first."""
    rng = np.random.default_rng(3)
    matrix = rng.standard_normal((12, 12))
    compliance = MatrixCompliance(matrix)
    few, many = np.array([1, 7]), np.array([0, 3, 4, 9, 11])
    for rows, columns in ((few, many), (many, few), (many, many), (few[:0], many)):
        block = compliance.block(rows, columns)
        assert np.array_equal(block, matrix[np.ix_(rows, columns)])
        assert block.flags.f_contiguous
    force = rng.standard_normal(12)
    assert np.allclose(compliance.apply(force), matrix @ force, rtol=1e-12)
