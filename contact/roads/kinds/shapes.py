"""Roads of simple shapes: flat, a sine across the rolling direction, a step or a cleat."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.road import EndlessRoad, RoadKind, road_kind
from tireroad.fem.parameters import ParameterError, number

Array = NDArray[np.float64]

SHARP = 1e-3  # m: assumed length of an edge without a ramp


@road_kind("flat", "flat: all heights are 0")
class Flat(EndlessRoad):
    """Heights 0 m, endless."""

    sampled = False

    def height(self, x: Array, y: Array) -> Array:
        """Zeros in the shape of x, m."""
        return np.zeros(np.shape(x))

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """0 m."""
        return 0.0

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """0 m."""
        return 0.0


@road_kind("sine", "sine waves, their crests across the rolling direction")
class Sine(EndlessRoad):
    """z = a sin(2 pi x/L + phase): amplitude a and wavelength L in m, phase in degrees; endless."""

    sampled = False

    amplitude: float = number(1.0e-3, "m", "amplitude of the waves", least=0, most=1)
    wavelength: float = number(0.1, "m", "wavelength", least=1e-3, most=1e4)
    phase: float = number(0.0, "deg", "phase of the waves at x = 0", least=-360, most=360)

    @property
    def spacing(self) -> float:
        """Half the wavelength, m: two points per wave."""
        return 0.5 * self.wavelength

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x, m, for any y."""
        wavenumber = 2.0 * np.pi / self.wavelength
        return self.amplitude * np.sin(wavenumber * np.asarray(x) + math.radians(self.phase))

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """The amplitude, m, the upper bound of any strip."""
        return self.amplitude

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Minus the amplitude, m."""
        return -self.amplitude


@dataclass(frozen=True, kw_only=True)
class Edges(RoadKind):
    """Common parameters of steps and cleats."""

    sampled = False

    position: float = number(
        0.3, "m", "x of the foot of the first edge on the road's middle line", least=-1e6, most=1e6
    )
    height: float = number(0.01, "m", "height of the step or cleat, positive up", least=-1, most=1)
    ramp: float = number(
        0.005, "m", "length over which an edge rises; 0: a jump", least=0, most=1e4
    )
    angle: float = number(
        0.0,
        "deg",
        "angle between the edge and the axle; positive: the left side (y > 0) is met first",
        least=-89,
        most=89,
    )


@road_kind("step", "a step up or down")
class StepRoad(Edges):
    """A single edge."""

    def make(self) -> "Obstacle":
        """The road with the step."""
        return Obstacle(self, math.inf)


@road_kind("cleat", "a bar across the road, or a groove")
class Cleat(Edges):
    """Two edges."""

    length: float = number(
        0.02,
        "m",
        "length from the foot of the first edge to the start of the second, which falls over one more ramp",
        least=1e-4,
        most=1e4,
    )

    def validate(self) -> None:
        """Require that the second edge begins after the first has ended."""
        if self.ramp >= self.length:
            raise ParameterError(
                "ramp", f"= {self.ramp:g} m must be less than length = {self.length:g} m"
            )

    def make(self) -> "Obstacle":
        """The road with the cleat."""
        return Obstacle(self, self.length)


class Obstacle:
    """z = h [s(xi/r) - s((xi - l)/r)], xi = (x - position) cos(a) + y sin(a).

    h, r, a, position: `height`, `ramp`, `angle` and `position` of `edges`; l = `length` (m) from
    the beginning of one edge to that of the other, infinite for a step; s(t) = 3 t^2 - 2 t^3 on
    [0, 1], constant outside (a jump for r = 0).
    """

    extent = ((-np.inf, np.inf), (-np.inf, np.inf))

    def __init__(self, edges: Edges, length: float) -> None:
        self._position, self._height = edges.position, edges.height
        self._length, self._ramp = length, edges.ramp
        angle = math.radians(edges.angle)
        self._along, self._across = math.cos(angle), math.sin(angle)
        self.spacing = max(edges.ramp, SHARP)

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x, y (m) of equal shape."""
        return self._height * self._share(self._distance(np.asarray(x), np.asarray(y)))

    def _distance(self, x: Array, y: Array) -> Array:
        """xi, m."""
        return (x - self._position) * self._along + y * self._across

    def _share(self, xi: Array) -> Array:
        """Height over h at xi, m."""
        rise = self._edge(xi)
        if np.isfinite(self._length):
            rise = rise - self._edge(xi - self._length)
        return rise

    def _edge(self, xi: Array) -> Array:
        if self._ramp == 0.0:
            return (xi > 0.0).astype(float)
        s = np.clip(xi / self._ramp, 0.0, 1.0)
        return s * s * (3.0 - 2.0 * s)

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Upper bound of a strip, m."""
        return max(self._height * share for share in self._shares(x0, x1, y0, y1))

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Lower bound of a strip, m."""
        return min(self._height * share for share in self._shares(x0, x1, y0, y1))

    def _shares(self, x0: float, x1: float, y0: float, y1: float) -> tuple[float, float]:
        """Least and greatest share of the height in a strip: it rises, stays, then falls."""
        xi = self._distance(np.array([x0, x0, x1, x1]), np.array([y0, y1, y0, y1]))
        ends = self._share(np.array([xi.min(), xi.max()]))
        whole = xi.min() <= self._length and xi.max() >= self._ramp
        return float(ends.min()), 1.0 if whole else float(ends.max())

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "Obstacle":
        """Nothing to prepare."""
        return self
