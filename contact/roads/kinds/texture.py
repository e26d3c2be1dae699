"""A self-affine road texture: random tiles with a given spectrum, blended so that nothing repeats."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.kind import RoadKind, road_kind
from tireroad.fem.parameters import ParameterError, integer, number

Array = NDArray[np.float64]

PER_WAVE = 4  # places of a tile a shortest wave
WAVES = (16, 6)  # longest waves in a tile, along and across
WIDEST = 0.6  # m: a tile is at least as wide, since it does repeat across; no tire is wider
MOST_PLACES = 16_000_000  # of a tile: 128 MB
KEPT = 3  # blended halves of tiles in memory


@road_kind("texture", "an isotropic, self-affine random texture")
class Texture(RoadKind):
    """Spectrum and seed of a texture."""

    rms: float = number(2e-4, "m", "root mean square of the heights", least=0, most=1)
    hurst: float = number(
        0.8, "-", "Hurst exponent H: the spectrum falls as wave number^(-2-2H)", least=0, most=1
    )
    roll_off: float = number(0.05, "m", "longest wavelength", least=1e-4, most=100)
    cut_off: float = number(0.004, "m", "shortest wavelength", least=1e-5, most=100)
    seed: int = integer(0, "seed of the random generator", least=0, most=2**31 - 1)

    def validate(self) -> None:
        """A band of waves, and a tile that fits into memory."""
        if self.cut_off >= self.roll_off:
            raise ParameterError(
                "cut_off", f"= {self.cut_off:g} m must be less than roll_off = {self.roll_off:g} m"
            )
        pitch, (along, across) = self.cut_off / PER_WAVE, self.tile
        if along * across > MOST_PLACES * pitch**2:
            raise ParameterError(
                "cut_off",
                f"= {self.cut_off:g} m makes {along * across / pitch**2:.3g} places of a tile of "
                f"{along:.3g} m x {across:.3g} m (roll_off = {self.roll_off:g} m), more than "
                f"{MOST_PLACES:g}: take a longer cut_off or a shorter roll_off",
            )

    @property
    def tile(self) -> tuple[float, float]:
        """Length and width of a tile, m."""
        return WAVES[0] * self.roll_off, max(WAVES[1] * self.roll_off, WIDEST)

    def make(self) -> "Tiles":
        """The road of this texture."""
        return Tiles(self)


class Tiles:
    """Isotropic, Gaussian: power of a wave vector q ~ |q|^(-2 - 2H) between the two cut-offs.

    H the Hurst exponent, cut-offs the longest and the shortest wave. Along the road independent tiles T_k, each 16 longest waves long and drawn when it
    is reached, overlap by half:

        z = cos(pi s/2) T_k(x) + sin(pi s/2) T_{k+1}(x),   s in [0, 1] over the overlap,

    which keeps the variance, smears the spectrum by 1/16 of its lowest wave number, and never
    repeats. Across, a tile continues itself after its width (6 longest waves, 0.6 m at least).
    Heights are bilinear between places a quarter of the shortest wave apart. Source of the spectrum:
    Persson et al., J. Phys. Condens. Matter 17 (2005) R1.
    """

    extent = ((-np.inf, np.inf), (-np.inf, np.inf))

    def __init__(self, spec: Texture) -> None:
        self._spec = spec
        self._pitch = spec.cut_off / PER_WAVE
        self._shape = self._places()
        self._filter: Array | None = None
        self._tiles: dict[int, Array] = {}
        self._halves: dict[int, Array] = {}
        self.spacing = 0.5 * spec.cut_off

    def _places(self) -> tuple[int, int]:
        """Places of a tile along and across, the first even."""
        from scipy import fft

        half, across = (
            fft.next_fast_len(int(np.ceil(length / self._pitch / part)), real=True)
            for length, part in zip(self._spec.tile, (2, 1), strict=True)
        )
        return 2 * half, across

    def _tile(self, number: int) -> Array:
        """The independent tile `number`: filtered white noise of exactly the expected variance."""
        from scipy import fft

        spec = self._spec
        if self._filter is None:
            qx = fft.fftfreq(self._shape[0], self._pitch)[:, None]
            qy = fft.rfftfreq(self._shape[1], self._pitch)[None, :]
            q = np.hypot(qx, qy)
            kept = (q >= 1.0 / spec.roll_off) & (q <= 1.0 / spec.cut_off)
            self._filter = np.where(kept, np.where(kept, q, 1.0) ** (-1.0 - spec.hurst), 0.0)
        # Python's remainder: tiles before the beginning have numbers of their own.
        rng = np.random.default_rng([spec.seed, number % 2**64])
        z = fft.irfft2(fft.rfft2(rng.standard_normal(self._shape)) * self._filter, self._shape)
        return z * (spec.rms / z.std())

    def _drawn(self, number: int) -> Array:
        """The tile `number`; the last two are kept, as each takes part in two halves."""
        if number not in self._tiles:
            if len(self._tiles) > 1:
                del self._tiles[next(iter(self._tiles))]
            self._tiles[number] = self._tile(number)
        return self._tiles[number]

    def _half(self, number: int) -> Array:
        """Heights over the overlap of tiles number - 1 and number, with the row that follows."""
        if number not in self._halves:
            if len(self._halves) >= KEPT:
                del self._halves[next(iter(self._halves))]
            half = self._shape[0] // 2
            share = 0.5 * np.pi * (np.arange(half + 1) / half)[:, None]
            before, here = self._drawn(number - 1), self._drawn(number)
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

    def _strip(self, x0: float, x1: float) -> Iterator[Array]:
        length = self._shape[0] // 2 * self._pitch
        for index in range(int(np.floor(x0 / length)), int(np.floor(x1 / length)) + 1):
            yield self._half(index)

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "Tiles":
        """Nothing to prepare."""
        return self
