"""Error of the load from two companions: refined at the footprint, and of another order.

Where contact ends, the surface opens as d^(3/2), d being the distance from the edge, which lies
anywhere in an element. This error fluctuates from mesh to mesh, and no coarser mesh reveals it.
Therefore the elements at the footprint are split in two, and equilibrium is solved again from the
present state. The excess stiffness of all other elements is estimated with elements of another
order on the same mesh: how far the footprint sinks under the same traction in one Newton step from
the present state.
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

HIGHEST = 3  # highest element order available
CUBIC = 0.1  # ratio of the errors of order 3 and order 2 on the same mesh
# Fraction of the bulk error that remains: the rest comes from the elements at the footprint, which
# the first companion refines. Estimated over true error of the soft torus at 4 and 12 mm
# deflection, order 2 on 16 x 8, 20 x 8 and 24 x 10 elements and order 3 on 16 x 6 and 30 x 14 (4
# mm): 0.6 to 1.3 (bench discretisation). Compared with order 3 split once or twice at the footprint
# (known to 0.2 %), order 2 on 16 x 8, 20 x 8 and 24 x 10 at 2, 4 and 12 mm: 0.7 to 2.0 in
# magnitude, with the wrong sign in two of the nine cases, where the two parts nearly cancel.
REMAINS = 0.7
ENOUGH = 1e-4  # of the load: residual allowed in a companion
UNKNOWN = "these elements strain the cords too much between their integration points; take smaller elements"
CANCELS = 0.5  # of the larger part: sums below this have an unknown sign


@dataclass(frozen=True)
class LoadError:
    """Estimated discretisation error of the load.

    `load` N extrapolated to infinitely small elements; `relative`: relative deviation from it, in
    magnitude; its parts `footprint` (elements at the footprint) and `bulk` (all elements),
    relative, positive if the load is too large. `bulk` None: unknown, the estimate then has the
    footprint's part only. `extent`: footprint on the finer companion, which has `unknowns`.
    """

    load: float
    relative: float
    footprint: float
    bulk: float | None
    extent: Footprint
    unknowns: int

    @property
    def signed(self) -> bool:
        """Whether the error's sign is known: both parts are, and do not nearly cancel."""
        if self.bulk is None:
            return False
        return self.relative > CANCELS * max(abs(self.footprint), abs(self.bulk))


def load_error(loader: Loader, rolling: Rolling) -> LoadError | str:
    """Estimated error of the load at the present road height, or the reason why it is unknown.

    The body is left unchanged. Collective.
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
    """The same tire and road with the elements at the footprint split in two. Collective."""
    lattice, force = given.lattice, given.face_force
    around = _touched(np.asarray(force.any(axis=1)), lattice.ring_corners, lattice, closed=True)
    along = _touched(np.asarray(force.any(axis=0)), lattice.arc_corners, lattice, closed=False)
    return given.balanced_on(split_ring(given.ring, around, along), ENOUGH * given.load)


def _bulk(given: Balance) -> float | None:
    """Relative excess of the load because the elements are too stiff. Collective.

    None if the state strains the cords of the other-order elements too much for a single step to be
    meaningful."""
    ring, load = given.ring, given.load
    order = ring.order + 1 if ring.order < HIGHEST else ring.order - 1
    section, corners = ring.section.of_order(order), ring.ring_corners
    half = ring.coarser() if order > ring.order else None
    if half is not None:
        # For the higher order half as many elements around give the same result at half the cost
        # (50 x 16, order 2: 0.741 % of the load with all elements, 0.747 % with half).
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
    """Centre and half widths of the contact (rad, around and along), at least one element each."""
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
    """Flags of intervals between corners with a marked node, and of their neighbours."""
    order, count = len(lattice.edge) - 1, len(corners) - 1
    index = order * np.arange(count)[:, None] + np.arange(order + 1)
    held = nodes[index % len(nodes)].any(axis=1)
    wide = np.pad(held, 1, mode="wrap" if closed else "constant")
    return wide[2:] | held | wide[:-2]
