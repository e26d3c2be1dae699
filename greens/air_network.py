"""Air in narrow pipes that are joined at nodes and open to the outside at their mouths.

With e^{+iwt}, a pipe of the section A is a line

    dp/dx = -i w rho_g / A U,    dU/dx = q - (i w A / K_g + 2 Y) p,

rho_g and K_g those of a tube of its hydraulic radius with viscous and thermal losses at its wall [Zwikker and Kosten 1949]. Into it
opens a slit of the height h on either side, closed at its far end a distance b away: of the wave number kappa in it

    Y = i w h b / K_h F,    F = tan(kappa b) / (kappa b),

and of what is squeezed out evenly over the slit the part F reaches the pipe at pressure 0 there. A length l between two nodes is the two-port of
that line: with gamma^2 = z y and Z^2 = z / y of its series z and shunt y, the flows into it are coth(gamma l) / Z times the pressure at the same
end less 1 / (Z sinh(gamma l)) times that at the other; closed at one end it takes tanh(gamma l) / Z. A mouth has the inertia of a
flanged pipe's, i w rho 0.8217 a / A, a = (A / pi)^1/2 [Norris and Sheng 1989, low ka], and radiates against a resistance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse, special
from scipy.sparse.linalg import spsolve

from tireroad.greens.tire_sound import SoundAir

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Index = NDArray[np.intp]

VISCOSITY, PRANDTL, ADIABATIC = 1.81e-5, 0.71, 1.4  # Pa s, -, -: air at 20 degrees C
FLANGED = 0.8217  # of the radius: the length that a flanged end adds
_THIN = 1e-9  # m: a slit, not none


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
class Pipe:
    """Pipe of a rectangular section, `width` by `depth` m, the road on one side; slits of a `reach` (m) open into its two sides."""

    width: float
    depth: float
    reach: float = 0.0

    @property
    def area(self) -> float:
        """Section, m2."""
        return self.width * self.depth

    @property
    def hydraulic_radius(self) -> float:
        """Twice the section over its circumference, the road included, m."""
        return self.area / (self.width + self.depth)

    def line(self, frequency: Array, height: float, air: SoundAir) -> tuple[Complex, Complex]:
        """gamma (f,) 1/m and Z (f,) Pa s/m3, with slits of a `height` in m."""
        omega = 2 * np.pi * frequency
        medium = Medium.in_tube(self.hydraulic_radius, frequency, air)
        slit = Medium.in_slit(max(height, _THIN), frequency, air).modulus
        beside = 2j * omega * height * self.reach / slit
        beside = beside * reaching(self.reach, height, frequency, air)
        series = 1j * omega * medium.density / self.area
        shunt = 1j * omega * self.area / medium.modulus + beside
        return np.sqrt(series * shunt), np.sqrt(series / shunt)

    def inertia(self, frequency: Array, air: SoundAir) -> Complex:
        """Impedance (f,) Pa s/m3 of the air that moves at a flanged mouth: i w rho 0.8217 a / A."""
        radius = np.sqrt(self.area / np.pi)
        return 2j * np.pi * frequency * air.density * FLANGED * radius / self.area


@dataclass(frozen=True)
class Lengths:
    """Lengths of one `pipe` between nodes: `ends` (k, 2), the second -1 where it is closed, `length` (k,) m; `count` (k,) of them
    lie side by side, which need not be whole."""

    pipe: Pipe
    ends: Index
    length: Array
    count: Array


@dataclass(frozen=True)
class Mouth:
    """Where a `node` is open to the outside: `count` mouths of a `pipe` side by side."""

    node: int
    pipe: Pipe
    count: float = 1.0


@dataclass(frozen=True)
class Network:
    """Pipes joined at a number of `nodes`, with m `mouths`."""

    nodes: int
    lengths: tuple[Lengths, ...]
    mouths: tuple[Mouth, ...]

    def leaving(
        self,
        flow: Complex,
        frequency: Array,
        height: float,
        air: SoundAir,
        resistance: Array,
        outside: Complex | float = 0.0,
    ) -> Complex:
        """Volume velocities (s, m, f) m3/s out of the mouths, of those squeezed in at the nodes, `flow` (s, n, f), of s states.

        Y p + U = q at the nodes, p = (Z + R) U + p_0 at the mouths: `resistance` (m, m, f) Pa s/m3 is R, `outside` (s, m, f) Pa is
        p_0, the pressure that others make there, `height` (m) that of the slits.
        """
        place = np.array([mouth.node for mouth in self.mouths], dtype=int)
        inertia = [one.pipe.inertia(frequency, air) / one.count for one in self.mouths]
        met = np.moveaxis(resistance.astype(complex), -1, 0)
        met[:, range(len(place)), range(len(place))] += np.array(inertia).T
        radiating = np.linalg.inv(met)
        row, column, value = self._admittance(frequency, height, air)
        rows, columns = (
            np.concatenate([here, there.ravel()])
            for here, there in zip(
                (row, column), np.meshgrid(place, place, indexing="ij"), strict=True
            )
        )
        out = np.zeros((len(frequency), len(place), len(flow)), complex)
        beyond = np.moveaxis(np.zeros((len(flow), len(place), len(frequency))) + outside, 0, -1)
        for k, admittance in enumerate(radiating):
            values = np.concatenate([value[:, k], admittance.ravel()])
            matrix = sparse.csc_matrix((values, (rows, columns)), shape=(self.nodes, self.nodes))
            pushed = flow[:, :, k].T.astype(complex)
            pushed[place] += admittance @ beyond[:, k]
            pressure = spsolve(matrix, pushed).reshape(pushed.shape)
            out[k] = admittance @ (pressure[place] - beyond[:, k])
        return np.moveaxis(out, 0, -1).swapaxes(0, 1)

    def _admittance(self, frequency: Array, height: float, air: SoundAir) -> tuple:
        """Rows and columns (e,) and values (e, f) of Y: flows into the pipes per pressure at the nodes, to be added up."""
        rows, columns, values = [], [], []
        for some in self.lengths:
            rate, impedance = some.pipe.line(frequency, height, air)
            far, count = rate * some.length[:, None], some.count[:, None]
            shut = some.ends[:, 1] < 0
            own = np.where(shut[:, None], np.tanh(far), 1 / np.tanh(far)) * count / impedance
            other = (-count / (impedance * np.sinh(far)))[~shut]
            (one, two), first = some.ends[~shut].T, some.ends[:, 0]
            rows += [first, two, one, two]
            columns += [first, two, two, one]
            values += [own, own[~shut], other, other]
        return np.concatenate(rows), np.concatenate(columns), np.concatenate(values)
