"""Text files damaged at random: cut, flipped, shortened and shuffled; the decks to damage."""

from collections.abc import Iterator

import numpy as np
from good_decks import BELTED, GOOD
from ring_decks import solids
from test_forms import MESHES
from torus_decks import Torus, plain


def mutants(data: bytes, count: int, seed: int) -> Iterator[bytes]:
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
