"""Roads by which the nonlinear force is trained and tested, and the contact with them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol

import numpy as np
from scipy import interpolate, sparse

from tireroad.fem.errors import ConvergenceError
from tireroad.fem.static.footprint import TreadSurface
from tireroad.fem.static.state import StaticState
from tireroad.fem.tire.mesh import NodeGrid

Array = np.ndarray

_MOST, _CLOSE, _REACH = 60, 1e-7, 8e-3  # iterations; m; m of motion in one of them


class Surface(NamedTuple):
    """Height (n,) m over the static road plane, slopes (n, 2) and curvatures (n, 2, 2) 1/m at n places."""

    height: Array
    slope: Array
    curvature: Array


class Ground(Protocol):
    """A road under a tire that does not roll on, x forward, y left of the axle, m, over the static road plane."""

    @property
    def largest(self) -> float:
        """Its greatest height or depth, m."""

    def times(self, part: float) -> Ground:
        """A part of its heights."""

    def at(self, x: Array, y: Array) -> Surface:
        """Height, slopes and curvatures at places (n,) m."""


@dataclass(frozen=True, kw_only=True)
class Feature:
    """A level rise, m, and a bar or hole upon it: the road at x forward, y left of the axle, m.

    `height` of the bar, negative for a hole; `length` along x at half height, about `position`; `ramp`: length of
    its flanks, h t^2 (3 - 2 t); `across`: its ends in y, with the same flanks.
    """

    rise: float = 0.0
    height: float = 0.0
    length: float = 0.02
    position: float = 0.0
    ramp: float = 0.01
    across: tuple[float, float] = (-np.inf, np.inf)

    @property
    def varies_across(self) -> bool:
        """Whether its height depends on y."""
        return bool(np.isfinite(self.across).any()) and self.height != 0.0

    @property
    def largest(self) -> float:
        """The greater of rise and height, m."""
        return max(abs(self.rise), abs(self.height))

    def times(self, part: float) -> Feature:
        """A part of its height and rise."""
        return replace(self, rise=part * self.rise, height=part * self.height)

    def turned(self) -> Feature:
        """The road turned by half a turn about the vertical."""
        low, high = self.across
        return replace(self, position=-self.position, across=(-high, -low))

    def at(self, x: Array, y: Array) -> Surface:
        """Height, slopes and curvatures at places (n,) m."""
        along = _hump(
            x, self.position - self.length / 2, self.position + self.length / 2, self.ramp
        )
        over = _hump(y, *self.across, self.ramp)
        slope = np.stack([along[1] * over[0], along[0] * over[1]], axis=-1)
        curvature = np.empty((len(x), 2, 2))
        curvature[:, 0, 0], curvature[:, 1, 1] = along[2] * over[0], along[0] * over[2]
        curvature[:, 0, 1] = curvature[:, 1, 0] = along[1] * over[1]
        height = self.rise + self.height * along[0] * over[0]
        return Surface(height, self.height * slope, self.height * curvature)

    def __str__(self) -> str:
        parts = [f"rise of {1e3 * self.rise:g} mm"] if self.rise else []
        if self.height:
            kind = "bar" if self.height > 0 else "hole"
            size = f"{1e3 * abs(self.height):g} x {1e3 * self.length:g} mm"
            parts.append(f"{kind} {size} at {1e3 * self.position:g} mm")
            if self.varies_across:
                parts.append("from {:g} to {:g} mm across".format(*(1e3 * y for y in self.across)))
        return ", ".join(parts) or "level road"


def _hump(x: Array, low: float, high: float, ramp: float) -> tuple[Array, Array, Array]:
    """Value, slope and curvature of a hump of height 1 between places at half height, m."""
    up, down = _step(x - low, ramp), _step(high - x, ramp)
    value = up[0] * down[0]
    return (
        value,
        up[1] * down[0] - up[0] * down[1],
        up[2] * down[0] - 2 * up[1] * down[1] + up[0] * down[2],
    )


def _step(distance: Array, ramp: float) -> tuple[Array, Array, Array]:
    """t^2 (3 - 2 t) of t = distance / ramp + 1/2 between 0 and 1, and its derivatives."""
    t = np.clip(distance / ramp + 0.5, 0.0, 1.0)
    return t * t * (3 - 2 * t), 6 * t * (1 - t) / ramp, (6 - 12 * t) * ((t > 0) & (t < 1)) / ramp**2


@dataclass(frozen=True, kw_only=True)
class Passage:
    """A road where the tire meets it: heights `z` (n, m) m at x (n,) and y (m,) m, a cubic spline between them and level
    beyond. `way` m rolled there, by which it is named; `part` of its heights."""

    x: Array
    y: Array
    z: Array
    way: float
    part: float = 1.0
    _kept: list[interpolate.RectBivariateSpline] = field(
        default_factory=list, repr=False, compare=False
    )

    @property
    def _spline(self) -> interpolate.RectBivariateSpline:
        if not self._kept:  # shared by all its parts
            self._kept.append(interpolate.RectBivariateSpline(self.x, self.y, self.z))
        return self._kept[0]

    @property
    def largest(self) -> float:
        """Its greatest height or depth, m."""
        return self.part * float(np.abs(self.z).max())

    def times(self, part: float) -> Passage:
        """A part of its heights."""
        return replace(self, part=part * self.part)

    def at(self, x: Array, y: Array) -> Surface:
        """Height, slopes and curvatures at places (n,) m."""
        ends = (self.x[0], self.x[-1]), (self.y[0], self.y[-1])
        places = [np.clip(one, *end) for one, end in zip((x, y), ends, strict=True)]
        free = [one == place for one, place in zip((x, y), places, strict=True)]

        def derived(along: int, across: int) -> Array:
            found = self.part * self._spline.ev(*places, dx=along, dy=across)
            return np.where((free[0] | (along == 0)) & (free[1] | (across == 0)), found, 0.0)

        mixed = derived(1, 1)
        curvature = np.array([[derived(2, 0), mixed], [mixed, derived(0, 2)]])
        slope = np.stack([derived(1, 0), derived(0, 1)], axis=-1)
        return Surface(derived(0, 0), slope, np.moveaxis(curvature, -1, 0))

    def __str__(self) -> str:
        return f"road after {self.way:.3f} m"


class Touch(NamedTuple):
    """Contact at one motion of the points: `force` (p,) N normal, `load` (3 p,) N on the tire in x, y and z,
    `entries` (a,): those of it that depend on the motion, and their derivative (a, a), N/m."""

    force: Array
    load: Array
    entries: Array
    derivative: sparse.csr_matrix


class Compliance(NamedTuple):
    """C - U S U^T (3 p, 3 p) m/N, of which U (3 p, k) and S (k, k) change often."""

    whole: Array
    thin: Array
    small: Array

    def times(self, load: Array) -> Array:
        """Motion (3 p,) m under loads (3 p,) N."""
        return self.whole @ load - self.thin @ (self.small @ (self.thin.T @ load))

    def among(self, index: Array) -> Array:
        """The rows and columns `index`."""
        thin = self.thin[index]
        return self.whole[np.ix_(index, index)] - thin @ self.small @ thin.T


@dataclass(frozen=True)
class ContactPoints:
    """Material points (p) of the outer face on springs of a tread, about a static state.

    `weights` (3 p, 3 s): from the outer face's nodes to the points, all x, then all y, then all z; `places` (p, 3)
    m; `stiffness` (p,) N/m; `gap` (p,) m at rest over the road plane: -force / stiffness where the static state
    has contact, so that it remains in equilibrium. Motions w (3 p,) m count from there. Not collective.
    """

    weights: sparse.csr_matrix
    places: Array
    stiffness: Array
    gap: Array

    @property
    def rest(self) -> Array:
        """Forces (3 p,) N of the static state."""
        load = np.zeros(3 * len(self.gap))
        load[2 * len(self.gap) :] = self.stiffness * np.maximum(0.0, -self.gap)
        return load

    def touch(self, w: Array, road: Ground, moved: bool = True) -> Touch:
        """The forces f (-r_x, -r_y, 1), f = k max(0, r - z), of a `road` without friction.

        It is read at the moved place x + u_x, y + u_y of each point, or at its place at rest.
        """
        p, k = len(self.gap), self.stiffness
        w = w.reshape(3, p)
        x, y = self.places[:, :2].T + (w[:2] if moved else 0.0)
        surface = road.at(x, y)
        force = k * np.maximum(0.0, surface.height - self.gap - w[2])
        slope = surface.slope
        load = np.concatenate([-force * slope[:, 0], -force * slope[:, 1], force])
        on = np.flatnonzero(force > 0)
        normal = np.stack([-slope[on, 0], -slope[on, 1], np.ones(len(on))], axis=1)
        felt = normal if moved else np.array([0.0, 0.0, 1.0]) + 0 * normal
        block = -k[on, None, None] * normal[:, :, None] * felt[:, None, :]
        if moved:
            block[:, :2, :2] -= force[on, None, None] * surface.curvature[on]
        # On a level part of the road a point takes part in z alone.
        there = block.any(axis=1) | block.any(axis=2)
        number = np.cumsum(there).reshape(there.shape) - 1
        point, row, column = np.nonzero(block)
        entries = number[point, row], number[point, column]
        index = (np.arange(3) * p + on[:, None])[there]
        derivative = sparse.csr_matrix((block[point, row, column], entries), (len(index),) * 2)
        return Touch(force, load, index, derivative)

    def solve(
        self, compliance: Compliance, free: Array, road: Ground, w: Array, moved: bool = True
    ) -> tuple[Array, Touch]:
        """Motion w = free + compliance (load - rest) (3 p,) m and its contact, by Newton's method from `w`.

        Raises ConvergenceError if there is no convergence.
        """
        rest = self.rest
        for turn in range(_MOST):
            touch = self.touch(w, road, moved)
            off = w - free - compliance.times(touch.load - rest)
            size = np.abs(off).max()
            if size < _CLOSE:
                return w, touch
            if not np.isfinite(size):
                break
            on, slope = touch.entries, touch.derivative
            inside = np.linalg.solve(np.eye(len(on)) - compliance.among(on) @ slope, -off[on])
            pushed = np.zeros(len(w))
            pushed[on] = slope @ inside
            change = compliance.times(pushed) - off
            change[on] = inside
            reach = _REACH if turn < _MOST / 2 else _REACH / 4
            w = w + min(1.0, reach / np.abs(change).max()) * change
        raise ConvergenceError(
            f"large motions: the contact with a {road} does not converge: {size:.1e} m left"
        )


def contact_points(
    lattice: NodeGrid,
    state: StaticState,
    bed: float,
    spacing: tuple[float, float] = (8e-3, 15e-3),
    half_length: float = 0.17,
    half_width: float = 0.09,
) -> ContactPoints:
    """Points about `spacing` (m) apart within +- `half_length` of the lowest meridian and +- `half_width` of the
    middle, m along the undeformed face, on a bed of springs `bed`, N/m3. Not collective.

    Their forces at rest are the static pressure times their areas, scaled to the load.
    """
    undeformed = lattice.points(lattice.face)
    surface = TreadSurface(lattice, undeformed)
    low = undeformed.reshape(*lattice.face_shape, 3)[0]
    crown = np.abs(low[np.abs(low[:, 1]).argmin(), 2])
    across = np.linspace(-half_width, half_width, 1 + 2 * round(half_width / spacing[1]))
    ring = np.linspace(-half_length, half_length, 1 + 2 * round(half_length / spacing[0])) / crown
    arc = np.interp(across, low[:, 1], lattice.arc)
    grid = [part.ravel() for part in np.meshgrid(ring, arc, indexing="ij")]
    weights = surface.weights(*grid)
    area = crown * (ring[1] - ring[0]) * (across[1] - across[0])
    places, force = weights @ state.positions, np.zeros(weights.shape[0])
    plane = places[:, 2].min()
    if state.road_height is not None:
        plane = state.road_height
        force = np.maximum(0.0, weights @ state.pressure) * area
        force *= state.load / max(force.sum(), np.finfo(float).tiny)
    stiffness = np.full(len(force), bed * area)
    gap = np.where(force > 0, -force / stiffness, np.maximum(places[:, 2] - plane, 0.0))
    three = sparse.vstack([sparse.kron(weights, unit) for unit in np.eye(3)[:, None, :]], "csr")
    return ContactPoints(three, places, stiffness, gap)
