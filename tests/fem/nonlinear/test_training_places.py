"""Which places of a road that passes are trained on."""

from types import SimpleNamespace

import numpy as np

from tireroad.fem.nonlinear.training import FAR, Trainer


def visited(lacked: dict[int, float], count: int = 9) -> set[int]:
    """Numbers of the places visited of `count`, where those of some `lacked` a share and the others nothing."""
    seen = set()

    def visit(number: int) -> SimpleNamespace:
        seen.add(number)
        return SimpleNamespace(lacked=lacked.get(number, 0.0))

    stub = SimpleNamespace(visit=visit)
    Trainer.follow(stub, np.arange(float(count)), int)  # type: ignore[arg-type]
    return seen


def test_every_other_place_is_trained_and_those_beside_one_that_lacked_much():
    even = {0, 2, 4, 6, 8}
    assert visited({}) == even
    assert visited({2: 0.9 * FAR}) == even
    assert visited({2: 1.1 * FAR}) == even | {1, 3}


def test_a_bar_whose_places_lack_a_twelfth_is_trained_on_all():
    """What one place of 15 mm fewer left out made runs over a bar of 25 mm grow without bound."""
    assert visited({2: 0.08, 6: 0.08}) == set(range(9))
