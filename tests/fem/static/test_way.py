"""The way to a load, on made-up curves of load over deflection that no mesh is needed for."""

from types import SimpleNamespace

import numpy as np
import pytest

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.equilibrium import SolveOutcome
from tireroad.fem.static.load_steps import LoadPath, LoadStepper
from tireroad.fem.static.virtual_work import AT_REST

# As measured on a torus of 16 x 6 elements: m, N. Its wall folds at 0.094 m.
DEFLECTION = 0.0, 0.0511, 0.0661, 0.0886, 0.0916, 0.0938, 0.0948, 0.0976, 0.1066, 0.1124, 0.13
LOAD = 0.0, 21.8e3, 32.7e3, 54.4e3, 61.0e3, 64.7e3, 46.6e3, 38.4e3, 40.9e3, 52.8e3, 58.0e3
REACH = 0.013  # m: from that far away a state is found


class MadeUp:
    """A loader, its body and its problem in one: the root of the deflection is its displacement.

    Its load is a `curve` of the deflection, and never solved for.
    """

    touch, rounding, farthest, rolling = 0.0, 0.0, 0.13, AT_REST
    march, _seen = LoadStepper.march, LoadStepper._seen

    def __init__(self, curve) -> None:
        self.curve, self.equilibrium, self.body = curve, self, self
        self.u = SimpleNamespace(x=SimpleNamespace(array=np.zeros(1)))
        self.ring = SimpleNamespace(thickness=0.012)
        self.road = SimpleNamespace(snapshot=lambda: None, restore=lambda state: None)
        self.road_height, self.newton_steps, self.visited = 0.0, 0, []

    def solve(self, height, load=None, allowed=0.0) -> SolveOutcome:
        field = self.u.x.array
        if load is not None or not abs(field[0] ** 2 - height) <= REACH:
            return SolveOutcome(False, 25, 1.0, "circles")
        field[0], self.road_height = np.sqrt(height), height
        self.visited.append(height)
        return SolveOutcome(True, 9, 0.0, "converged")  # not easy enough for steps to grow

    def predict(self, height) -> bool:
        return False

    def load(self) -> float:
        return float(self.curve(self.road_height))

    def tell(self, *told) -> None: ...


def snapping(deflection):
    return np.interp(deflection, DEFLECTION, LOAD)


@pytest.mark.parametrize("load", [300.0, 20e3, 60e3, 62e3])
def test_a_load_is_met_where_the_curve_first_crosses_it(load):
    """60 kN ended by a division by zero: the bracket reached from behind the snap to before it."""
    tire = MadeUp(snapping)
    found = LoadPath(tire).carry(load)
    rising = LOAD.index(max(LOAD)) + 1
    assert found == pytest.approx(np.interp(load, LOAD[:rising], DEFLECTION[:rising]), rel=1e-8)
    assert found == tire.road_height and tire.load() == pytest.approx(load, rel=1e-9)
    assert max(tire.visited) < 0.095


def test_a_load_above_the_peak_is_said_with_the_fall():
    with pytest.raises(ConvergenceError, match="out of reach; the load falls.*static.deflection"):
        LoadPath(MadeUp(snapping)).carry(70e3)


def test_a_load_that_the_curve_jumps_over_is_said_at_once():
    """The bracket closes on the jump: further trials would be of one deflection."""

    def curve(deflection):
        jumped = 30e3 if deflection > 0.08 else 0.0
        return np.interp(deflection, [0.0, 0.05, 0.06, 0.13], [0.0, 50e3, 30e3, 50e3]) + jumped

    tire = MadeUp(curve)
    with pytest.raises(ConvergenceError, match=r"where it jumps.*snap-through.*static\.deflection"):
        LoadPath(tire).carry(60e3)
    assert len(tire.visited) < 80


def test_a_deflection_that_is_visited_twice_is_solved_twice():
    tire = MadeUp(snapping)
    way = LoadPath(tire)
    for deflection in (0.0, 0.0, 0.01, 0.01, 0.02):
        way.to(deflection)
    assert tire.road_height == 0.02
