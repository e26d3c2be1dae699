"""Air of the footprint on its way out: grooves as pipes, the texture between them as thin slits.

What the tread squeezes out of the texture's pits (contact.results.squeezed_air) leaves by the nearest of two ways: over
the footprint's edge, or into a circumferential groove, which carries it to its ends ahead and behind. With e^{+iwt}, a groove of the
section A is a line

    dp/dx = -i w rho_g / A U,    dU/dx = q - (i w A / K_g + 2 Y) p,

between ends of the impedance of a flanged pipe, (rho c / A) [(ka)^2/2 + 0.8217 i ka], a = (A/pi)^1/2 [Norris and Sheng 1989, low ka].
rho_g and K_g are those of a tube of the groove's hydraulic radius with viscous and thermal losses at its wall [Zwikker and Kosten 1949].
The texture on either side is a slit of the mean gap h, closed at its far end a distance b away: of the wave number kappa in it

    Y = i w h b / K_h F,    F = tan(kappa b) / (kappa b),

and of what is squeezed out evenly over it the part F reaches the groove at pressure 0 there. The air outside is that of the tire over
the road: each outlet is a source at the nearest place of the tire's face.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse, special

from tireroad.greens.tire_sound import SoundAir, SoundingTire

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]

VISCOSITY, PRANDTL, ADIABATIC = 1.81e-5, 0.71, 1.4  # Pa s, -, -: air at 20 degrees C
FLANGED = 0.8217  # of the radius: the length that a flanged end adds
_THIN = 1e-9  # m: a slit, not none
UNDER = 0.03  # m over the road: places of the tire's face near the contact


@dataclass(frozen=True)
class Groove:
    """A circumferential groove: its middle `y`, `width` and `depth`, all in m."""

    y: float
    width: float
    depth: float

    @property
    def area(self) -> float:
        """Section, m2."""
        return self.width * self.depth

    @property
    def hydraulic_radius(self) -> float:
        """Twice the section over its circumference, the road included, m."""
        return self.area / (self.width + self.depth)


@dataclass(frozen=True)
class Medium:
    """Density (kg/m3) and bulk modulus (Pa) of air between walls, (f,), complex for e^{+iwt}."""

    density: Complex
    modulus: Complex

    @staticmethod
    def in_tube(radius: float, frequency: Array, air: SoundAir) -> Medium:
        """In a circular tube, by Bessel functions of radius over the boundary layer's thickness."""

        def mean(number: float) -> Complex:
            at = radius * np.sqrt(-2j * np.pi * frequency * air.density * number / VISCOSITY)
            # Both are scaled by the same exponential.
            ratio: Complex = special.jve(1, at) / special.jve(0, at)
            return 2.0 * ratio / at

        return Medium._of(mean, air)

    @staticmethod
    def in_slit(height: float, frequency: Array, air: SoundAir) -> Medium:
        """Between two planes."""

        def mean(number: float) -> Complex:
            at = height / 2 * np.sqrt(2j * np.pi * frequency * air.density * number / VISCOSITY)
            found: Complex = np.tanh(at) / at
            return found

        return Medium._of(mean, air)

    @staticmethod
    def _of(mean: Callable[[float], Complex], air: SoundAir) -> Medium:
        whole = air.density * air.speed**2
        return Medium(
            density=air.density / (1 - mean(1.0)),
            modulus=whole / (1 + (ADIABATIC - 1) * mean(PRANDTL)),
        )

    def wave_number(self, frequency: Array) -> Complex:
        """kappa (f,) 1/m, whose imaginary part is negative."""
        return 2 * np.pi * frequency * np.sqrt(self.density / self.modulus)


def reaching(reach: float, height: float, frequency: Array, air: SoundAir) -> Complex:
    """F (f,): the part of what is squeezed evenly out of a slit of a `height` (m) and a length `reach` (m) that gets to its end."""
    if not reach * height:
        return np.ones(len(frequency), complex)
    along = Medium.in_slit(height, frequency, air).wave_number(frequency) * reach
    found: Complex = np.tan(along) / along
    return found


def to_ends(
    groove: Groove,
    length: float,
    stations: Array,
    frequency: Array,
    air: SoundAir,
    beside: Complex | float = 0.0,
) -> Complex:
    """Volume velocities (2, f, s) out of the rear and the front end of a groove per unit of them at `stations` (s,) m from the rear.

    `length` m; `beside` (f,) m4 s/kg: 2 Y, admittance of what opens into the groove per metre. Source: the line's
    equations (module), solved for a volume velocity at one place.
    """
    omega, area = 2 * np.pi * frequency, groove.area
    medium = Medium.in_tube(groove.hydraulic_radius, frequency, air)
    along = 1j * omega * medium.density / area
    across = 1j * omega * area / medium.modulus + beside
    rate, impedance = np.sqrt(along * across), np.sqrt(along / across)
    radius = np.sqrt(area / np.pi)
    ka = omega / air.speed * radius
    end = air.impedance / area * (ka**2 / 2 + 1j * FLANGED * ka)
    share = (end / impedance)[:, None]

    def side(distance: Array) -> tuple[Complex, Complex]:
        """Input impedance at a place so far from an end, and the volume velocity at the end over that there."""
        at = rate[:, None] * distance
        through = np.cosh(at) + share * np.sinh(at)
        return impedance[:, None] * (share * np.cosh(at) + np.sinh(at)) / through, 1 / through

    (rear, out_rear), (front, out_front) = side(stations), side(length - stations)
    both = rear + front
    return np.stack([front / both * out_rear, rear / both * out_front])


@dataclass(frozen=True)
class Outlets:
    """Ways out of the footprint's air.

    `sums` (o, k): cells of the footprint to ways: places of the edge first, then stations of the grooves; `edge` (e, 2) m: of the
    edge; `grooves`, each with its `ends` (g, 2) m: x of the rear and the front one, and `stations`, x in m; `reach` m: mean
    distance of a cell from its way out over the edge, `reaches` (g,) from the grooves.
    """

    sums: sparse.csr_matrix
    edge: Array
    grooves: tuple[Groove, ...]
    ends: Array
    stations: tuple[Array, ...]
    reach: float
    reaches: Array

    @staticmethod
    def of(
        inside: Mask,
        cell: NDArray[np.intp],
        x: Array,
        y: Array,
        grooves: Sequence[Groove] = (),
    ) -> Outlets:
        """The nearest way out of each cell (k, 2) of a footprint `inside` (nx, ny) on the grid `x`, `y` (m).

        Grooves beside the footprint are left out.
        """
        low, high = _ends(inside, x)
        left, right = _ends(inside.T, y)
        half = (x[1] - x[0]) / 2  # a groove is as long as its cells
        at, across = x[cell[:, 0]], y[cell[:, 1]]
        row, column = cell.T
        ways = [at - low[column], high[column] - at, across - left[row], right[row] - across]
        places = [
            np.stack([low[column], across], axis=1),
            np.stack([high[column], across], axis=1),
            np.stack([at, left[row]], axis=1),
            np.stack([at, right[row]], axis=1),
        ]
        taken = [g for g in grooves if inside[:, np.abs(y - g.y).argmin()].any()]
        nearest = [int(np.abs(y - g.y).argmin()) for g in taken]
        beyond = [np.maximum(np.abs(across - g.y) - g.width / 2, 0.0) for g in taken]
        ends = np.array([[low[j] - half, high[j] + half] for j in nearest]).reshape(-1, 2)
        for k, (rear, front) in enumerate(ends):  # only where the groove is beside the cell
            beyond[k] = np.where((at >= rear) & (at <= front), beyond[k], np.inf)
        distance = np.stack(ways + beyond)
        way = distance.argmin(axis=0)
        own = distance[way, np.arange(len(cell))]
        over = way < len(ways)
        chosen = np.stack(places)[np.minimum(way, len(ways) - 1), np.arange(len(cell))]
        edge, number = np.unique(chosen[over], axis=0, return_inverse=True)
        outlet = np.zeros(len(cell), dtype=int)
        outlet[over] = number
        stations, count = [], len(edge)
        for k in range(len(taken)):
            some = way == len(ways) + k
            station, index = np.unique(at[some], return_inverse=True)
            outlet[some] = count + index
            stations.append(station)
            count += len(station)
        ones = np.ones(len(cell)), (outlet, np.arange(len(cell)))
        return Outlets(
            sums=sparse.csr_matrix(ones, shape=(count, len(cell))),
            edge=edge,
            grooves=tuple(taken),
            ends=ends,
            stations=tuple(stations),
            # Of cells that lie evenly from 0 to the farthest, twice the mean distance.
            reach=2 * float(own[over].mean()) if over.any() else 0.0,
            reaches=np.array([2 * _mean(own[way == len(ways) + k]) for k in range(len(taken))]),
        )

    @property
    def places(self) -> Array:
        """Where air comes out (e + 2 g, 2) m: at the edge, then at the rear and the front end of each groove."""
        middle = np.repeat([g.y for g in self.grooves], 2)
        return np.vstack([self.edge, np.stack([self.ends.ravel(), middle], axis=1)])

    def leaving(self, rate: Complex, frequency: Array, height: float, air: SoundAir) -> Complex:
        """Volume velocities (e + 2 g, f) m3/s at the `places`, of those squeezed (o, f) m3/s, with a mean gap of `height` m."""
        first = len(self.edge)
        out = [rate[:first] * reaching(self.reach, height, frequency, air)]
        for groove, end, station, reach in zip(
            self.grooves, self.ends, self.stations, self.reaches, strict=True
        ):
            own = rate[first : first + len(station)]
            first += len(station)
            part = reaching(reach, height, frequency, air)
            slit = Medium.in_slit(max(height, _THIN), frequency, air).modulus
            beside = 2 * 2j * np.pi * frequency * height * reach / slit * part
            given = groove, end[1] - end[0], station - end[0], frequency, air, beside
            out.append(np.einsum("bfs,sf->bf", to_ends(*given), own * part))
        return np.vstack(out)


def _ends(inside: Mask, place: Array) -> tuple[Array, Array]:
    """First and last place of each column of a footprint; NaN where it has none."""
    some = inside.any(axis=0)
    low = np.where(some, place[inside.argmax(axis=0)], np.nan)
    high = np.where(some, place[len(place) - 1 - inside[::-1].argmax(axis=0)], np.nan)
    return low, high


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else 0.0


def on_elements(tire: SoundingTire, face: Array, places: Array) -> sparse.csr_matrix:
    """Shares (e, o) of the elements in sources at `places` (o, 2) m beside the contact, x forward and y left on the road.

    g of a source is that at the nearest node of the outer face that is in the air; `face` (s, 3) m: the nodes in the road's axes,
    over the road.
    """
    free = np.flatnonzero((np.linalg.norm(tire.area, axis=1) > 0) & (face[:, 2] < UNDER))
    apart = np.linalg.norm(face[free, None, :2] - places[None], axis=2)
    return tire.nodes[free[apart.argmin(axis=0)]].T.tocsr()
