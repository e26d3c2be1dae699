"""Isotropic random surfaces from levels of the texture, in tiles that repeat, in layers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.under_tire import Road, lattice_of
from tireroad.fem.errors import InputError

Array = NDArray[np.float64]
THIRD = 10.0**0.1  # ratio of two third octaves (IEC 61260, base ten)

PER_WAVE = 4  # points of a tile per shortest wave
WAVES = (16, 6)  # longest waves in a tile, along and across
WIDEST = 0.6  # m, smallest width of a tile, which repeats across; no tire is wider
MOST_PLACES = 16_000_000  # points of a tile: 128 MB
# Fewest blended halves in memory, and points up to which more are kept (64 MB): a run passes over its road several
# times, to level it, for its bounds and in the loop, and drawing it takes as long as the rest of the road under the points.
KEPT = 3, 8_000_000
# Longest over shortest wave of one field of tiles. The tiles of long waves can be coarse; the
# number of points of a single field for all waves would grow with the fourth power of their ratio.
_RATIO = 8.0
MOST_SKEW = 1.5
_NEIGHBOURS = 11
# Flanks of stones are that steep at most, times the pitch (as the limit of ISO 13473-1 for spikes).
STEEP = 3.0
_NOISE = 50e-6  # m
MOST_LOST = 0.1  # share of a profile that may be bridged
_LONGEST = 4  # longest waves of the surface that fit into the profile; twice the width fits one


def bands(shortest: float, longest: float) -> Array:
    """Edges (k + 1,) 1/m, ascending, of bands that fill the waves from `shortest` to `longest` (m).

    The bands are as near to third octaves as possible.
    """
    count = max(round(np.log(longest / shortest) / np.log(THIRD)), 1)
    return np.geomspace(1.0 / longest, 1.0 / shortest, count + 1)


def profile_power(edges: Array) -> Array:
    """(k, k) 1/m^2: variance of a profile in each band for C = 1 in one band."""
    low, high = edges[:-1, None], edges[1:, None]

    def within(radius: Array) -> Array:
        """int sqrt(radius^2 - n^2) dn over each band, for n < radius."""
        ends = [np.minimum(end, radius) for end in (low, high)]
        parts = [n * np.sqrt(radius**2 - n**2) + radius**2 * np.arcsin(n / radius) for n in ends]
        return 0.5 * (parts[1] - parts[0])

    return 4.0 * (within(edges[None, 1:]) - within(edges[None, :-1]))


def surface_density(edges: Array, power: Array) -> Array:
    """C (k,) m^4 in the bands between the `edges`, for profile variances `power` (k,) m^2 there.

    The least-squares nearest, since not every spectrum belongs to a surface (none that falls too
    fast towards long waves).

    C(q) (m^4) is the two-sided density of the surface's heights over wave vectors of length q (1/m,
    waves per metre). A profile along any line has the one-sided density

        G(n) = 4 int_n^inf C(q) q dq / sqrt(q^2 - n^2)       (m^3),

    so long waves of a profile are partly short ones cut obliquely. With C constant in each of k
    bands the power of a profile in each band is a triangular matrix times C, which is solved for
    nonnegative C.
    """
    from scipy.optimize import nnls  # not needed to read a scene

    matrix = profile_power(edges)
    unit = power / np.diag(matrix)  # of C in each band, to remove the scale
    weights, _ = nnls(matrix * unit / power.max(), power / power.max())
    return weights * unit


def filter_of(edges: Array, density: Array, wave: Array) -> Array:
    """sqrt(C) (m^2) at wave numbers (1/m) of any shape; 0 outside the bands."""
    band = np.searchsorted(edges, wave, side="right") - 1
    inside = (band >= 0) & (band < len(density))
    return np.where(inside, np.sqrt(density[np.clip(band, 0, len(density) - 1)]), 0.0)


def tile_size(longest: float) -> tuple[float, float]:
    """Length and width (m) of a tile for the longest wave (m)."""
    return WAVES[0] * longest, max(WAVES[1] * longest, WIDEST)


def tile_places(shortest: float, longest: float) -> float:
    """Number of points of a tile for waves from `shortest` to `longest` (m)."""
    along, across = tile_size(longest)
    return along * across / (shortest / PER_WAVE) ** 2


class Tiles:
    """Isotropic Gaussian field of root mean square `rms` (m).

    Waves from `shortest` to `longest` (m) have the `amplitude` (any unit) of their wave number
    (1/m), and are drawn by `seed`. Along the road independent tiles T_k, each 16 longest waves long
    and drawn when needed, overlap by half:

        z = cos(pi s/2) T_k(x) + sin(pi s/2) T_{k+1}(x),   s in [0, 1] over the overlap,

    which preserves the variance, smears the spectrum by 1/16 of its lowest wave number, and never
    repeats. Across, a tile is periodic in its width (6 longest waves, at least 0.6 m). Heights are
    bilinear between points a quarter of the shortest wave apart.
    """

    extent = ((-np.inf, np.inf), (-np.inf, np.inf))

    def __init__(
        self,
        amplitude: Callable[[Array], Array],
        *,
        shortest: float,
        longest: float,
        rms: float,
        seed: tuple[int, ...],
    ) -> None:
        self._amplitude, self._band, self._rms, self._seed = (
            amplitude,
            (shortest, longest),
            rms,
            seed,
        )
        self._pitch = shortest / PER_WAVE
        self._shape = self._places()
        self._filter: Array | None = None
        self._tiles: dict[int, Array] = {}
        self._halves: dict[int, Array] = {}  # ordered by use, the last one at the end
        # Lowest and highest point of each half ever drawn, so that bounds do not draw it again.
        self._ends: dict[int, tuple[float, float]] = {}
        self.shortest_wave, self.spacing = shortest, 0.5 * shortest

    def _places(self) -> tuple[int, int]:
        """Points of a tile along and across, the first number even."""
        from scipy import fft

        half, across = (
            fft.next_fast_len(int(np.ceil(length / self._pitch / part)), real=True)
            for length, part in zip(tile_size(self._band[1]), (2, 1), strict=True)
        )
        return 2 * half, across

    def _tile(self, number: int) -> Array:
        """The independent tile `number`: filtered white noise, scaled to the exact variance."""
        from scipy import fft

        if self._filter is None:
            qx = fft.fftfreq(self._shape[0], self._pitch)[:, None]
            qy = fft.rfftfreq(self._shape[1], self._pitch)[None, :]
            q = np.hypot(qx, qy)
            shortest, longest = self._band
            inside = (q >= 1.0 / longest) & (q <= 1.0 / shortest)
            self._filter = np.where(inside, self._amplitude(np.where(inside, q, 1.0)), 0.0)
        # Python's remainder: tiles before the beginning have distinct numbers too.
        rng = np.random.default_rng([*self._seed, number % 2**64])
        z = fft.irfft2(fft.rfft2(rng.standard_normal(self._shape)) * self._filter, self._shape)
        return z * (self._rms / z.std())

    def _drawn(self, number: int) -> Array:
        """The tile `number`; the last two are kept, since each takes part in two halves."""
        if number not in self._tiles:
            if len(self._tiles) > 1:
                del self._tiles[next(iter(self._tiles))]
            self._tiles[number] = self._tile(number)
        return self._tiles[number]

    def _half(self, number: int) -> Array:
        """Heights over the overlap of tiles number - 1 and number, with the following row."""
        half = self._halves.pop(number, None)
        self._halves[number] = self._blended(number) if half is None else half
        # With short waves a footprint covers several halves: if fewer were kept, each step would
        # draw all of them again.
        while len(self._halves) > max(KEPT[0], KEPT[1] // self._halves[number].size):
            del self._halves[next(iter(self._halves))]
        return self._halves[number]

    def _blended(self, number: int) -> Array:
        half = self._shape[0] // 2
        share = 0.5 * np.pi * (np.arange(half + 1) / half)[:, None]
        before, here = self._drawn(number - 1), self._drawn(number)
        # The row that follows the end of the earlier tile has no weight.
        ending = np.concatenate([before[half:], before[:1]])
        z = np.cos(share) * ending + np.sin(share) * here[: half + 1]
        self._ends[number] = float(z.min()), float(z.max())
        return z

    def height(self, x: Array, y: Array) -> Array:
        """Bilinear heights (m) at x, y (m) of equal shape."""
        half = self._shape[0] // 2
        u = np.asarray(x, dtype=float) / self._pitch
        number = np.floor(u / half).astype(np.int64)
        v = np.asarray(y, dtype=float) / self._pitch
        if number.size and number.min() == number.max():
            return self._within(int(number.flat[0]), u, v)
        out = np.empty(u.shape)
        for index in np.unique(number):
            out[number == index] = self._within(int(index), u[number == index], v[number == index])
        return out

    def _within(self, number: int, u: Array, v: Array) -> Array:
        z, rows = self._half(number), self._shape[0] // 2
        local = u - number * rows
        i = np.minimum(local.astype(np.int64), rows - 1)
        j = np.floor(v).astype(np.int64)
        s, t = local - i, v - j
        j = j % self._shape[1]
        next_j = (j + 1) % self._shape[1]
        near = z[i, j] + t * (z[i, next_j] - z[i, j])
        far = z[i + 1, j] + t * (z[i + 1, next_j] - z[i + 1, j])
        return near + s * (far - near)

    def lattice(self, x: Array, y: Array) -> Array:
        """Heights (n, m) m at every x (n,) with every y (m,): across first, at each row once."""
        half = self._shape[0] // 2
        u, v = (np.asarray(a, dtype=float) / self._pitch for a in (x, y))
        number = np.floor(u / half).astype(np.int64)
        floor = np.floor(v).astype(np.int64)
        j, t = floor % self._shape[1], v - floor
        next_j = (j + 1) % self._shape[1]
        out = np.empty((len(u), len(v)))
        for index in np.unique(number).tolist():
            here = number == index
            local = u[here] - index * half
            i = np.minimum(local.astype(np.int64), half - 1)
            rows, place = np.unique(np.concatenate([i, i + 1]), return_inverse=True)
            z = self._half(index)[rows]
            left = z.take(j, axis=1)
            left += t * (z.take(next_j, axis=1) - left)
            near, far = left[place[: len(i)]], left[place[len(i) :]]
            out[here] = near + (local - i)[:, None] * (far - near)
        return out

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """The highest point from x0 to x1, m."""
        return max(high for _, high in self._strip(x0, x1))

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """The lowest point from x0 to x1, m."""
        return min(low for low, _ in self._strip(x0, x1))

    def _strip(self, x0: float, x1: float) -> Iterator[tuple[float, float]]:
        length = self._shape[0] // 2 * self._pitch
        for index in range(int(np.floor(x0 / length)), int(np.floor(x1 / length)) + 1):
            if index not in self._ends:
                self._half(index)
            yield self._ends[index]

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> Tiles:
        """Nothing to prepare."""
        return self


class Skewed:
    """z = rms (h + b (h^2 - 1)) / sqrt(1 + 2 b^2) of a Gaussian h of variance 1.

    Mean 0, variance rms^2, skewness (6 b + 8 b^3) / (1 + 2 b^2)^1.5. Negative: plateaus with pits,
    as on rolled asphalt.
    """

    def __init__(self, skewness: float) -> None:
        from scipy.optimize import brentq  # not needed to read a scene

        def excess(b: float) -> float:
            return (6 * b + 8 * b**3) / (1 + 2 * b**2) ** 1.5 - skewness

        self._b = brentq(excess, -0.7, 0.7) if skewness else 0.0

    def __call__(self, h: Array) -> Array:
        b = self._b
        return (h + b * (h * h - 1.0)) / np.sqrt(1.0 + 2.0 * b * b)

    def bounds(self, low: float, high: float) -> tuple[float, float]:
        """Lowest and highest z for h from low to high."""
        ends = [float(self(np.array(h))) for h in (low, high)]
        turn = -0.5 / self._b if self._b else np.inf
        if low < turn < high:
            ends.append(float(self(np.array(turn))))
        return min(ends), max(ends)


class Layered:
    """`base` + rms * skew(sum of fields / rms), m; independent fields with a joint `rms` (m)."""

    extent = ((-np.inf, np.inf), (-np.inf, np.inf))

    def __init__(self, base: Road | None, fields: Sequence[Tiles], rms: float, skew: float) -> None:
        self._base, self._fields, self._rms, self._skew = base, fields, rms, Skewed(skew)
        self.spacing = min(field.spacing for field in fields)
        self.shortest_wave = min(field.shortest_wave for field in fields)

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x, y (m) of equal shape."""
        z = self._skewed([field.height(x, y) for field in self._fields])
        return z if self._base is None else z + self._base.height(x, y)

    def lattice(self, x: Array, y: Array) -> Array:
        """Heights (n, m) m at every x (n,) with every y (m,) m."""
        z = self._skewed([field.lattice(x, y) for field in self._fields])
        return z if self._base is None else z + lattice_of(self._base, x, y)

    def _skewed(self, fields: list[Array]) -> Array:
        return self._rms * self._skew(np.sum(fields, axis=0) / self._rms)

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Upper bound of the heights in a strip, m."""
        return self._bounds((x0, x1, y0, y1))[1]

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Lower bound of the heights in a strip, m."""
        return self._bounds((x0, x1, y0, y1))[0]

    def _bounds(self, strip: tuple[float, float, float, float]) -> tuple[float, float]:
        low, high = (
            sum(getattr(field, which)(*strip) for field in self._fields) / self._rms
            for which in ("lowest", "highest")
        )
        low, high = (self._rms * end for end in self._skew.bounds(low, high))
        if self._base is None:
            return low, high
        return low + self._base.lowest(*strip), high + self._base.highest(*strip)

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> Layered:
        """Nothing to prepare."""
        return self


def textured(
    edges: Array, power: Array, seed: int, base: Road | None = None, skewness: float = 0.0
) -> Layered:
    """An isotropic texture with given profile variances, on top of `base`.

    `power` (k,) m^2 in the bands between the `edges` (k + 1,) 1/m (isotropic.surface_density).
    InputError if the resulting surface has no variance.
    """
    density = surface_density(edges, power)
    # Variance of the surface in its bands.
    own = np.pi * density * (edges[1:] ** 2 - edges[:-1] ** 2)
    if not own.sum() > 0:
        raise InputError("road: a texture needs a level above nothing in one band at least")

    def field(part: slice, number: int) -> Tiles:
        ends = edges[part.start : part.stop + 1]
        return Tiles(
            lambda q: filter_of(ends, density[part], np.clip(q, ends[0], ends[-1] * (1 - 1e-12))),
            shortest=1.0 / ends[-1],
            longest=1.0 / ends[0],
            rms=float(np.sqrt(own[part].sum())),
            seed=(seed, number),
        )

    parts = [part for part in _parted(edges) if own[part].sum() > 0]
    fields = [field(part, number) for number, part in enumerate(parts, 1)]
    return Layered(base, fields, float(np.sqrt(own.sum())), skewness)


def _parted(edges: Array) -> list[slice]:
    """Bands in groups whose longest wave is at most _RATIO times the shortest."""
    count = len(edges) - 1
    groups = max(int(np.ceil(np.log(edges[-1] / edges[0]) / np.log(_RATIO))), 1)
    cuts = np.unique(np.linspace(0, count, min(groups, count) + 1).round().astype(int))
    return [slice(a, b) for a, b in pairwise(cuts.tolist())]


def band_power(wavelength: Sequence[float], level: Sequence[float], edges: Array) -> Array:
    """Variances (k,) m^2 in the bands between `edges` (1/m) from third-octave levels (re 1 um).

    The levels are given at wavelengths (m) and interpolated linearly over the logarithm, constant
    beyond.
    """
    middle = -np.log(np.sqrt(edges[1:] * edges[:-1]))
    order = np.argsort(wavelength)
    of = np.interp(middle, np.log(np.array(wavelength))[order], np.array(level, float)[order])
    width = np.log10(edges[1:] / edges[:-1]) / 0.1  # third octaves per band
    return 1e-12 * 10 ** (of / 10) * width


@dataclass(frozen=True)
class Cleaned:
    """`profile` (n,) m without holes; counts of `missing` and `outliers`; `longest` gap, m."""

    profile: Array
    missing: int
    outliers: int
    longest: float

    @property
    def summary(self) -> str:
        """The processing, in one line."""
        count = len(self.profile)
        lost = 100 * (self.missing + self.outliers) / count
        return (
            f"laser profile of {count} points: {self.missing} missing and {self.outliers} outliers bridged by "
            f"straight lines ({lost:.2g} %, longest {1e3 * self.longest:.3g} mm)"
        )


def cleaned(profile: Array, pitch: float, limit: float, longest: float, source: str) -> Cleaned:
    """Clean heights (n,) m every `pitch` m, nan where missing; gaps up to `longest` m are bridged.

    InputError if there is no valid height, if a gap is longer, or if more than a tenth would be
    bridged.

    An outlier is farther from the median of 11 neighbours than `limit` times 1.4826 times the
    median such distance of all points, and farther than 50 um. For Gaussian noise the factor yields
    the standard deviation, and the laser's own noise and the crests of fine waves remain. Gaps,
    outliers included, are bridged by straight lines up to a length; longer ones are refused, since
    their heights would be invented.
    """
    missing = np.isnan(profile)
    if missing.all():
        raise InputError(f"{source}: none of the {len(profile)} heights is a number")
    bridged = _bridged(profile, missing)
    outlier = _outliers(bridged, limit, STEEP * pitch) & ~missing
    lost = missing | outlier
    gap, place = _longest_run(lost)
    if gap * pitch > longest * (1 + 1e-9):
        raise InputError(
            f"{source}: {gap * pitch:.3g} m without a sound height at {place * pitch:.4g} m, more than "
            f"road.longest_gap = {longest:g} m; cut the profile there, or allow longer gaps"
        )
    if lost.mean() > MOST_LOST:
        raise InputError(
            f"{source}: {int(missing.sum())} heights are missing and {int(outlier.sum())} are outliers, "
            f"{100 * lost.mean():.3g} % of {len(profile)}, more than {100 * MOST_LOST:g} %: too few valid "
            f"heights. If road.outlier = {limit:g} takes steep stones for outliers, raise it"
        )
    whole = _bridged(profile, lost)
    return Cleaned(whole, int(missing.sum()), int(outlier.sum()), gap * pitch)


def _outliers(profile: Array, limit: float, least: float) -> NDArray[np.bool_]:
    from scipy.ndimage import median_filter  # not needed to read a scene

    distance = np.abs(profile - median_filter(profile, _NEIGHBOURS, mode="nearest"))
    return distance > max(limit * 1.4826 * float(np.median(distance)), _NOISE, least)


def _bridged(profile: Array, lost: NDArray[np.bool_]) -> Array:
    place, known = np.arange(len(profile)), np.flatnonzero(~lost)
    return np.interp(place, known, profile[known])


def _longest_run(lost: NDArray[np.bool_]) -> tuple[int, int]:
    """Number of points in the longest run of lost ones, and where it begins."""
    change = np.diff(np.concatenate([[0], lost.astype(np.int8), [0]]))
    begin, end = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    if len(begin) == 0:
        return 0, 0
    which = int(np.argmax(end - begin))
    return int(end[which] - begin[which]), int(begin[which])


def widened(profile: Array, pitch: float, width: float, seed: int) -> tuple[Array, Array]:
    """y (m,) m, symmetric about 0, and z (n, m) m of a surface with the profile (n,) m at y = 0.

    Waves too long for either length are those of the profile, constant across.

    The spectrum of the profile is taken as that of an isotropic Gaussian surface of density C(q). A
    wave of the profile with wave number k along then decays across as

        rho_k(y) = int C(sqrt(k^2 + l^2)) cos(2 pi l y) dl / int C dl,

    and the addition of u(k, y) - u(k, 0) rho_k(y), with an independent surface u, makes the whole
    equally rough everywhere (simple kriging of the line: Chiles and Delfiner, Geostatistics,
    7.3.1).
    """
    from scipy import fft  # not needed to read a scene

    half, longest, shape = _sizes(len(profile), pitch, width)
    across = 2 * half + 1
    smooth, rough = _split(profile, pitch, longest)
    edges = bands(2 * pitch, longest)
    power = _band_power(rough, pitch, edges)
    amplitude = _amplitude(edges, power, shape, pitch)
    middle = np.fft.rfft(np.pad(rough, (0, shape[0] - len(profile)), mode="reflect"))
    rho = _decay(amplitude)
    noise = np.random.default_rng(seed).standard_normal(shape)
    other = fft.ifft(fft.fft(fft.rfft(noise, axis=0), axis=1) * amplitude, axis=1)
    lag = np.abs(np.arange(across) - half)
    field = other[:, :across] + rho[:, lag] * (middle - other[:, half])[:, None]
    z = fft.irfft(field, shape[0], axis=0)[: len(profile)]
    y: Array = np.float64(pitch) * np.arange(-half, half + 1)
    return y, z + smooth[:, None]


def memory(count: int, pitch: float, width: float) -> float:
    """Largest memory of `widened`, bytes: 37 per height of the periodic surface (measured)."""
    _, _, shape = _sizes(count, pitch, width)
    return 37.0 * shape[0] * shape[1]


def _sizes(count: int, pitch: float, width: float) -> tuple[int, float, tuple[int, int]]:
    """Heights on either side of the profile, longest wave (m), and heights along and across."""
    from scipy.fft import next_fast_len  # not needed to read a scene

    half = int(np.ceil(0.5 * width / pitch))
    longest = min(count * pitch / _LONGEST, 2.0 * width)
    return half, longest, (_padded(count, longest, pitch), next_fast_len(2 * (2 * half + 1)))


def _split(profile: Array, pitch: float, longest: float) -> tuple[Array, Array]:
    """Waves longer than `longest` (m), including the straight line, and the rest."""
    from scipy.ndimage import gaussian_filter1d  # not needed to read a scene

    from tireroad.contact.roads.under_tire import DEVIATION

    smooth = gaussian_filter1d(profile, DEVIATION * longest / pitch, mode="nearest")
    return smooth, profile - smooth


def _band_power(profile: Array, pitch: float, edges: Array) -> Array:
    """Variances (k,) m^2 of the profile in the bands between the `edges` (1/m)."""
    power = np.abs(np.fft.rfft(profile - profile.mean())) ** 2 * 2 / len(profile) ** 2
    wave = np.fft.rfftfreq(len(profile), pitch)
    total = np.concatenate([[0.0], np.cumsum(power)])
    ends = np.interp(edges, np.concatenate([[0.0], wave + 0.5 * wave[1]]), total)
    return np.maximum(np.diff(ends), 1e-30)


def _padded(count: int, longest: float, pitch: float) -> int:
    """A length with small factors at which the profile does not meet its own beginning."""
    from scipy.fft import next_fast_len

    extra = min(int(longest / pitch), count - 1)
    whole = next_fast_len(count + extra, real=True)
    return whole if whole - count < count else count + extra


def _amplitude(edges: Array, power: Array, shape: tuple[int, int], pitch: float) -> Array:
    """(n // 2 + 1, m) amplitudes for white noise, such that profiles have the `power`."""
    density = surface_density(edges, power)
    along, across = np.fft.rfftfreq(shape[0], pitch), np.fft.fftfreq(shape[1], pitch)
    wave = np.hypot(along[:, None], across[None, :])
    return filter_of(edges, density, wave) / pitch


def _decay(amplitude: Array) -> Array:
    """rho (n // 2 + 1, m) at the transform's lags across."""
    correlation = np.fft.ifft(amplitude**2, axis=1).real
    own = correlation[:, :1]
    return np.where(own > 0, correlation / np.where(own > 0, own, 1.0), 1.0)
