"""The tread pattern: grooves that rotate with the tire, as depths under its outer face.

The material under the point (x, y) at time t was at s = x + v t around the tire: it moves as the
road does, and returns after the rolling circumference C = 2 pi r_e. The gap becomes
static + tire - road + depth(s, y).  Lateral grooves repeat by pitches; several pitch lengths in
random order spread the tone that equal pitches make at v (number of pitches) / C and its multiples.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tireroad.fem.errors import InputError

Array = NDArray[np.float64]
_SAMPLES = 4096  # around the tire, to check for land
_LEAST_LAND = 1e-3


class GrooveLike(Protocol):
    """A groove (runs.scene.tables.contact): lengths in m.

    `angle` a in degrees from the axle: the middle of a lateral groove is at s = s_0 + y tan(a).
    """

    @property
    def direction(self) -> str: ...
    @property
    def position(self) -> float: ...
    @property
    def width(self) -> float: ...
    @property
    def depth(self) -> float: ...
    @property
    def flank(self) -> float: ...
    @property
    def angle(self) -> float: ...
    @property
    def span(self) -> tuple[float, float]: ...


@dataclass(frozen=True)
class Heights:
    """A measured or drawn pattern.

    `depth` (n, m) m at n equal steps around the tire and at the ascending `y` (m,) m; constant
    beyond the ends.
    """

    depth: Array
    y: Array


@dataclass(frozen=True)
class Pattern:
    """`grooves`, or `heights`, on a tire of rolling `circumference` m.

    `starts` (p + 1,) m where the pitches begin, the last one being C.
    """

    circumference: float
    grooves: Sequence[GrooveLike] = ()
    starts: Array = field(default_factory=lambda: np.zeros(0))
    heights: Heights | None = None

    @property
    def pitches(self) -> int:
        """Number of pitches around the tire; 0 without lateral grooves."""
        return max(len(self.starts) - 1, 0) if any(_lateral(g) for g in self.grooves) else 0

    def depth(self, s: Array, y: Array) -> Array:
        """Depth (m) below the tread surface at s around the tire and y across (m), of one shape."""
        out = np.zeros(np.broadcast_shapes(np.shape(s), np.shape(y)))
        if self.heights is not None:
            return self._read(s, y, out)
        for groove in self.grooves:
            if _lateral(groove):
                away = self._from_pitches(s - np.tan(np.radians(groove.angle)) * y, groove)
                own = _profile(away * math.cos(math.radians(groove.angle)), groove)
                low, high = groove.span
                own = np.where((y >= low) & (y <= high), own, 0.0)
            else:
                own = _profile(y - groove.position, groove)
            np.maximum(out, own, out=out)
        return out

    def _from_pitches(self, s: Array, groove: GrooveLike) -> Array:
        """Distance (m) along s from the nearest groove, of which there is one in each pitch."""
        lengths = np.diff(self.starts)
        centres = self.starts[:-1] + groove.position * lengths
        around = np.mod(s, self.circumference)
        whole = np.concatenate([
            centres[-1:] - self.circumference, centres, centres[:1] + self.circumference
        ])  # fmt: skip
        right = np.clip(np.searchsorted(whole, around), 1, len(whole) - 1)
        return np.minimum(around - whole[right - 1], whole[right] - around)

    def _read(self, s: Array, y: Array, out: Array) -> Array:
        """Bilinear interpolation of the heights, periodic around the tire."""
        assert self.heights is not None, "a pattern of grooves has no heights"
        depth, across = self.heights.depth, self.heights.y
        place = np.mod(s, self.circumference) / self.circumference * len(depth)
        i = np.floor(place).astype(int) % len(depth)
        part = place - np.floor(place)
        j = np.clip(np.searchsorted(across, y) - 1, 0, len(across) - 2)
        share = np.clip((y - across[j]) / (across[j + 1] - across[j]), 0.0, 1.0)
        after = (i + 1) % len(depth)
        near = (1 - share) * depth[i, j] + share * depth[i, j + 1]
        far = (1 - share) * depth[after, j] + share * depth[after, j + 1]
        out[...] = (1 - part) * near + part * far
        return out

    def land(self, y: Array) -> float:
        """Share of the tread without depth at the positions y (m) across; InputError if none."""
        s = np.arange(_SAMPLES) * self.circumference / _SAMPLES
        share = float(np.mean(self.depth(*np.meshgrid(s, np.unique(y), indexing="ij")) <= 0.0))
        if share < _LEAST_LAND:
            raise InputError(
                "pattern: its grooves leave no contact area under the footprint: take narrower ones, or fewer"
            )
        return share


def pitch_starts(pitches: int, lengths: Sequence[float], seed: int, circumference: float) -> Array:
    """Starts of the pitches (p + 1,) m: relative `lengths` in equal numbers, shuffled."""
    drawn = np.resize(np.asarray(lengths, float), pitches)
    np.random.default_rng(seed).shuffle(drawn)
    return np.concatenate([[0.0], np.cumsum(drawn)]) * circumference / drawn.sum()


def _lateral(groove: GrooveLike) -> bool:
    return groove.direction == "lateral"


def _profile(away: Array, groove: GrooveLike) -> Array:
    """A trapezoid: full depth inside, with flanks about the edges."""
    inside = (groove.width / 2 + groove.flank / 2 - np.abs(away)) / groove.flank
    return groove.depth * np.clip(inside, 0.0, 1.0)
