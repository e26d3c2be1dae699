"""States of the near-defective block obey the rules of all others: too fast for a step, they follow statically."""

import numpy as np
from scipy import linalg

from tireroad.greens.response import Response


def response(rigid: bool = False) -> Response:
    """A pole pair and a coupled block of two critically damped motions, at 40 and 3,000 1/s, in mixed axes."""
    random = np.random.default_rng(8)
    companions = [np.array([[0.0, 1.0], [-(w**2), -2 * w]]) for w in (40.0, 3000.0)]
    turn = np.linalg.qr(random.standard_normal((4, 4)))[0]
    block = turn @ linalg.block_diag(*companions) @ turn.T
    parts = [block, np.array([[0.0, 1.0], [0.0, 0.0]])] if rigid else [block]
    block = linalg.block_diag(*parts)
    size = len(block)
    return Response(
        eigenvalue=np.array([-3.0 + 60.0j]),
        output=random.standard_normal((2, 1)) + 1j * random.standard_normal((2, 1)),
        input=random.standard_normal((1, 2)) + 1j * random.standard_normal((1, 2)),
        block=block,
        block_output=random.standard_normal((2, size)),
        block_input=random.standard_normal((size, 2)),
        residual=np.zeros((2, 2)),
        momentum=np.zeros((3, 1)),
        block_momentum=random.standard_normal((3, size)),
        rigid=2 if rigid else 0,
    )


def test_the_fast_part_of_a_block_follows_statically():
    """Same at 0 Hz; up to 5 Hz within the w / 3,000 that a critically damped motion lags behind, of its part."""
    for rigid in (False, True):
        whole = response(rigid)
        kept = whole.resolved(2e-3)
        assert len(kept.block) == (4 if rigid else 2)
        assert kept.rigid == whole.rigid
        np.testing.assert_allclose(
            np.sort(np.abs(kept.every)), [40, 40, np.hypot(3, 60)], rtol=1e-4
        )
        both = kept.residual + kept.static(), whole.residual + whole.static()
        np.testing.assert_allclose(*both, rtol=1e-7)
        frequency = np.array([0.01, 5.0])
        difference = np.abs(kept.receptance(frequency) - whole.receptance(frequency))
        assert difference[0].max() < 3e-3 * difference[1].max()
        lag = 2 * 2 * np.pi * 5.0 / 3000.0
        assert 0 < difference[1].max() < 2 * lag * np.abs(kept.residual).max()


def test_slow_enough_a_step_changes_nothing():
    whole = response()
    assert whole.resolved(1e-5) is whole


def test_a_growing_block_state_can_be_left_out_as_a_pole_can():
    """Second-order residual states that grow are made static, whichever way they are kept."""
    whole = response()
    grown = whole.keeping_where(lambda s: np.abs(s) > 50.0)
    assert sorted(np.round(np.abs(grown.every))) == [60.0, 3000.0, 3000.0]
    np.testing.assert_allclose(grown.residual + grown.static(), whole.static(), rtol=1e-7)
