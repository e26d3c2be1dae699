"""The error of the load by two companions: one finer where the tire touches, one of another order everywhere.

Where the road lets go, the surface bends as d^(3/2) of the distance d to the edge, which falls anywhere in an
element: the error of that goes up and down from mesh to mesh, and no coarser mesh tells it. So the elements
at the footprint are cut in two, and the road is met again from the state that is there. What the elements
are too stiff everywhere else is told by elements of another order on the same mesh: how far the footprint
sinks, under one and the same traction, by a step of Newton's method from the state that is there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.matrices import probe
from tireroad.fem.sections.split import split_ring
from tireroad.fem.static.companion import Balance
from tireroad.fem.static.footprint import Footprint
from tireroad.fem.static.path.loading import Loader
from tireroad.fem.static.path.near import cords_strained
from tireroad.fem.static.virtual_work import Rolling
from tireroad.fem.tire.mesh import Lattice, field_lattice

HIGHEST = 3  # order of elements there is
CUBIC = 0.1  # error of elements of order 3 over that of order 2 on the same mesh
# Of the bulk's error: the rest is that of the elements at the footprint, which are smaller in the first companion.
# Estimated over true error of the soft torus 4 and 12 mm on the road, of order 2 on 16 x 8, 20 x 8 and 24 x 10
# elements and of order 3 on 16 x 6 and 30 x 14 (4 mm): 0.6 to 1.3 so (bench discretisation).
# Beside order 3 cut in two at the footprint once or twice (known to 0.2 %), 16 x 8, 20 x 8 and 24 x 10 of order 2 at
# 2, 4 and 12 mm: 0.7 to 2.0 in size; with the wrong sign in two of the nine, in which both parts all but cancel.
REMAINS = 0.7
ENOUGH = 1e-4  # of the load: what of it may be out of balance in a companion
UNKNOWN = "these elements strain the cords too much between their integration points; take smaller elements"
CANCELS = 0.5  # of the larger part: what is left of both, below which its sign is not known


@dataclass(frozen=True)
class LoadError:
    """`load` N of ever smaller elements as estimated, `relative` how far the load is from it; what of
    that is of the `footprint`'s elements and what of all in `bulk` (relative, above 0 where the load is
    too large; None where it is not known: both are then of the footprint's alone); `extent` of the footprint on the
    finer companion, of so many `unknowns`.
    """

    load: float
    relative: float
    footprint: float
    bulk: float | None
    extent: Footprint
    unknowns: int

    @property
    def signed(self) -> bool:
        """Whether it is known on which side the load errs: not where both parts all but cancel each other."""
        if self.bulk is None:
            return False
        return self.relative > CANCELS * max(abs(self.footprint), abs(self.bulk))


def load_error(loader: Loader, rolling: Rolling) -> LoadError | str:
    """How far the load at this height of the road is from that of ever smaller elements; or why it is unknown.

    Collective; the body is left as it is.
    """
    if not loader.load():
        return "nothing touches the road"
    given = Balance.of(loader, rolling)
    try:
        finer = at_finer_footprint(given)
        bulk = _bulk(given)
    except ConvergenceError as error:
        return f"on the companion, {error}"
    edge = 1 - finer.load / given.load
    both = edge if bulk is None else edge + bulk
    return LoadError(
        load=given.load * (1 - both),
        relative=abs(both),
        footprint=edge,
        bulk=bulk,
        extent=finer.extent,
        unknowns=3 * finer.lattice.size,
    )


def at_finer_footprint(given: Balance) -> Balance:
    """The same tire on the same road, elements at the footprint cut in two. Collective."""
    lattice, force = given.lattice, given.face_force
    around = _touched(np.asarray(force.any(axis=1)), lattice.ring_corners, lattice, closed=True)
    along = _touched(np.asarray(force.any(axis=0)), lattice.arc_corners, lattice, closed=False)
    return given.balanced_on(split_ring(given.ring, around, along), ENOUGH * given.load)


def _bulk(given: Balance) -> float | None:
    """How far the load is too large since the elements are too stiff, relative; None where the state strains elements of
    another order too much for one step to tell. Collective."""
    ring, load = given.ring, given.load
    order = ring.order + 1 if ring.order < HIGHEST else ring.order - 1
    section, corners = ring.section.of_order(order), ring.ring_corners
    half = ring.coarser() if order > ring.order else None
    if half is not None:
        # Of the higher order half as many elements around say the same (50 x 16 of order 2: 0.741 % of the load
        # by all of them, 0.747 % by half) at half the cost.
        corners = half.ring_corners
    other = replace(ring, ring_corners=corners, section=section)
    place, spread = _spot(given)
    weights, others = (probe.spot(field_lattice(one), *place, spread) for one in (ring, other))
    near = given.near(other)
    if cords_strained(near, load):
        return None
    sinks, compliance = given.near(ring).sinking(weights, load)
    further = near.sinking(others, load)[0]
    share = REMAINS * (further - sinks) / compliance / load
    return share if order > ring.order else -CUBIC * share


def _spot(given: Balance) -> tuple[tuple[float, float], tuple[float, float]]:
    """Middle and half widths (rad, around and along) of where the tire touches, an element at least."""
    lattice, force = given.lattice, given.face_force
    around = (lattice.ring + np.pi) % (2 * np.pi) - np.pi
    places, spreads = [], []
    for angle, share, corners in (
        (around, force.sum(axis=1), lattice.ring_corners),
        (lattice.arc, force.sum(axis=0), lattice.arc_corners),
    ):
        middle = float(angle @ share / share.sum())
        least = np.diff(corners)[np.abs(corners[:-1] - middle).argmin()]
        places.append(middle)
        spreads.append(max(float(np.ptp(angle[share > 0])) / 2, float(least)))
    return (places[0], places[1]), (spreads[0], spreads[1])


def _touched(nodes: np.ndarray, corners: np.ndarray, lattice: Lattice, closed: bool) -> np.ndarray:
    """Intervals between the corners with one of the marked nodes of their line, and those next to them."""
    order, count = len(lattice.edge) - 1, len(corners) - 1
    index = order * np.arange(count)[:, None] + np.arange(order + 1)
    held = nodes[index % len(nodes)].any(axis=1)
    wide = np.pad(held, 1, mode="wrap" if closed else "constant")
    return wide[2:] | held | wide[:-2]
