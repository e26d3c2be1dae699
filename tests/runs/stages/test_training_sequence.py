"""The training of large motions: what follows one of its runs."""

import numpy as np

from tireroad.runs.stages.training import DONE, ENOUGH, MORE, NO_BETTER, STATES, after_run


def test_a_run_that_leaves_little_out_is_the_last():
    assert after_run(ENOUGH, np.inf, more=True, joined=False) == DONE
    assert after_run(0.5 * ENOUGH, ENOUGH, more=False, joined=True) == DONE


def test_vectors_of_known_states_come_before_states_of_the_run():
    much = 3 * ENOUGH
    assert after_run(much, np.inf, more=True, joined=False) == MORE
    # Even where the last ones made it worse.
    assert after_run(much, 2 * ENOUGH, more=True, joined=False) == MORE
    assert after_run(much, 2 * ENOUGH, more=False, joined=False) == STATES


def test_states_of_runs_join_while_they_help():
    assert after_run(2 * ENOUGH, 3 * ENOUGH, more=False, joined=True) == STATES
    assert after_run(3 * ENOUGH, 2 * ENOUGH, more=False, joined=True) == NO_BETTER


def test_a_run_that_stopped_teaches_until_one_goes_through():
    assert after_run(np.inf, np.inf, more=False, joined=True) == STATES
    assert after_run(np.inf, 2 * ENOUGH, more=False, joined=True) == NO_BETTER
