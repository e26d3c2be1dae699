"""A random road of an ISO 8608 class: one profile for the whole width, generated as it rolls by."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.road import Levelled, road_kind
from tireroad.fem.parameters import choice, integer, number

Array = NDArray[np.float64]

# Geometric mean of G_d(n0), m^3, at n0 = 0.1 cycles/m (ISO 8608, table C.1); G_d falls as n^-2.
CLASSES = {name: 16e-6 * 4.0**k for k, name in enumerate("ABCDEFGH")}
REFERENCE = 0.1
LONGEST = 1.0 / 0.011  # m, the standard's longest wavelength; the shortest is a parameter
WAVES = 400
CHUNK = 4096  # points of the profile generated at once: 13 MB of working memory, 33 kB kept
KEPT = 8  # chunks


@road_kind("iso8608", "a random profile of an ISO 8608 class, the same over the whole width")
class Iso8608(Levelled):
    """Class, shortest wave and seed of a profile."""

    drawn = True

    road_class: str = choice("C", tuple(CLASSES), "road class of ISO 8608, A smooth to H rough")
    shortest_wave: float = number(
        0.1, "m", "shortest wavelength of the profile", least=1e-3, most=50
    )
    seed: int = integer(0, "seed of the random generator", least=0, most=2**31 - 1)

    def make(self) -> "IsoProfile":
        """The road of this class."""
        return IsoProfile(self)


class IsoProfile:
    """z(x) = sum_k sqrt(2 G_d(n_k) dn_k) cos(2 pi n_k x + phase_k), n_k in equal bands of log n.

    G_d by road class, n up to 1/shortest wave, phases by seed. The profile is generated in chunks
    with 16 points per shortest wave and interpolated cubically (Catmull-Rom, error below 1 % of
    that wave's amplitude), so memory does not grow with the distance.
    """

    extent = ((-np.inf, np.inf), (-np.inf, np.inf))

    def __init__(self, spec: Iso8608) -> None:
        shortest = spec.shortest_wave
        edges = np.geomspace(1.0 / LONGEST, 1.0 / shortest, WAVES + 1)
        n = np.sqrt(edges[1:] * edges[:-1])
        density = CLASSES[spec.road_class] * (n / REFERENCE) ** -2
        self._amplitude = np.sqrt(2.0 * density * np.diff(edges))
        rng = np.random.default_rng(spec.seed)
        # A random position in its band for each wave: evenly spaced waves would repeat.
        n = edges[:-1] * (edges[1:] / edges[:-1]) ** rng.random(WAVES)
        self._wavenumber = 2.0 * np.pi * n
        self._phase = 2.0 * np.pi * rng.random(WAVES)
        self._pitch = shortest / 16.0
        self._chunks: dict[int, Array] = {}
        self.shortest_wave, self.spacing = shortest, 0.5 * shortest

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x, m, for any y."""
        place = np.asarray(x, dtype=float) / self._pitch
        chunk = np.floor(place / CHUNK).astype(np.int64)
        if chunk.size and chunk.min() == chunk.max():
            return self._within(int(chunk.flat[0]), place)
        out = np.empty(place.shape)
        for index in np.unique(chunk):
            out[chunk == index] = self._within(int(index), place[chunk == index])
        return out

    def lattice(self, x: Array, y: Array) -> Array:
        """Heights (n, m) m at every x (n,) with every y (m,), m."""
        return np.broadcast_to(self.height(x, y)[:, None], (len(x), len(y)))

    def _within(self, chunk: int, place: Array) -> Array:
        z = self._chunk(chunk)
        local = place - chunk * CHUNK
        i = np.minimum(local.astype(np.int64), CHUNK - 1)
        t = local - i
        before, here, there, after = (z[i + k] for k in range(4))
        bend = t * (1.0 - t)
        return (
            here + t * (there - here)
            + 0.5 * bend * ((1.0 - t) * (2.0 * here - before - there) + t * (2.0 * there - here - after))
        )  # fmt: skip

    def _chunk(self, number: int) -> Array:
        """The profile from one point before the chunk to two after it."""
        if number not in self._chunks:
            if len(self._chunks) >= KEPT:
                del self._chunks[next(iter(self._chunks))]
            x = self._pitch * (number * CHUNK + np.arange(-1, CHUNK + 2))
            waves = np.cos(np.outer(x, self._wavenumber) + self._phase)
            self._chunks[number] = waves @ self._amplitude
        return self._chunks[number]

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Highest point of the profile from x0 to x1, m, plus a bound between two points."""
        return self._extreme(x0, x1, np.max)

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Lowest point of the profile from x0 to x1, m, less a bound between two points."""
        return -self._extreme(x0, x1, lambda z: np.max(-z))

    def _extreme(self, x0: float, x1: float, pick: Callable[[Array], float]) -> float:
        first, last = (int(np.floor(v / self._pitch / CHUNK)) for v in (x0, x1))
        worst = -np.inf
        for index in range(first, last + 1):
            place = np.clip(np.array([x0, x1]) / self._pitch - index * CHUNK, 0, CHUNK)
            part = self._chunk(index)[int(place[0]) : int(place[1]) + 4]
            worst = max(worst, float(pick(part)))
        # z'' p^2/8 of all waves together bounds the excess between two points.
        return worst + float(self._amplitude @ self._wavenumber**2) * self._pitch**2 / 8.0

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "IsoProfile":
        """Nothing to prepare: chunks are generated as needed."""
        return self
