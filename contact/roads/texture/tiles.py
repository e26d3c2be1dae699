"""Random fields with a given spectrum: tiles blended so that nothing repeats along the road."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PER_WAVE = 4  # points of a tile per shortest wave
WAVES = (16, 6)  # longest waves in a tile, along and across
WIDEST = 0.6  # m, smallest width of a tile, which repeats across; no tire is wider
MOST_PLACES = 16_000_000  # points of a tile: 128 MB
KEPT = 3, 2_000_000  # fewest blended halves in memory, and points up to which more are kept (16 MB)


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
            kept = (q >= 1.0 / longest) & (q <= 1.0 / shortest)
            self._filter = np.where(kept, self._amplitude(np.where(kept, q, 1.0)), 0.0)
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
        found = self._halves.pop(number, None)
        self._halves[number] = self._blended(number) if found is None else found
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
        for one in np.unique(number):
            out[number == one] = self._within(int(one), u[number == one], v[number == one])
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
