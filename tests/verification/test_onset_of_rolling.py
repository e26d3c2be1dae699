"""From a shift to steady rolling: a sphere whose tangential force is held, beside what the program CONTACT publishes.

Example catt_to_cart of CONTACT, open-source version (E.A.H. Vollebregt, Kalker's theory; github eve70a/CONTACT at d431cdbd,
file examples/catt_to_cart.ref_out, Apache License 2.0): two equal bodies, G = 1, nu = 0.28, contact radius 3.5, friction
0.4013, force -0.657 of the bound, cells and steps of 0.25.
"""

import numpy as np
import pytest
from scipy.optimize import brentq

from tireroad.contact.solver.stick_slip import BrushFriction, PlaneCompliance, stick_slip
from tireroad.contact.tread.brush import Brush, BrushLaw
from tireroad.contact.tread.kernel import GridPlaces
from tireroad.contact.tread.shear import KernelShear, half_space_shear
from tireroad.tests.reference.step import Pressed

POISSON, RADIUS, LOAD, FRICTION, PITCH = 0.28, 3.5, 0.4705, 0.4013, 0.25
FORCE = 0.657 * FRICTION * LOAD
SHIFT = 1.774e-2  # published
FIRST, PEAK = {2: 1.824e-3, 5: 2.050e-3, 8: 2.334e-3, 11: 2.676e-3}, 3.403e-3
"""Creepage by case, the first of rolling being 2, and its largest, of case 15."""
SETTLING = {20: 3.123e-3, 25: 3.062e-3, 30: 3.093e-3, 40: 3.100e-3, 57: 3.101e-3}


class Alone(KernelShear):
    """For two equal bodies: pressure moves both sideways by the same amount."""

    def __init__(self, grid: GridPlaces) -> None:
        # Two bodies of G = 1 give way like one of half of it.
        super().__init__(
            grid, lambda x, y, a, b: half_space_shear(x, y, a, b, 1.0 + POISSON, POISSON)
        )
        self.coupled = False


@pytest.mark.slow
def test_creepage_from_a_shift_to_steady_rolling() -> None:
    i = (np.arange(30) - 14.5) * PITCH
    x, y = (each.ravel() for each in np.meshgrid(i, i, indexing="ij"))
    c, inside = len(x), x**2 + y**2 < RADIUS**2
    pressure = np.sqrt(np.maximum(1.0 - (x**2 + y**2) / RADIUS**2, 0.0))
    normal = LOAD * pressure / pressure.sum()
    shear = Alone(GridPlaces((30, 30), (PITCH, PITCH), np.arange(c)))
    plane = PlaneCompliance(np.zeros((2 * c, 2 * c)), shear=shear)

    def shifted(shift: float) -> np.ndarray:
        constant = np.tile([-shift, 0.0], (c, 1))
        return stick_slip(plane, constant, FRICTION * normal, np.zeros((c, 2)))

    shift = brentq(lambda s: shifted(s)[:, 0].sum() - FORCE, 0.5 * SHIFT, 1.5 * SHIFT, rtol=1e-6)
    assert shift == pytest.approx(SHIFT, rel=0.03)
    pushed = shifted(shift)
    moved = shear.spread(pushed @ [1, 1j])
    brush = Brush(
        BrushLaw(np.inf, FRICTION, np.zeros((c, 2))), x, np.tile(np.arange(30), 30), PITCH, 1.0
    )
    brush.begin(inside, np.stack([moved.real, moved.imag], axis=-1))
    friction = BrushFriction(brush, np.zeros((3 * c, 3 * c)), None, shear, tolerance=1e-6)
    state = friction.state() | {"horizontal": pushed, "horizontal_before": pushed}
    creepage: dict[int, float] = {}
    gap, still = np.where(inside, 0.0, 1.0), np.zeros(2 * c)
    for case in range(2, 58):

        def excess(creep: float, state=state) -> float:
            friction.set_state(state)
            friction.creep((creep, 0.0))
            return (
                float(friction.solve(Pressed(), gap, inside, normal, still)[1][:, 0].sum()) - FORCE
            )

        last = creepage.get(case - 1, 2e-3)
        creepage[case] = brentq(excess, 0.5 * last, 2.0 * last, rtol=1e-5)
        excess(creepage[case])
        state = friction.state()
    # Bristles enter half a cell ahead of the foremost point here, so the first steps lag behind by half a cell.
    for case, published in FIRST.items():
        assert 0.86 * published < creepage[case] < published, case
    assert max(creepage.values()) == pytest.approx(PEAK, rel=0.03)
    assert 14 <= max(creepage, key=creepage.__getitem__) <= 17
    for case, published in SETTLING.items():
        assert creepage[case] == pytest.approx(published, rel=0.011), case
    assert creepage[57] == pytest.approx(SETTLING[57], rel=2e-3)
