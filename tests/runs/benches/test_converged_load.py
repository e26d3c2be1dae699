"""The limit of a sequence of meshes that the loads of `bench discretisation` are held against."""

import pytest

from tireroad.tests.bench.parts.converged_load import Pressed, converged


def test_a_limit_is_told_only_where_all_of_a_sequence_closes_in() -> None:
    """Load by half a cut, to 100 N; length and width, which go up and down, as the last has them."""
    given = [(104, 30.9, 11.18), (102, 31.6, 10.69), (101, 31.2, 10.40), (100.5, 31.1, 10.55)]
    found = converged([Pressed(*one) for one in given])
    assert found.values == pytest.approx([100, 31.1, 10.55])
    assert found.error == pytest.approx([0.5 / 100.5, 0.1 / 31.1, 0.15 / 10.55])
