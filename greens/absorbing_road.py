"""Sound over a road that absorbs: the impedance of a porous layer, and the half-space it closes.

Over a plane z = 0 of the surface impedance Z = rho c / b, which reacts locally, dp/dz = i k b p
(e^{+iwt}). The Green's function is that of the rigid plane and a line of images under its image,

    G = e^{-ikr} / (4 pi r) + e^{-ikr'} / (4 pi r') + C,
    C = -2 i k b int_0 e^{-ikbs} e^{-ikR(s)} / (4 pi R(s)) ds,   R(s)^2 = d^2 + (h + s)^2,

d the distance along the road and h the sum of the heights. The images lie in the complex plane, where
the integral converges (Ochmann, J. Acoust. Soc. Am. 116 (2004) 3304; Taraldsen, Wave Motion 43
(2005) 91). On the path of steepest descent, with a = r' + b h and z = k d sqrt(1 - b^2),

    C = -(i k b / 2 pi) e^{-ikr'} J,   J = int_0^inf 2 e^{-2 v0 x - x^2} / sqrt((v0 + x)^2 + 2 i z) dx,
    v0 = i k (h + b r') / sqrt(i k a + i z),

and where Re v0 < 0 the surface wave is left behind on the way: C(v0) is then that of -v0 with the
other sign, and -(k b / 2) e^{ikbh} H_0^(2)(z). Nothing is approximated, at grazing incidence and next
to the road neither. All derivatives follow from C and P = (dC/dd) / d by dC/dh = ikb (C + 2 G') with
G' the field of the image, and by Helmholtz's equation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import hankel2

from tireroad.fem.parameters import Parameters, number

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Real32 = NDArray[np.float32]
Single = NDArray[np.complex64]

NODES = 40  # of the path: 1e-8 of C down to k r' = 1e-4
STEEPEST = np.pi / 6  # rad, of the path to the real axis: past the root's branch point
DECAY = 37.0  # e-folds along it
AT_ONCE = 40_000  # pairs of points whose paths are followed together
DISTANCES, SLOPES = 768, 96  # of a table: C to 2e-4
NEAREST = 1e-6  # of the longest distance of a table: nearer ones are taken as this
PRANDTL, HEATS = 0.71, 1.4  # of air


@dataclass(frozen=True, kw_only=True)
class PorousLayer(Parameters):
    """A porous layer on a rigid base, as of porous asphalt, reacting locally."""

    owner = "sound.road"
    resistivity: float = number(
        2e4, "N s/m4", "flow resistivity; the larger the more rigid", least=1, most=1e15
    )
    porosity: float = number(
        0.2, "-", "porosity of what the air reaches from above", least=1e-3, most=1
    )
    tortuosity: float = number(
        3.0, "-", "tortuosity: mass of the air in the pores over its own", least=1, most=100
    )
    thickness: float = number(0.04, "m", "thickness over the rigid base", least=1e-4, most=10)

    def impedance(
        self, frequency: Array, speed_of_sound: float = 343.0, density: float = 1.2
    ) -> Complex:
        """Surface impedance (f,) over that of air at frequencies (f,) Hz > 0, e^{+iwt}. Not collective.

        -i Zc cot(k d) with the phenomenological model of Hamet and Berengier (Berengier, Stinson, Daigle,
        Hamet, J. Acoust. Soc. Am. 101 (1997) 155), whose tortuosity is the square of their q.
        """
        viscous = self.porosity * self.resistivity / (2 * np.pi * density * self.tortuosity)
        thermal = self.resistivity / (2 * np.pi * density * PRANDTL)
        inertia = self.tortuosity * (1 - 1j * viscous / frequency)
        heat = HEATS - (HEATS - 1) / (1 - 1j * thermal / frequency)
        wave = 2 * np.pi * frequency / speed_of_sound * np.sqrt(inertia * heat)
        decay = np.exp(-2j * wave * self.thickness)  # Im k < 0
        return np.sqrt(inertia / heat) / self.porosity * (1 + decay) / (1 - decay)


@dataclass(frozen=True)
class AbsorbingPlane:
    """The plane z = 0 at the wave number `k` 1/m with the `admittance` b, that of air over its impedance."""

    k: float
    admittance: complex

    def correction(self, along: Array, heights: Array) -> tuple[Complex, Complex]:
        """C 1/m and P = (dC/d along) / along 1/m3 of points `along` m apart, of `heights` m in sum."""
        along, heights = np.broadcast_arrays(np.asarray(along, float), np.asarray(heights, float))
        terms = np.empty((2, along.size), complex)
        for first in range(0, along.size, AT_ONCE):
            some = slice(first, first + AT_ONCE)
            terms[:, some] = self._followed(along.ravel()[some], heights.ravel()[some])
        return terms[0].reshape(along.shape), terms[1].reshape(along.shape)

    def _followed(self, along: Array, heights: Array) -> tuple[Complex, Complex]:
        """The same of flat arrays, along the path of steepest descent."""
        k, b = self.k, complex(self.admittance)
        apart = np.maximum(np.hypot(along, heights), np.finfo(float).tiny ** 0.25)
        z = k * along * np.sqrt(1 - b**2)
        start = 1j * k * (apart + b * heights)  # i k a
        rise = heights + b * apart
        below = np.sqrt(start + 1j * z)
        v = 1j * k * rise / below
        wave = v.real < 0  # the path crosses the saddle of the surface wave
        v = np.where(wave, -v, v)
        size = np.maximum(np.abs(v), 1e-12)
        turn = np.clip(np.angle(v) / 2, -STEEPEST, STEEPEST)
        first = 2 * size * np.cos(np.angle(v) - turn)
        end = 2 * DECAY / (first + np.sqrt(first**2 + 4 * DECAY * np.cos(2 * turn)))
        ends = np.sqrt(-2j * z)  # where the root vanishes
        nearest = np.minimum(np.abs(v - ends), np.abs(v + ends))
        scale = np.maximum(np.minimum(np.minimum(size, nearest), end / 3), 1e-12)
        at, weight = np.polynomial.legendre.leggauss(NODES)
        power = np.log1p(end / scale)
        y = np.outer((at + 1) / 2, power)
        way = np.exp(-1j * turn)
        x = scale * np.expm1(y) * way
        step = weight[:, None] / 2 * power * scale * np.exp(y) * way
        more = x * (2 * v + x)  # k tau
        root = np.sqrt((v + x) ** 2 + 2j * z)
        part = 2 * step * np.exp(-more) / root
        j = part.sum(axis=0)
        # d/d along of 1 / ((v + x) root) at the same tau, over `along`
        slope = (k**2 * b * rise - 1j * k * more) / apart
        dj = (part * slope / ((v + x) * root) ** 2).sum(axis=0)
        outside = np.where(wave, 1, -1) * (1j * k * b / (2 * np.pi)) * np.exp(-1j * k * apart)
        c = outside * j
        p = outside * (dj - 1j * k / apart * j)
        if wave.any():
            zw, up = z[wave], -k * b / 2 * np.exp(1j * k * b * heights[wave])
            c[wave] += up * hankel2(0, zw)
            p[wave] -= up * hankel2(1, zw) * zw / along[wave] ** 2
        return c, p

    def source(self, place: Array, source: Array) -> tuple[Complex, Complex]:
        """C (n,) 1/m at `place` (n, 3) m of a point source (3,) m, and its gradient there (n, 3) 1/m2."""
        d, heights = place[:, :2] - source[:2], place[:, 2] + source[2]
        along = np.linalg.norm(d, axis=1)
        c, p = self.correction(along, heights)
        apart = np.hypot(along, heights)
        image = np.exp(-1j * self.k * apart) / (4 * np.pi * apart)
        rise = 1j * self.k * self.admittance * (c + 2 * image)
        return c, np.concatenate([p[:, None] * d, rise[:, None]], axis=1)

    def kernels(
        self,
        found: tuple[Any, Any],
        place: tuple[Any, Any],
        weight: tuple[Any, Any],
        normal: tuple[Any, Any, Any] | None = None,
    ) -> tuple[Any, Any]:
        """dC/dn_y and, given the `normal` at x, d2C/dn_x dn_y, from the values C and P `found`.

        Of points y - x = d: `place`, their image's distance and the heights' sum; `weight`, the products
        of n_y (times an area) with d along the road, and its z; `normal`, the same products of n_x, and
        that of both along the road.
        """
        (c, p), (apart, heights), (ahead, up) = found, place, weight
        k, b = 1j * apart.dtype.type(self.k), np.result_type(c)  # in the precision of the values
        turn = b.type(1j * self.k * self.admittance)
        image = np.exp(-k * apart) / (4 * apart.dtype.type(np.pi) * apart)
        rise = turn * (c + 2 * image)
        double = up * rise + ahead * p
        if normal is None:
            return double, 0.0
        along, high, both = normal
        fall = (
            -(k + 1 / apart) / apart * image
        )  # of the image's field along the road, over the distance
        turned = turn * (p + 2 * fall)
        bent = turn * (rise + 2 * heights * fall)
        level = np.maximum(apart**2 - heights**2, (1e-6 * apart) ** 2)
        rest = (k * k * c - bent - 2 * p) / level
        second = high * (up * bent + turned * ahead) - along * (up * turned + rest * ahead)
        return double, second - p * both

    def tabulated(self, farthest: float) -> Tabulated:
        """C and P for the many pairs of a body whose images are at most `farthest` m away."""
        return Tabulated(self, farthest)


@dataclass(frozen=True)
class Tabulated:
    """C and P between the points of a table over distances up to `farthest` m, and slopes."""

    plane: AbsorbingPlane
    farthest: float

    @cached_property
    def _values(self) -> tuple[Single, Single]:
        """r' e^{ikr'} C and r'^3 e^{ikr'} P (distances x slopes), smooth in r'^(1/4) and (h/r')^(1/2)."""
        apart = (self.farthest * np.linspace(0, 1, DISTANCES) ** 4)[:, None]
        apart[0] = apart[1] / 16
        steep = np.linspace(0, 1, SLOPES) ** 2
        c, p = self.plane.correction(apart * np.sqrt(1 - steep**2), apart * steep)
        ahead = apart * np.exp(1j * self.plane.k * apart)
        return (c * ahead).astype(np.complex64).ravel(), (p * ahead * apart**2).astype(
            np.complex64
        ).ravel()

    def at(self, apart: Real32, heights: Real32) -> tuple[Single, Single]:
        """C and P of images `apart` m away, of `heights` m in sum, by bilinear interpolation."""
        near = np.maximum(apart, np.float32(NEAREST * self.farthest))
        i = np.sqrt(np.sqrt(near * np.float32(1 / self.farthest))) * np.float32(DISTANCES - 1)
        j = np.sqrt(np.minimum(heights / near, np.float32(1.0))) * np.float32(SLOPES - 1)
        row = np.minimum(i.astype(np.int32), DISTANCES - 2)
        column = np.minimum(j.astype(np.int32), SLOPES - 2)
        i -= row
        j -= column
        place = row * SLOPES + column
        back = np.exp(np.complex64(-1j * self.plane.k) * near) / near
        rows = []
        for table in self._values:
            one = (1 - j) * table[place] + j * table[place + 1]
            other = (1 - j) * table[place + SLOPES] + j * table[place + SLOPES + 1]
            rows.append(((1 - i) * one + i * other) * back)
        return rows[0], rows[1] / near**2
