"""Universal File 58: read back by the columns that its format fixes."""

from __future__ import annotations

import numpy as np
import pytest

from tireroad.runs.results.export import DISPLACEMENT, dataset, direction


@pytest.mark.parametrize("even", [True, False])
def test_a_function_is_read_back(even: bool) -> None:
    frequency = np.arange(1.0, 8.0) if even else np.array([1.0, 2.0, 4.0, 8.0, 9.0])
    values = (1 + 2j) * np.exp(1j * frequency) * 1e-6
    lines = list(dataset(frequency, values, DISPLACEMENT, (2, -3), (11, 1)))
    assert lines[0] == lines[-1] == "    -1" and lines[1] == "    58"
    assert max(map(len, lines)) <= 80
    who = lines[7]
    columns = (0, 5), (41, 51), (51, 55), (66, 76), (76, 80)
    assert [int(who[a:b]) for a, b in columns] == [4, 2, -3, 11, 1]
    kind = lines[8]
    assert [int(kind[a : a + 10]) for a in (0, 10, 20)] == [6, len(frequency), int(even)]
    numbers = [
        line[k : k + 20] for line in lines[13:-1] for k in range(0 if even else 13, len(line), 20)
    ]
    found = np.array(numbers, float).reshape(-1, 2) @ [1, 1j]
    np.testing.assert_allclose(found, values, rtol=1e-11)
    if not even:
        np.testing.assert_allclose([float(line[:13]) for line in lines[13:-1]], frequency)


def test_directions() -> None:
    assert [direction(one) for one in ((2, 0, 0), (0, -1, 0), (0, 0, 3), (1, 1, 0))] == [
        1,
        -2,
        3,
        0,
    ]
