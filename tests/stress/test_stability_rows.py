"""The rows of `validate stability` that modes and Green's functions give: nothing blows up or goes unseen."""

import pytest

from tireroad.tests.validation import stability


@pytest.mark.long
@pytest.mark.parametrize(
    "rows_of", [stability.modal_rows, stability.greens_rows], ids=["modal", "greens"]
)
def test_every_case_ends_well(rows_of) -> None:
    rows = rows_of()
    assert len(rows) > 5
    for _, case, what, caught in rows:
        assert "nan" not in what.lower() and "inf " not in what, case
        assert caught and caught != "not caught", case


@pytest.mark.slow
def test_each_case_ends_as_it_should() -> None:
    """Only what has no answer is refused; what has no vectors of its own goes to a block, nothing else does."""
    modal = {case: (what, caught) for _, case, what, caught in stability.modal_rows()}
    refused = {case for case, (what, _) in modal.items() if what.startswith("refused")}
    assert refused == {"negative stiffness: 5 MPa from outside"}
    identities = [what for what, _ in modal.values() if what.startswith("identities hold to")]
    assert len(identities) == 4
    for what in identities:
        assert float(what.removeprefix("identities hold to ").split(";")[0]) < 1e-8
    greens = {case: caught for _, case, _, caught in stability.greens_rows()}
    blocks = {case for case, caught in greens.items() if "as a block" in caught}
    defective = "near-defective: coupling back of "
    assert {case for case in blocks if "critical damping" not in case} == {
        f"{defective}0",
        f"{defective}1e-13",
    }
    assert len(blocks) == 4


def test_greens_functions_are_the_exponentials() -> None:
    """What the table shows as text: 1e-9 at worst."""
    for _, case, what, _ in stability.greens_rows():
        assert float(what.removeprefix("amplitudes drift by ").split()[0]) < 1e-9, case


@pytest.mark.slow
def test_a_growing_motion_and_a_buckled_tire_are_named() -> None:
    rows = {case: (what, caught) for _, case, what, caught in stability.modal_rows()}
    assert "grows at" in rows["twice the critical speed"][0]
    assert "buckles" in rows["negative stiffness: 5 MPa from outside"][1]
