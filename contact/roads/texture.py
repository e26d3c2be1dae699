"""A self-affine road texture: random tiles with a given spectrum, blended so that nothing repeats."""

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

PER_WAVE = 4  # places of a tile a shortest wave
WAVES = (16, 6)  # longest waves in a tile, along and across
WIDEST = 0.6  # m: a tile is at least as wide, since it does repeat across; no tire is wider
MOST_PLACES = 16_000_000  # of a tile: 128 MB
KEPT = 3  # blended halves of tiles in memory


class Texture:
    """Isotropic, Gaussian: power of a wave vector q ~ |q|^(-2 - 2H) between the two cut-offs.

    `rms` (m) of the heights, `hurst` exponent H in [0, 1], waves from `longest` down to `shortest`
    (m), `seed`. Along the road independent tiles T_k, each 16 longest waves long and drawn when it
    is reached, overlap by half:

        z = cos(pi s/2) T_k(x) + sin(pi s/2) T_{k+1}(x),   s in [0, 1] over the overlap,

    which keeps the variance, smears the spectrum by 1/16 of its lowest wave number, and never
    repeats. Across, a tile continues itself after its width (6 longest waves, 0.6 m at least).
    Heights are bilinear between places a quarter of the shortest wave apart. Source of the spectrum:
    Persson et al., J. Phys. Condens. Matter 17 (2005) R1.
    """

    extent = ((-np.inf, np.inf), (-np.inf, np.inf))

    def __init__(
        self, rms: float, hurst: float, longest: float, shortest: float, seed: int = 0
    ) -> None:
        if not 0.0 < shortest < longest:
            raise InputError(
                f"road: cut_off {shortest:g} m must be positive and below roll_off {longest:g} m"
            )
        if not (rms >= 0.0 and 0.0 <= hurst <= 1.0):
            raise InputError(f"road: rms {rms:g} m must not be negative, hurst {hurst:g} in [0, 1]")
        self._pitch = shortest / PER_WAVE
        self._shape = self._sizes(longest, shortest)
        self._rms, self._seed, self._filter = rms, seed, None
        self._hurst, self._longest, self._shortest = hurst, longest, shortest
        self._halves: dict[int, Array] = {}
        self.spacing = 0.5 * shortest

    def _sizes(self, longest: float, shortest: float) -> tuple[int, int]:
        """Places of a tile along and across, the first even."""
        from scipy import fft

        lengths = WAVES[0] * longest, max(WAVES[1] * longest, WIDEST)
        if lengths[0] * lengths[1] > MOST_PLACES * self._pitch**2:
            raise InputError(
                f"road: a tile of the texture, {lengths[0]:.3g} m x {lengths[1]:.3g} m every "
                f"{self._pitch:.3g} m, would have more than {MOST_PLACES:g} places; raise cut_off "
                f"({shortest:g} m) or lower roll_off ({longest:g} m)"
            )
        half, across = (
            fft.next_fast_len(int(np.ceil(length / self._pitch / part)), real=True)
            for length, part in zip(lengths, (2, 1), strict=True)
        )
        return 2 * half, across

    def _tile(self, number: int) -> Array:
        """The independent tile `number`: filtered white noise of exactly the expected variance."""
        from scipy import fft

        if self._filter is None:
            qx = fft.fftfreq(self._shape[0], self._pitch)[:, None]
            qy = fft.rfftfreq(self._shape[1], self._pitch)[None, :]
            q = np.hypot(qx, qy)
            kept = (q >= 1.0 / self._longest) & (q <= 1.0 / self._shortest)
            self._filter = np.where(kept, np.where(kept, q, 1.0) ** (-1.0 - self._hurst), 0.0)
        # Python's remainder: tiles before the beginning have numbers of their own.
        rng = np.random.default_rng([self._seed, number % 2**64])
        z = fft.irfft2(fft.rfft2(rng.standard_normal(self._shape)) * self._filter, self._shape)
        return z * (self._rms / z.std())

    def _half(self, number: int) -> Array:
        """Heights over the overlap of tiles number - 1 and number, with the row that follows."""
        if number not in self._halves:
            if len(self._halves) >= KEPT:
                del self._halves[next(iter(self._halves))]
            half = self._shape[0] // 2
            share = 0.5 * np.pi * (np.arange(half + 1) / half)[:, None]
            before, here = self._tile(number - 1), self._tile(number)
            # The row that follows the earlier tile's end has no weight.
            ending = np.concatenate([before[half:], before[:1]])
            self._halves[number] = np.cos(share) * ending + np.sin(share) * here[: half + 1]
        return self._halves[number]

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
        """The highest place from x0 to x1, m."""
        return max(float(z.max()) for z in self._strip(x0, x1))

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """The lowest place from x0 to x1, m."""
        return min(float(z.min()) for z in self._strip(x0, x1))

    def _strip(self, x0: float, x1: float):
        length = self._shape[0] // 2 * self._pitch
        for number in range(int(np.floor(x0 / length)), int(np.floor(x1 / length)) + 1):
            yield self._half(number)

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "Texture":
        """Nothing to prepare."""
        return self
