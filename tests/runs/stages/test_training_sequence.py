"""The training of large motions: what follows one of its runs."""

import numpy as np

from tireroad.runs.stages.training import ALL, DONE, ENOUGH, MORE, STATES, after_run


def test_a_run_that_leaves_little_out_is_the_last():
    assert after_run(ENOUGH, np.inf, more=True) == DONE
    assert after_run(0.5 * ENOUGH, ENOUGH, more=False) == DONE


def test_vectors_of_known_states_follow_where_it_is_much():
    much = 3 * ENOUGH
    assert after_run(much, np.inf, more=True) == MORE
    assert after_run(2 * ENOUGH, much, more=True) == MORE


def test_no_more_vectors_follow_where_the_last_gained_nothing():
    assert after_run(3 * ENOUGH, 2 * ENOUGH, more=True) == ALL
    assert after_run(np.inf, 2 * ENOUGH, more=True) == ALL
    # Unless none went through.
    assert after_run(np.inf, np.inf, more=True) == MORE


def test_states_of_runs_join_until_one_goes_through():
    assert after_run(np.inf, np.inf, more=False) == STATES
    assert after_run(np.inf, 2 * ENOUGH, more=False) == ALL
    assert after_run(3 * ENOUGH, np.inf, more=False) == ALL
    assert after_run(2 * ENOUGH, 3 * ENOUGH, more=False) == ALL
