"""The road as the tire meets it: placement, run-in, level, motion, and the levels of its texture.

Mean profile depth (ISO 13473-1): the profile without waves shorter than 2.5 mm is divided into
pieces of 100 mm, each less its straight line; the mean of the highest peaks in the two halves of a
piece, averaged over the pieces. Level of a third octave (ISO 13473-4): 20 lg(a / 1 um), a being the
root mean square of the profile in the band, from a periodogram of Hann-windowed pieces with half
overlap, each less its straight line. Bands by wavelength, 10^(k/10) m.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError
from tireroad.fem.parameters import Parameters, choice, number

Array = NDArray[np.float64]
BASE = 0.1  # m, of a piece
SAMPLING = 5e-4  # m, between the samples from which the mean profile depth is taken
CUT_OFF = (
    2.4e-3  # m, of its low-pass filter, which runs there and back: half is left of 3 mm in power
)
REFERENCE = 1e-6  # m
_CYCLES = 5  # waves in a piece at a band's centre, at least
_SEAM = 0.1  # of the length, and at most this many metres, are blended
_LONGEST = 0.2
# The profile of the strip is sampled at no more than this many points.
MOST_POINTS = 1_000_000
PIECE = 20_000  # points evaluated at once
# The Gaussian profile filter of ISO 16610-21 passes half of a wave of the cut-off length; its
# weight exp(-pi (x / (alpha lambda))^2) has the standard deviation alpha lambda / sqrt(2 pi).
DEVIATION = np.sqrt(np.log(2) / np.pi) / np.sqrt(2 * np.pi)
NOTHING = 1e-9  # m: relief below is rounding
# Smallest number of pieces that a strip is divided into for its bounds: the level varies slowly
# over one.
PIECES = 64
LONGEST = 0.25  # m, longest piece
# The reported texture: longest and shortest profile (m), most points, largest spacing (m).
_SEEN, _LEAST_SEEN, _MOST_SEEN, _COARSEST = 20.0, 0.1, 100_000, 1e-3


@dataclass(frozen=True, kw_only=True)
class Placement(Parameters):
    """Where a road lies under the tire."""

    owner = "road"

    run_in: float = number(
        0.1,
        "m",
        "length over which the heights grow from flat: the run starts at rest",
        least=0,
        most=1e4,
    )
    lateral: float = number(
        0.0,
        "m",
        "y of the road under the tire's middle, positive to the left",
        least=-1e4,
        most=1e4,
    )
    start: float | None = number(
        None,
        "m",
        "x of the road under the axle at t = 0, in the file's own x for a measured road; absent: 0, or the "
        "first x of a file that does not contain 0",
        least=-1e6,
        most=1e6,
    )
    offset: float = number(
        0.0, "m", "height added to the whole road, positive up", least=-10, most=10
    )
    drum_radius: float | None = number(
        None,
        "m",
        "the road lies on a drum of this radius, and repeats after its circumference; absent: a plane",
        least=0.1,
        most=1e4,
    )
    drum: str = choice("outside", ("outside", "inside"), "side of the drum that the tire runs on")


def begun_at(road: object, start: float | None) -> float:
    """x (m) of the road under the axle at t = 0: `start`, or by default 0.

    A road from a file has `measured`, its first and last x (m): one that does not contain 0 is
    driven from its first x.
    """
    if start is not None:
        return start
    first, last = getattr(road, "measured", (0.0, 0.0))
    return 0.0 if first <= 0.0 <= last else first


def moved_start(first: float) -> str:
    """Message on a run that begins at the first x (m) of its file by default."""
    return (
        f"the axle starts at x = {shown(first)} m, the first of the file, which does not contain 0; "
        "road.start sets another x"
    )


def shown(x: float) -> str:
    """A position along the road (m) to the millimetre, as messages show it."""
    return f"{round(float(x), 3) + 0.0:.12g}"


@dataclass(frozen=True)
class Texture:
    """Mean profile `depth` m, None for a profile shorter than 100 mm, and third-octave levels.

    `wavelength` (k,) m, descending, and `level` (k,) dB re 1 um.
    """

    depth: float | None
    wavelength: Array
    level: Array


def texture_of(profile: Array, pitch: float, shortest: float = 0.0) -> Texture:
    """The texture of heights (n,) m every `pitch` m, in bands of waves longer than `shortest` m.

    Below that, a road on a grid has what its interpolation makes: 26 dB at 1.3 mm of a road cut off
    at 4 mm.
    """
    depth, (wavelength, level) = mean_profile_depth(profile, pitch), third_octaves(profile, pitch)
    whole = wavelength > 10**0.05 * shortest
    return Texture(depth, wavelength[whole], level[whole])


def mean_profile_depth(profile: Array, pitch: float) -> float | None:
    """Mean profile depth, m; None for less than 100 mm, or fewer than 8 points per 100 mm.

    ISO 13473-1:2019: means over 0.5 mm, a Butterworth low-pass of second order run there and back,
    each piece of 100 mm less its straight line, the mean of the peaks of its halves.
    """
    together = round(SAMPLING / pitch)
    if together > 1:
        profile = profile[: len(profile) // together * together].reshape(-1, together).mean(axis=1)
        pitch *= together
    count = round(BASE / pitch)
    if count < 8 or len(profile) < count:
        return None
    smooth = _without_short(profile, pitch)
    pieces = _level(smooth[: len(smooth) // count * count].reshape(-1, count))
    halves = np.array_split(pieces, 2, axis=1)
    return float(np.mean([half.max(axis=1) for half in halves]))


def third_octaves(profile: Array, pitch: float) -> tuple[Array, Array]:
    """Wavelengths (k,) m, descending, and levels (k,) dB re 1 um; empty for a short profile."""
    length = len(profile) * pitch
    first = int(np.ceil(10 * np.log10(2.5 * pitch)))
    last = int(np.floor(10 * np.log10(length / _CYCLES / 2)))
    exponents = np.arange(last, first - 1, -1)
    if len(exponents) == 0:
        return np.zeros(0), np.zeros(0)
    wavelength = 10.0 ** (exponents / 10)
    count = min(len(profile), 2 * int(_CYCLES * wavelength[0] / pitch))
    density, spacing = _periodogram(profile, pitch, count)
    # The integral of the density up to a wave number, linear between its lines.
    edges = (np.arange(len(density) + 1) - 0.5) * spacing
    total = np.concatenate([[0.0], np.cumsum(density) * spacing])
    low, high = (np.interp(10**s / wavelength, edges, total) for s in (-0.05, 0.05))
    power = np.maximum(high - low, 1e-30)
    return wavelength, 10 * np.log10(power / REFERENCE**2)


def _periodogram(profile: Array, pitch: float, count: int) -> tuple[Array, float]:
    """One-sided density (count // 2 + 1,) m^3 of pieces of `count` points; line spacing (1/m)."""
    window = np.hanning(count + 1)[:-1]
    begin = np.arange(0, len(profile) - count + 1, max(count // 2, 1))
    total = np.zeros(count // 2 + 1)
    for first in begin:  # one at a time: a long road has thousands
        piece = _level(profile[None, first : first + count])[0]
        total += np.abs(np.fft.rfft(window * piece)) ** 2
    return 2 * total / len(begin) * pitch / (window @ window), 1 / (count * pitch)


def _level(pieces: Array) -> Array:
    """Each row (n,) m less its straight line."""
    place = np.linspace(-1.0, 1.0, pieces.shape[1])
    slope = pieces @ place / (place @ place)
    return pieces - pieces.mean(axis=1, keepdims=True) - slope[:, None] * place


def _without_short(profile: Array, pitch: float) -> Array:
    """The profile by the low-pass filter of ISO 13473-1; as it is, where it has no shorter waves."""
    from scipy.signal import butter, sosfiltfilt  # not needed to read a scene

    if 2 * pitch >= CUT_OFF:
        return profile
    return sosfiltfilt(butter(2, 2 * pitch / CUT_OFF, output="sos"), profile)


class Repeated:
    """h(x mod L) of a road h, whose last part b blends into the mirror image of its beginning:

        z = (1 - w) h(x) + w h(L - x),   w from 0 to 1 over L - b < x < L.

    So z is continuous and only its slope jumps, and the road is needed only over its `length` L
    (m). x counts from the first x of a measured road, and from 0 on others.
    """

    def __init__(self, road: Road, length: float) -> None:
        self._road, self._length = road, length
        self._first: float = getattr(road, "measured", (0.0, 0.0))[0]
        self._seam = min(_SEAM * length, _LONGEST)
        self.spacing = road.spacing
        self.shortest_wave: float = getattr(road, "shortest_wave", 0.0)
        self.filled: int = getattr(road, "filled", 0)
        self.notes: tuple[str, ...] = (
            *getattr(road, "notes", ()),
            f"repeats after {length:.4g} m, blended over {self._seam:.2g} m",
        )

    @property
    def extent(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Endless along x, as wide as the road, m."""
        return (-np.inf, np.inf), self._road.extent[1]

    @property
    def _period(self) -> tuple[float, float]:
        """The part of the road that is needed, m."""
        return self._first, self._first + self._length

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x, y (m) of equal shape."""
        place = np.mod(x - self._first, self._length)
        z = self._road.height(self._first + place, y)
        share = (place - (self._length - self._seam)) / self._seam
        late = share > 0
        if late.any():
            w = share[late] ** 2 * (3.0 - 2.0 * share[late])
            back = self._first + (self._length - place[late])
            mirrored = self._road.height(back, np.asarray(y)[late])
            z = np.array(z)
            z[late] = (1.0 - w) * z[late] + w * mirrored
        return z

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Upper bound of the heights anywhere along x, m."""
        return self._road.highest(*self._period, y0, y1)

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Lower bound of the heights anywhere along x, m."""
        return self._road.lowest(*self._period, y0, y1)

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> Repeated:
        """The repeated road, with one period prepared. InputError if the road is shorter."""
        return Repeated(self._road.prepare(*self._period, y0, y1), self._length)


class Level:
    """Heights (m) along x (m), linear between its points and constant beyond them."""

    def __init__(self, x: Array, z: Array) -> None:
        self._x, self._z = x, z

    def __call__(self, x: Array) -> Array:
        return np.interp(x, self._x, self._z)

    def bounds(self, x0: float, x1: float) -> tuple[float, float]:
        """Least and greatest height from x0 to x1, m."""
        inside = self._z[np.searchsorted(self._x, x0) : np.searchsorted(self._x, x1)]
        ends = np.interp([x0, x1], self._x, self._z)
        values = np.concatenate([inside, ends])
        return float(values.min()), float(values.max())


def mean_level(road: Road, x0: float, x1: float, y0: float, y1: float) -> Level:
    """The mean height of a strip of road (contact.roads.under_tire.Road), as a constant level."""
    _, profile = _profile(road, x0, x1, y0, y1)
    return Level(np.array([x0]), np.array([profile.mean()]))


def wave_level(
    road: Road, x0: float, x1: float, y0: float, y1: float, longest_wave: float
) -> Level:
    """The waves of the strip longer than `longest_wave` (m): ISO 16610-21 on its mean profile.

    Beyond its ends the profile is continued by reflection. It is then a sum of cosines, each
    transmitted by the filter as exp(-pi (alpha lambda_c / lambda)^2), at a cost that does not
    depend on the cut-off.
    """
    from scipy.fft import dct, idct  # not needed to read a scene

    x, profile = _profile(road, x0, x1, y0, y1)
    waves = np.arange(len(x)) / (2 * (x1 - x0))  # 1/m
    passed = np.exp(-0.5 * (2 * np.pi * DEVIATION * longest_wave * waves) ** 2)
    return Level(x, idct(passed * dct(profile)))


def _profile(road: Road, x0: float, x1: float, y0: float, y1: float) -> tuple[Array, Array]:
    """x (n,) m and mean height over the width (n,) m, at half the road's spacing if affordable."""
    step = 0.5 * road.spacing
    if not np.isfinite(step):
        return np.array([x0]), np.zeros(1)
    counts = [max(int(np.ceil(d / step)), 1) for d in (x1 - x0, y1 - y0)]
    excess = np.sqrt(max(1.0, counts[0] * counts[1] / MOST_POINTS))
    nx, ny = (max(int(c / excess), 1) for c in counts)
    x = x0 + (np.arange(nx) + 0.5) * (x1 - x0) / nx
    y = y0 + (np.arange(ny) + 0.5) * (y1 - y0) / ny
    # The full width of a short piece at a time, so that a file is read once and a texture generated
    # once, not once for every y.
    pieces = np.array_split(x, max(nx * ny // PIECE, 1))
    means = [road.height(*np.meshgrid(piece, y)).sum(axis=0) / ny for piece in pieces]
    return x, np.concatenate(means)


def smoothstep(s: float) -> float:
    """6 s^5 - 15 s^4 + 10 s^3 on [0, 1], constant outside: twice continuously differentiable."""
    s = min(max(s, 0.0), 1.0)
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


@dataclass(frozen=True, kw_only=True)
class Motion(Parameters):
    """Height r(t) of the road over time: 0, a ramp, or a sine."""

    owner = "road.motion"

    kind: str = choice(
        "none", ("none", "ramp", "sine"), "vertical motion of the whole road over time"
    )
    amplitude: float = number(1.0e-3, "m", "amplitude of the motion, positive up", least=-1, most=1)
    frequency: float = number(
        50.0,
        "Hz",
        "frequency of the sine",
        least=1e-3,
        most=1e5,
        only_for=("kind", ("none", "sine")),
    )
    duration: float = number(
        0.01, "s", "duration of the ramp", least=1e-5, most=1e5, only_for=("kind", ("none", "ramp"))
    )


def make_motion(
    kind: str, amplitude: float = 0.0, frequency: float = 50.0, duration: float = 0.01
) -> Callable[[float], float]:
    """Height r(t) in m of the road over time t in s, r(0) = 0.

    kind "none": 0; "ramp": from 0 to `amplitude` (m, may be negative) over `duration` (s) by a
    smoothstep, then constant; "sine": amplitude sin(2 pi frequency t), frequency in Hz. InputError
    for another kind or a value outside the range given in `Motion`.
    """
    Motion(kind=kind, amplitude=amplitude, frequency=frequency, duration=duration)
    if kind == "ramp":
        return lambda t: amplitude * smoothstep(t / duration)
    if kind == "sine":
        return lambda t: amplitude * math.sin(2.0 * math.pi * frequency * t)
    return lambda t: 0.0


class Bounded(Protocol):
    """Bounds (m) of the heights in a strip of road."""

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float: ...

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float: ...


class Road(Bounded, Protocol):
    """Heights (m) at x in rolling direction and y to the left (m).

    `extent` ((x0, x1), (y0, y1)) in m, may be infinite; `spacing` (m) the shortest length resolved.
    """

    @property
    def extent(self) -> tuple[tuple[float, float], tuple[float, float]]: ...

    @property
    def spacing(self) -> float: ...

    def height(self, x: Array, y: Array) -> Array: ...

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> Road: ...


class Heights(Protocol):
    """Heights (m) at x along and y to the left (m)."""

    def height(self, x: Array, y: Array) -> Array: ...


def lattice_of(road: Heights, x: Array, y: Array) -> Array:
    """Heights (n, m) m of a road at every x (n,) with every y (m,), m.

    By the road's own `lattice(x, y)` if it has one, which computes once what depends on x or y
    alone, to the bits of its `height`.
    """
    lattice: Callable[[Array, Array], Array] | None = getattr(road, "lattice", None)
    if lattice is not None:
        return lattice(x, y)
    return road.height(*np.broadcast_arrays(x, y[:, None])).T


def is_level(road: Bounded, x0: float, x1: float, y0: float, y1: float) -> bool:
    """Whether a strip of road has one height, by its own bounds."""
    strip = x0, x1, y0, y1
    return bool(0.0 <= road.highest(*strip) - road.lowest(*strip) < NOTHING)


class RoadUnderTire:
    """A road placed under the axle; `prepare` cuts out the strip that a run passes over.

    start, lateral, run_in, offset, drum_radius (m), drum: see Placement; datum: "mean" subtracts
    the strip's mean height, "zero" nothing; longest_wave (m): longer waves are removed too.
    InputError for an unknown datum or a negative run_in.
    """

    def __init__(
        self,
        road: Road,
        *,
        start: float | None = None,
        lateral: float = 0.0,
        run_in: float = 0.1,
        offset: float = 0.0,
        datum: str = "zero",
        longest_wave: float | None = None,
        drum_radius: float | None = None,
        drum: str = "outside",
    ) -> None:
        if datum not in ("mean", "zero"):
            raise InputError(f'road: datum = "{datum}" is unknown: take "mean" or "zero"')
        if not run_in >= 0.0:
            raise InputError(f"road: run_in {run_in:g} m must not be negative")
        self._start = begun_at(road, start)
        self._moved = start is None and self._start != 0.0
        if drum_radius is not None and np.isfinite(road.spacing):
            road = Repeated(road, 2 * np.pi * drum_radius)
        self.road, self._datum, self.drum = road, datum, drum
        self._lateral, self.run_in, self._offset = lateral, run_in, offset
        self._longest_wave = longest_wave

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> PreparedRoad:
        """The strip of a run, in distances (m) from the axle's start and from the tire's middle.

        x0 is the foremost point of the patch at t = 0, ahead of the axle, x1 the farthest it gets,
        y0 and y1 its sides. Up to x0 the road is flat, whatever the file contains there, because
        the tire stands on it at t = 0. InputError if the road is too short, too narrow or has holes
        there.
        """
        if not (x0 <= x1 and y0 <= y1):
            raise InputError(f"road: empty strip, x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m")
        strip = (
            x0 + self._start,
            x1 + self._start,
            y0 + self._lateral,
            y1 + self._lateral,
        )
        road = self.road.prepare(*strip)
        prepared = PreparedRoad(
            road,
            shift=(self._start, self._lateral),
            level=self._level(road, strip),
            offset=self._offset,
            reach=(x0, x1),
            run_in=self.run_in,
        )
        if self._moved:
            prepared.notes += (moved_start(self._start),)
        return prepared

    def _level(self, road: Road, strip: tuple[float, float, float, float]) -> Level | None:
        if self._longest_wave is not None:
            return wave_level(road, *strip, self._longest_wave)
        return mean_level(road, *strip) if self._datum == "mean" else None


class PreparedRoad:
    """z(x, y) = s((x - lead)/run_in) [h(x + start, y + lateral) + offset - level] in m.

    s is the smoothstep, x the distance from the axle's starting point, y from the tire's middle.
    Also a `Road`, except for `prepare`. `filled` counts the holes that were filled; `notes`
    describes how else a measured road was processed.
    """

    def __init__(
        self,
        road: Road,
        shift: tuple[float, float],
        level: Level | None,
        offset: float,
        reach: tuple[float, float],
        run_in: float,
    ) -> None:
        self._road, self._shift, self._level, self._offset = road, shift, level, offset
        self._lead, self._run_in = reach[0], run_in
        self.end = reach[1]  # the largest x (m) at which `height` may be evaluated
        self._span = (reach[1] - reach[0]) * (1.0 + 1e-9)
        self.spacing = road.spacing
        self.filled: int = getattr(road, "filled", 0)
        self.notes: tuple[str, ...] = getattr(road, "notes", ())
        self._shortest: float = getattr(road, "shortest_wave", 0.0)

    @property
    def extent(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((x0, x1), (y0, y1)) of the road in the axle's coordinates, m."""
        (x0, x1), (y0, y1) = self._road.extent
        dx, dy = self._shift
        return (x0 - dx, x1 - dx), (y0 - dy, y1 - dy)

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) over the static road plane at x, y (m) of equal shape.

        ValueError for x beyond the prepared strip, where the border would be mistaken for the road.
        """
        ahead = self._ahead(x)
        along = self._along(ahead)
        return self._placed(self._road.height(along, np.asarray(y) + self._shift[1]), ahead, along)

    def lattice(self, x: Array, y: Array) -> Array:
        """Heights (n, m) m at every x (n,) with every y (m,), as `height`."""
        ahead = self._ahead(x)[:, None]
        along = self._along(ahead)
        z = lattice_of(self._road, along[:, 0], np.asarray(y) + self._shift[1])
        return self._placed(z, ahead, along)

    def _ahead(self, x: Array) -> Array:
        """Distances (m) behind the foremost point at t = 0."""
        ahead = np.asarray(x) - self._lead
        farthest = ahead.max(initial=0.0)
        if farthest > self._span:
            raise ValueError(f"x = {farthest + self._lead:g} m lies beyond the prepared strip")
        return ahead

    def _along(self, ahead: Array) -> Array:
        """Those places in the road's own x, m."""
        return np.maximum(ahead, 0.0) + (self._lead + self._shift[0])

    def _placed(self, z: Array, ahead: Array, along: Array) -> Array:
        """The road's own heights z (m), offset, levelled and grown over the run-in."""
        if self._offset != 0.0:
            z = z + self._offset
        if self._level is not None:
            z = z - self._level(along)
        if ahead.min(initial=np.inf) >= self._run_in:
            return z
        return z * self._share(ahead)

    def _share(self, ahead: Array) -> Array:
        if self._run_in == 0.0:
            return (ahead > 0.0).astype(float)
        s = np.minimum(np.maximum(ahead / self._run_in, 0.0), 1.0)
        return s * s * s * (10.0 + s * (6.0 * s - 15.0))

    def share(self, along: float) -> float:
        """The share of its height that the run-in leaves at x = `along` (m) of the road itself."""
        return float(self._share(np.array(along - self._shift[0] - self._lead)))

    @property
    def grown(self) -> float:
        """x (m) from which on the heights are whole, behind the run-in."""
        return self._lead + self._run_in

    @property
    def passed(self) -> tuple[float, float]:
        """First and last x (m) of the road itself that the front of the patch passes over."""
        return self._lead + self._shift[0], self.end + self._shift[0]

    @cached_property
    def texture(self) -> Texture | None:
        """Texture of the middle line after the run-in, over at most 20 m.

        None for a road without resolution (flat), or too short for an evaluation.
        """
        first = self.grown
        length = min(self.end - first, _SEEN)
        if not (np.isfinite(self.spacing) and length >= _LEAST_SEEN):
            return None
        pitch = max(min(0.25 * self.spacing, _COARSEST), length / _MOST_SEEN)
        x: Array = np.float64(first) + np.float64(pitch) * np.arange(int(length / pitch))
        return texture_of(self.height(np.asarray(x), np.zeros(len(x))), pitch, self._shortest)

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Upper bound (m) of the heights in a strip, including the flat start."""
        pieces = self._pieces(x0, x1, y0, y1)
        return max(0.0, *(self._road.highest(*piece) - low for piece, low, _ in pieces))

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Lower bound (m) of the heights in a strip, including the flat start."""
        pieces = self._pieces(x0, x1, y0, y1)
        return min(0.0, *(self._road.lowest(*piece) - high for piece, _, high in pieces))

    def _pieces(
        self, x0: float, x1: float, y0: float, y1: float
    ) -> Iterator[tuple[tuple[float, float, float, float], float, float]]:
        """The strip in the road's own coordinates, in pieces with bounds of what is subtracted."""
        dx, dy = self._shift
        count = max(PIECES, int(np.ceil((x1 - x0) / LONGEST))) if self._level else 1
        edges = np.linspace(x0 + dx, x1 + dx, count + 1)
        for start, end in zip(edges[:-1], edges[1:], strict=True):
            low, high = self._level.bounds(start, end) if self._level else (0.0, 0.0)
            yield (start, end, y0 + dy, y1 + dy), low - self._offset, high - self._offset
