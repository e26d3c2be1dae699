"""Decks cut short, mutilated or very large."""

import pytest
from good_decks import GOOD
from mutants import DECKS, mutants

from tireroad.fem.decks.user_section import Wishes, read
from tireroad.fem.errors import InputError


@pytest.mark.slow
@pytest.mark.parametrize("name", DECKS)
def test_mutants(tmp_path, name):
    """300 damaged copies of each deck: a section or an InputError, nothing else."""
    wishes = Wishes(rim=("RIMNODES",) if name.endswith("inp") else ())
    refused = 0
    for data in mutants(DECKS[name], 300, seed=1):
        (tmp_path / name).write_bytes(data)
        try:
            read(tmp_path / name, wishes)
        except InputError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 100


@pytest.mark.slow
def test_large_decks(tmp_path):
    """What is not used is not kept: 40 MB of output requests take seconds of one processor and no memory."""
    import resource
    import time

    junk = (
        "*STEP\n*NODE OUTPUT\n"
        + "1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12\n" * 1_000_000
        + "*END STEP\n"
    )
    (tmp_path / "tire.inp").write_text(GOOD + junk)
    del junk
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.process_time()
    read(tmp_path / "tire.inp", Wishes(rim=("RIMNODES",)))
    assert time.process_time() - begin < 10
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 60_000  # kB
