"""Decks cut short, mutilated or very large."""

import numpy as np
import pytest
from good_decks import BELTED, GOOD
from ring_decks import solids
from test_forms import MESHES
from torus_decks import Torus, plain

from tireroad.fem.decks.own import Wishes, read
from tireroad.fem.errors import InputError


def mutants(data, count, seed):
    """Cut, flipped, shortened and shuffled copies."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        new = bytearray(data)
        kind = rng.integers(4)
        if kind == 0:
            yield data[: rng.integers(len(data))]
        elif kind == 1:
            for at in rng.integers(len(data), size=rng.integers(1, 6)):
                new[at] = rng.integers(256)
            yield bytes(new)
        elif kind == 2:
            at = rng.integers(len(data))
            del new[at : at + rng.integers(1, 80)]
            yield bytes(new)
        else:
            rows = data.split(b"\n")
            a, b = rng.integers(len(rows), size=2)
            rows[a], rows[b] = rows[b], rows[a]
            yield b"\n".join(rows)


DECKS = {
    "belted.inp": BELTED.encode(),
    "triangles.inp": plain(Torus(False, arcs=4, wall=1, triangles=True), "CAX3").encode(),
    "body.inp": solids(Torus(False, arcs=4, wall=1), np.linspace(0, 2 * np.pi, 5)[:-1]).encode(),
    "compounds.inp": (
        GOOD.replace(
            "*ELASTIC\n6.0E6, 0.45",
            "*HYPERELASTIC, N=3\n4.E5, 0., 7., 0., 0., 9., 0., 0.\n0., 4.E-9",
        )
        + "*VISCOELASTIC, TIME=PRONY\n0.2, 0., 1.E-3\n*STEP\n*DSLOAD\nINSIDE, P, 2.E5\n*END STEP\n"
    ).encode(),
    **{path.name: path.read_bytes() for path in MESHES},
}


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
