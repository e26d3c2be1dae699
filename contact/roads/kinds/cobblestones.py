"""A generated cobblestone road: rows of rounded blocks with joints, endless and reproducible."""

import math

import numpy as np
from numpy.typing import NDArray

from tireroad.contact.roads.road import Levelled, road_kind
from tireroad.fem.parameters import ParameterError, flag, integer, number

Array = NDArray[np.float64]

# Block heights stay within three standard deviations, so that bounds exist.
SIGMAS = 3.0
TAIL = 0.5 * math.erfc(SIGMAS / math.sqrt(2.0))
# A prepared strip tabulates its blocks' heights up to this number (16 MB); above, they are
# generated again in every call, which takes 89 instead of 35 us for 300 points.
TABLE_LIMIT = 2_000_000


@road_kind("cobblestones", "rows of rounded stone blocks with joints, endless, random heights")
class Cobblestones(Levelled):
    """Sizes of the pavement, which repeats with the pitch of block plus joint."""

    drawn = True

    block_length: float = number(
        0.14, "m", "length of a block along x; the pitch is joint_width more", least=1e-3, most=10
    )
    block_width: float = number(
        0.12, "m", "width of a block along y; the pitch is joint_width more", least=1e-3, most=10
    )
    joint_width: float = number(
        0.012, "m", "width of the joint between two blocks", least=1e-4, most=10
    )
    joint_depth: float = number(
        0.006, "m", "depth of the joints below the blocks' mean", least=1e-5, most=1
    )
    edge_radius: float = number(
        0.006, "m", "radius of the rounded edges of the blocks", least=0, most=1
    )
    height_scatter: float = number(
        0.001, "m", "standard deviation of the blocks' heights", least=0, most=1
    )
    stagger: bool = flag(True, "whether every second row is shifted by half a block")
    seed: int = integer(0, "seed of the random generator", least=0, most=2**31 - 1)

    def validate(self) -> None:
        """Require joints narrower than blocks, edges that fit, blocks that stay above joints."""
        for side in ("block_length", "block_width"):
            size = getattr(self, side)
            if self.joint_width >= size:
                raise ParameterError(
                    "joint_width", f"= {self.joint_width:g} m must be less than {side} = {size:g} m"
                )
        if 2.0 * self.edge_radius > min(self.block_length, self.block_width):
            raise ParameterError(
                "edge_radius",
                f"= {self.edge_radius:g} m must not be more than half a block "
                f"({self.block_length:g} m x {self.block_width:g} m)",
            )
        if SIGMAS * self.height_scatter > self.joint_depth:
            raise ParameterError(
                "height_scatter",
                f"= {self.height_scatter:g} m would sink blocks below their joints: it must not be more "
                f"than a third of joint_depth = {self.joint_depth:g} m",
            )

    def make(self) -> "Pavement":
        """The road of these blocks."""
        return Pavement(self)


class Pavement:
    """Block tops at z = 0 plus their scatter, joints down to z = -joint_depth.

    With q the distance beyond the block's plateau (half size less the edge radius r), the edge
    falls as a circle, r - sqrt(r^2 - q^2), over q < r, then as a half cosine to the middle of the
    joint, so that z is continuous everywhere, corners included. A block's height is a truncated
    normal number from a hash of (seed, row, column): the road is endless and takes no memory.
    """

    extent = ((-np.inf, np.inf), (-np.inf, np.inf))

    def __init__(self, blocks: Cobblestones) -> None:
        self._b = blocks
        self._pitch = (
            blocks.block_length + blocks.joint_width,
            blocks.block_width + blocks.joint_width,
        )
        self._plateau = (
            0.5 * blocks.block_length - blocks.edge_radius,
            0.5 * blocks.block_width - blocks.edge_radius,
        )
        self.spacing = min(blocks.joint_width, blocks.edge_radius or blocks.joint_width)
        self._table: Array | None = None
        self._corner = (0, 0)

    def height(self, x: Array, y: Array) -> Array:
        """Heights (m) at x, y (m), in their shape."""
        px, py = self._pitch
        u = np.asarray(x) / px
        row = np.floor(u).astype(np.int64)
        v = np.asarray(y) / py
        if self._b.stagger:
            v = v + 0.5 * (row & 1)
        column = np.floor(v).astype(np.int64)
        beyond_x = np.maximum(np.abs(u - row - 0.5) * px - self._plateau[0], 0.0)
        beyond_y = np.maximum(np.abs(v - column - 0.5) * py - self._plateau[1], 0.0)
        beyond = np.sqrt(beyond_x * beyond_x + beyond_y * beyond_y)
        return self._profile(beyond, self._top(row, column))

    def _profile(self, beyond: Array, top: Array) -> Array:
        radius, depth = self._b.edge_radius, self._b.joint_depth
        on_edge = np.minimum(beyond, radius)
        edge = top - radius + np.sqrt(radius**2 - on_edge**2)
        along = np.minimum((beyond - on_edge) * (2.0 / self._b.joint_width), 1.0)
        share = 0.5 - 0.5 * np.cos(np.pi * along)
        return np.maximum(edge - share * (edge + depth), -depth)

    def _top(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> Array:
        if self._b.height_scatter == 0.0:
            return np.zeros(row.shape)
        if self._table is not None:
            return self._table[row - self._corner[0], column - self._corner[1]]
        return self._draw(row, column)

    def _draw(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> Array:
        """Truncated normal heights of the blocks, m, the same for the same (seed, row, column)."""
        from scipy.special import ndtri  # a second of import, which reading a scene avoids

        key = np.full(row.shape, self._b.seed % 2**64, dtype=np.uint64)
        for index in (row, column):
            key = _mix(_mix(key) ^ index.astype(np.uint64))
        key = _mix(key)
        uniform = ((key >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
        return self._b.height_scatter * ndtri(TAIL + (1.0 - 2.0 * TAIL) * uniform)

    def highest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """Upper bound of any strip, m."""
        return SIGMAS * self._b.height_scatter

    def lowest(self, x0: float, x1: float, y0: float, y1: float) -> float:
        """The bottom of the joints, m."""
        return -self._b.joint_depth

    def prepare(self, x0: float, x1: float, y0: float, y1: float) -> "Pavement":
        """The same road with the strip's block heights in a table; valid only in that strip (m)."""
        px, py = self._pitch
        rows = np.arange(int(np.floor(x0 / px)) - 1, int(np.floor(x1 / px)) + 2)
        columns = np.arange(int(np.floor(y0 / py)) - 1, int(np.floor(y1 / py)) + 3)
        road = Pavement(self._b)
        if len(rows) * len(columns) <= TABLE_LIMIT:
            grid = np.meshgrid(rows, columns, indexing="ij")
            road._table = self._draw(*grid)
            road._corner = int(rows[0]), int(columns[0])
        return road


def _mix(key: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """One step of splitmix64 (Steele, Lea, Flood 2014): one bit in changes half of those out."""
    key = key + np.uint64(0x9E3779B97F4A7C15)
    key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return key ^ (key >> np.uint64(31))
