"""A self-affine road texture: a random tile with a given spectrum, repeated without seams."""

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from tireroad.fem.errors import InputError

Array = NDArray[np.float64]

PER_WAVE = 4  # places of the tile a shortest wave
WAVES = (16, 6)  # longest waves in the tile, along and across
MOST_PLACES = 16_000_000  # 128 MB


class Texture:
    """Isotropic, Gaussian: power of a wave vector q ~ |q|^(-2 - 2H) between the two cut-offs.

    `rms` (m) of the heights, `hurst` exponent H in [0, 1], waves from `longest` down to `shortest`
    (m), `seed`. The tile is 16 longest waves long and 6 wide, bilinear between its places, and
    continues itself. Source of the spectrum: Persson et al., J. Phys. Condens. Matter 17 (2005) R1.
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
        shape = tuple(fft.next_fast_len(int(np.ceil(n * longest / self._pitch))) for n in WAVES)
        if shape[0] * shape[1] > MOST_PLACES:
            raise InputError(
                f"road: the texture's tile would have {shape[0]} x {shape[1]} places; raise cut_off "
                f"({shortest:g} m) or lower roll_off ({longest:g} m)"
            )
        self._z = self._tile(shape, rms, hurst, longest, shortest, seed)
        self.spacing = 0.5 * shortest

    def _tile(self, shape, rms: float, hurst: float, longest, shortest, seed: int) -> Array:
        noise = fft.rfft2(np.random.default_rng(seed).standard_normal(shape))
        qx = fft.fftfreq(shape[0], self._pitch)[:, None]
        qy = fft.rfftfreq(shape[1], self._pitch)[None, :]
        q = np.hypot(qx, qy)
        kept = (q >= 1.0 / longest) & (q <= 1.0 / shortest)
        filtered = noise * np.where(kept, np.where(kept, q, 1.0) ** (-1.0 - hurst), 0.0)
        z = fft.irfft2(filtered, shape)
        return z * (rms / z.std())

    def height(self, x: Array, y: Array) -> Array:
        """Bilinear heights (m) at x, y (m) of equal shape."""
        nx, ny = self._z.shape
        u, v = np.asarray(x) / self._pitch, np.asarray(y) / self._pitch
        i, j = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
        s, t = u - i, v - j
        i, j = i % nx, j % ny
        i1, j1 = (i + 1) % nx, (j + 1) % ny
        z = self._z
        near = z[i, j] + t * (z[i, j1] - z[i, j])
        far = z[i1, j] + t * (z[i1, j1] - z[i1, j])
        return near + s * (far - near)

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """The tile's highest place, m: the bound of any strip."""
        return float(self._z.max())

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """The tile's lowest place, m."""
        return float(self._z.min())

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "Texture":
        """Nothing to prepare."""
        return self
