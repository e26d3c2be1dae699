"""Work against the skew part of a flexibility: twice the area that the force encloses, times the skew entry."""

import numpy as np
import pytest

from tireroad.contact.results.energy import Circulation, Work


@pytest.mark.parametrize("blocks", [1, 7])
def test_a_circle_of_forces(blocks: int) -> None:
    flexibility = np.array([[2.0, 0.7], [-0.1, 3.0]])  # skew part 0.4
    angle = np.linspace(0.0, 2 * np.pi, 2001)
    forces = 5.0 * np.column_stack([np.cos(angle) - 1, np.sin(angle)])
    found = Circulation(flexibility)
    for part in np.array_split(forces[1:], blocks):
        found.add(part)
    # int f . S df = 0.4 int (f_x df_y - f_y df_x) = 0.4 times twice the area, by Green's theorem.
    assert found.work == pytest.approx(0.4 * 2 * np.pi * 25.0, rel=1e-5)


def test_what_is_symmetric_stores_and_loses_nothing() -> None:
    forces = np.random.default_rng(1).standard_normal((50, 3))
    symmetric = np.random.default_rng(2).standard_normal((3, 3))
    found = Circulation(symmetric + symmetric.T)
    found.add(forces)
    assert found.work == 0.0


def test_goes_on_from_a_checkpoint() -> None:
    forces = np.random.default_rng(3).standard_normal((20, 2))
    flexibility = np.array([[0.0, 1.0], [0.0, 0.0]])
    whole, first, second = (Circulation(flexibility) for _ in range(3))
    whole.add(forces)
    first.add(forces[:9])
    second.set_state(first.state())
    second.add(forces[9:])
    assert second.work == whole.work


@pytest.mark.parametrize("scheme", ["linear", "damped", "constant"])
def test_forces_ahead_of_the_mean_take_what_is_said(scheme: str) -> None:
    """On a symmetric flexibility: sum of (mean force - (f_n + f_{n-1}) / 2) . G (f_n - f_{n-1}), however blocked."""
    random = np.random.default_rng(4)
    forces, symmetric = random.standard_normal((30, 3)), random.standard_normal((3, 3))
    symmetric = symmetric @ symmetric.T
    path = np.concatenate([np.zeros((2, 3)), forces])
    now, last, before = path[2:], path[1:-1], path[:-2]
    mean = {
        "linear": (now + last) / 2,
        "damped": (9 * now + 6 * last + before) / 16,
        "constant": now,
    }[scheme]
    expected = ((mean - (now + last) / 2) * ((now - last) @ symmetric)).sum()
    found = Circulation(symmetric, scheme)
    for part in np.array_split(forces, 4):
        found.add(part)
    assert found.lead == pytest.approx(expected, abs=1e-12)
    work = Work(scheme)
    for part in np.array_split(forces, 3):
        work.add(part, part @ symmetric)
    assert work.lead == pytest.approx(expected, abs=1e-12)
