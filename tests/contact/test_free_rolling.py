"""Free rolling: the slip of the static shape, and where bristles feel it."""

import numpy as np
import pytest

from tireroad.contact.model import TreadContact
from tireroad.contact.patch import Patch
from tireroad.contact.roads.kinds.shapes import Flat
from tireroad.contact.roads.under_tire import RoadUnderTire
from tireroad.contact.rolling import _Rolled, rolling_steadily
from tireroad.contact.setup import ContactSetup, Rolled
from tireroad.contact.solver.active_set import ActiveSet
from tireroad.contact.solver.stick_slip import BrushFriction
from tireroad.contact.tread.brush import Brush, BrushLaw, shape_slip
from tireroad.contact.tread.law import TREADS
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.response import Response


def test_slip_of_a_rigid_wheel_and_of_a_cone() -> None:
    """A surface of radius R at its own rolling radius does not slip; one of R - y slips by -y / R."""
    ring = 2 * np.pi * np.arange(400) / 400
    y = np.linspace(-0.05, 0.05, 5)
    radius = 0.3 - 0.1 * y
    places = np.stack(
        [
            np.outer(np.sin(ring), radius),
            np.broadcast_to(y, (400, 5)),
            -np.outer(np.cos(ring), radius),
        ],
        axis=-1,
    ).reshape(-1, 3)
    slip = shape_slip(places, ring, (400, 5), 0.3).reshape(400, 5, 2)
    assert slip[0, :, 0] == pytest.approx(radius / 0.3 - 1, abs=1e-4)
    assert np.abs(slip[0, :, 1]).max() < 1e-12


def test_bristles_sum_up_the_slip_of_their_way() -> None:
    """e(x) = integral of the slip from where they enter: here s_x = c x, from x = a: e = -c (x^2 - a^2) / 2 upstream."""
    a, c, way = 0.05, 0.3, 5e-4
    x = np.linspace(-a, a, 201)
    slip = np.stack([c * x, 0 * x], axis=-1)
    brush = Brush(BrushLaw(1.0, None, slip), x, np.zeros(201, int), way, 1.0)
    brush.begin(np.ones(201, bool))
    friction = BrushFriction(brush, np.zeros((603, 603)), None)
    solver, pressed, none = ActiveSet(np.eye(201)), np.ones(201), np.zeros(402)
    for _ in range(450):
        friction.solve(solver, 0 * pressed, None, pressed, none)
    expected = -c * (a**2 - x**2) / 2
    assert brush.deflection[:, 0] == pytest.approx(expected, abs=0.03 * np.abs(expected).max())


def test_slips_follow_the_points_whatever_grid_they_are_on() -> None:
    """The shape's slip belongs to nodes: another grid on the same nodes, as error bars take, reads its own."""
    from dataclasses import dataclass

    from scipy import sparse

    from tireroad.contact.setup import ContactSetup

    @dataclass
    class Points:
        index: np.ndarray
        weights: object

    nodes = np.stack([np.arange(6.0), -np.arange(6.0)], axis=-1)
    given = {"reach": 1.0, "road": None, "rolled": None, "slip": (0.5, 0.25)}
    halves = sparse.csr_matrix(np.array([[0.5, 0.5], [0.0, 1.0], [1.0, 0.0]]))
    fine = ContactSetup(patch=Points(np.array([2, 4]), halves), shape_slip=nodes, **given)
    assert fine.slips == pytest.approx(np.array([[3.5, -2.75], [4.5, -3.75], [2.5, -1.75]]))
    on_nodes = ContactSetup(patch=Points(np.array([1, 3]), None), shape_slip=nodes, **given)
    assert on_nodes.slips == pytest.approx(np.array([[1.5, -0.75], [3.5, -2.75]]))
    assert ContactSetup(patch=Points(np.array([1]), None), **given).slips == pytest.approx(
        [0.5, 0.25]
    )


def rolling_tire(offset: np.ndarray | None, step: float = 1e-3):
    """A row of points on springs of their own, pressed on a flat road by 100 N, of a wheel of 0.3 m that rolls freely."""
    x = np.linspace(-0.05, 0.05, 21)
    c = len(x)
    patch = Patch(
        index=np.arange(c),
        points=np.stack([x, 0 * x, np.full(c, -0.3)], axis=-1),
        half_sizes=np.full((c, 2), 0.0025),
        force=np.full(c, 100.0 / c),
        gap=np.zeros(c),
        edge=np.zeros(c, bool),
        line=np.zeros(c, int),
    )
    response = Response(
        eigenvalue=np.zeros(0, complex),
        output=np.zeros((3 * c, 0), complex),
        input=np.zeros((0, 3 * c), complex),
        block=np.zeros((0, 0)),
        block_output=np.zeros((3 * c, 0)),
        block_input=np.zeros((0, 3 * c)),
        residual=1e-6 * np.eye(3 * c),
        momentum=np.zeros((3, 0)),
        block_momentum=np.zeros((3, 0)),
        offset=offset,
    )
    law = TREADS.make("half-space", youngs_modulus=1e8)
    spec = TreadContact(law=law, friction=1.0)
    road = RoadUnderTire(Flat()).prepare(0.1, 0.2, -0.1, 0.1)
    given = {"reach": 0.01, "road": road, "rolled": Rolled(speed=20.0, duration=0.1)}
    setup = ContactSetup(patch=patch, free=True, **given)
    settled, _ = setup.equilibrated(response, patch.force, spec)
    return settled, rolling_steadily(spec, settled, response, step)


def test_what_losses_move_ahead_of_the_axle_the_road_drags() -> None:
    """Points that losses move down ahead and up behind: the load stays, its centre is e ahead, and of a wheel that nothing
    drives the road takes e / R of the load."""
    x = np.linspace(-0.05, 0.05, 21)
    level, rolled = rolling_tire(None)
    assert level.patch.force @ x == pytest.approx(0.0, abs=1e-9)
    assert abs(rolled.steady.horizontal[:, 0].sum()) < 2e-4 * 100.0
    tilted, rolled = rolling_tire(np.r_[-1e-5 * x / 0.05, np.zeros(42)])
    ahead = tilted.patch.force @ x / 100.0
    assert tilted.patch.force.sum() == pytest.approx(100.0)
    assert ahead > 0.002
    drag = -rolled.steady.horizontal[:, 0].sum()
    assert drag == pytest.approx(100.0 * ahead / 0.3, rel=0.02)


def test_steps_of_a_point_are_a_guess_for_the_loops_own(monkeypatch) -> None:
    """What does not settle in them settles in the loop's own, shorter ones; what does not settle there fails."""
    tilt = np.r_[-1e-5 * np.linspace(-1.0, 1.0, 21), np.zeros(42)]
    _, alone = rolling_tire(tilt, 1e-4)
    stretch, grows, longest = _Rolled._stretch, iter(range(100_000)), 0.003

    def unsettled(self: _Rolled) -> np.ndarray:
        more = [0.0, float(next(grows)) if self._step > longest else 0.0, 0.0]
        return stretch(self) + more

    monkeypatch.setattr(_Rolled, "_stretch", unsettled)
    _, rolled = rolling_tire(tilt, 1e-4)
    drag, wanted = (one.steady.horizontal[:, 0].sum() for one in (rolled, alone))
    assert drag == pytest.approx(wanted, abs=2e-4 * 100.0)
    longest = 0.0
    with pytest.raises(ConvergenceError, match="no slip at which"):
        rolling_tire(tilt, 1e-4)
