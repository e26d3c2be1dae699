"""The roads on which the reduced force of large motions is trained: what the road of a run has under the footprint."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from tireroad.contact.setup import ContactSetup
from tireroad.fem.nonlinear.road import Feature, Passage

Array = np.ndarray

PITCH = 4e-3, 8e-3  # m along and across, of the sampled road
CLOSE = 5e-4  # m: gap at rest of points that count as the footprint
BESIDE = 0.03, 0.02  # m that is sampled before and beside the footprint, at least
# Without inertia and friction single points jump over flanks that are steeper.
STEEPEST = 1.2
SHORT = 0.02  # m: bumps that are shorter are taken by the tread and the bending of the belts
# Lengths and heights (m) from which a road is trained on, the distance of the places, and the most of these.
LEAST, APART, MOST = 1e-3, 0.015, 120
# Measured on rises of 1 to 25 mm and bars of 10 to 25 mm (docs/large-motions.md): 15 % for each 10 mm.
ERROR_PER_METRE = 15.0


def expected(setup: ContactSetup) -> float:
    """Height or depth (m) to which the road takes the tire in the run: the largest mean over 20 mm, and its motion."""
    road = TrainingRoads.of(setup)
    return float(road.bumps().max()) + road.lift


@dataclass(frozen=True)
class TrainingRoads:
    """Heights `z` (n, m) m of the road that a run passes over, at x (n,) and y (m,) m, as its tire stands at t = 0; the
    `footprint` reaches from and to x, m, the road `met` by a standing tire, too; `lift` m of the road's own motion."""

    x: Array
    y: Array
    z: Array
    footprint: tuple[float, float]
    met: tuple[float, float]
    lift: float

    @staticmethod
    def of(setup: ContactSetup) -> TrainingRoads:
        """Training roads for the setup of a run, level where it has no relief."""
        points, gap = setup.patch.points[:, :2], setup.patch.gap
        # Grids of points are not settled yet and have no forces.
        touching = points[gap < CLOSE]
        low, high = touching.min(axis=0) - BESIDE, touching.max(axis=0) + BESIDE
        x, y, z = _sampled(setup, low, high)
        # What rises by the gap touches there: a bar of 25 mm 50 mm before those places.
        met = np.vstack([touching, points[gap < z.max() + setup.rolled.lift]])
        ends = met.min(axis=0) - PITCH, met.max(axis=0) + PITCH
        if (ends[0] < low).any() or (ends[1] > high).any():
            low, high = np.minimum(low, ends[0]), np.maximum(high, ends[1])
            x, y, z = _sampled(setup, low, high)
        footprint = float(touching[:, 0].min()), float(touching[:, 0].max())
        return TrainingRoads(x, y, z, footprint, (float(low[0]), float(high[0])), setup.rolled.lift)

    @property
    def reach(self) -> tuple[float, float]:
        """Half length and half width (m) about the lowest meridian that the sampled road has under a standing tire."""
        return max(-self.met[0], self.met[1]), float(np.abs(self.y).max())

    def smooth(self) -> TrainingRoads:
        """The same with flanks no steeper than 1.2."""
        z, width = self.z, PITCH[0]
        while self._slope(z) > STEEPEST:
            z = ndimage.gaussian_filter(self.z, [width / pitch for pitch in PITCH], mode="nearest")
            width *= 1.25
        return replace(self, z=z)

    def _slope(self, z: Array) -> float:
        return float(np.hypot(*np.gradient(z, *PITCH)).max())

    def rises(self) -> list[Feature]:
        """Level rises and falls as far as the road takes the whole footprint, or half as far as its bumps reach."""
        long = max(round((self.footprint[1] - self.footprint[0]) / PITCH[0]), 1)
        mean = ndimage.uniform_filter1d(self.z.mean(axis=1), long, mode="nearest")
        up = max(mean.max(), 0.5 * self.z.max(), 0.0) + self.lift
        down = max(-mean.min(), -0.5 * self.z.min(), 0.5 * up, 0.0) + self.lift
        return [Feature(rise=float(max(up, LEAST))), Feature(rise=-float(max(down, LEAST)))]

    def ways(self) -> Array:
        """Ways (k,) m after which there are bumps under the tire, 15 mm apart, or farther where they are many."""
        count = len(self.x) - self._long + 1
        bumpy = np.abs(self.z).max(axis=1) > LEAST
        under = np.array([bumpy[first : first + self._long].any() for first in range(count)])
        places = np.flatnonzero(under)
        stride = max(round(APART / PITCH[0]), -(-len(places) // MOST))
        return PITCH[0] * places[::stride]

    def bumps(self) -> Array:
        """Largest height or depth (n,) m across the road at each x, of means over 20 mm both ways."""
        size = [max(round(SHORT / pitch), 1) for pitch in PITCH]
        mean: Array = np.abs(ndimage.uniform_filter(self.z, size, mode="nearest")).max(axis=1)
        return mean

    def passage(self) -> tuple[float, float]:
        """Ways (m) between which the bumps up to the greatest one, its mean over 20 mm, pass under the tire, from a level road on;
        (0, 0) where there are none."""
        bumpy = np.flatnonzero(np.abs(self.z).max(axis=1) > LEAST)
        if not len(bumpy):
            return 0.0, 0.0
        first, greatest = self.x[bumpy[0]] - self.x[self._long - 1], self.x[self.bumps().argmax()]
        return max(float(first), 0.0), float(greatest) - self.met[0]

    @property
    def _long(self) -> int:
        """Samples along that are under the tire at once."""
        return min(int(np.ceil((self.met[1] - self.met[0]) / PITCH[0])) + 1, len(self.x))

    def under(self, way: float) -> Passage:
        """The road under the tire after a way, m."""
        first = min(round(way / PITCH[0]), len(self.x) - self._long)
        some = slice(first, first + self._long)
        return Passage(x=self.x[some] - way, y=self.y, z=self.z[some], way=way)


def _sampled(setup: ContactSetup, low: Array, high: Array) -> tuple[Array, Array, Array]:
    """x (n,), y (m,) and heights (n, m) of the road that passes between the corners (2,) m of what is under the tire."""
    last = high[0] + setup.rolled.travel
    x, y = (
        start + step * np.arange(max(np.ceil((end - start) / step), 3.0) + 1)
        for start, end, step in zip(low, (last, high[1]), PITCH, strict=True)
    )
    return x, y, setup.heights(x, y)
