"""The rows of `validate stability` that modes and Green's functions give: nothing blows up or goes unseen."""

import pytest

from tireroad.runs.validation import stress_greens, stress_modal


@pytest.mark.parametrize("package", [stress_modal, stress_greens], ids=["modal", "greens"])
def test_every_case_ends_well(package) -> None:
    rows = package.rows()
    assert len(rows) > 5
    for _, case, what, caught in rows:
        assert "nan" not in what.lower() and "inf " not in what, case
        assert caught and caught != "not caught", case


def test_greens_functions_are_the_exponentials() -> None:
    """What the table shows as text: 1e-9 at worst."""
    for _, case, what, _ in stress_greens.rows():
        assert float(what.removeprefix("amplitudes drift by ").split()[0]) < 1e-9, case


def test_a_growing_motion_and_a_buckled_tire_are_named() -> None:
    rows = {case: (what, caught) for _, case, what, caught in stress_modal.rows()}
    assert "grows at" in rows["twice the critical speed"][0]
    assert "buckles" in rows["negative stiffness: 5 MPa from outside"][1]
