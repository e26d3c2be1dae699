"""The contact points at nodes of the mesh, and how close points of a grid must be.

Spacing of the contact points where the scene leaves it to the program.

The forces of a footprint a few points wide depend on where its edge falls between them; a fifth of
its width and length is fine enough (soft torus, 14 mm wide; docs/verification/contact-points.md). A
wave needs twelve points: with ten the deviation of the radial tire, 130 mm wide, is 0.7 to 2.2 %
off (docs/verification/default-settings.md), with twelve 0.6 % at most. Points much closer than the
nodes that carry them resolve no more of the tire.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from tireroad.contact.tread.kernel import GridPlaces
from tireroad.fem.errors import ConvergenceError
from tireroad.fem.parameters import second_digit

if TYPE_CHECKING:
    from tireroad.fem.static.footprint import Footprint


ACROSS = 5.0  # points on the footprint's width or length
ON_A_WAVE = 12.0  # points on the shortest wave of interest
ON_A_NODE = 2.0  # points from node to node, at most

# Allowance for the tire's own motion beyond the road's height, m: the smallest reach by default.
LEAST_REACH = 5e-3


def spacing(footprint: Footprint, nodes: Patch, speed: float, highest: float) -> float | None:
    """Spacing (m) of the points, two digits of it; None if nothing touches.

    From the `footprint` as solved, the `nodes` in it, and the shortest wave: the road's `speed`
    (m/s) over the `highest` frequency (Hz) of interest.
    """
    between = math.sqrt(float(nodes.spacing.prod()))
    if not between or not min(footprint.length, footprint.width) > 0:
        return None
    target = min(footprint.length, footprint.width) / ACROSS
    if speed > 0:
        target = min(target, speed / highest / ON_A_WAVE)
    target = max(target, between / ON_A_NODE)
    digit = second_digit(target)
    return round(math.floor(target / digit * (1 + 1e-9)) * digit, 9)


@dataclass(frozen=True, kw_only=True)
class Patch:
    """c contact points on p nodes of the outer face.

    `index` (p,) into the outer face; `points` (c, 3) m deformed; `half_sizes` (c, 2) m of each
    point's rectangle; `force` (c,) N and `gap` (c,) m of the static state on a flat road; `edge`
    (c,): the outermost points, which should never touch; `weights` W (c, p): nodal values to
    points, None if the points are the nodes; `places` on a regular grid, or None. Points of equal
    `line` (c,) int follow each other in the rolling direction. `frames` (c, 3, 3): unit vectors
    along, across and normal to the road in the wheel's axes, in which forces and displacements are
    given; None: x, y, z. `pull` (c, 2) N: horizontal forces of a static state with friction, held
    constant; None without.
    """

    index: np.ndarray
    points: np.ndarray
    half_sizes: np.ndarray
    force: np.ndarray
    gap: np.ndarray
    edge: np.ndarray
    line: np.ndarray
    weights: sparse.csr_matrix | None = None
    places: GridPlaces | None = None
    frames: np.ndarray | None = None
    pull: np.ndarray | None = None

    def resultant(self, force: np.ndarray, horizontal: np.ndarray) -> np.ndarray:
        """Resultant (3,) N in the wheel's axes of normal (c,) and tangential (c, 2) forces."""
        if self.frames is None:
            # A product: sum(axis=0) of so narrow an array takes ten times as long, 2 % of a step.
            return np.array([*(np.ones(len(force)) @ horizontal), force.sum()])
        return np.einsum("ci,cij->j", np.column_stack([horizontal, force]), self.frames)

    def at_points(self, values: np.ndarray) -> np.ndarray:
        """Values at the points from values (p, ...) at the nodes."""
        return values if self.weights is None else self.weights @ values

    @property
    def area(self) -> np.ndarray:
        """Area of each point's rectangle, (c,) m2."""
        return 4 * self.half_sizes.prod(axis=1)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """x0, x1, y0, y1 of the points, m."""
        low, high = self.points[:, :2].min(axis=0), self.points[:, :2].max(axis=0)
        return float(low[0]), float(high[0]), float(low[1]), float(high[1])

    @property
    def spacing(self) -> np.ndarray:
        """Point spacing (2,) m along and across the footprint at rest; 0 without one."""
        held = self.force > 0
        return 2 * np.median(self.half_sizes[held], axis=0) if held.any() else np.zeros(2)

    @property
    def touching(self) -> np.ndarray:
        """Number of points (2,) along and across the footprint at rest; 0 without one."""
        held = self.force > 0
        if not held.any():
            return np.zeros(2)
        return np.rint(np.ptp(self.points[held, :2], axis=0) / self.spacing) + 1

    def check_edge(self, force: np.ndarray, time: np.ndarray, reach: float) -> None:
        """Raise ConvergenceError if a point on the edge touches: others beyond might touch too.

        `force` (n, c) N at the times (n,) s.
        """
        when, which = np.nonzero(force[:, self.edge] > 0)
        if len(when):
            x, y, _ = self.points[self.edge][which[0]]
            raise ConvergenceError(
                f"contact: at t = {time[when[0]]:.6g} s the road touches the edge of the patch at "
                f"x = {x:.4g} m, y = {y:.4g} m; points beyond it were left out because their static "
                f"gap is more than {reach:.4g} m. Give contact.reach a larger value, "
                f"e.g. {max(2 * reach, LEAST_REACH):.2g}."
            )


def make_patch(
    positions: np.ndarray,
    half_sizes: np.ndarray,
    force: np.ndarray,
    gap: np.ndarray,
    shape: tuple[int, int],
    reach: float,
) -> Patch:
    """The points of the outer face with a static gap within reach (m).

    The outer face has s points as a ring of `shape`. One more row around the points is the edge,
    which reveals contact beyond the patch.
    """
    near = (gap <= reach).reshape(shape)
    # The tread ends at the beads and is periodic around the axle.
    wide = np.pad(near, ((0, 0), (1, 1)))
    taken = near | np.roll(near, 1, 0) | np.roll(near, -1, 0) | wide[:, 2:] | wide[:, :-2]
    index = np.flatnonzero(taken.ravel())
    return Patch(
        index=index,
        points=positions[index],
        half_sizes=half_sizes[index],
        force=force[index],
        gap=gap[index],
        edge=~near.ravel()[index],
        line=index % shape[1],
    )
