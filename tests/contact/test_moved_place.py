"""The road is met where the points have moved to: closed forms of points on springs, and roads that give back what they take."""

import tracemalloc

import numpy as np
import pytest
from scipy.optimize import brentq

from tireroad.contact.loop import MEETING, ContactProblem, Drive, Loop
from tireroad.contact.patch import Patch
from tireroad.contact.roads.cell_mean import CellMean
from tireroad.contact.rolling import StaticTire
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.fem.errors import ConvergenceError
from tireroad.tests.validation.cases import oval_patch

ALONG_Z, IN_PLANE = 1e-6, 3e-6  # m/N: tires are up to three times as soft in the plane
SPEED, STEP = 10.0, 1e-4


def one_point() -> Patch:
    flag, none = np.zeros(1, bool), np.zeros(1)
    return Patch(
        index=np.zeros(1, int), points=np.zeros((1, 3)), half_sizes=np.full((1, 2), 5e-3), force=none, gap=none, edge=flag,
        line=np.zeros(1, int),
    )  # fmt: skip


class Ramp:
    """A road that rises for ever."""

    spacing, end = 1e-3, np.inf

    def height(self, x, y):
        return 0.3 * np.maximum(x, 0.0) + 0.0 * y


def over(
    patch: Patch, same_step: np.ndarray, drive: Drive, steps: int, tolerance: float = 1e-9
) -> tuple:
    p = len(patch.points)
    problem = ContactProblem(patch, same_step, ActiveSet(same_step[:p, :p]), tolerance=tolerance)
    blocks = list(Loop(StaticTire(same_step), problem).roll(drive, STEP, steps))
    time, vertical = (
        np.concatenate([getattr(b, name) for b in blocks]) for name in ("time", "force")
    )
    return time, vertical, np.concatenate([b.horizontal for b in blocks]), problem


@pytest.mark.parametrize("slope", [0.1, -0.3, 0.5])
def test_a_point_on_springs_presses_a_plane_normal_to_it(slope: float) -> None:
    """f (A_zz + r^2 A_xx) = h, the height that the plane would have under the point at rest."""
    compliance = np.diag([ALONG_Z, IN_PLANE, IN_PLANE])
    begun = 2e-3 if slope < 0 else 0.0
    drive = Drive(
        lambda x, y: begun + slope * x,
        lambda t: 0.0,
        SPEED,
        lambda x, y: np.stack([slope + 0 * x, 0 * x], -1),
    )
    time, vertical, horizontal, problem = over(one_point(), compliance, drive, 30)
    height = begun + slope * SPEED * time
    force = np.maximum(height, 0.0) / (ALONG_Z + slope**2 * IN_PLANE)
    assert vertical[:, 0] == pytest.approx(force, rel=1e-7)
    assert horizontal[:, 0, 0] == pytest.approx(-slope * force, rel=1e-7)
    assert problem.unsettled == 0


class Lost(StaticTire):
    """A tire that presses its points down and 10 km on."""

    def predict(self):
        return np.repeat([-1e-3, 1e4, 0.0], len(self.same_step) // 3)


def test_points_that_move_without_bound_end_a_run_before_memory_does() -> None:
    """Heights would be kept of all the road up to there, 480 MB of them."""
    same_step = np.diag([ALONG_Z, IN_PLANE, IN_PLANE])
    road = CellMean(Ramp(), np.zeros(1), one_point().half_sizes)
    problem = ContactProblem(one_point(), same_step, ActiveSet(same_step[:1, :1]))
    drive = Drive(road.height, lambda t: 0.0, SPEED, road.slope)
    tracemalloc.start()
    with pytest.raises(ConvergenceError, match="without bound"):
        list(Loop(Lost(same_step), problem).roll(drive, STEP, 1))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 1e7


def test_a_point_on_springs_over_waves_sideways_and_along() -> None:
    """The place solves x' = x - A_xx f r(x'), found here by bisection."""
    wave, high, across = 0.08, 4e-3, 0.4
    k = 2 * np.pi / wave

    def height(x, y):
        return high * (1 - np.cos(k * (x + across * y)))

    def slope(x, y):
        along = high * k * np.sin(k * (x + across * y))
        return np.stack([along, across * along], -1)

    compliance = np.diag([ALONG_Z, IN_PLANE, IN_PLANE])
    time, vertical, horizontal, problem = over(
        one_point(), compliance, Drive(height, lambda t: 0.0, SPEED, slope), 80
    )
    assert problem.unsettled == 0
    for at, f, plane in zip(time, vertical[:, 0], horizontal[:, 0], strict=True):
        # Along the wave's normal the point goes by s: f = h / A_zz, s = -A_xx f r.
        def off(s, at=at):
            here = SPEED * at + s * (1 + across**2)
            return s + IN_PLANE / ALONG_Z * height(here, 0.0) * slope(here, 0.0)[0]

        place = brentq(off, -0.02, 0.02, xtol=1e-15)
        here = SPEED * at + place * (1 + across**2)
        assert f == pytest.approx(height(here, 0.0) / ALONG_Z, rel=1e-6, abs=1e-6)
        assert plane == pytest.approx(-f * slope(here, 0.0), rel=1e-5, abs=1e-4 * f + 1e-6)


def elastic(patch: Patch) -> np.ndarray:
    """A symmetric, positive definite compliance between the points in z, x and y, which are coupled."""
    away = np.linalg.norm(patch.points[:, None] - patch.points[None], axis=-1)
    return np.kron([[1.0, 0.3, 0.1], [0.3, 2.5, 0.0], [0.1, 0.0, 2.0]], 1e-6 * np.exp(-away / 0.03))


@pytest.mark.parametrize("steep", [0.05, 0.1])
def test_an_elastic_tire_without_friction_takes_no_work_from_a_wave(steep: float) -> None:
    """Each wave gives back what it took: the mean force along the road is none. Read at the points' own places it drags."""
    patch = oval_patch((9, 5), (0.012, 0.015), 800.0)
    wave = 0.06
    high = steep * wave / (2 * np.pi)

    def height(x, y):
        return np.where(x > -1.0, high * np.sin(2 * np.pi * (x + 0.1 * y) / wave), 0.0)

    def slope(x, y):
        along = steep * np.cos(2 * np.pi * (x + 0.1 * y) / wave)
        return np.stack([along, 0.1 * along], -1)

    whole = round(wave / (SPEED * STEP))
    drive = Drive(height, lambda t: 0.0, SPEED, slope)
    _, vertical, horizontal, problem = over(patch, elastic(patch), drive, 3 * whole, MEETING)
    force = horizontal[whole:, :, 0].sum(axis=1)
    assert np.ptp(force) > 0.1 * steep * 800.0
    assert abs(force.mean()) < 2e-3 * np.ptp(force)
    assert problem.unsettled == 0 and vertical.min() >= 0.0


def test_with_friction_a_sticking_point_climbs_with_the_road() -> None:
    """Springs in place of rolling bristles hold a point that sticks: it moves along the slope by what its bristle yields."""
    compliance, stiffness, slope = np.diag([ALONG_Z, IN_PLANE, IN_PLANE]), 1e5, 0.3
    brush = Brush(
        BrushLaw(stiffness, 5.0, kind="spring"), np.zeros(1), np.zeros(1, int), SPEED, STEP
    )
    friction = BrushFriction(brush, compliance, None, tolerance=1e-12)
    patch = one_point()
    problem = ContactProblem(
        patch, compliance, ActiveSet(compliance[:1, :1]), friction, tolerance=1e-12
    )
    rise = 2e-3
    drive = Drive(
        lambda x, y: rise + slope * x,
        lambda t: 0.0,
        0.0,
        lambda x, y: np.stack([slope + 0 * x, 0 * x], -1),
    )
    block = next(Loop(StaticTire(compliance), problem).roll(drive, STEP, 1))
    vertical, along = block.force[0, 0], block.horizontal[0, 0, 0]
    # Force (t - f r, f + t r), base at u, tip at u - e with t = -K e; z = A_zz F_z meets rise + r (u - e).
    base = IN_PLANE * along
    t = along + slope * (vertical - slope * along) / (1 + slope**2)
    tip = base + t / stiffness
    assert t == pytest.approx(-stiffness * base, rel=1e-9)
    assert ALONG_Z * vertical == pytest.approx(rise + slope * tip, rel=1e-9)


@pytest.mark.parametrize("coefficient", [0.0, 0.6])
def test_a_step_solved_again_is_as_if_it_had_been_solved_once(coefficient: float) -> None:
    """Bristles, places and forces go back to the step before, whatever displacements were tried first."""
    patch = oval_patch((9, 5), (0.012, 0.015), 800.0)
    compliance, p = elastic(patch), len(patch.points)
    drive = Drive(
        lambda x, y: 5e-4 * np.sin(90 * x + 40 * y),
        lambda t: 0.0,
        SPEED,
        lambda x, y: 5e-4 * np.cos(90 * x + 40 * y)[..., None] * (90.0, 40.0),
    )

    def forces(pushes: tuple[float, ...]) -> np.ndarray:
        friction, found = None, []
        if coefficient:
            brush = Brush(BrushLaw(1e5, coefficient), patch.points[:, 0], patch.line, SPEED, STEP)
            brush.begin(patch.force > 0)
            friction = BrushFriction(brush, compliance, None, tolerance=1e-10)
        solver = ActiveSet(compliance[:p, :p])
        problem = ContactProblem(patch, compliance, solver, friction, tolerance=1e-10)
        for _, roads in drive.roads(patch, STEP, 12, 0, moving=True):
            for road in roads:
                for turn, push in enumerate(pushes):
                    problem.commit(problem.solve(road, None, np.full(3 * p, push), again=turn > 0))
                found.append(np.stack([problem.vertical, *problem.horizontal]))
        return np.array(found)

    once, twice = forces((0.0,)), forces((2e-5, -1e-5, 0.0))
    assert np.abs(twice - once).max() < 1e-6 * once.max()
    assert np.abs(np.diff(once, axis=0)).max() > 0.01 * once.max()


def test_forces_yield_as_they_change_where_the_same_points_touch() -> None:
    """`yields` is the derivative of the forces on the nodes, the road being met where it was."""
    patch = oval_patch((9, 5), (0.012, 0.015), 800.0)
    compliance, p = elastic(patch), len(patch.points)
    plane = Drive(
        lambda x, y: 1e-4 + 0.2 * x - 0.1 * y,
        lambda t: 0.0,
        0.0,
        lambda x, y: np.stack([0.2 + 0 * x, -0.1 + 0 * y], axis=-1),
    )
    problem = ContactProblem(patch, compliance, ActiveSet(compliance[:p, :p]), tolerance=1e-13)
    ((_, (road,)),) = plane.roads(patch, STEP, 1, 0, moving=True)

    def forces(free: np.ndarray, again: bool = True) -> np.ndarray:
        for turn in range(30):
            problem.commit(problem.solve(road, None, free, again=again or turn > 0))
        return problem.change.copy()

    begun = forces(np.zeros(3 * p), again=False)
    touching = problem._force > 0.0
    assert 5 < np.count_nonzero(touching) < p
    away = 1e-9 * np.random.default_rng(3).standard_normal(3 * p)
    expected = problem.yields(away[:, None])[:, 0]
    found = forces(away) - begun
    assert np.array_equal(problem._force > 0.0, touching)
    # On a plane, places count through the gap's change alone.
    assert np.abs(found - expected).max() < 1e-3 * np.abs(found).max()
