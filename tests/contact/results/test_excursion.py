"""How far the contact moves beyond the static state, as the wheel sees it, and what is said of it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tireroad.contact.results.chatter import Chatter
from tireroad.contact.results.energy import Totals
from tireroad.contact.roads.kinds.shapes import Cleat, Flat
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.footprint import Footprint
from tireroad.runs.stages.contact import edges, excursion, points
from tireroad.runs.stages.stage import Record
from tireroad.tests.validation.cases import oval_patch


def block(displacement: np.ndarray, **more: np.ndarray) -> dict[str, np.ndarray]:
    n, c = displacement.shape
    zeros = np.zeros((n, c))
    given = {name: zeros for name in ("normal_force", "change", "moved")}
    given |= {name: np.zeros(n) for name in ("time", "residual", "penetration", "active")}
    return given | {"displacement": displacement, "total_force": np.zeros((n, 3))} | more


def test_points_that_touch_at_rest_count_less_the_wheel() -> None:
    patch = oval_patch((5, 4), (0.015, 0.02), 500.0)
    force = patch.force.copy()
    one, other = np.flatnonzero(force > 0)[:2]
    force[one] = 0.0
    totals = Totals(replace(patch, force=force), 1.0)
    moved = np.zeros((3, 20))
    moved[1, other], moved[2, one] = -4e-3, 0.5  # the second no longer touches at rest
    totals.add(block(moved))
    assert totals.figures.excursion == 4e-3
    lifted = np.full((2, 20), 6e-3)
    totals.add(block(lifted, wheel_height=np.array([6e-3, 5e-3])))
    assert totals.figures.excursion == 4e-3  # nothing but the wheel's own motion, or 1 mm of it


def test_a_small_reach_is_named_and_no_motion_of_millimetres_is_called_growth() -> None:
    """Reach 1 um: 0.5 mm of motion is none without bound; a point at the edge that touches is said."""
    patch = oval_patch((5, 4), (0.015, 0.02), 500.0)
    totals, still = Totals(patch, 1e-6), np.zeros((2, 20))
    totals.add(block(still + 5e-4))
    touching = still.copy()
    touching[1, np.flatnonzero(patch.edge)[0]] = 1.0
    with pytest.raises(ConvergenceError, match=r"contact\.reach a larger value, e\.g\. 0\.005"):
        totals.add(block(still + 5e-4, normal_force=touching))
    with pytest.raises(Chatter, match=r"moved by 0\.6 m, more than 0\.5 m: .*grows without bound"):
        totals.add(block(still + 0.6))


def test_beyond_a_third_of_the_deflection_it_is_said() -> None:
    record = Record()
    excursion(record, 2e-3, 0.01, held=True)
    assert not record.warnings
    assert record.indicators["that, of the static deflection"] == (0.2, "-")
    excursion(record, 4e-3, 0.01, held=True)
    assert "0.4 of the static deflection of 10 mm" in record.warnings[0]
    assert 'axle.kind = "corner"' in record.warnings[0]
    excursion(record, 4e-3, None, held=True)
    excursion(record, 4e-3, 0.01, held=False)
    assert "corner" not in record.warnings[1], "advised to take what it is"


def test_a_footprint_of_few_points_is_told_where_the_road_has_heights() -> None:
    """Points 15 x 20 mm apart."""
    patch, record = oval_patch((9, 5), (0.015, 0.02), 500.0), Record()
    assert patch.touching.tolist() == [5, 3]
    few, many = (Footprint(0.08, width, 1e-3) for width in (0.04, 0.05))
    points(record, patch, few, 0.0)
    points(record, patch, many, 1e-3)
    assert not record.warnings
    points(record, patch, few, 1e-3)
    assert "15 × 20 mm apart on a footprint of 80 × 40 mm" in record.warnings[0]
    points(record, replace(patch, force=0 * patch.force), few, 1e-3)
    assert len(record.warnings) == 1


def test_points_that_touch_on_a_soft_tread_are_counted_as_they_settled() -> None:
    """Under a stiff tire the finite elements' footprint is a fraction of that of a soft tread."""
    patch, record = oval_patch((9, 9), (0.01, 0.01), 500.0), Record()
    points(record, patch, Footprint(0.005, 0.004, 1e-5), 1e-3)
    assert patch.touching.tolist() == [5, 5]
    assert not record.warnings


@pytest.mark.parametrize(
    ("speed", "spacing", "surface", "said"),
    [
        (8.3, 0.010, Cleat(), True),
        (8.3, 0.005, Cleat(), False),
        (4.1, 0.005, Cleat(), True),
        (16.6, 0.010, Cleat(), False),
        (8.3, 0.010, Flat(), False),
        (0.003, 0.010, Cleat(), False),
        (8.3, 0.0, Cleat(), False),
    ],
)
def test_points_that_pass_an_edge_one_by_one_are_told_of(speed, spacing, surface, said) -> None:
    """Modes to 570 Hz: 830 Hz is too near to 456 Hz, 1660 Hz is not, whatever makes it."""
    record = Record()
    patch = SimpleNamespace(spacing=np.array([spacing, spacing]))
    edges(record, SimpleNamespace(surface=surface, kind="cleat"), patch, speed, 570.0)
    assert any("one by one" in text for text in record.warnings) == said
    if said:
        assert f"contact.points.dx = {speed / 1368:.2g} m" in record.warnings[0]
