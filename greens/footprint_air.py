"""Air of the footprint on its way out: grooves as pipes, the texture between them as thin slits.

What the tread squeezes out of the texture's pits (contact.results.squeezed_air) leaves by the nearest of two ways: over
the footprint's edge, or into a circumferential groove, which carries it to its ends ahead and behind. With e^{+iwt}, a groove of the
section A is a line

    dp/dx = -i w rho_g / A U,    dU/dx = q - (i w A / K_g + 2 Y) p,

between ends that have the inertia of a flanged pipe's, i w rho 0.8217 a / A, a = (A/pi)^1/2 [Norris and Sheng 1989, low ka], and radiate
against the resistance that the tire over the road gives them, their own and with each other (`radiation_resistance`): on a plane that is
the flanged pipe's, (rho c / A) (ka)^2/2; between tread and road, at 1 kHz, ten times as much and more.
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
from scipy import interpolate, sparse, special

from tireroad.greens.tire_sound import FAR, SoundAir, SoundingTire, Transfer, directions

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
            ratio: Complex = np.tanh(at) / at
            return ratio

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
    ratio: Complex = np.tan(along) / along
    return ratio


@dataclass(frozen=True)
class Line:
    """A groove between its rear and its front end, over frequencies.

    `shorted` (2, f, s): volume velocities out of the ends per unit at the stations, without pressure at the ends; `admittance` (2, 2,
    f) m4 s/kg: by which pressures at the ends reduce them.
    """

    shorted: Complex
    admittance: Complex

    @staticmethod
    def of(
        groove: Groove,
        length: float,
        stations: Array,
        frequency: Array,
        air: SoundAir,
        beside: Complex | float = 0.0,
    ) -> Line:
        """The line of a groove of a `length` m with `stations` (s,) m from the rear; `beside` (f,) m4 s/kg/m: 2 Y, what opens into it."""
        omega, area = 2 * np.pi * frequency, groove.area
        medium = Medium.in_tube(groove.hydraulic_radius, frequency, air)
        along = 1j * omega * medium.density / area
        across = 1j * omega * area / medium.modulus + beside
        rate, impedance = np.sqrt(along * across), np.sqrt(along / across)
        whole = np.sinh(rate * length)
        sides = length - stations, stations
        shorted = np.stack([np.sinh(rate[:, None] * one) / whole[:, None] for one in sides])
        own, other = 1 / (impedance * np.tanh(rate * length)), -1 / (impedance * whole)
        return Line(shorted, np.array([[own, other], [other, own]]))


def inertia(groove: Groove, frequency: Array, air: SoundAir) -> Complex:
    """Impedance (f,) Pa s/m3 of the air that moves at a flanged end: i w rho 0.8217 a / A."""
    radius = np.sqrt(groove.area / np.pi)
    return 2j * np.pi * frequency * air.density * FLANGED * radius / groove.area


def radiation_resistance(
    far: Transfer, met: sparse.csr_matrix, sources: sparse.csr_matrix, lines: Array
) -> Array:
    """Resistance (m, o, l) Pa s/m3 that sources `met` (shares (e, m) of the elements) radiate against beside `sources` (e, o).

    R_ij = (w rho)^2 / (rho c) int Re(g_i g_j*) r^2 dOmega, from the Green's functions `far` to `directions`, of which quotients by
    w^2 are interpolated at lines (l,) Hz. Of a source on a plane rho w^2 / (2 pi c), which is a flanged pipe's.
    """
    weight = directions()[1] * FAR**2
    own, every = (
        np.stack([np.asarray(shares.T @ one.T) for one in far.ahead]) for shares in (met, sources)
    )
    resistance = ((own * weight) @ np.swapaxes(every.conj(), 1, 2)).real
    at_lines = interpolate.CubicSpline(far.frequency, resistance)(lines)
    scale = (2 * np.pi * lines * far.air.density) ** 2 / far.air.impedance
    return np.asarray(np.moveaxis(at_lines * scale[:, None, None], 0, -1))


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
        under = [g for g in grooves if inside[:, np.abs(y - g.y).argmin()].any()]
        nearest = [int(np.abs(y - g.y).argmin()) for g in under]
        beyond = [np.maximum(np.abs(across - g.y) - g.width / 2, 0.0) for g in under]
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
        for k in range(len(under)):
            some = way == len(ways) + k
            station, index = np.unique(at[some], return_inverse=True)
            outlet[some] = count + index
            stations.append(station)
            count += len(station)
        ones = np.ones(len(cell)), (outlet, np.arange(len(cell)))
        return Outlets(
            sums=sparse.csr_matrix(ones, shape=(count, len(cell))),
            edge=edge,
            grooves=tuple(under),
            ends=ends,
            stations=tuple(stations),
            # Of cells that lie evenly from 0 to the farthest, twice the mean distance.
            reach=2 * float(own[over].mean()) if over.any() else 0.0,
            reaches=np.array([2 * _mean(own[way == len(ways) + k]) for k in range(len(under))]),
        )

    @property
    def places(self) -> Array:
        """Where air comes out (e + 2 g, 2) m: at the edge, then at the rear and the front end of each groove."""
        middle = np.repeat([g.y for g in self.grooves], 2)
        return np.vstack([self.edge, np.stack([self.ends.ravel(), middle], axis=1)])

    def leaving(
        self, rate: Complex, frequency: Array, height: float, air: SoundAir, resistance: Array
    ) -> Complex:
        """Volume velocities (e + 2 g, f) m3/s at the `places`, of those squeezed (o, f) m3/s, with a mean gap of `height` m.

        `resistance` (2 g, e + 2 g, f): `radiation_resistance` that the grooves' ends meet beside all places. The ends U of the grooves meet the pressures of all
        places: U = U_0 - Y p, p = Z U + R Q, Z of the ends' inertia and R.
        """
        first = len(self.edge)
        over = rate[:first] * reaching(self.reach, height, frequency, air)
        ends = 2 * len(self.grooves)
        admittance = np.zeros((ends, ends, len(frequency)), complex)
        impedance = resistance[:, first:].astype(complex)
        shorted = np.zeros((ends, len(frequency)), complex)
        begun = first
        for k, (groove, end, station, reach) in enumerate(
            zip(self.grooves, self.ends, self.stations, self.reaches, strict=True)
        ):
            both = slice(2 * k, 2 * k + 2)
            own = rate[begun : begun + len(station)]
            begun += len(station)
            part = reaching(reach, height, frequency, air)
            slit = Medium.in_slit(max(height, _THIN), frequency, air).modulus
            beside = 2 * 2j * np.pi * frequency * height * reach / slit * part
            given = groove, end[1] - end[0], station - end[0], frequency, air, beside
            line = Line.of(*given)
            shorted[both] = np.einsum("bfs,sf->bf", line.shorted, own * part)
            admittance[both, both] = line.admittance
            impedance[range(2 * k, 2 * k + 2), range(2 * k, 2 * k + 2)] += inertia(
                groove, frequency, air
            )
        if not ends:
            return over
        outside = np.einsum("ijf,jf->if", resistance[:, :first], over)
        shorted -= np.einsum("ijf,jf->if", admittance, outside)
        held, met = np.moveaxis(admittance, -1, 0), np.moveaxis(impedance, -1, 0)
        out = np.linalg.solve(np.eye(ends) + held @ met, shorted.T[..., None])[..., 0].T
        return np.vstack([over, out])


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
